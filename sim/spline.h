// Cubic splines through given knots.
#pragma once

#include <optional>
#include <vector>

namespace tsdfpp {

// The C2 cubic through (knots[i], values[i]). An end whose slope is not given is natural (its
// second derivative is zero). Outside the knots the end values hold.
class CubicSpline {
 public:
  // Two knots at least, strictly increasing; as many values.
  CubicSpline(std::vector<double> knots, std::vector<double> values,
              std::optional<double> start_slope = std::nullopt,
              std::optional<double> end_slope = std::nullopt);

  double Value(double at) const;
  double Slope(double at) const;

 private:
  std::size_t Segment(double at) const;

  std::vector<double> knots_;
  std::vector<double> values_;
  std::vector<double> second_;  // second derivatives at the knots
};

}  // namespace tsdfpp
