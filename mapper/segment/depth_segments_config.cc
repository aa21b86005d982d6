#include "mapper/segment/depth_segments_config.h"

#include <cmath>

namespace tsdfpp {
namespace {

Expected<void> InRange(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("segmentation setting '{}' is {}, expected {} to {}", field, value, lowest,
                    highest);
}

}  // namespace

Expected<void> DepthSegmentsConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(InRange("noise_scale", noise_scale, 0.01, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("sigmas", sigmas, 0.1, 10));
  TSDFPP_RETURN_IF_ERROR(InRange("jump_px", jump_px, 0.1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("concave_deg", concave_deg, 1, 89));
  TSDFPP_RETURN_IF_ERROR(InRange("gap_px", gap_px, 0, 16));
  TSDFPP_RETURN_IF_ERROR(InRange("min_share", min_share, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("min_m2", min_m2, 0, 1e6));
  TSDFPP_RETURN_IF_ERROR(InRange("plane_m2", plane_m2, 0.001, 1e6));
  return {};
}

Expected<DepthSegmentsConfig> DepthSegmentsConfig::FromToml(const toml::table& table,
                                                            const std::string& where) {
  DepthSegmentsConfig config;
  std::string noise(DepthNoiseName(config.noise));
  TomlReader reader(table, where);
  reader.Get("noise", noise)
      .Get("noise_scale", config.noise_scale)
      .Get("sigmas", config.sigmas)
      .Get("jump_px", config.jump_px)
      .Get("concave_deg", config.concave_deg)
      .Get("gap_px", config.gap_px)
      .Get("min_share", config.min_share)
      .Get("min_m2", config.min_m2)
      .Get("plane_m2", config.plane_m2);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  const Expected<DepthNoise> named = DepthNoiseFromName(noise);
  if (!named) return UsageError("{}: {}", where, named.error().message);
  config.noise = *named;
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table DepthSegmentsConfig::ToToml() const {
  return toml::table{{"noise", DepthNoiseName(noise)},
                     {"noise_scale", noise_scale},
                     {"sigmas", sigmas},
                     {"jump_px", jump_px},
                     {"concave_deg", concave_deg},
                     {"gap_px", gap_px},
                     {"min_share", min_share},
                     {"min_m2", min_m2},
                     {"plane_m2", plane_m2}};
}

}  // namespace tsdfpp
