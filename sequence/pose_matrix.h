// Poses as matrices of text, which are rotations only about.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// The largest entry of R^T R - I that still passes for a rotation; 7-Scenes has 4e-4
// (docs/sources.md, "7-Scenes").
inline constexpr double kOrthonormalTolerance = 2e-3;

// The rotation nearest to `rotation` (SVD) and the translation. Errors: kData, beginning with
// `where`: numbers that are not finite, not orthonormal, a reflection, farther than kFarthest_m.
Expected<Pose> PoseFromMatrix(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                              const std::string& where);

// The same from 16 numbers, row by row. Errors also: another count, a last row other than 0 0 0 1.
Expected<Pose> PoseFromNumbers(std::span<const double> numbers, const std::string& where);

// A file of 16 numbers.
Expected<Pose> ReadPoseMatrix(const std::filesystem::path& path);

// Four lines of four numbers, each with all its bits.
std::string PoseToMatrixText(const Pose& T_target_source);

// The 3x3 or 4x4 matrix fx 0 cx 0 fy cy 0 0 1 as intrinsics without a size. Errors: kData, naming
// the file: other numbers, focal lengths that are not over 0.
Expected<Intrinsics> ReadIntrinsicMatrix(const std::filesystem::path& path);

}  // namespace tsdfpp
