// Says whose the surface at a point is.
#pragma once

#include <functional>

#include "core/types.h"

namespace tsdfpp {

// Of a point in metres, in the lattice's frame. It may remember what it looked up last, so each
// thread has one of its own.
using PointLabel = std::function<InstanceId(const Eigen::Vector3f& point)>;

}  // namespace tsdfpp
