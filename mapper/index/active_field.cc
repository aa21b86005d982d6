#include "mapper/index/active_field.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

}  // namespace

void ActiveField::Note(const std::vector<Index3>& changed, std::size_t all) {
  once_.Outdate();
  if (all_are_stale_) return;
  stale_.insert(stale_.end(), changed.begin(), changed.end());
  // Nor may they pile up while nobody asks.
  all_are_stale_ = stale_.size() > all;
}

void ActiveField::NoteAll() {
  once_.Outdate();
  all_are_stale_ = true;
}

const TsdfGrid& ActiveField::Of(const PairIndex& pairs, const ObjectVolumes& volumes,
                                const MapConfig& config) const {
  once_.Run([&] { MakeAgain(pairs, volumes, config.back()); });
  return field_;
}

void ActiveField::MakeAgain(const PairIndex& pairs, const ObjectVolumes& volumes,
                            float back) const {
  std::vector<Index3> stale = std::exchange(stale_, {});
  if (std::exchange(all_are_stale_, false)) {
    stale.clear();
    for (const auto& entry : field_.entries()) stale.push_back(entry.index);
    for (const auto& entry : pairs.blocks().entries()) stale.push_back(entry.index);
  }
  if (stale.empty()) return;
  std::sort(stale.begin(), stale.end());
  stale.erase(std::unique(stale.begin(), stale.end()), stale.end());
  std::vector<Index3> gone;
  std::erase_if(stale, [&](const Index3& index) {
    if (pairs.blocks().Find(index) != nullptr) return false;
    if (field_.Find(index) != nullptr) gone.push_back(index);
    return true;
  });
  field_.Erase(gone);
  made_from_.Erase(gone);
  for (const Index3& index : stale) {
    field_.FindOrAdd(index);
    made_from_.FindOrAdd(index);
  }
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, stale.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const PairIndex::Block& list = *pairs.blocks().Find(stale[i]);
          std::vector<std::uint64_t> from{list.revision};
          std::vector<const TsdfBlock*> of;
          for (const auto& [id, volume] : volumes) {
            of.push_back(volume.grid.Find(stale[i]));
            from.push_back(of.back() == nullptr ? 0 : of.back()->revision);
          }
          std::vector<std::uint64_t>& made_from = *made_from_.Find(stale[i]);
          if (from == made_from) continue;
          made_from = std::move(from);
          TsdfBlock& block = *field_.Find(stale[i]);
          block = {};
          auto source = of.begin();
          for (const auto& [id, volume] : volumes) {
            const TsdfBlock* values = *source++;
            if (values == nullptr) continue;
            for (std::size_t k = 0; k < kBlockVoxels; ++k) {
              if (list.active[k].id != id) continue;
              block.distance[k] = values->distance[k];
              block.weight[k] = values->weight[k];
              block.SetColour(k, values->FixedColourAt(k), values->ColourCount(k));
            }
          }
          block.UpdateMasks(back);
        }
      },
      tbb::simple_partitioner());
}

std::size_t ActiveField::Bytes() const {
  return once_.Alone([&] { return tsdfpp::BytesOf(field_) - field_.TableBytes(); });
}

VoxelLabels ActiveLabels(const PairIndex& pairs) {
  return LabelsOf(pairs.blocks(), [](const PairIndex::Block& block, std::size_t place) {
    return block.active[place].id;
  });
}

}  // namespace tsdfpp
