#include "mapper/methods/volumes_map.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "mapper/index/cover.h"
#include "mapper/index/grid_invariants.h"
#include "mapper/map_reach.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/volume/freeing.h"
#include "mapper/volume/pull_back.h"

namespace tsdfpp {

void VolumesMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  MoveLattice(id, T_WO, [] {});
  CheckInDebugBuilds(*this);
}

void VolumesMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const FrameFreeing freeing(volumes_);
  const std::vector<FusedBlock> fused =
      FuseIntoVolumes(FrameView(frame, labels, config_.distances), config_, volumes_);
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
    // Beyond, the directory's keys would wrap; nothing is there.
    if (!(q.cwiseAbs().maxCoeff() < kFurthestStored * double{kBlockSide})) continue;
    if (!CoversPoint(volume.grid, q, config_.back())) continue;
    if (const auto distance = DistanceAtPoint(volume.grid, q)) order.emplace_back(*distance, id);
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

Fault VolumesMap::FindFault() const {
  std::size_t blocks = 0;
  if (Fault fault = FindVolumeFault(false, blocks)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = FindListFault(*this)) return fault;
  return FindCoverFault(*this, true);
}

}  // namespace tsdfpp
