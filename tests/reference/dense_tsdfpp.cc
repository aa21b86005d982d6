// docs/map.md, "The index of tsdf++": object volumes in the world's lattice under lists with votes.
#include <algorithm>
#include <map>
#include <set>
#include <vector>

#include "tests/reference/dense_map.h"

namespace tsdfpp::reference {
namespace {

using Marks = DenseGrid<std::uint8_t>;

class DenseTsdfpp : public DenseMap {
 public:
  DenseTsdfpp(const MapConfig& config, const Box& box)
      : config_(config),
        layers_(static_cast<std::size_t>(LayersOf(Method::kTsdfpp, config))),
        box_(box),
        lists_(box) {}

  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    const auto T_rel = poses_.Update(id, T_WO);
    const auto found = volumes_.find(id);
    if (!T_rel || found == volumes_.end()) return;
    TakeOffEverywhere(id);
    found->second = Resample(found->second, *T_rel, config_);
    const Marks cover = CoverOfLattice(found->second.grid, config_);
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      if (cover(v) == 0) return;
      List& list = lists_.At(v);
      list.insert(list.begin(), Listing{id, config_.moved_confidence});
      DropOverflow(list);
    });
  }

  void Fuse(const Frame& frame, const cv::Mat& labels) override {
    for (const InstanceId id : LabelsIn(labels)) {
      BlockSet blocks;
      const auto wanted = [id](InstanceId label) { return label == id; };
      Allocate(frame, labels, Pose::Identity(), config_, wanted, blocks);
      if (blocks.size() == 0) continue;
      DenseVolume& volume = volumes_.try_emplace(id, box_).first->second;
      Allocate(frame, labels, Pose::Identity(), config_, wanted, volume.blocks);
    }
    std::map<InstanceId, Marks> covered_before;
    std::map<InstanceId, Marks> covered;
    std::map<InstanceId, Marks> votes;
    const View view(frame, labels, Pose::Identity(), config_);
    for (auto& [id, volume] : volumes_) {
      covered_before.emplace(id, CoverOfLattice(volume.grid, config_));
      FuseObject(id, view, config_, volume, &votes.try_emplace(id, box_).first->second);
      if (config_.rims) {
        CompleteRims(id, frame, labels, Pose::Identity(), config_, volume);
      }
      covered.emplace(id, CoverOfLattice(volume.grid, config_));
    }
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      List& list = lists_.At(v);
      for (const auto& [id, cover] : covered) {  // a
        if (cover(v) == 0) TakeOff(id, list);
      }
      for (const auto& [id, cover] : covered) {  // b
        if (votes.at(id)(v) != 0 && cover(v) != 0) Vote(id, list);
      }
      for (const auto& [id, cover] : covered) {  // c
        if (cover(v) == 0 || covered_before.at(id)(v) != 0 || IsListed(id, list)) continue;
        list.push_back({id, 1});
        DropOverflow(list);
      }
    });
    for (auto& [id, volume] : volumes_) volume.FreeEmptyBlocks();
  }

  void Remove(InstanceId id) override {
    const std::vector<Eigen::Vector3i> was_listed = TakeOffEverywhere(id);
    volumes_.erase(id);
    poses_.Forget(id);
    if (!config_.relist_on_removal) return;
    for (const auto& [other, volume] : volumes_) {
      const Marks cover = CoverOfLattice(volume.grid, config_);
      for (const Eigen::Vector3i& v : was_listed) {
        List& list = lists_.At(v);
        if (cover(v) == 0 || IsListed(other, list)) continue;
        list.push_back({other, 1});
        DropOverflow(list);
      }
    }
  }

  void Rename(InstanceId from, InstanceId to) override {
    if (const auto found = volumes_.find(from); found != volumes_.end()) {
      volumes_.insert_or_assign(to, found->second);
      volumes_.erase(from);
    }
    poses_.Rename(from, to);
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      for (Listing& listing : lists_.At(v)) {
        if (listing.id == from) listing.id = to;
      }
    });
  }

  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& v) const override {
    const auto found = volumes_.find(id);
    return found == volumes_.end() ? std::nullopt : AsValue(found->second.grid(v));
  }

  std::vector<Listing> ListAt(const Eigen::Vector3i& v) const override { return lists_(v); }

  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return reference::ObservedVoxels(found->second.grid);
  }

  std::vector<Eigen::Vector3i> ListedVoxels() const override { return NonEmpty(lists_); }

  std::vector<Eigen::Vector3i> CrossedCubesOf(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return CrossedCubes(found->second.grid);
  }

 private:
  static std::set<InstanceId> LabelsIn(const cv::Mat& labels) {
    std::set<InstanceId> ids;
    for (int v = 0; v < labels.rows; ++v) {
      for (int u = 0; u < labels.cols; ++u) ids.insert(labels.at<std::uint16_t>(v, u));
    }
    ids.erase(kNoInstance);
    return ids;
  }

  // Returns the voxels at which it was listed.
  std::vector<Eigen::Vector3i> TakeOffEverywhere(InstanceId id) {
    std::vector<Eigen::Vector3i> voxels;
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      if (!IsListed(id, lists_(v))) return;
      TakeOff(id, lists_.At(v));
      voxels.push_back(v);
    });
    return voxels;
  }

  void Vote(InstanceId id, List& list) const {
    if (list.empty()) {
      list.push_back({id, 1});
      return;
    }
    if (list[0].id == id) {
      list[0].confidence = std::min(list[0].confidence + 1, config_.confidence_cap);
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

  void DropOverflow(List& list) const {
    while (list.size() > layers_) {
      std::size_t dropped = 0;  // none yet: the active one never goes
      for (std::size_t i = 1; i < list.size(); ++i) {
        if (list[i].id == kBackground && list.size() > 2) continue;
        if (dropped == 0 || list[i].confidence <= list[dropped].confidence) dropped = i;
      }
      list.erase(list.begin() + static_cast<std::ptrdiff_t>(dropped));
    }
  }

  MapConfig config_;
  std::size_t layers_;
  Box box_;
  std::map<InstanceId, DenseVolume> volumes_;
  DenseGrid<List> lists_;
  PoseBook poses_;
};

}  // namespace

std::unique_ptr<DenseMap> MakeDenseTsdfpp(const MapConfig& config, const Box& box) {
  return std::make_unique<DenseTsdfpp>(config, box);
}

}  // namespace tsdfpp::reference
