// docs/map.md, "The index of tsdf++", in floating point: object volumes in the world's lattice
// under lists with votes.
#include <algorithm>
#include <map>
#include <set>

#include "tests/reference/dense_map.h"
#include "tests/reference/float_map.h"
#include "tests/reference/float_mesh.h"
#include "tests/reference/float_move.h"

namespace tsdfpp::reference {
namespace {

constexpr std::size_t kLayers = 2;

using Values = SparseVoxels<FloatVoxel>;
using Marked = SparseVoxels<std::uint8_t>;
using Lists = SparseVoxels<List>;

struct FloatVolume {
  Values values;
  Marked cover;  // docs/map.md, "Cover", at lattice points
};

Marked CoverOf(const Values& values, const FloatRule& rule) {
  Marked cover;
  for (const auto& [key, block] : values.blocks()) {
    const CubesOfBlock<FloatVoxel> cubes(values, key);
    // The block's own marks and those around it are looked up once.
    std::array<Marked::Block*, 8> marks{};
    const auto mark = [&](const Eigen::Vector3i& v) {
      const Marked::Key of = Marked::KeyOf(v);
      Marked::Block*& there = marks[static_cast<std::size_t>(
          (of[0] - key[0]) * 4 + (of[1] - key[1]) * 2 + of[2] - key[2])];
      if (there == nullptr) there = &cover.FindOrAdd(of);
      (*there)[Marked::PlaceOf(v)] = 1;
    };
    for (std::size_t place = 0; place < block.size(); ++place) {
      const FloatVoxel& voxel = block[place];
      if (!voxel.observed()) continue;
      const Eigen::Vector3i v = Values::VoxelAt(key, place);
      if (voxel.distance < 0 && voxel.distance >= -rule.back()) mark(v);
      bool inside = false;
      bool outside = false;
      bool observed = true;
      for (int i = 0; i < 8 && observed; ++i) {
        const FloatVoxel& corner = cubes.Corner(place, i);
        observed = corner.observed();
        (corner.distance < 0 ? inside : outside) = true;
      }
      if (!observed || !inside || !outside) continue;
      for (int i = 0; i < 8; ++i) mark(CubeCorner(v, i));
    }
  }
  return cover;
}

std::set<InstanceId> IdsIn(const cv::Mat& labels) {
  std::set<InstanceId> ids;
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) ids.insert(labels.at<std::uint16_t>(v, u));
  }
  ids.erase(kNoInstance);
  return ids;
}

void DropOverflow(List& list) {
  while (list.size() > kLayers) {
    std::size_t dropped = 0;  // none yet: the active one never goes
    for (std::size_t i = 1; i < list.size(); ++i) {
      if (list[i].id == kBackground && list.size() > 2) continue;
      if (dropped == 0 || list[i].confidence <= list[dropped].confidence) dropped = i;
    }
    list.erase(list.begin() + static_cast<std::ptrdiff_t>(dropped));
  }
}

class FloatTsdfpp : public FloatMap {
 public:
  explicit FloatTsdfpp(const FloatConfig& config) : rule_(config) {}

  std::unique_ptr<FloatMap> Clone() const override { return std::make_unique<FloatTsdfpp>(*this); }

  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    const auto T_rel = poses_.Update(id, T_WO);
    const auto found = volumes_.find(id);
    if (!T_rel || found == volumes_.end()) return;
    TakeOffEverywhere(id);
    Resample(*T_rel, found->second);
    found->second.cover.ForEach([&](const Eigen::Vector3i& v, std::uint8_t covered) {
      if (covered == 0) return;
      List& list = lists_.At(v);
      list.insert(list.begin(), Listing{id, rule_.map().moved_confidence});
      DropOverflow(list);
    });
    DropEmptyLists();
  }

  void Fuse(const Frame& frame, const cv::Mat& labels) override {
    for (const InstanceId id : IdsIn(labels)) {
      BlockSet blocks;
      const auto wanted = [id](InstanceId label) { return label == id; };
      Allocate(frame, labels, Pose::Identity(), rule_.map(), wanted, blocks);
      if (blocks.size() == 0) continue;
      Values& values = volumes_[id].values;
      for (const auto& zyx : blocks.blocks()) values.FindOrAdd(zyx);
    }
    const View view(frame, labels, Pose::Identity(), rule_.map());
    std::map<InstanceId, Change> changes;
    for (auto& [id, volume] : volumes_) {
      Change& change = changes[id];
      FuseObject(id, view, frame.intrinsics, volume.values, change.votes);
      change.covered_before = std::move(volume.cover);
      volume.cover = CoverOf(volume.values, rule_);
      volume.values.DropUnless([](const FloatVoxel& voxel) { return voxel.observed(); });
    }
    UpdateLists(changes);
    DropEmptyLists();
  }

  void Remove(InstanceId id) override {
    TakeOffEverywhere(id);
    volumes_.erase(id);
    poses_.Forget(id);
    DropEmptyLists();
  }

  TriangleMesh SceneMesh() const override {
    const float h = rule_.voxel();
    TriangleMesh scene;
    for (const auto& [id, volume] : volumes_) {
      const TriangleMesh mesh = MeshOf(volume.values, h);
      const auto first = static_cast<std::uint32_t>(scene.vertices.size());
      scene.vertices.insert(scene.vertices.end(), mesh.vertices.begin(), mesh.vertices.end());
      for (const auto& [a, b, c] : mesh.triangles) {
        if (IsHidden(id, mesh.vertices[a], mesh.vertices[b], mesh.vertices[c])) continue;
        scene.triangles.push_back({first + a, first + b, first + c});
        scene.face_ids.push_back(id);
      }
    }
    return scene;
  }

  std::optional<FloatVoxel> ValueAt(InstanceId id, const Eigen::Vector3i& v) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return std::nullopt;
    const FloatVoxel& voxel = found->second.values(v);
    return voxel.observed() ? std::optional(voxel) : std::nullopt;
  }

  std::vector<Listing> ListAt(const Eigen::Vector3i& v) const override { return lists_(v); }

  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return VoxelsWith(found->second.values, [](const FloatVoxel& v) { return v.observed(); });
  }

  std::vector<Eigen::Vector3i> ListedVoxels() const override {
    return VoxelsWith(lists_, [](const List& list) { return !list.empty(); });
  }

  void ForEachObserved(const std::function<void(const FloatVoxel&)>& function) const override {
    for (const auto& [id, volume] : volumes_) {
      volume.values.ForEach([&](const Eigen::Vector3i&, const FloatVoxel& voxel) {
        if (voxel.observed()) function(voxel);
      });
    }
  }

 private:
  // What one frame did to an object.
  struct Change {
    Marked covered_before;
    Marked votes;
  };

  void FuseObject(InstanceId id, const View& view, const Intrinsics& camera, Values& values,
                  Marked& votes) const {
    const float h = rule_.voxel();
    for (auto& [key, block] : values.blocks()) {
      Marked::Block* block_votes = nullptr;
      for (std::size_t place = 0; place < block.size(); ++place) {
        FloatVoxel& voxel = block[place];
        const std::optional<Seen> seen = view.Look(Values::VoxelAt(key, place));
        if (!seen) continue;
        const float weight = rule_.WeightOf(*seen, camera);
        if (seen->label == id) {
          rule_.Fuse(*seen, weight, voxel);
          if (!rule_.InBand(seen->s)) continue;
          if (block_votes == nullptr) block_votes = &votes.FindOrAdd(key);
          (*block_votes)[place] = 1;
          continue;
        }
        const bool contradicted =
            voxel.observed() && voxel.distance < -0.5F * h && seen->s >= -0.5F * h;
        if (!contradicted) continue;
        voxel = FloatVoxel{};
        if (seen->s > h) voxel = rule_.Fresh(std::min(seen->s, rule_.front()), weight);
      }
    }
  }

  void UpdateLists(const std::map<InstanceId, Change>& changes) {
    std::set<Marked::Key> keys;
    for (const auto& [id, change] : changes) {
      for (const auto& [key, block] : change.covered_before.blocks()) keys.insert(key);
      for (const auto& [key, block] : volumes_.at(id).cover.blocks()) keys.insert(key);
    }
    // An object's blocks there; null where it has none.
    struct Here {
      InstanceId id;
      const Marked::Block* covered_before;
      const Marked::Block* covered;
      const Marked::Block* votes;
    };
    const auto marked = [](const Marked::Block* block, std::size_t place) {
      return block != nullptr && (*block)[place] != 0;
    };
    for (const Marked::Key& key : keys) {
      std::vector<Here> objects;
      for (const auto& [id, change] : changes) {
        const Here here{id, change.covered_before.Find(key), volumes_.at(id).cover.Find(key),
                        change.votes.Find(key)};
        if (here.covered_before != nullptr || here.covered != nullptr) objects.push_back(here);
      }
      Lists::Block& lists = lists_.FindOrAdd(key);
      for (std::size_t place = 0; place < lists.size(); ++place) {
        List& list = lists[place];
        for (const Here& here : objects) {  // a
          if (!marked(here.covered, place)) TakeOff(here.id, list);
        }
        for (const Here& here : objects) {  // b
          if (marked(here.votes, place) && marked(here.covered, place)) Vote(here.id, list);
        }
        for (const Here& here : objects) {  // c
          if (!marked(here.covered, place) || marked(here.covered_before, place)) continue;
          if (IsListed(here.id, list)) continue;
          list.push_back({here.id, 1});
          DropOverflow(list);
        }
      }
    }
  }

  void Vote(InstanceId id, List& list) const {
    if (list.empty()) {
      list.push_back({id, 1});
      return;
    }
    if (list[0].id == id) {
      list[0].confidence = std::min(list[0].confidence + 1, rule_.map().confidence_cap);
      return;
    }
    if (--list[0].confidence <= 0) {
      TakeOff(id, list);
      list[0].confidence = 0;
      list.insert(list.begin(), Listing{id, 1});
    } else if (!IsListed(id, list)) {
      list.push_back({id, 1});
    }
    DropOverflow(list);
  }

  void TakeOffEverywhere(InstanceId id) {
    lists_.ForEach([id](const Eigen::Vector3i&, List& list) { TakeOff(id, list); });
  }

  void DropEmptyLists() {
    lists_.DropUnless([](const List& list) { return !list.empty(); });
  }

  void Resample(const Pose& T_rel, FloatVolume& volume) const {
    const std::vector<Eigen::Vector3i> voxels =
        VoxelsWith(volume.values, [](const FloatVoxel& v) { return v.observed(); });
    if (voxels.empty()) return;
    const DenseGrid<FloatVoxel> sources = CopyOf(volume.values, voxels);
    volume.values = Values{};
    const Pose T_rel_inverse = T_rel.inverse();
    const Box reached = MovedBox(sources.box(), T_rel, rule_.map().voxel_m);
    ForEachVoxel(reached, [&](const Eigen::Vector3i& v) {
      const Neighbourhood place(SourcePoint(T_rel_inverse, v, rule_.map().voxel_m));
      std::array<FloatVoxel, 8> corners;
      for (int i = 0; i < 8; ++i) {
        corners[static_cast<std::size_t>(i)] = sources(CubeCorner(place.base, i));
      }
      if (const auto value = rule_.Interpolate(place, corners)) volume.values.At(v) = *value;
    });
    volume.cover = CoverOf(volume.values, rule_);
  }

  // docs/map.md, "Scene mesh of both".
  bool IsHidden(InstanceId id, const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                const Eigen::Vector3f& c) const {
    const float h = rule_.voxel();
    const Eigen::Vector3f normal = (b - a).cross(c - a).stableNormalized();
    const Eigen::Vector3f p = (a + b + c) / 3 + 0.5F * h * normal;
    const Eigen::Vector3i v = NearestVoxel(p, h);
    const List& list = lists_(v);
    if (list.empty() || list[0].id == id) return false;
    const Neighbourhood place(p.cast<double>() / rule_.map().voxel_m);
    std::array<float, 8> distances{};
    for (int i = 0; i < 8; ++i) {
      if (place.Coefficient(i) == 0) continue;
      const auto active = ValueAt(list[0].id, CubeCorner(place.base, i));
      if (!active) return false;
      distances[static_cast<std::size_t>(i)] = active->distance;
    }
    return place.Interpolate(distances) < -h;
  }

  FloatRule rule_;
  std::map<InstanceId, FloatVolume> volumes_;
  Lists lists_;
  PoseBook poses_;
};

}  // namespace

std::unique_ptr<FloatMap> MakeFloatTsdfpp(const FloatConfig& config) {
  return std::make_unique<FloatTsdfpp>(config);
}

}  // namespace tsdfpp::reference
