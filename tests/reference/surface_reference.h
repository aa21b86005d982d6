// The maps of docs/segmentation.md, "Maps", pixel by pixel in double precision, written from that
// page alone: slow, and with its formulae as they stand there.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"

namespace tsdfpp::reference {

struct SurfaceSettings {
  double noise_scale = 0;  // of nguyen2012; 0 is exact
  double sigmas = 3;
  double jump_px = 1.5;
  double concave_deg = 15;
  int gap_px = 2;
  int step_px = 2;    // s
  int smooth_px = 0;  // m
};

class SurfaceReference {
 public:
  using Grid = std::vector<std::vector<double>>;

  SurfaceReference(const cv::Mat& depth, const Intrinsics& k, const SurfaceSettings& settings)
      : k_(k), set_(settings), w_(1 / std::min(k.fx, k.fy)) {
    measured_ = Make([&](int u, int v) {
      const double z = depth.at<float>(v, u);
      return z >= 0.001 && z <= 100 ? 1 / z : 0;
    });
    const Grid along_rows = Make([&](int u, int v) { return Bridged(measured_, u, v, 1, 0); });
    bridged_ = Make([&](int u, int v) { return Bridged(along_rows, u, v, 0, 1); });
    const Grid rows = Make([&](int u, int v) { return Mean(bridged_, u, v, 1, 0); });
    smooth_ = Make([&](int u, int v) { return Mean(rows, u, v, 0, 1); });
  }

  double Q(int u, int v) const { return At(smooth_, u, v); }

  // The unit normal; 0 where nothing is known.
  Eigen::Vector3d Normal(int u, int v) const {
    const double q = Q(u, v);
    if (q == 0) return Eigen::Vector3d::Zero();
    const double a = Slope(u, v, 1, 0);
    const double b = Slope(u, v, 0, 1);
    return -Eigen::Vector3d(a * k_.fx, b * k_.fy, q - a * (u - k_.cx) - b * (v - k_.cy))
                .normalized();
  }

  double Sigma(int u, int v) const {
    const double q = Q(u, v);
    if (q == 0) return 0;
    const Eigen::Vector3d ray((u - k_.cx) / k_.fx, (v - k_.cy) / k_.fy, 1);
    const double th =
        std::min(std::acos(-Normal(u, v).dot(ray.normalized())), 85 * std::numbers::pi / 180);
    const double z = 1 / q;
    double axial = HeadOn(z);
    if (th > std::numbers::pi / 3) {
      axial += set_.noise_scale * 0.0001 / std::sqrt(z) * th * th /
               std::pow(std::numbers::pi / 2 - th, 2);
    }
    const double lateral_px = set_.noise_scale * (0.8 + 0.035 * th / (std::numbers::pi / 2 - th));
    const double slope = std::hypot(Slope(u, v, 1, 0), Slope(u, v, 0, 1)) * z * z;
    return std::hypot(axial, lateral_px * slope);
  }

  // Is there a jump between (u, v) and the next pixel in direction (du, dv)?
  bool Jumps(int u, int v, int du, int dv) const {
    const double q0 = Q(u, v);
    const double q1 = Q(u + du, v + dv);
    if (q0 == 0 || q1 == 0) return true;
    const int s = set_.step_px;
    const double before = Q(u - s * du, v - s * dv);
    const double behind = Q(u + (1 + s) * du, v + (1 + s) * dv);
    const bool first_is_nearer = q0 > q1;
    const double q = first_is_nearer ? q0 : q1;
    const double sigma = first_is_nearer ? Sigma(u, v) : Sigma(u + du, v + dv);
    const double z = 1 / q;
    const double window = (2 * set_.smooth_px + 1) * (set_.smooth_px + 1);
    const double tolerance =
        (set_.sigmas * std::sqrt(2 / window) * sigma + set_.jump_px * w_ * z) / (z * z);
    const double step = q1 - q0;
    std::vector<double> off;
    if (before != 0) off.push_back(std::abs(step - (q0 - before) / s));
    if (behind != 0) off.push_back(std::abs(step - (behind - q1) / s));
    if (off.empty()) off.push_back(std::abs(step) - std::tan(80 * std::numbers::pi / 180) * w_ * q);
    return *std::min_element(off.begin(), off.end()) > tolerance;
  }

  bool IsConcave(int u, int v) const { return Bends(u, v, 1, 0) || Bends(u, v, 0, 1); }

 private:
  Grid Make(const std::function<double(int, int)>& value) const {
    Grid grid(static_cast<std::size_t>(k_.height),
              std::vector<double>(static_cast<std::size_t>(k_.width)));
    for (int v = 0; v < k_.height; ++v) {
      for (int u = 0; u < k_.width; ++u) {
        grid[static_cast<std::size_t>(v)][static_cast<std::size_t>(u)] = value(u, v);
      }
    }
    return grid;
  }
  double At(const Grid& grid, int u, int v) const {
    if (u < 0 || v < 0 || u >= k_.width || v >= k_.height) return 0;
    return grid[static_cast<std::size_t>(v)][static_cast<std::size_t>(u)];
  }
  double HeadOn(double z) const {
    return set_.noise_scale * (0.0012 + 0.0019 * (z - 0.4) * (z - 0.4));
  }
  double Bridged(const Grid& grid, int u, int v, int du, int dv) const {
    const double own = At(grid, u, v);
    if (own != 0) return own;
    for (int before = 1; before <= set_.gap_px; ++before) {
      const double first = At(grid, u - before * du, v - before * dv);
      if (first == 0) continue;
      for (int after = 1; before + after - 1 <= set_.gap_px; ++after) {
        const double last = At(grid, u + after * du, v + after * dv);
        if (last == 0) continue;
        const double q = (first + last) / 2;
        const double tolerance = set_.sigmas * std::sqrt(2.0) * HeadOn(1 / q) * q * q +
                                 std::tan(80 * std::numbers::pi / 180) * w_ * q * (before + after);
        if (std::abs(first - last) > tolerance) return 0;
        return first + (last - first) * before / (before + after);
      }
      return 0;
    }
    return 0;
  }
  double Mean(const Grid& grid, int u, int v, int du, int dv) const {
    const double q = At(grid, u, v);
    if (q == 0) return 0;
    double sum = q;
    int count = 1;
    for (int i = 1; i <= set_.smooth_px; ++i) {
      const double before = At(grid, u - i * du, v - i * dv);
      const double behind = At(grid, u + i * du, v + i * dv);
      if (before == 0 || behind == 0) continue;
      const double slope = std::min(std::abs(behind - before) / (2 * i),
                                    std::tan(80 * std::numbers::pi / 180) * w_ * q);
      const double tolerance =
          set_.sigmas * std::sqrt(6.0) * (HeadOn(1 / q) * q * q + set_.noise_scale * 0.25 * slope);
      if (std::abs(before + behind - 2 * q) > tolerance) continue;
      sum += before + behind;
      count += 2;
    }
    return sum / count;
  }
  double Slope(int u, int v, int du, int dv) const {
    const int s = set_.step_px;
    const double q = Q(u, v);
    const double before = Q(u - s * du, v - s * dv);
    const double behind = Q(u + s * du, v + s * dv);
    const double back = (q - before) / s;
    const double ahead = (behind - q) / s;
    if (before == 0 && behind == 0) return 0;
    if (before == 0) return ahead;
    if (behind == 0) return back;
    const double z = 1 / q;
    const double tolerance = (set_.sigmas * HeadOn(z) + w_ * z) / (z * z) / s;
    if (std::abs(back - ahead) <= tolerance) return (back + ahead) / 2;
    return std::abs(back) < std::abs(ahead) ? back : ahead;
  }
  Eigen::Vector3d Point(int u, int v) const {
    return Eigen::Vector3d((u - k_.cx) / k_.fx, (v - k_.cy) / k_.fy, 1) / Q(u, v);
  }
  bool Bends(int u, int v, int du, int dv) const {
    const int s = set_.step_px;
    for (int i = -s; i < s; ++i) {
      if (Q(u + i * du, v + i * dv) == 0 || Jumps(u + i * du, v + i * dv, du, dv)) return false;
    }
    const Eigen::Vector3d first = Point(u, v) - Point(u - s * du, v - s * dv);
    const Eigen::Vector3d second = Point(u + s * du, v + s * dv) - Point(u, v);
    // Towards the camera: the middle lies behind the chord.
    if (!(Q(u - s * du, v - s * dv) + Q(u + s * du, v + s * dv) > 2 * Q(u, v))) return false;
    const double angle = std::atan2(first.cross(second).norm(), first.dot(second));
    const double h = std::min(first.norm(), second.norm());
    const double z = 1 / Q(u, v);
    const double tangent = std::tan(set_.concave_deg * std::numbers::pi / 180) +
                           set_.sigmas * std::sqrt(6.0) * Sigma(u, v) / (2 * set_.smooth_px + 1) *
                               s * w_ * z / (h * h);
    return angle > std::atan(tangent);
  }

  Intrinsics k_;
  SurfaceSettings set_;
  double w_;
  Grid measured_;
  Grid bridged_;
  Grid smooth_;
};

}  // namespace tsdfpp::reference
