#include "mapper/volume_fusion.h"

#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "mapper/allocation.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 32;
constexpr std::size_t kAhead = 4;

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

std::uint8_t SlicesOf(const BlockMask& voxels) {
  unsigned slices = 0;
  for (unsigned z = 0; z < voxels.size(); ++z) slices |= (voxels[z] != 0 ? 1U : 0U) << z;
  return static_cast<std::uint8_t>(slices);
}

struct Candidate {
  Index3 index;
  InstanceId id = kNoInstance;
  TsdfBlock* block = nullptr;
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
      candidates.push_back({entry.index, id, entry.block.get(), &camera.first->second});
    }
  }
  const std::vector<PlannedBlock> planned = PlanBlocks(
      frame, candidates.size(), config.voxel(), config.back(),
      [&](std::size_t i) -> BlockCandidate {
        const Candidate& of = candidates[i];
        return {of.index, of.T_CL, of.id, false, config.contradiction ? of.block : nullptr};
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
          TsdfBlock& block = *of.block;
          const TsdfBlock* next =
              k + 1 == range.end() ? nullptr : candidates[planned[k + 1].number].block;
          if (k + kAhead < range.end()) hwy::Prefetch(&candidates[planned[k + kAhead].number]);
          const BlockPlace place = PlaceOf(*of.T_CL, of.index, config.voxel(), planned[k]);
          const FusionResult result = FuseVoxels(frame.kernel, place, rule, block, next);
          if (!result.changed) continue;
          block.revision = NewRevision();
          fused[k] = {of.id,
                      of.index,
                      &block,
                      result.in_band,
                      AroundVoxels(result.changed_signs) |
                          (result.changed_band != 0 ? 1U << kItselfAround : 0U),
                      SlicesOf(result.changed_signs),
                      result.changed_band,
                      block.is_listed_with_others};
        }
      },
      tbb::simple_partitioner());
  std::erase_if(fused, [](const FusedBlock& block) { return block.block == nullptr; });
  InstanceId last = kNoInstance;
  for (const FusedBlock& block : fused) {
    if (block.id != last) volumes.at(block.id).revision = NewRevision();
    last = block.id;
  }
  return fused;
}

}  // namespace tsdfpp
