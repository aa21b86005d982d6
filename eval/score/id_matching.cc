#include "eval/score/id_matching.h"

#include <algorithm>
#include <numeric>

namespace tsdfpp {

void IdMatching::Observe(const cv::Mat& labels, const cv::Mat& truth) {
  CV_Assert(labels.size() == truth.size());
  for (int v = 0; v < labels.rows; ++v) {
    const auto* label = labels.ptr<InstanceId>(v);
    const auto* object = truth.ptr<InstanceId>(v);
    for (int u = 0; u < labels.cols;) {
      int end = u + 1;
      while (end < labels.cols && label[end] == label[u] && object[end] == object[u]) ++end;
      if (label[u] != kBackground && label[u] != kNoInstance) {
        pixels_[label[u]][object[u]] += end - u;
      }
      u = end;
    }
  }
}

void IdMatching::Settle() {
  struct Wish {
    std::int64_t pixels;
    InstanceId id;
    InstanceId object;
  };
  std::vector<Wish> wishes;
  std::set<InstanceId> taken{kBackground};
  for (const auto& [id, object] : truth_of_) taken.insert(object);
  for (const auto& [id, of] : pixels_) {
    if (truth_of_.contains(id)) continue;
    const auto most = std::max_element(
        of.begin(), of.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    wishes.push_back({most->second, id, most->first});
  }
  std::stable_sort(wishes.begin(), wishes.end(),
                   [](const Wish& a, const Wish& b) { return a.pixels > b.pixels; });
  for (const Wish& wish : wishes) {
    truth_of_[wish.id] = taken.insert(wish.object).second ? wish.object : kNoInstance;
  }
}

InstanceId IdMatching::TruthOf(InstanceId id) const {
  if (id == kBackground) return kBackground;
  const auto found = truth_of_.find(id);
  return found == truth_of_.end() ? kNoInstance : found->second;
}

InstanceId IdMatching::IdOf(InstanceId object) const {
  if (object == kBackground) return kBackground;
  for (const auto& [id, of] : truth_of_) {
    if (of == object && object != kNoInstance) return id;
  }
  return kNoInstance;
}

nlohmann::json IdMatching::ToJson() const {
  nlohmann::json json = nlohmann::json::array();
  for (const auto& [id, object] : truth_of_) {
    const auto& of = pixels_.at(id);
    const auto all =
        std::accumulate(of.begin(), of.end(), std::int64_t{0},
                        [](std::int64_t sum, const auto& one) { return sum + one.second; });
    const auto own = of.find(object);
    const std::int64_t shared = own == of.end() ? 0 : own->second;
    json.push_back(
        {{"id", id},
         {"object", object == kNoInstance ? nlohmann::json(nullptr) : nlohmann::json(object)},
         {"share", static_cast<double>(shared) / static_cast<double>(all)}});
  }
  return json;
}

SceneMeshes MeshesOf(const MapRepresentation& map, const std::set<InstanceId>& movers,
                     const IdMatching& matching, SceneMesher& mesher) {
  std::set<InstanceId> ids;
  for (const InstanceId object : movers) {
    const InstanceId id = matching.IdOf(object);
    if (id != kNoInstance) ids.insert(id);
  }
  SceneMeshes meshes = MeshesOf(map, ids, mesher);
  const auto relabel = [&](TriangleMesh& mesh) {
    for (InstanceId& id : mesh.face_ids) id = matching.TruthOf(id);
  };
  relabel(meshes.scene);
  // A mover that the map does not know has nothing that could be removed.
  std::map<std::set<InstanceId>, TriangleMesh> without;
  for (const std::set<InstanceId>& removed : RemovalsOf(movers)) {
    if (removed.empty()) continue;
    std::set<InstanceId> in_map;
    for (const InstanceId object : removed) {
      const InstanceId id = matching.IdOf(object);
      if (id != kNoInstance) in_map.insert(id);
    }
    TriangleMesh mesh = in_map.empty() ? meshes.scene : meshes.without.at(in_map);
    if (!in_map.empty()) relabel(mesh);
    without[removed] = std::move(mesh);
  }
  meshes.without = std::move(without);
  return meshes;
}

}  // namespace tsdfpp
