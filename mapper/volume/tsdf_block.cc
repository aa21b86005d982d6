#include "mapper/volume/tsdf_block.h"

#include <atomic>

#include "mapper/volume/value_masks.h"

namespace tsdfpp {

std::uint64_t NewRevision() {
  // Each thread takes a batch at a time, so that they do not wait for each other.
  constexpr std::uint64_t kBatch = 4096;
  static std::atomic<std::uint64_t> next_batch{1};
  thread_local std::uint64_t next = 0;
  if (next % kBatch == 0) next = kBatch * next_batch.fetch_add(1, std::memory_order_relaxed);
  return next++;
}

bool TsdfBlock::UpdateMasks(float back) {
  revision = NewRevision();
  full = {};
  const ValueMasks now = MasksOfValues(*this, back);
  const bool changed = now.observed != observed || now.negative != negative || now.band != band;
  observed = now.observed;
  negative = now.negative;
  band = now.band;
  FreeColoursIfNone();
  return changed;
}

std::size_t BytesOf(const TsdfGrid& grid) {
  std::size_t bytes = grid.TableBytes();
  for (const TsdfGrid::Entry& entry : grid.entries()) bytes += entry.block->Bytes();
  return bytes;
}

}  // namespace tsdfpp
