#include "sequence/bop_instances.h"

#include <algorithm>
#include <tuple>

namespace tsdfpp::bop {
namespace {

struct Track {
  InstanceId id;
  Pose T_WO;  // where it was last
};

double Apart(const Pose& a, const Pose& b) {
  const Eigen::AngleAxisd turn(a.linear().transpose() * b.linear());
  return (a.translation() - b.translation()).norm() + kTurnWeight_m * std::abs(turn.angle());
}

}  // namespace

Expected<std::map<InstanceId, int>> AssignIds(std::map<int, Image>& images) {
  int next = 0;
  for (const auto& [number, image] : images) {
    for (const Instance& instance : image.instances) next = std::max(next, instance.obj_id);
  }
  std::map<InstanceId, int> objects;
  std::map<int, std::vector<Track>> tracks;  // by obj_id
  for (auto& [number, image] : images) {
    std::map<int, std::vector<Instance*>> found;
    for (Instance& instance : image.instances) found[instance.obj_id].push_back(&instance);
    for (auto& [obj_id, instances] : found) {
      std::vector<Track>& known = tracks[obj_id];
      std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
      for (std::size_t t = 0; t < known.size(); ++t) {
        for (std::size_t i = 0; i < instances.size(); ++i) {
          pairs.emplace_back(Apart(known[t].T_WO, image.T_WC * instances[i]->T_CO), t, i);
        }
      }
      std::sort(pairs.begin(), pairs.end());
      std::vector<bool> taken(known.size(), false);
      for (const auto& [apart, t, i] : pairs) {
        if (taken[t] || instances[i]->id != kNoInstance) continue;
        taken[t] = true;
        instances[i]->id = known[t].id;
        known[t].T_WO = image.T_WC * instances[i]->T_CO;
      }
      for (Instance* instance : instances) {
        if (instance->id != kNoInstance) continue;
        const int id = known.empty() ? obj_id : ++next;
        if (id >= kNoInstance) {
          return DataError("image {}: its objects need more than {} ids", number, kNoInstance - 1);
        }
        instance->id = static_cast<InstanceId>(id);
        known.push_back({instance->id, image.T_WC * instance->T_CO});
        objects[instance->id] = obj_id;
      }
    }
  }
  return objects;
}

}  // namespace tsdfpp::bop
