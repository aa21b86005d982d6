// Faces of mesh files, cut into triangles.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// Cuts a polygon that does not cross itself into triangles (ear clipping), oriented like the
// polygon (either way round). Where no ear is left, which only a polygon that crosses itself can
// do, the rest is fanned.
std::vector<std::array<std::uint32_t, 3>> CutPolygon(const std::vector<Eigen::Vector2d>& polygon);

// Cuts the faces of a file, and refuses those that would take too long.
class FaceCutter {
 public:
  // Triangles of a flat face, three corners at least: convex ones are fanned, others cut. Errors:
  // kData, to be led by the place in the file.
  Expected<std::vector<std::array<std::uint32_t, 3>>> Cut(
      const std::vector<Eigen::Vector3d>& corners);

 private:
  std::size_t concave_work_ = 0;  // so far
};

}  // namespace tsdfpp
