#include "sequence/silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tsdfpp {
namespace {

constexpr double kNear_m = 1e-3;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double x, double y) {
  return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
}

void Fill(const std::array<Eigen::Vector2d, 3>& p, cv::Mat& image) {
  const double left = std::min({p[0].x(), p[1].x(), p[2].x()});
  const double right = std::max({p[0].x(), p[1].x(), p[2].x()});
  const double top = std::min({p[0].y(), p[1].y(), p[2].y()});
  const double bottom = std::max({p[0].y(), p[1].y(), p[2].y()});
  // As numbers of pixels the others may be beyond what an int holds.
  if (!(left <= image.cols - 1.0 && right >= 0 && top <= image.rows - 1.0 && bottom >= 0)) return;
  const int x0 = static_cast<int>(std::ceil(std::max(left, 0.0)));
  const int x1 = static_cast<int>(std::floor(std::min(right, image.cols - 1.0)));
  const int y0 = static_cast<int>(std::ceil(std::max(top, 0.0)));
  const int y1 = static_cast<int>(std::floor(std::min(bottom, image.rows - 1.0)));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double a = Cross(p[0], p[1], x, y);
      const double b = Cross(p[1], p[2], x, y);
      const double c = Cross(p[2], p[0], x, y);
      if ((a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0)) {
        image.at<std::uint8_t>(y, x) = 255;
      }
    }
  }
}

// The part of a triangle in front of the near plane: three or four corners, or none.
std::vector<Eigen::Vector3d> Clip(const std::array<Eigen::Vector3d, 3>& corners) {
  std::vector<Eigen::Vector3d> kept;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d& a = corners[i];
    const Eigen::Vector3d& b = corners[(i + 1) % 3];
    if (a.z() >= kNear_m) kept.push_back(a);
    if ((a.z() >= kNear_m) != (b.z() >= kNear_m)) {
      kept.push_back(a + (kNear_m - a.z()) / (b.z() - a.z()) * (b - a));
    }
  }
  return kept;
}

}  // namespace

cv::Mat Silhouette(const TriangleMesh& mesh_O, const Pose& T_CO, const Intrinsics& camera) {
  cv::Mat image = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  std::vector<Eigen::Vector3d> points_C;
  points_C.reserve(mesh_O.vertices.size());
  for (const Eigen::Vector3f& p_O : mesh_O.vertices) points_C.push_back(T_CO * p_O.cast<double>());
  const auto project = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector2d(camera.fx * p.x() / p.z() + camera.cx,
                           camera.fy * p.y() / p.z() + camera.cy);
  };
  for (const auto& triangle : mesh_O.triangles) {
    const auto corners =
        Clip({points_C[triangle[0]], points_C[triangle[1]], points_C[triangle[2]]});
    for (std::size_t i = 2; i < corners.size(); ++i) {
      Fill({project(corners[0]), project(corners[i - 1]), project(corners[i])}, image);
    }
  }
  return image;
}

}  // namespace tsdfpp
