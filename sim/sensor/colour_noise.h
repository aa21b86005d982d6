// Exposure, vignetting and noise of the colour camera. Formulae in docs/sensors.md.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "core/types.h"
#include "sim/config/sensor_config.h"

namespace tsdfpp {

// What light is multiplied with at a pixel: 1 - strength (1 - cos^4 a), a the angle between the
// pixel's ray and the optical axis.
double VignettingGain(const Intrinsics& intrinsics, double u, double v, double strength);

// This frame's exposure in stops: exposure_ev and a keyed draw of exposure_jitter_ev.
double FrameExposure_ev(const ColourSensorConfig& config, std::uint64_t seed, int frame);

// A colour image, CV_8UC3 RGB, as the camera gives it: levels become linear light, light is
// multiplied by 2^exposure and the vignetting gain, shot noise of variance light /
// full_well_electrons is added, light becomes levels again, level noise is added, and the result is
// rounded and clamped. Draws are keyed by (seed, frame.index, pixel). The exact config returns the
// frame's image itself, as does an empty one.
cv::Mat SenseColour(const ColourSensorConfig& config, std::uint64_t seed, const Frame& frame);

}  // namespace tsdfpp
