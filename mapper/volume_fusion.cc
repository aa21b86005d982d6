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

struct Task : FusedBlock {
  const CameraFromLattice* T_CL = nullptr;
};

// True where a voxel of the block changed.
bool FuseBlock(const FrameView& frame, const MapConfig& config, const BlockObservation& observation,
               FusedBlock& fused) {
  TsdfBlock& block = *fused.block;
  Lanes in_band;
  Lanes contradicted;
  FusionRule rule;
  rule.id = fused.id;
  rule.contradiction = config.contradiction;
  rule.front = config.front();
  rule.half_voxel = 0.5F * config.voxel();
  rule.weight_cap = static_cast<float>(config.weight_cap);
  const FusionResult result =
      FuseVoxels(frame.kernel, rule, observation, block, in_band, contradicted);
  if (result.any_in_band) fused.votes = MaskOf(in_band);
  if (result.any_contradicted) {
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (contradicted[i] == 0) continue;
      block.Clear(static_cast<int>(i));
      if (observation.distance[i] > config.voxel()) {
        block.distance[i] = std::min(observation.distance[i], rule.front);
        block.weight[i] = 1;
      }
    }
  }
  if (!result.any_taken && !result.any_contradicted) return false;
  fused.masks_changed = block.UpdateMasks(config.back());
  return true;
}

}  // namespace

std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes) {
  AllocateBlocks(frame, config, volumes);

  std::vector<Task> tasks;
  std::map<InstanceId, CameraFromLattice> cameras;
  for (auto& [id, volume] : volumes) {
    const auto camera =
        cameras.emplace(id, CameraFromLattice(frame.T_WC, volume.T_WL, volume.lattice_is_world));
    for (const TsdfGrid::Entry& entry : volume.grid.entries()) {
      tasks.push_back({{id, entry.index, entry.block.get(), {}, false}, &camera.first->second});
    }
  }
  const std::vector<std::uint32_t> order =
      BlocksInView(frame, tasks.size(), config.voxel(), [&](std::size_t i) -> BlockInView {
        return {tasks[i].index, tasks[i].T_CL};
      });
  std::vector<std::uint8_t> changed(tasks.size(), 0);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, order.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        BlockObservation observation;
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          Task& task = tasks[order[k]];
          if (ObserveBlock(frame, *task.T_CL, task.index, config.voxel(), config.back(),
                           observation)) {
            changed[order[k]] = FuseBlock(frame, config, observation, task) ? 1 : 0;
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
