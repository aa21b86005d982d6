// How well the camera is found by the background, where its given poses are off or not used.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct CameraBenchOptions {
  std::vector<std::string> scenes{"scenes/toycar3.toml", "scenes/handheld.toml",
                                  "scenes/room.toml"};
  std::string recording = "../shared/data/tum_fr1_rpy_subset";  // TUM's; empty: none
  // Its fx fy cx cy, pixels. These are what TUM gives for the colour camera of its fr1 recordings;
  // no file of a recording holds them.
  std::array<double, 4> camera{517.3, 516.5, 318.6, 255.3};
  // Seconds after the images' times at which its motion capture is read; rows for each.
  std::vector<double> pose_offsets_s{0, -0.03};
  std::string method = "tsdf++/anchored";
  std::vector<double> voxels_m{0.01, 0.02};
  std::string settings;  // a file of mapper/track/sdf_track_config.h; empty for the defaults
  int until = 100000;    // the last frame of each
  std::string out;
};

// Maps each scene with its true masks and poses of objects, with exact depth and with the noise of
// nguyen2012, and the recording, which has neither, as background alone. Given poses of the camera
// are true (the recording's: motion capture's), drift, or jitter, the first one excepted. Writes
// camera.csv, a row a sequence, depth and voxel size: how far the poses of `--camera refine` and
// `track` are off (RMSE over the frames, millimetres / degrees, nothing aligned), those that drift
// and jitter as "given to found", and in how many frames the camera was not found. Of the recording
// without an offset clock.csv as well: how far the motions from frame to frame of `refine`,
// `track` and Open3D's ICP are from those of its groundtruth.txt, where it is TUM's and has one,
// which may have been written by another clock than the images' times: as stamped, and with the
// offset that fits best (bench/camera_clock.h). Errors: kUsage for wrong settings; those of scenes,
// renderer and recording; kEnvironment where `out` cannot be written.
Expected<void> RunCameraBench(const CameraBenchOptions& options);

}  // namespace tsdfpp
