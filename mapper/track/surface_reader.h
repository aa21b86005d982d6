// An object's signed distances at points between its voxels.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstddef>
#include <limits>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {

// Where a point stands to a model's surface.
struct SurfaceSample {
  bool is_observed = false;  // the eight voxels around the point are
  bool has_slope = false;    // and their distances tell where the surface is
  float value_m = 0;         // the distance as the voxels have it
  Eigen::Vector3f gradient_L = Eigen::Vector3f::Zero();
  float slope = 0;   // the gradient's length
  float weight = 0;  // the least number of observations of the eight

  // Distances in a map are along the rays that saw them, up to 1 / cos of the angle of incidence
  // too long; this is that to the surface. Where there is a slope.
  float distance_m() const { return value_m / slope; }
  Eigen::Vector3f normal_L() const { return gradient_L / slope; }
};

// The eight voxels around a point as they were read last, for points that are asked for again and
// again and hardly move.
struct VoxelCube {
  Index3 base{std::numeric_limits<int>::max(), 0, 0};  // of none at first
  std::array<float, 8> distance{};                     // corner x + 2 y + 4 z
  int least_weight = 0;                                // 0 where one is unobserved
};

// A cube of voxels, and the second differences of the distances along the lines of voxels that pass
// through its corners, four along each axis: 0 where a corner is unobserved.
struct BentCube {
  VoxelCube cube;
  std::array<float, 12> low{};  // at the corner with the lower index
  std::array<float, 12> high{};
};

// Further out no voxel is, and indices stay far from the ends of their 21 bits.
inline constexpr double kFurthestVoxel = double{kBlockSide} * (kFurthestBlock + 1);

// Reads an object's distances. The grid must not change meanwhile.
class SurfaceReader {
 public:
  SurfaceReader(const TsdfGrid& grid, double voxel_m);

  // At a point of the lattice's frame, metres; any point that is not finite is unobserved. `sag_m`
  // is taken off the distance first.
  SurfaceSample At(const Eigen::Vector3d& p_L, float sag_m = 0) const;
  // The same; `cube` is this reader's, and is read anew where the point left it.
  SurfaceSample At(const Eigen::Vector3d& p_L, float sag_m, VoxelCube& cube) const;

  // What At() has of a point without its slope's length: false where it is unobserved. Numbers one
  // by one: a vector that is read right after its numbers were written waits for them.
  struct Linear {
    float value_m = 0;
    float slope_x = 0;  // the gradient, of the lattice
    float slope_y = 0;
    float slope_z = 0;
  };
  bool LinearAt(const Eigen::Vector3d& p_L, float sag_m, VoxelCube& cube, Linear& linear) const {
    const Eigen::Vector3d q = p_L * per_voxel_;
    if (!(q.cwiseAbs().maxCoeff() < kFurthestVoxel)) return false;
    const Index3 base = FloorOf(q);
    if (cube.base != base) Read(base, cube);
    if (cube.least_weight == 0) return false;
    const auto fx = static_cast<float>(q.x() - base.x);
    const auto fy = static_cast<float>(q.y() - base.y);
    const auto fz = static_cast<float>(q.z() - base.z);
    // Along x, then y, then z, with the slopes on the way.
    const std::array<float, 8>& d = cube.distance;
    const float x00 = d[1] - d[0];
    const float x10 = d[3] - d[2];
    const float x01 = d[5] - d[4];
    const float x11 = d[7] - d[6];
    const float c00 = d[0] + x00 * fx;
    const float c10 = d[2] + x10 * fx;
    const float c01 = d[4] + x01 * fx;
    const float c11 = d[6] + x11 * fx;
    const float c0 = c00 + (c10 - c00) * fy;
    const float c1 = c01 + (c11 - c01) * fy;
    const float x0 = x00 + (x10 - x00) * fy;
    const float x1 = x01 + (x11 - x01) * fy;
    linear.value_m = c0 + (c1 - c0) * fz - sag_m;
    linear.slope_x = (x0 + (x1 - x0) * fz) * gradient_per_step_;
    linear.slope_y = ((c10 - c00) + ((c11 - c01) - (c10 - c00)) * fz) * gradient_per_step_;
    linear.slope_z = (c1 - c0) * gradient_per_step_;
    return true;
  }

  // By how much the trilinear interpolation of the voxels around a point lies above a function
  // whose second differences along the axes are those of the voxels: f (1 - f) / 2 times each, f
  // the point's place between two voxels, which is exact for any quadratic one. Distances along
  // rays bend where a surface does, upwards over convex ones, and the more the flatter the rays
  // fall; without this the interpolated surface lies inside the object
  // (docs/tracking.md). Lines of voxels that go on on neither side count as straight. 0 where a
  // corner is unobserved. Metres, of a point of the lattice's frame, metres. `cube`, which is this
  // reader's, becomes that around the point. Points often lie close to those before, as an image's
  // do: `cache`, which is this thread's, keeps what a cube of voxels has for the next point in it.
  class SagCache {
   public:
    BentCube& Of(const Index3& base) {
      const auto at = static_cast<unsigned>(base.x) * 73U + static_cast<unsigned>(base.y) * 19U +
                      static_cast<unsigned>(base.z) * 5U;
      return cubes_[at % kCubes];
    }

   private:
    static constexpr std::size_t kCubes = 512;
    std::array<BentCube, kCubes> cubes_{};
  };
  SagCache& CacheOfThread() const { return caches_.local(); }
  float SagAt(const Eigen::Vector3d& p_L, SagCache& cache, VoxelCube& cube) const;

 private:
  void Read(const Index3& base, VoxelCube& cube) const;

  VoxelReader voxels_;
  double per_voxel_;
  float gradient_per_step_;  // 1 / voxel
  mutable tbb::enumerable_thread_specific<SagCache> caches_;
};

}  // namespace tsdfpp
