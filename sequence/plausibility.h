// Finds what users of such systems get wrong in silence: units, pose directions, intrinsics of
// another resolution (docs/sources.md, "What goes wrong in silence").
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"

namespace tsdfpp {

// A focal length must be 0.2 to 10 times the image's width, and the principal point no further from
// the image's middle than this share of its width and height: intrinsics of half the resolution are
// off by a quarter, real cameras by a few per cent.
inline constexpr double kFarthestPrincipalPoint = 0.15;
// Errors: kData, beginning with `where`.
Expected<void> CheckCamera(const Intrinsics& camera, const std::string& where);

// What every camera is, also one that a user made up: sides of 1 to kLargestCameraSide_px pixels,
// finite numbers, focal lengths above 0. Errors: kData, beginning with `where`.
inline constexpr int kLargestCameraSide_px = 16384;
Expected<void> CheckPossibleCamera(const Intrinsics& camera, const std::string& where);

// The median depth of a frame must lie between these.
inline constexpr double kNearestMedian_m = 0.05;
inline constexpr double kFarthestMedian_m = 50.0;

// Evidence against the poses or the unit of depth. Surfaces seen by two frames must agree: a
// pixel's point, carried into the other frame by the camera poses, should lie where that frame
// measured (to kAgreement of its depth). Where few pixels do, the same is tried with inverted
// poses, cameras that look along -z (OpenGL's axes), translations in millimetres, and other units
// of depth. Only one fault at a time is looked for.
inline constexpr double kAgreement = 0.015;
// An explanation is named where this share of pixels agrees under it, and this times the share
// under the poses and units as they are. Measured on shared/data: 0.56 to 0.97 where all is right,
// also with 73 % of the depth missing; 0.00 to 0.43 under each of the faults below.
inline constexpr double kClearShare = 0.5;
inline constexpr double kClearRatio = 2.0;

// Reads up to eight frames of `source`, whose camera poses are T_WC, and looks at depth's range and
// at the agreement above. `units_per_m` is the unit that depth was read with, nothing where it is
// float metres or changes on the way. Frames that cannot be read are left to Read(). Errors: kData,
// beginning with the sequence's name and saying what was found and what it looks like.
Expected<void> CheckFrames(FrameSource& source, const std::vector<Pose>& T_WC,
                           std::optional<double> units_per_m);

}  // namespace tsdfpp
