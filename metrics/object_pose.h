// Errors of an object's pose, measured at its model's points (as bop_toolkit defines them). Metres,
// pixels for MSPD. Undefined where the model has no points.
#pragma once

#include <span>
#include <vector>

#include "core/types.h"
#include "metrics/measured.h"

namespace tsdfpp {

// ADD (Hinterstoisser et al. 2012): mean distance between the model's points at both poses.
Measured AddError_m(std::span<const Eigen::Vector3f> points_O, const Pose& T_WO_estimate,
                    const Pose& T_WO_truth);

// ADD-S, also ADI: mean distance from each point at the true pose to the nearest one at the
// estimated pose. Quadratic in the points (4 million pairs take some 5 ms): subsample the model.
// Single precision: exact to some 1e-7 m for an object of a metre.
Measured AddSymmetricError_m(std::span<const Eigen::Vector3f> points_O, const Pose& T_WO_estimate,
                             const Pose& T_WO_truth);

// MSSD, maximum symmetry-aware surface distance (BOP Challenge 2019): the largest distance between
// a point at both poses, the truth turned by whichever symmetry (T_O_O, the identity always among
// them) makes that smallest.
Measured Mssd_m(std::span<const Eigen::Vector3f> points_O, const Pose& T_WO_estimate,
                const Pose& T_WO_truth, std::span<const Pose> symmetries = {});

// MSPD, the same of the points' projections: poses in the camera's frame. Undefined also where a
// point lies behind the camera at either pose.
Measured Mspd_px(std::span<const Eigen::Vector3f> points_O, const Pose& T_CO_estimate,
                 const Pose& T_CO_truth, const Intrinsics& camera,
                 std::span<const Pose> symmetries = {});

// Area under the accuracy-threshold curve (Xiang et al. 2018, PoseCNN): the share of the errors
// that are at most t, averaged over t from 0 to `greatest`; 0..1. An exact integral: the mean of
// max(0, 1 - error / greatest). PoseCNN's own script adds up the curve over its own errors, which
// differs by less than 1 / errors. Undefined without errors; an error that is undefined (an object
// that was not found) counts as infinite.
inline constexpr double kGreatestAucError_m = 0.1;
Measured AreaUnderCurve(std::span<const Measured> errors, double greatest = kGreatestAucError_m);

}  // namespace tsdfpp
