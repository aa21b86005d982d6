// How far off a depth camera's values are, as far as segmentation has to know.
#pragma once

#include <cmath>
#include <numbers>
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
// (pi/2 - th) pixels; th is at most 85 deg in both. Cosines below are of th. Without branches, so
// that compilers take several pixels at once.
struct NoiseModel {
  float scale = 0;  // 0: exact

  NoiseModel(DepthNoise noise, double noise_scale)
      : scale(noise == DepthNoise::kExact ? 0.0F : static_cast<float>(noise_scale)) {}

  // Standard deviations: of depth for th up to 60 deg, metres; the same as inverse depth q, 1/m.
  float HeadOn_m(float z) const { return scale * (0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F)); }
  float HeadOnInverse(float q) const {
    return scale * (0.0012F * q * q + 0.0019F * (1 - 0.4F * q) * (1 - 0.4F * q));
  }
  // Of depth, metres.
  float Axial_m(float z, float cosine) const {
    const float ratio = AngleRatio(cosine);
    const float grazing = cosine < 0.5F ? 0.0001F * ratio * ratio / std::sqrt(z) : 0.0F;
    return HeadOn_m(z) + scale * grazing;
  }
  // Of the place in the image at which depth was measured, pixels.
  float Lateral_px(float cosine) const { return scale * (0.8F + 0.035F * AngleRatio(cosine)); }

 private:
  // th / (pi/2 - th). pi/2 - th is the arc sine of the cosine: within 2e-5 rad up to 30 deg.
  static float AngleRatio(float cosine) {
    constexpr float kCosOf85Deg = 0.08715574F;
    constexpr float kHalfPi = std::numbers::pi_v<float> / 2;
    const float c = cosine > kCosOf85Deg ? cosine : kCosOf85Deg;
    const float c2 = c * c;
    const float series =
        c * (1 + c2 * (1.0F / 6 + c2 * (3.0F / 40 + c2 * (15.0F / 336 + c2 * (105.0F / 3456)))));
    return (kHalfPi - series) / series;
  }
};

}  // namespace tsdfpp
