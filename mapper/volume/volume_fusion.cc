#include "mapper/volume/volume_fusion.h"

#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>

#include "mapper/volume/allocation.h"
#include "mapper/volume/cube_masks.h"
#include "mapper/volume/rims.h"

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

struct Candidate {
  Index3 index;
  InstanceId id = kNoInstance;
  std::uint32_t number = 0;  // in the grid's entries()
  TsdfBlock* block = nullptr;
  const CameraFromLattice* T_CL = nullptr;
};

// The blocks of all volumes, by id, then number.
class Candidates {
 public:
  Candidates(const FrameView& frame, const ObjectVolumes& volumes) {
    for (const auto& [id, volume] : volumes) {
      volumes_.push_back({size_, id, &volume.grid,
                          CameraFromLattice(frame.T_WC, volume.T_WL, volume.lattice_is_world)});
      size_ += volume.grid.size();
    }
  }

  std::size_t size() const { return size_; }
  const TsdfGrid::Entry& EntryAt(std::size_t i) const {
    const Volume& of = VolumeAt(i);
    return of.grid->entries()[i - of.first];
  }
  Candidate operator[](std::size_t i) const {
    const Volume& of = VolumeAt(i);
    const TsdfGrid::Entry& entry = of.grid->entries()[i - of.first];
    return {entry.index, of.id, static_cast<std::uint32_t>(i - of.first), entry.block.get(),
            &of.T_CL};
  }

 private:
  struct Volume {
    std::size_t first;  // of its blocks
    InstanceId id;
    const TsdfGrid* grid;
    CameraFromLattice T_CL;
  };
  const Volume& VolumeAt(std::size_t i) const {
    const auto after =
        std::upper_bound(volumes_.begin(), volumes_.end(), i,
                         [](std::size_t wanted, const Volume& of) { return wanted < of.first; });
    return *std::prev(after);
  }

  std::vector<Volume> volumes_;
  std::size_t size_ = 0;
};

FusionRule RuleOf(const MapConfig& config, InstanceId id, bool one_label) {
  FusionRule rule;
  rule.id = id;
  rule.contradiction = config.contradiction;
  rule.one_label = one_label;
  rule.front = config.front();
  rule.back = config.back();
  rule.colour_band = config.colour_band();
  rule.first_colour_band = config.first_colour_band();
  rule.weight_cap = static_cast<float>(config.weight_cap);
  return rule;
}

}  // namespace

std::uint8_t BlocksOfCubesAt(const BlockMask& voxels) {
  std::uint64_t any = 0;
  for (const std::uint64_t slice : voxels) any |= slice;
  if (any == 0) return 0;
  // Bit 0: its own, 1: the one before.
  const unsigned x = (any & kFirstColumn) != 0 ? 3 : 1;
  const unsigned xy = (any & 0xFFU) != 0 ? x | x << 2U : x;
  return static_cast<std::uint8_t>(voxels.front() != 0 ? xy | xy << 4U : xy);
}

std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes, BlockVotes* votes) {
  AllocateBlocks(frame, config, volumes);

  const Candidates candidates(frame, volumes);
  const std::vector<PlannedBlock> planned = PlanBlocks(
      frame, candidates.size(), config.voxel(), config.back(),
      [&](std::size_t i) -> BlockCandidate {
        const Candidate of = candidates[i];
        return {of.index, of.T_CL, of.id, false, config.contradiction ? of.block : nullptr};
      });
  std::vector<FusedBlock> fused(planned.size());
  // Each is written below before it is read.
  if (votes != nullptr) *votes = std::make_unique_for_overwrite<BlockMask[]>(planned.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, planned.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const Candidate of = candidates[planned[k].number];
          const FusionRule rule = RuleOf(config, of.id, planned[k].label == of.id);
          TsdfBlock& block = *of.block;
          const TsdfBlock* next =
              k + 1 == range.end() ? nullptr : candidates[planned[k + 1].number].block;
          if (k + kAhead < range.end()) {
            hwy::Prefetch(&candidates.EntryAt(planned[k + kAhead].number));
          }
          const BlockPlace place = PlaceOf(*of.T_CL, of.index, config.voxel(), planned[k]);
          const FusionResult result = FuseVoxels(frame.kernel, place, rule, block, next);
          if (!result.changed) continue;
          block.revision = NewRevision();
          BlockMask* own_votes = votes == nullptr ? nullptr : &(*votes)[k];
          if (own_votes != nullptr) *own_votes = result.in_band;
          fused[k] = {of.id,
                      of.index,
                      of.number,
                      &block,
                      own_votes,
                      BlocksOfCubesAt(result.changed_signs),
                      result.band_changed,
                      block.is_listed_with_others,
                      !block.AnyObserved()};
        }
      },
      tbb::simple_partitioner());
  std::erase_if(fused, [](const FusedBlock& block) { return block.block == nullptr; });
  if (config.rims) FuseRims(frame, config, volumes, fused);
  InstanceId last = kNoInstance;
  for (const FusedBlock& block : fused) {
    if (block.id != last) volumes.at(block.id).revision = NewRevision();
    last = block.id;
  }
  return fused;
}

}  // namespace tsdfpp
