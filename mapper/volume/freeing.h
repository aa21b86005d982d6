// Which blocks a frame leaves empty (docs/map.md, "Freeing").
#pragma once

#include <map>
#include <vector>

#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

// Frees the volumes that hold nothing, and of which no pose is known.
void FreeUnknown(ObjectVolumes& volumes);

// Frees what a frame leaves without an observed voxel: blocks that it allocated in vain, and those
// that contradiction emptied; and FreeUnknown(). All other blocks hold what they held. Made before
// the frame is fused.
class FrameFreeing {
 public:
  explicit FrameFreeing(const ObjectVolumes& volumes);
  // `fused` is what FuseIntoVolumes returned; its pointers to freed blocks are no longer valid.
  void FreeEmpty(const std::vector<FusedBlock>& fused, ObjectVolumes& volumes) const;

 private:
  std::map<InstanceId, std::size_t> blocks_before_;
};

// The indices of the entries from position `first` on for whose block `is_empty` holds.
template <typename Block, typename Predicate>
std::vector<Index3> EmptyFrom(const BlockGrid<Block>& grid, std::size_t first,
                              const Predicate& is_empty) {
  std::vector<Index3> empty;
  for (std::size_t i = first; i < grid.size(); ++i) {
    const auto& entry = grid.entries()[i];
    if (is_empty(*entry.block)) empty.push_back(entry.index);
  }
  return empty;
}

}  // namespace tsdfpp
