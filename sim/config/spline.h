// Splines through given knots: numbers and rotations.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
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

// Slopes at the knots of a cubic that starts and ends at rest and never leaves the range of two
// neighbouring values: what is lowered to a table does not dip into it. Inner slopes are the
// weighted harmonic mean of the neighbouring chords' slopes, zero where those differ in sign
// (Fritsch & Butland 1984, as in pchip).
std::vector<double> RestingSlopes(const std::vector<double>& knots,
                                  const std::vector<double>& values);

// The C1 cubic with RestingSlopes. Outside the knots the end values hold. One knot at least.
class RestingSpline {
 public:
  RestingSpline(std::vector<double> knots, std::vector<double> values);
  double Value(double at) const;

 private:
  std::vector<double> knots_;
  std::vector<double> values_;
  std::vector<double> slopes_;
};

// A C1 curve through rotations, at rest at both ends and wherever two neighbours are equal. Between
// two knots it takes the shorter way: the cubic Bezier curve of slerps (Shoemake 1985) whose
// angular velocities at the knots, in the turning frame, are RestingSlopes of the neighbouring
// chords. Turns about one axis are therefore exactly RestingSpline of the angle.
class RotationSpline {
 public:
  RotationSpline(std::vector<double> knots, std::vector<Eigen::Quaterniond> values);
  Eigen::Quaterniond Value(double at) const;

 private:
  std::vector<double> knots_;
  std::vector<Eigen::Quaterniond> values_;   // neighbours on the same half of the sphere
  std::vector<Eigen::Vector3d> velocities_;  // radians a unit of `at`, in the turning frame
};

// The rotation about `vector` by its length, radians.
Eigen::Quaterniond FromRotationVector(const Eigen::Vector3d& vector);
// Its inverse, length 0 to pi.
Eigen::Vector3d ToRotationVector(const Eigen::Quaterniond& rotation);

}  // namespace tsdfpp
