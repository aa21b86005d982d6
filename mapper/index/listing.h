// What a voxel of the global map volume says of an object (paper III-A).
#pragma once

#include "core/types.h"

namespace tsdfpp {

// One entry of a voxel's list; the first entry is the active object.
struct Listing {
  InstanceId id = kNoInstance;
  int confidence = 0;  // 0 where the method keeps none
  bool operator==(const Listing&) const = default;
};

}  // namespace tsdfpp
