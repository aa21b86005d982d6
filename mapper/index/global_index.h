// The global map volume (paper III-A): which objects each voxel of the world lists, and which of
// them is active, as meshes and rays read it.
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
