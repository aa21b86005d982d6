// What a user would pick instead for rays: Open3D's VoxelBlockGrid, in a process of its own,
// because its RayCast may not return.
#pragma once

#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// One cast of a map that has all frames up to this one.
struct RayTiming {
  double wall_ms = 0;
  double cpu_ms = 0;           // all threads of the process
  double median_error_mm = 0;  // of depth, where there is true depth and a surface
  double seen = 0;             // share of the pixels with true depth that show a surface
};

// Depth errors of one cast against a frame's own depth; fills the last two fields.
void ScoreDepth(const cv::Mat& depth, const Frame& frame, RayTiming& timing);

// Integrates the frames with colour in order, in blocks of `side`^3 voxels, and casts depth and
// normals at those whose `cast` is true, `repeats` times, of which the fastest counts. Errors:
// kEnvironment where the child process could not be started, died or took longer than `limit_s`.
Expected<std::vector<RayTiming>> CastWithOpen3d(const std::vector<Frame>& frames,
                                                const std::vector<bool>& cast, double voxel_m,
                                                double truncation_voxels, int side, int threads,
                                                int repeats, double limit_s);

}  // namespace tsdfpp
