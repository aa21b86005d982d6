// docs/map.md, "`tsdf++/literal`": the paper's sentences.
#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "tests/reference/dense_map.h"

namespace tsdfpp::reference {
namespace {

struct Pair {
  std::optional<Listing> active;
  std::optional<Listing> inactive;

  void Erase(InstanceId id) {
    if (inactive && inactive->id == id) inactive.reset();
    if (active && active->id == id) {
      active = inactive;
      inactive.reset();
    }
  }
};

class DenseLiteral : public DenseMap {
 public:
  DenseLiteral(const MapConfig& config, const Box& box) : config_(config), box_(box), pairs_(box) {}

  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    const auto T_rel = poses_.Update(id, T_WO);
    const auto found = volumes_.find(id);
    if (!T_rel || found == volumes_.end()) return;
    TakeOffEverywhere(id);
    found->second = Resample(found->second, *T_rel, config_);
    for (const Eigen::Vector3i& v : ObservedVoxels(id)) {
      Pair& pair = pairs_.At(v);
      pair.inactive = pair.active;
      pair.active = Listing{id, config_.moved_confidence};
      list_blocks_.AddBlockOf(v);
    }
    FreeEmptyListBlocks();
  }

  void Fuse(const Frame& frame, const cv::Mat& labels) override {
    const Pose T_WL = Pose::Identity();
    Allocate(
        frame, labels, T_WL, config_, [](InstanceId) { return true; }, list_blocks_);
    const View view(frame, labels, T_WL, config_);
    list_blocks_.ForEachVoxelOfBlocks([&](const Eigen::Vector3i& v) {
      const std::optional<Seen> seen = view.Look(v);
      if (!seen || seen->s < -config_.back()) return;
      if (InBand(seen->s, config_)) {
        FuseInBand(*seen, v);
      } else {
        FuseClamped(*seen, v);
      }
    });
    FreeEmptyListBlocks();
  }

  void Remove(InstanceId id) override {
    TakeOffEverywhere(id);
    volumes_.erase(id);
    poses_.Forget(id);
    FreeEmptyListBlocks();
  }

  void Rename(InstanceId from, InstanceId to) override {
    if (const auto found = volumes_.find(from); found != volumes_.end()) {
      volumes_.insert_or_assign(to, found->second);
      volumes_.erase(from);
    }
    poses_.Rename(from, to);
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      for (auto* listing : {&pairs_.At(v).active, &pairs_.At(v).inactive}) {
        if (*listing && (*listing)->id == from) (*listing)->id = to;
      }
    });
  }

  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& v) const override {
    const auto found = volumes_.find(id);
    return found == volumes_.end() ? std::nullopt : AsValue(found->second.grid(v));
  }

  std::vector<Listing> ListAt(const Eigen::Vector3i& v) const override {
    std::vector<Listing> list;
    const Pair& pair = pairs_(v);
    if (pair.active) list.push_back(*pair.active);
    if (pair.inactive) list.push_back(*pair.inactive);
    return list;
  }

  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return reference::ObservedVoxels(found->second.grid);
  }

  std::vector<Eigen::Vector3i> ListedVoxels() const override {
    std::vector<Eigen::Vector3i> voxels;
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      if (!ListAt(v).empty()) voxels.push_back(v);
    });
    return voxels;
  }

  std::vector<Eigen::Vector3i> CrossedCubesOf(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return CrossedCubes(found->second.grid);
  }

 private:
  // docs/map.md, "Freeing". The volumes have no empty blocks: what makes one writes to it.
  void FreeEmptyListBlocks() {
    list_blocks_.FreeUnless(
        [this](const Eigen::Vector3i& v) { return pairs_(v).active.has_value(); });
  }

  void TakeOffEverywhere(InstanceId id) {
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) { pairs_.At(v).Erase(id); });
  }

  void FuseInBand(const Seen& seen, const Eigen::Vector3i& v) {
    const InstanceId m = seen.label;
    Pair& pair = pairs_.At(v);
    if (!pair.active) {
      pair.active = Listing{m, 1};
    } else if (pair.active->id == m) {
      pair.active->confidence = std::min(pair.active->confidence + 1, config_.confidence_cap);
    } else if (--pair.active->confidence <= 0) {
      pair.active = Listing{m, 1};
      if (pair.inactive && pair.inactive->id == m) pair.inactive.reset();
    }
    DenseVolume& volume = volumes_.try_emplace(pair.active->id, box_).first->second;
    FuseSeen(seen, config_, volume.grid.At(v));
    volume.blocks.AddBlockOf(v);
  }

  // Where m is active its block exists: a vote or a move has written there. So it does not matter
  // whether "exists" means before this frame or within it.
  void FuseClamped(const Seen& seen, const Eigen::Vector3i& v) {
    const Pair& pair = pairs_(v);
    if (!pair.active || pair.active->id != seen.label) return;
    const auto found = volumes_.find(seen.label);
    if (found == volumes_.end() || !found->second.blocks.HasBlockOf(v)) return;
    FuseSeen(seen, config_, found->second.grid.At(v));
  }

  MapConfig config_;
  Box box_;
  DenseGrid<Pair> pairs_;
  BlockSet list_blocks_;
  std::map<InstanceId, DenseVolume> volumes_;
  PoseBook poses_;
};

}  // namespace

std::unique_ptr<DenseMap> MakeDenseLiteral(const MapConfig& config, const Box& box) {
  return std::make_unique<DenseLiteral>(config, box);
}

}  // namespace tsdfpp::reference
