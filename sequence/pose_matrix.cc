#include "sequence/pose_matrix.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/farthest.h"
#include "sequence/text_lines.h"

namespace tsdfpp {

Expected<Pose> PoseFromMatrix(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                              const std::string& where) {
  if (!rotation.allFinite() || !translation.allFinite()) {
    return DataError("{}: the pose holds numbers that are not finite", where);
  }
  const double farthest_m = translation.cwiseAbs().maxCoeff();
  if (farthest_m > kFarthest_m) {
    return DataError("{}: the pose is {:g} m from the origin, expected at most {:g}", where,
                     farthest_m, kFarthest_m);
  }
  const double off =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > kOrthonormalTolerance) {
    return DataError("{}: the rotation is not orthonormal (R^T R is off by {:.3g}, allowed {:g})",
                     where, off, kOrthonormalTolerance);
  }
  if (rotation.determinant() < 0) {
    return DataError("{}: the rotation is a reflection (determinant -1), expected +1", where);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Pose pose = Pose::Identity();
  pose.linear() = svd.matrixU() * svd.matrixV().transpose();
  pose.translation() = translation;
  return pose;
}

Expected<Pose> PoseFromNumbers(std::span<const double> numbers, const std::string& where) {
  if (numbers.size() != 16) {
    return DataError("{}: {} numbers, expected the 16 of a 4x4 camera-to-world matrix", where,
                     numbers.size());
  }
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = numbers[static_cast<std::size_t>(i)];
  constexpr double kLastRowTolerance = 1e-6;
  if (!((matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() <=
        kLastRowTolerance) &&
      matrix.topRows<3>().allFinite()) {
    return DataError("{}: the matrix's last row is {} {} {} {}, expected 0 0 0 1", where,
                     matrix(3, 0), matrix(3, 1), matrix(3, 2), matrix(3, 3));
  }
  return PoseFromMatrix(matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>(), where);
}

Expected<Pose> ReadPoseMatrix(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::vector<double> numbers, ReadNumbers(path));
  return PoseFromNumbers(numbers, path.string());
}

std::string PoseToMatrixText(const Pose& T_target_source) {
  const Eigen::Matrix4d m = T_target_source.matrix();
  std::string text;
  for (int row = 0; row < 4; ++row) {
    text += fmt::format("{:.17g} {:.17g} {:.17g} {:.17g}\n", m(row, 0), m(row, 1), m(row, 2),
                        m(row, 3));
  }
  return text;
}

Expected<Intrinsics> ReadIntrinsicMatrix(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::vector<double> numbers, ReadNumbers(path));
  const std::size_t side = numbers.size() == 16 ? 4 : 3;
  const bool finite = std::all_of(numbers.begin(), numbers.end(),
                                  [](double number) { return std::isfinite(number); });
  if ((numbers.size() != 9 && numbers.size() != 16) || !finite || numbers[side] != 0 ||
      numbers[2 * side] != 0 || numbers[2 * side + 1] != 0 || numbers[2 * side + 2] != 1) {
    return DataError("{}: not a camera matrix, expected fx 0 cx, 0 fy cy, 0 0 1 (3x3 or 4x4)",
                     path.string());
  }
  const Intrinsics camera{0, 0, numbers[0], numbers[side + 1], numbers[2], numbers[side + 2]};
  if (!(camera.fx > 0) || !(camera.fy > 0)) {
    return DataError("{}: focal lengths {} and {}, expected both over 0", path.string(), camera.fx,
                     camera.fy);
  }
  return camera;
}

}  // namespace tsdfpp
