// Open3D's VoxelBlockGrid with colour on the CPU, in a file of its own.
#pragma once

#include <memory>

#include "core/types.h"

namespace tsdfpp {

class VoxelBlockGridPeer {
 public:
  // Lengths in metres; blocks of `side`^3 voxels.
  VoxelBlockGridPeer(double voxel_m, double truncation_m, int side);
  ~VoxelBlockGridPeer();

  // Converts the frame to Open3D's raw formats, for which it is fastest, which is not timed; then
  // finds its blocks and integrates it; returns the seconds of these.
  double Integrate(const Frame& frame);
  struct Mesh {
    double seconds = 0;
    std::size_t triangles = 0;
  };
  // Times the extraction alone. Open3D 0.16 may abort in it or hang.
  Mesh ExtractMesh() const;
  // The same triangles, in the world, without colours and ids.
  TriangleMesh Triangles() const;
  // Values of the blocks that were ever observed, without the grid's reserve.
  std::size_t OccupiedBytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tsdfpp
