// Poses as text, "tx ty tz qx qy qz qw". A pose that is streamed takes the same round trip through
// text as one on disk, so that both give a mapper the same bytes.
#pragma once

#include <string>
#include <string_view>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// Nine decimals (a nanometre); the quaternion has unit length and qw >= 0. The text is a fixed
// point: PoseToText(PoseFromText(text)) is the same text, so a second trip changes no bit.
std::string PoseToText(const Pose& T_target_source);

// Metres. Errors: kData where there are not seven finite numbers, the quaternion's length is not 1
// +- 1e-3, or the place is farther than kFarthest_m (core/farthest.h).
Expected<Pose> PoseFromText(std::string_view text);

// PoseFromText(PoseToText(pose)).
Pose PoseThroughText(const Pose& T_target_source);

}  // namespace tsdfpp
