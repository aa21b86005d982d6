// What a user would pick instead: Open3D's ScalableTSDFVolume, in a file of its own.
#pragma once

#include <memory>

#include "core/types.h"

namespace tsdfpp {

enum class Open3dColour { kNone, kRgb };

class Open3dVolume {
 public:
  // Lengths in metres; Open3D has one truncation for both sides.
  Open3dVolume(double voxel_m, double truncation_m, Open3dColour colour = Open3dColour::kRgb);
  ~Open3dVolume();

  // Converts the frame, which is not timed, then integrates it; returns the seconds of the latter.
  double Integrate(const Frame& frame);

  struct Mesh {
    double seconds = 0;
    std::size_t triangles = 0;
  };
  // Times the extraction of all triangles.
  Mesh ExtractMesh() const;
  // The same triangles, in the world, without ids.
  TriangleMesh Triangles() const;
  // The voxels of all blocks.
  std::size_t OccupiedBytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Threads of Open3D's OpenMP loops. Several spin at their barriers on a busy machine, many times as
// long as they work.
void SetOpen3dThreads(int threads);

}  // namespace tsdfpp
