#include "mapper/methods/field_fusion.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <limits>
#include <optional>
#include <vector>

#include "mapper/volume/allocation.h"
#include "mapper/volume/freeing.h"
#include "mapper/volume/rims.h"

namespace tsdfpp {
namespace {

using LabelBlock = LabelledField::LabelBlock;

constexpr std::size_t kBlocksPerTask = 16;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// `label` is the one that all the block's pixels have, kNoInstance where there may be several.
// `next` as FuseVoxels() takes it.
void FuseBlock(const FrameView& frame, const MapConfig& config, bool guarded,
               const BlockPlace& place, InstanceId label, const TsdfBlock* next, TsdfBlock& block,
               LabelBlock& labels) {
  FusionRule rule;
  rule.id = label;
  rule.one_label = label != kNoInstance;
  rule.front = config.front();
  rule.back = config.back();
  // Colours go wherever labels do: a triangle's label and colour are of the same observations.
  rule.colour_band = std::numeric_limits<float>::infinity();
  rule.first_colour_band = rule.colour_band;
  rule.weight_cap = static_cast<float>(config.weight_cap);
  LabelVotes votes{labels.id.data(), labels.confidence.data(), config.confidence_cap};
  votes.band = config.vote_band();
  if (guarded) votes.guard = config.voxel();
  const FusionResult result = FuseVoxels(frame.kernel, place, rule, block, next, &votes);
  if (result.changed) block.revision = NewRevision();
  if (votes.any_label_changed) labels.NoteLabels();
}

// Rims of one field (docs/map.md, `tsdf/guarded`).
void CompleteRims(const FrameView& frame, const MapConfig& config, LabelledField& field) {
  const auto field_of = [&](InstanceId) -> std::optional<RimVolume> {
    return RimVolume{&field.values(), Pose::Identity(), true};
  };
  const auto is_own = [&](InstanceId id, const Index3& voxel) {
    const LabelBlock* labels = field.labels().Find(BlockOf(voxel));
    return labels != nullptr && labels->id[At(PlaceInBlock(voxel))] == id;
  };
  for (const RimBlock& rim : FindRims(frame, config, field_of, is_own)) {
    TsdfBlock& block = field.values().FindOrAdd(rim.index);
    LabelBlock& labels = field.labels().FindOrAdd(rim.index);
    for (const RimValue& value : rim.voxels) {
      const std::size_t i = At(value.place);
      if (block.weight[i] > 0) continue;  // an object before this one has completed it
      FuseRim(frame, config, value, block);
      labels.id[i] = rim.id;
      labels.confidence[i] = 1;
    }
    labels.NoteLabel(rim.id);
    block.UpdateMasks(config.back());
  }
}

}  // namespace

void FuseIntoField(const FrameView& frame, const MapConfig& config, bool guarded,
                   LabelledField& field) {
  const auto lattice_of = [&](InstanceId) -> LatticeOfLabel {
    return {Pose::Identity(), &field.values().directory()};
  };
  const std::size_t blocks_before = field.values().size();
  for (const auto& [id, indices] : BlocksAlongRays(frame, config, lattice_of)) {
    for (const Index3& index : indices) field.AddBlock(index);
  }
  const CameraFromLattice T_CW(frame.T_WC, Pose::Identity(), true);
  const auto& blocks = field.values().entries();
  const std::vector<PlannedBlock> planned = PlanBlocks(
      frame, blocks.size(), config.voxel(), config.back(), [&](std::size_t i) -> BlockCandidate {
        return {blocks[i].index, &T_CW, kNoInstance, true};
      });
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, planned.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const auto& [index, block] = blocks[planned[k].number];
          const TsdfBlock* next =
              k + 1 == range.end() ? nullptr : blocks[planned[k + 1].number].block.get();
          FuseBlock(frame, config, guarded, PlaceOf(T_CW, index, config.voxel(), planned[k]),
                    planned[k].label, next, *block, *field.labels().Find(index));
        }
      },
      tbb::simple_partitioner());
  if (guarded && config.rims) CompleteRims(frame, config, field);
  // A frame makes no voxel unobserved; it may have made blocks in vain.
  field.FreeEmpty(EmptyFrom(field.values(), blocks_before,
                            [](const TsdfBlock& b) { return !b.AnyObserved(); }));
}

}  // namespace tsdfpp
