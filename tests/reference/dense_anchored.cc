// docs/map.md, "The index of tsdf++/anchored" (and "`volumes`", whose lists are asked of the
// volumes): volumes that stay in their objects' lattices, and an index that is a pure function of
// volumes and poses.
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "tests/reference/dense_map.h"

namespace tsdfpp::reference {
namespace {

class DenseAnchored : public DenseMap {
 public:
  DenseAnchored(const MapConfig& config, const Box& box, int layers)
      : config_(config), layers_(static_cast<std::size_t>(layers)), box_(box) {}

  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    poses_.Update(id, T_WO);
    index_.reset();
  }

  void Fuse(const Frame& frame, const cv::Mat& labels) override {
    std::set<InstanceId> ids;
    for (int v = 0; v < labels.rows; ++v) {
      for (int u = 0; u < labels.cols; ++u) ids.insert(labels.at<std::uint16_t>(v, u));
    }
    ids.erase(kNoInstance);
    for (const InstanceId id : ids) {
      const auto wanted = [id](InstanceId label) { return label == id; };
      BlockSet blocks;
      Allocate(frame, labels, ObjectLattice(id), config_, wanted, blocks);
      if (blocks.size() == 0) continue;
      DenseVolume& volume = volumes_.try_emplace(id, box_).first->second;
      Allocate(frame, labels, ObjectLattice(id), config_, wanted, volume.blocks);
    }
    index_.reset();
    for (auto& [id, volume] : volumes_) {
      FuseObject(id, View(frame, labels, ObjectLattice(id), config_), config_, volume, nullptr);
      if (config_.rims) {
        CompleteRims(id, frame, labels, ObjectLattice(id), config_, volume);
      }
      volume.FreeEmptyBlocks();
    }
  }

  void Remove(InstanceId id) override {
    volumes_.erase(id);
    poses_.Forget(id);
    index_.reset();
  }

  void Rename(InstanceId from, InstanceId to) override {
    if (const auto found = volumes_.find(from); found != volumes_.end()) {
      volumes_.insert_or_assign(to, found->second);
      volumes_.erase(from);
    }
    poses_.Rename(from, to);
    index_.reset();
  }

  Pose ObjectLattice(InstanceId id) const override { return poses_.Lattice(id); }

  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& v) const override {
    const auto found = volumes_.find(id);
    return found == volumes_.end() ? std::nullopt : AsValue(found->second.grid(v));
  }

  std::vector<Listing> ListAt(const Eigen::Vector3i& v) const override { return Index()(v); }

  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return reference::ObservedVoxels(found->second.grid);
  }

  std::vector<Eigen::Vector3i> ListedVoxels() const override { return NonEmpty(Index()); }

  std::vector<Eigen::Vector3i> CrossedCubesOf(InstanceId id) const override {
    const auto found = volumes_.find(id);
    if (found == volumes_.end()) return {};
    return CrossedCubes(found->second.grid);
  }

 private:
  // Made anew from volumes and poses after every event.
  const DenseGrid<List>& Index() const {
    if (index_) return *index_;
    index_.emplace(box_);
    std::map<InstanceId, Pose> moved_T_LW;
    for (const auto& [id, volume] : volumes_) {
      const Pose T_WL = ObjectLattice(id);
      if (T_WL.matrix() != Pose::Identity().matrix()) moved_T_LW.emplace(id, T_WL.inverse());
    }
    ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
      std::vector<std::pair<float, InstanceId>> order;
      for (const auto& [id, volume] : volumes_) {
        const auto moved = moved_T_LW.find(id);
        const Eigen::Vector3d q = moved == moved_T_LW.end()
                                      ? Eigen::Vector3d(v.cast<double>())
                                      : SourcePoint(moved->second, v, config_.voxel_m);
        if (!Covers(volume.grid, q, config_)) continue;
        order.emplace_back(DistanceAt(volume.grid, q).value(), id);
      }
      std::sort(order.begin(), order.end());
      if (order.size() > layers_) order.resize(layers_);
      for (const auto& [distance, id] : order) index_->At(v).push_back({id, 0});
    });
    return *index_;
  }

  MapConfig config_;
  std::size_t layers_;
  Box box_;
  std::map<InstanceId, DenseVolume> volumes_;
  PoseBook poses_;
  mutable std::optional<DenseGrid<List>> index_;
};

}  // namespace

std::unique_ptr<DenseMap> MakeDenseAnchored(const MapConfig& config, const Box& box, int layers) {
  return std::make_unique<DenseAnchored>(config, box, layers);
}

}  // namespace tsdfpp::reference
