#include "mapper/volumes_map.h"

#include <array>

#include "mapper/freeing.h"
#include "mapper/map_invariants.h"
#include "mapper/pull_back.h"
#include "mapper/ray_pass.h"
#include "mapper/voxel_list.h"

namespace tsdfpp {
namespace {

// docs/map.md, "Cover", of one point, read voxel by voxel.
class CoverOfPoint {
 public:
  CoverOfPoint(const TsdfGrid& grid, const Eigen::Vector3d& q) : grid_(grid), q_(q) {
    base_ = FloorOf(q);
    fraction_ = {static_cast<float>(q.x() - base_.x), static_cast<float>(q.y() - base_.y),
                 static_cast<float>(q.z() - base_.z)};
  }

  // The distance at the point if the object covers it.
  std::optional<float> Distance(float back) const {
    const auto distance = Interpolated();
    if (!distance) return std::nullopt;
    if ((*distance < 0 && *distance >= -back) || InCrossedCube()) return distance;
    return std::nullopt;
  }

 private:
  // NaN where unobserved.
  float At(const Index3& voxel) const {
    const TsdfBlock* block = grid_.Find(BlockOf(voxel));
    const auto i = static_cast<std::size_t>(PlaceInBlock(voxel));
    return block == nullptr || block->weight[i] <= 0 ? std::numeric_limits<float>::quiet_NaN()
                                                     : block->distance[i];
  }

  std::optional<float> Interpolated() const {
    std::array<float, 8> corner{};
    for (int i = 0; i < 8; ++i) {
      bool counts = true;
      for (int axis = 0; axis < 3; ++axis) {
        const float f = fraction_[static_cast<std::size_t>(axis)];
        counts = counts && (((i >> axis) & 1) != 0 ? f != 0 : f != 1);
      }
      if (!counts) continue;
      const float value = At(base_ + Index3{i & 1, (i >> 1) & 1, i >> 2});
      if (value != value) return std::nullopt;
      corner[static_cast<std::size_t>(i)] = value;
    }
    return Trilinear(corner, fraction_);
  }

  bool IsCrossed(const Index3& cube) const {
    bool inside = false;
    bool outside = false;
    for (int i = 0; i < 8; ++i) {
      const float value = At(cube + Index3{i & 1, (i >> 1) & 1, i >> 2});
      if (value != value) return false;
      (value < 0 ? inside : outside) = true;
    }
    return inside && outside;
  }

  // A point on a plane of the lattice lies in the closed cubes on both sides of it.
  bool InCrossedCube() const {
    for (int i = 0; i < 8; ++i) {
      const Index3 below{i & 1, (i >> 1) & 1, i >> 2};
      if ((below.x != 0 && q_.x() != base_.x) || (below.y != 0 && q_.y() != base_.y) ||
          (below.z != 0 && q_.z() != base_.z)) {
        continue;
      }
      if (IsCrossed({base_.x - below.x, base_.y - below.y, base_.z - below.z})) return true;
    }
    return false;
  }

  const TsdfGrid& grid_;
  const Eigen::Vector3d& q_;
  Index3 base_;
  std::array<float, 3> fraction_{};
};

}  // namespace

void VolumesMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  ObjectVolume& volume = volumes_[id];
  volume.T_WO = T_WO;
  if (!volume.T_WO_birth) volume.T_WO_birth = T_WO;
  PlaceLattice(volume);
  CheckInDebugBuilds(*this);
}

void VolumesMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  const FrameFreeing freeing(volumes_);
  const std::vector<FusedBlock> fused =
      FuseIntoVolumes(FrameView(frame, labels), config_, volumes_);
  freeing.FreeEmpty(fused, volumes_);
  CheckInDebugBuilds(*this);
}

void VolumesMap::Remove(InstanceId id) { volumes_.erase(id); }

std::unique_ptr<MapRepresentation> VolumesMap::Clone() const {
  return std::make_unique<VolumesMap>(*this);
}

std::vector<Listing> VolumesMap::ListAt(const Eigen::Vector3i& voxel) const {
  std::vector<std::pair<float, InstanceId>> order;
  for (const auto& [id, volume] : volumes_) {
    const Eigen::Vector3d v = voxel.cast<double>();
    const Eigen::Vector3d q =
        volume.lattice_is_world
            ? v
            : Eigen::Vector3d((volume.T_WL.inverse() * (config_.voxel_m * v)) / config_.voxel_m);
    const auto distance = CoverOfPoint(volume.grid, q).Distance(config_.back());
    if (distance) order.emplace_back(*distance, id);
  }
  std::sort(order.begin(), order.end());
  if (order.size() > kMaxLayers) order.resize(kMaxLayers);
  std::vector<Listing> listings;
  for (const auto& entry : order) listings.push_back({entry.second, 0});
  return listings;
}

std::vector<Eigen::Vector3i> VolumesMap::ListedVoxels() const {
  std::vector<Index3> voxels;
  const auto keep = [&](const Index3& block, int place) {
    voxels.push_back(VoxelAt(block, place));
  };
  for (const auto& [id, volume] : volumes_) {
    if (volume.lattice_is_world) {
      for (const auto& entry : volume.grid.entries()) {
        const BlockMask cover = FindCover(volume.grid, entry.index);
        for (int place = 0; place < kBlockVoxels; ++place) {
          if (Bit(cover, place)) keep(entry.index, place);
        }
      }
      continue;
    }
    const VoxelReader reader(volume.grid);
    const std::array<double, 12> T_LW = RowsOf(volume.T_WL.inverse());
    for (const Index3& block : BlocksTouchedBy(reader, volume.T_WL, config_.voxel_m, true)) {
      PulledCover cover;
      if (!CoverOfBlock(reader, T_LW, config_.voxel_m, config_.back(), block, cover)) continue;
      for (int place = 0; place < kBlockVoxels; ++place) {
        if (Bit(cover.covered, place)) keep(block, place);
      }
    }
  }
  std::sort(voxels.begin(), voxels.end());
  voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
  return SortedVoxels(std::move(voxels));
}

std::vector<RaySurface> VolumesMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                             const RayCastOptions& options) const {
  RayPass pass;
  pass.voxel_m = config_.voxel_m;
  pass.each_alone = true;
  for (const auto& [id, volume] : volumes_) {
    pass.volumes.push_back({id, &volume.grid, volume.T_WL, volume.lattice_is_world});
  }
  return RunRayPass(pass, camera, T_WC, options);
}

MapMemory VolumesMap::Memory() const { return VolumeMemory(); }

}  // namespace tsdfpp
