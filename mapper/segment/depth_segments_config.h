// The settings of the geometric segmentation (docs/segmentation.md).
#pragma once

#include <string>

#include "core/error.h"
#include "core/toml_reader.h"
#include "mapper/segment/depth_noise.h"

namespace tsdfpp {

struct DepthSegmentsConfig {
  DepthNoise noise = DepthNoise::kNguyen2012;
  double noise_scale = 1;  // multiplies the model's standard deviations
  double sigmas = 3;       // standard deviations that noise reaches
  // A step between neighbours is a jump above this many pixels' width at its depth, and noise.
  double jump_px = 1.5;
  // A surface is concave where it bends towards the camera by more than this, and noise.
  double concave_deg = 15;
  int gap_px = 2;  // holes that narrow do not part a surface; they stay holes
  // What is smaller, in pixels or as seen, is no segment:
  double min_share = 0.0003;  // of the image's pixels
  double min_m2 = 0.001;      // a matchbox
  double plane_m2 = 0.15;     // planes of which that much is visible are background

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<DepthSegmentsConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const DepthSegmentsConfig&) const = default;
};

}  // namespace tsdfpp
