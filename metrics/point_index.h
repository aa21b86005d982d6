// Exact distance from points to a set of points, in double precision.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// An immutable k-d tree of points. Distances are those of the stored single-precision positions,
// computed in double precision. Results do not depend on the number of threads.
class PointIndex {
 public:
  // `points` are finite.
  explicit PointIndex(std::span<const Eigen::Vector3f> points);

  // Distance from each query to its nearest point, metres; infinite where there are none.
  std::vector<double> Distances_m(std::span<const Eigen::Vector3f> queries) const;

  // Distance from each indexed point, in the order given, to the nearest *other* one.
  std::vector<double> Spacings_m() const;

 private:
  static constexpr std::uint32_t kNobody = 0xFFFFFFFF;
  void Build(std::size_t begin, std::size_t end);
  double Nearest2(const Eigen::Vector3d& query, std::uint32_t except) const;
  void Search(std::size_t begin, std::size_t end, const Eigen::Vector3d& query,
              std::uint32_t except, double& least2) const;

  // In the tree's order: a range's middle splits it along `axis_`, smaller coordinates before.
  std::vector<Eigen::Vector3f> points_;
  std::vector<std::uint32_t> original_;
  std::vector<std::uint8_t> axis_;
};

}  // namespace tsdfpp
