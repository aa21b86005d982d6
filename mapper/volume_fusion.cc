#include "mapper/volume_fusion.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "mapper/allocation.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

void AllocateBlocks(const FrameView& frame, const MapConfig& config, ObjectVolumes& volumes) {
  const auto T_WL_of = [&](InstanceId id) {
    const auto volume = volumes.find(id);
    return volume == volumes.end() ? Pose::Identity() : volume->second.T_WL;
  };
  for (const auto& [id, indices] : BlocksAlongRays(frame, config, T_WL_of)) {
    TsdfGrid& grid = volumes[id].grid;
    for (const Index3& index : indices) grid.FindOrAdd(index);
  }
}

// True where a voxel of the block changed.
bool FuseBlock(const FrameView& frame, const MapConfig& config, const BlockObservation& observation,
               FusedBlock& fused) {
  const float front = config.front();
  const float half_voxel = 0.5F * config.voxel();
  const auto weight_cap = static_cast<float>(config.weight_cap);
  TsdfBlock& block = *fused.block;
  bool changed = false;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const std::int32_t pixel = observation.pixel[i];
    if (pixel < 0) continue;
    const float s = observation.distance[i];
    if (frame.label[pixel] == fused.id) {
      const bool in_band = s <= front;
      FuseVoxel(block, i, in_band ? s : front, in_band ? frame.colour + 3 * pixel : nullptr,
                weight_cap);
      if (in_band) SetBit(fused.votes, static_cast<int>(i));
      changed = true;
    } else if (config.contradiction && block.weight[i] > 0 && block.distance[i] < -half_voxel &&
               s >= -half_voxel) {
      block.Clear(static_cast<int>(i));
      if (s > config.voxel()) {
        block.distance[i] = std::min(s, front);
        block.weight[i] = 1;
      }
      changed = true;
    }
  }
  if (changed) fused.masks_changed = block.UpdateMasks(config.back());
  return changed;
}

}  // namespace

std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes) {
  AllocateBlocks(frame, config, volumes);

  std::vector<FusedBlock> tasks;
  std::map<InstanceId, CameraFromLattice> cameras;
  for (auto& [id, volume] : volumes) {
    cameras.emplace(id, CameraFromLattice(frame.T_WC, volume.T_WL, volume.lattice_is_world));
    for (const TsdfGrid::Entry& entry : volume.grid.entries()) {
      tasks.push_back({id, entry.index, entry.block.get(), {}, false});
    }
  }
  std::vector<std::uint8_t> changed(tasks.size(), 0);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, tasks.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        BlockObservation observation;
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          FusedBlock& task = tasks[i];
          if (ObserveBlock(frame, cameras.at(task.id), task.index, config.voxel(), config.back(),
                           observation)) {
            changed[i] = FuseBlock(frame, config, observation, task) ? 1 : 0;
          }
        }
      },
      tbb::simple_partitioner());
  std::vector<FusedBlock> fused;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    if (changed[i] != 0) fused.push_back(tasks[i]);
  }
  return fused;
}

}  // namespace tsdfpp
