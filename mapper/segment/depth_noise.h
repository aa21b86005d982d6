// How far off a depth camera's values are, as far as segmentation has to know.
#pragma once

#include <string_view>

#include "core/error.h"

namespace tsdfpp {

enum class DepthNoise {
  kExact,       // a renderer's
  kNguyen2012,  // Kinect v1 (Nguyen, Izadi, Lovell 2012)
};

// "exact", "nguyen2012".
std::string_view DepthNoiseName(DepthNoise noise);
// Errors: kUsage.
Expected<DepthNoise> DepthNoiseFromName(std::string_view name);

// The noise of a depth image, by depth z and the angle of incidence th, between ray and normal
// (docs/sensors.md). nguyen2012: along the ray 0.0012 + 0.0019 (z - 0.4)^2 metres, to which
// (0.0001 / sqrt z) th^2 / (pi/2 - th)^2 is added for th above 60 deg; across it 0.8 + 0.035 th /
// (pi/2 - th) pixels; th is at most 85 deg in both. What depends on th is in
// surface_kernels_plain.cc.
struct NoiseModel {
  float scale = 0;  // 0: exact

  NoiseModel(DepthNoise noise, double noise_scale)
      : scale(noise == DepthNoise::kExact ? 0.0F : static_cast<float>(noise_scale)) {}

  // Standard deviations: of depth for th up to 60 deg, metres; the same as inverse depth q, 1/m.
  float HeadOn_m(float z) const { return scale * (0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F)); }
  float HeadOnInverse(float q) const {
    return scale * (0.0012F * q * q + 0.0019F * (1 - 0.4F * q) * (1 - 0.4F * q));
  }
};

}  // namespace tsdfpp
