// The arithmetic of the global indices over the voxels of a block (docs/map.md, "The index of
// tsdf++" and "The index of tsdf++/anchored").
#pragma once

#include "mapper/index/voxel_list.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

struct VotesCounted {
  BlockMask others{};     // marked voxels where another object is active, or none
  BlockMask saturated{};  // marked voxels where the confidence is now at the cap
};

// One vote for `id` at each voxel that `votes` marks and whose id in `active` (kBlockVoxels of
// them) is `id`: its confidence grows by one, up to the cap.
VotesCounted VoteForActive(const BlockMask& votes, InstanceId id, int confidence_cap,
                           const InstanceId* active, std::uint8_t* confidences);

// Lists of the object alone where `covered` marks a voxel, empty ones elsewhere.
void ListAlone(const BlockMask& covered, InstanceId id, InstanceId* ids);

// The lists of a block while they are ordered: entry k of voxel i at [k * kBlockVoxels + i], the
// distance being infinite where there is no entry.
struct OrderedLists {
  int layers = 0;
  float* distance = nullptr;
  InstanceId* id = nullptr;
};

// Puts the object into the lists of the voxels that `covered` marks, behind all with a distance not
// greater; what is beyond the last layer is dropped.
void InsertByDistance(const BlockMask& covered, const float* distance, InstanceId id,
                      const OrderedLists& lists);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::VoteForActive) VoteForActive;
decltype(tsdfpp::ListAlone) ListAlone;
decltype(tsdfpp::InsertByDistance) InsertByDistance;
}  // namespace plain

}  // namespace tsdfpp
