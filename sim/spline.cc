#include "sim/spline.h"

#include <algorithm>
#include <cassert>
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

}  // namespace tsdfpp
