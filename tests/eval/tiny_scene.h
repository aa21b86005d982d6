// A scene of a few small frames, and a sequence on disk made from it by the command.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/files.h"
#include "tests/cli/run_command.h"

namespace tsdfpp::test {

// `frames` frames; the camera is `radius_m` from a car that turns beside a mug.
inline std::string TinyScene(int frames, double radius_m = 0.85) {
  return fmt::format(R"(name = "tiny"
purpose = "A car turns beside a mug, in a few small frames."
frames = {}
rate_hz = 10
[camera]
width = 128
height = 96
f = 90.0
cx = 63.0
cy = 48.5
target = [0.0, 0.0, 0.74]
azimuth_deg = [-112.0, -92.0, -70.0]
radius_m = [{}, 0.80, 0.85]
height_m = [{}, 0.58, 0.52]
[[object]]
name = "car"
id = 1
class = "car"
model = "car"
x = -0.20
y = -0.10
yaw_deg = -10
[object.drive]
start_frame = 1
end_frame = {}
ramp_s = 0.05
x = [0.02, 0.18]
y = [-0.12, 0.02]
[[object]]
name = "mug"
id = 2
class = "mug"
model = "mug"
x = 0.10
y = 0.16
)",
                     frames, radius_m, radius_m < 0.5 ? 0.12 : 0.52, frames);
}

}  // namespace tsdfpp::test
