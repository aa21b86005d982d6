#include "sim/config/spline.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

namespace tsdfpp {

CubicSpline::CubicSpline(std::vector<double> knots, std::vector<double> values,
                         std::optional<double> start_slope, std::optional<double> end_slope)
    : knots_(std::move(knots)), values_(std::move(values)), second_(knots_.size(), 0.0) {
  const std::size_t n = knots_.size();
  assert(n >= 2 && values_.size() == n);
  // The tridiagonal system of the second derivatives, solved by forward elimination.
  std::vector<double> upper(n, 0.0);
  std::vector<double> right(n, 0.0);
  if (start_slope) {
    const double h = knots_[1] - knots_[0];
    upper[0] = 0.5;
    right[0] = 3.0 / h * ((values_[1] - values_[0]) / h - *start_slope);
  }
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before = knots_[i] - knots_[i - 1];
    const double after = knots_[i + 1] - knots_[i];
    const double jump =
        (values_[i + 1] - values_[i]) / after - (values_[i] - values_[i - 1]) / before;
    const double lower = before / (before + after);
    const double pivot = 2.0 - lower * upper[i - 1];
    upper[i] = (1.0 - lower) / pivot;
    right[i] = (6.0 * jump / (before + after) - lower * right[i - 1]) / pivot;
  }
  if (end_slope) {
    const double h = knots_[n - 1] - knots_[n - 2];
    const double wanted = 6.0 / h * (*end_slope - (values_[n - 1] - values_[n - 2]) / h);
    right[n - 1] = (wanted - right[n - 2]) / (2.0 - upper[n - 2]);
  }
  second_[n - 1] = right[n - 1];
  for (std::size_t i = n - 1; i-- > 0;) second_[i] = right[i] - upper[i] * second_[i + 1];
}

std::size_t CubicSpline::Segment(double at) const {
  const auto above = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, at);
  return static_cast<std::size_t>(above - knots_.begin()) - 1;
}

double CubicSpline::Value(double at) const {
  const double t = std::clamp(at, knots_.front(), knots_.back());
  const std::size_t i = Segment(t);
  const double h = knots_[i + 1] - knots_[i];
  const double a = (knots_[i + 1] - t) / h;
  const double b = 1.0 - a;
  return a * values_[i] + b * values_[i + 1] +
         ((a * a * a - a) * second_[i] + (b * b * b - b) * second_[i + 1]) * h * h / 6.0;
}

double CubicSpline::Slope(double at) const {
  const double t = std::clamp(at, knots_.front(), knots_.back());
  const std::size_t i = Segment(t);
  const double h = knots_[i + 1] - knots_[i];
  const double a = (knots_[i + 1] - t) / h;
  const double b = 1.0 - a;
  return (values_[i + 1] - values_[i]) / h +
         ((3.0 * b * b - 1.0) * second_[i + 1] - (3.0 * a * a - 1.0) * second_[i]) * h / 6.0;
}

namespace {

// The weighted harmonic mean of the slopes on both sides of a knot.
double InnerSlope(double before, double slope_before, double after, double slope_after) {
  if (!(slope_before * slope_after > 0)) return 0;
  const double w1 = 2 * after + before;
  const double w2 = after + 2 * before;
  return (w1 + w2) / (w1 / slope_before + w2 / slope_after);
}

// The segment of `at` in knots (two at least), and where in it, 0 to 1.
std::pair<std::size_t, double> Locate(const std::vector<double>& knots, double at) {
  const double t = std::clamp(at, knots.front(), knots.back());
  const auto above = std::upper_bound(knots.begin() + 1, knots.end() - 1, t);
  const auto i = static_cast<std::size_t>(above - knots.begin()) - 1;
  return {i, (t - knots[i]) / (knots[i + 1] - knots[i])};
}

}  // namespace

std::vector<double> RestingSlopes(const std::vector<double>& knots,
                                  const std::vector<double>& values) {
  std::vector<double> slopes(knots.size(), 0.0);
  for (std::size_t i = 1; i + 1 < knots.size(); ++i) {
    const double before = knots[i] - knots[i - 1];
    const double after = knots[i + 1] - knots[i];
    slopes[i] = InnerSlope(before, (values[i] - values[i - 1]) / before, after,
                           (values[i + 1] - values[i]) / after);
  }
  return slopes;
}

RestingSpline::RestingSpline(std::vector<double> knots, std::vector<double> values)
    : knots_(std::move(knots)),
      values_(std::move(values)),
      slopes_(RestingSlopes(knots_, values_)) {
  assert(!knots_.empty() && values_.size() == knots_.size());
}

double RestingSpline::Value(double at) const {
  if (knots_.size() == 1) return values_.front();
  const auto [i, u] = Locate(knots_, at);
  const double h = knots_[i + 1] - knots_[i];
  const double rise = values_[i + 1] - values_[i];
  const double smooth = u * u * (3 - 2 * u);
  return values_[i] + smooth * rise + h * u * (1 - u) * ((1 - u) * slopes_[i] - u * slopes_[i + 1]);
}

Eigen::Quaterniond FromRotationVector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle == 0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, vector / angle));
}

Eigen::Vector3d ToRotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

RotationSpline::RotationSpline(std::vector<double> knots, std::vector<Eigen::Quaterniond> values)
    : knots_(std::move(knots)),
      values_(std::move(values)),
      velocities_(knots_.size(), Eigen::Vector3d::Zero()) {
  assert(!knots_.empty() && values_.size() == knots_.size());
  for (std::size_t i = 1; i < values_.size(); ++i) {
    if (values_[i].dot(values_[i - 1]) < 0) values_[i].coeffs() = -values_[i].coeffs();
  }
  for (std::size_t i = 1; i + 1 < values_.size(); ++i) {
    const double before = knots_[i] - knots_[i - 1];
    const double after = knots_[i + 1] - knots_[i];
    const Eigen::Vector3d in = ToRotationVector(values_[i - 1].conjugate() * values_[i]) / before;
    const Eigen::Vector3d out = ToRotationVector(values_[i].conjugate() * values_[i + 1]) / after;
    for (int k = 0; k < 3; ++k) velocities_[i][k] = InnerSlope(before, in[k], after, out[k]);
  }
}

Eigen::Quaterniond RotationSpline::Value(double at) const {
  if (knots_.size() == 1) return values_.front();
  const auto [i, u] = Locate(knots_, at);
  const double third = (knots_[i + 1] - knots_[i]) / 3;
  std::array<Eigen::Quaterniond, 4> q{
      values_[i], values_[i] * FromRotationVector(third * velocities_[i]),
      values_[i + 1] * FromRotationVector(-third * velocities_[i + 1]), values_[i + 1]};
  for (std::size_t left = 3; left > 0; --left) {
    for (std::size_t k = 0; k < left; ++k) q[k] = q[k].slerp(u, q[k + 1]);
  }
  return q[0].normalized();
}

}  // namespace tsdfpp
