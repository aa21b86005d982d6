// Discs as a camera sees them: where each can be in the image, and where a ray meets it.
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// A disc that faces the camera, in the camera's frame.
struct Splat {
  Eigen::Vector3d centre_C;
  Eigen::Vector3d normal_C;
  double plane_m = 0;    // normal_C . centre_C, below 0
  double radius2 = 0;    // square metres
  std::uint32_t u0 = 0;  // the pixels that it may be seen in, u0 <= u < u1
  std::uint32_t u1 = 0;
  std::uint32_t v0 = 0;
  std::uint32_t v1 = 0;

  // Where the ray through `ray_C` (z = 1) meets the disc: the depth, or 0 where it passes by.
  // `distance2`, if given, is the square of the distance from the centre.
  double DepthAlong(const Eigen::Vector3d& ray_C, double* distance2 = nullptr) const {
    const double slope = normal_C.dot(ray_C);
    if (!(slope < 0)) return 0;
    const double depth = plane_m / slope;
    const double apart2 = (depth * ray_C - centre_C).squaredNorm();
    if (!(apart2 <= radius2)) return 0;
    if (distance2 != nullptr) *distance2 = apart2;
    return depth;
  }
};

// The directions of the rays through the pixels' centres, z = 1.
class PixelRays {
 public:
  explicit PixelRays(const Intrinsics& camera);
  Eigen::Vector3d At(std::size_t u, std::size_t v) const { return {x_[u], y_[v], 1}; }

 private:
  std::vector<double> x_;
  std::vector<double> y_;
};

// The splat of a disc; empty (u0 == u1) where it turns its back to the camera or is out of view.
Splat SplatOf(const Eigen::Vector3d& centre_C, const Eigen::Vector3d& normal_C, double radius_m,
              const Intrinsics& camera);

// Image rows in bands, which threads take one by one, and for each band the splats that may be seen
// in it, by increasing number.
class SplatBands {
 public:
  static constexpr std::size_t kRows = 16;

  SplatBands(const std::vector<Splat>& splats, int height);
  std::size_t size() const { return begin_.size() - 1; }
  // The rows of band i are first to end - 1.
  static std::size_t FirstRow(std::size_t band) { return band * kRows; }
  std::size_t EndRow(std::size_t band) const;
  const std::uint32_t* begin(std::size_t band) const { return numbers_.data() + begin_[band]; }
  const std::uint32_t* end(std::size_t band) const { return numbers_.data() + begin_[band + 1]; }

 private:
  std::size_t height_;
  std::vector<std::size_t> begin_;
  std::vector<std::uint32_t> numbers_;
};

}  // namespace tsdfpp
