// The global map volume (paper III-A): which objects each voxel of the world lists, and which of
// them is active, as meshes and rays read it.
//
// There are three, one a rule. What is read is the same in all; the paper's verbs (Deactivate and
// Activate of III-E, Vote of III-F) have a form of their own in each, since each rule votes at
// another time and needs other things of the volumes:
// - VotingIndex (`tsdf++`): a frame's votes are counted once it has been fused, block by block,
//   with what the objects cover then: Update().
// - DistanceIndex (`tsdf++/anchored`): nobody votes. Deactivate(), Activate() and NoteFusion() say
//   where lists are out of date; Refresh() makes those again.
// - PairIndex (`tsdf++/literal`): voxels vote before the frame is fused, since only who is active
//   then takes its values: Vote(). Fusion makes and reads its blocks itself: it is no GlobalIndex.
#pragma once

#include <vector>

#include "mapper/index/change_log.h"
#include "mapper/index/listing.h"

namespace tsdfpp {

class GlobalIndex {
 public:
  virtual ~GlobalIndex() = default;

  // The active objects of the kBlockVoxels voxels of a block, kNoInstance where there is none;
  // nullptr where nothing is listed in the block. Valid until the map changes.
  virtual const InstanceId* ActiveIn(const Index3& block) const = 0;

  // The objects listed at a voxel, the active one first.
  virtual std::vector<Listing> ListedAt(const Index3& voxel) const = 0;

  // The blocks where other objects may be active than were. Not noted where that is because the one
  // that was is gone or has moved: a reader sees to what its blocks hid.
  virtual const ChangeLog& changes() const = 0;
};

}  // namespace tsdfpp
