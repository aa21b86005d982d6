// Meshing and memory beside Open3D, on the same frames in the same run.
#pragma once

#include <string>

#include "core/error.h"

namespace tsdfpp {

struct MeshBenchOptions {
  std::string scene = "scenes/toycar3.toml";
  std::string profile = "paper";
  double open3d_band = 10;  // voxels on both sides of a surface
  double voxel_m = 0.01;
  int frames = 256;  // from the first on
  int every = 16;    // frames between two meshes from scratch, beside the kept ones
  int threads = 2;
  int block_side = 16;  // of VoxelBlockGrid, in the child's process; voxels
};

// Prints two tables. Meshing: for each method triangles and milliseconds of the whole visible scene
// from scratch, Open3D's ScalableTSDFVolume and VoxelBlockGrid beside it (the latter in processes
// of their own, with blocks of 8 and of 16 voxels), ratios over the fastest of these; then of the
// kept meshes a frame with the share of changed blocks. Memory: bytes of occupied blocks, of these
// a voxel, and growth of the process. Errors: those of the source.
Expected<void> RunMeshBench(const MeshBenchOptions& options);

// The child process's part: VoxelBlockGrid alone; prints one line for RunMeshBench.
Expected<void> RunVoxelBlockGrid(const MeshBenchOptions& options);

}  // namespace tsdfpp
