// Who else registers two depth images: Open3D's point-to-plane ICP.
#pragma once

#include "core/types.h"

namespace tsdfpp {

// The motion between two frames of a camera, T_before_after, beginning at `T_guess`: points of
// every pixel with depth, thinned to one a centimetre, first those within 7 cm of each other, then
// within 2.5 cm, with Open3D's normals and Tukey's weights. The guess where either frame has no
// depth.
Pose MotionByOpen3dIcp(const Frame& before, const Frame& after, const Pose& T_guess);

}  // namespace tsdfpp
