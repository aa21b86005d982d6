#include "mapper/volume_fusion.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "mapper/allocation.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

void AllocateBlocks(const FrameView& frame, const MapConfig& config, ObjectVolumes& volumes) {
  const auto lattice_of = [&](InstanceId id) -> LatticeOfLabel {
    const auto volume = volumes.find(id);
    if (volume == volumes.end()) return {};
    return {volume->second.T_WL, &volume->second.grid.directory()};
  };
  for (const auto& [id, indices] : BlocksAlongRays(frame, config, lattice_of)) {
    TsdfGrid& grid = volumes[id].grid;
    for (const Index3& index : indices) grid.FindOrAdd(index);
  }
}

constexpr std::uint32_t kItself = 1U << 13U;  // of the 27 blocks around

// Which of the 27 blocks around hold a neighbour of the voxels.
std::uint32_t AroundVoxels(const BlockMask& voxels) {
  std::uint64_t any = 0;
  for (const std::uint64_t slice : voxels) any |= slice;
  if (any == 0) return 0;
  constexpr std::uint64_t kFirstColumn = 0x0101010101010101ULL;
  // Bit 0: the one below, 1: the same, 2: the one above.
  const auto along = [](bool first, bool last) {
    return (first ? 1U : 0U) | 2U | (last ? 4U : 0U);
  };
  const unsigned x = along((any & kFirstColumn) != 0, (any & (kFirstColumn << 7U)) != 0);
  const unsigned y = along((any & 0xFFU) != 0, (any >> 56U) != 0);
  const unsigned z = along(voxels.front() != 0, voxels.back() != 0);
  const std::uint32_t row = x * ((y & 1U) | (y & 2U) << 2U | (y & 4U) << 4U);
  return row * ((z & 1U) | (z & 2U) << 8U | (z & 4U) << 16U);
}

struct Candidate {
  InstanceId id = kNoInstance;
  const TsdfGrid::Entry* entry = nullptr;
  const CameraFromLattice* T_CL = nullptr;
};

}  // namespace

std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes) {
  AllocateBlocks(frame, config, volumes);

  std::vector<Candidate> candidates;
  std::map<InstanceId, CameraFromLattice> cameras;
  for (auto& [id, volume] : volumes) {
    const auto camera =
        cameras.emplace(id, CameraFromLattice(frame.T_WC, volume.T_WL, volume.lattice_is_world));
    for (const TsdfGrid::Entry& entry : volume.grid.entries()) {
      candidates.push_back({id, &entry, &camera.first->second});
    }
  }
  const std::vector<PlannedBlock> planned =
      PlanBlocks(frame, candidates.size(), config.voxel(), config.back(),
                 [&](std::size_t i) -> BlockCandidate {
                   const Candidate& of = candidates[i];
                   return {of.entry->index, of.T_CL, of.id,
                           config.contradiction && of.entry->block->AnyNegative()};
                 });
  std::vector<FusedBlock> fused(planned.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, planned.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const Candidate& of = candidates[planned[k].number];
          FusionRule rule;
          rule.id = of.id;
          rule.contradiction = config.contradiction;
          rule.one_label = planned[k].label == of.id;
          rule.front = config.front();
          rule.back = config.back();
          rule.colour_band = config.colour_band();
          rule.first_colour_band = config.first_colour_band();
          rule.weight_cap = static_cast<float>(config.weight_cap);
          TsdfBlock& block = *of.entry->block;
          const TsdfBlock* next =
              k + 1 == range.end() ? nullptr : candidates[planned[k + 1].number].entry->block.get();
          const BlockPlace place = PlaceOf(*of.T_CL, of.entry->index, config.voxel(), planned[k]);
          const FusionResult result = FuseVoxels(frame.kernel, place, rule, block, next);
          if (!result.changed) continue;
          block.revision = NewRevision();
          fused[k] = {of.id,
                      of.entry->index,
                      &block,
                      result.in_band,
                      AroundVoxels(result.changed_signs) | (result.changed_band ? kItself : 0U),
                      block.is_listed_with_others};
        }
      },
      tbb::simple_partitioner());
  std::erase_if(fused, [](const FusedBlock& block) { return block.block == nullptr; });
  return fused;
}

}  // namespace tsdfpp
