#include "mapper/track/sdf_track_config.h"

#include <Eigen/Core>
#include <cmath>
#include <utility>

#include "core/setting_order.h"

namespace tsdfpp {
namespace {

Expected<void> InRange(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("tracking setting '{}' is {}, expected {} to {}", field, value, lowest,
                    highest);
}

}  // namespace

Expected<void> SdfTrackConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(InRange("mask_erosion_px", mask_erosion_px, 0, 50));
  TSDFPP_RETURN_IF_ERROR(InRange("max_step_voxels", max_step_voxels, 0.01, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("max_points", max_points, 10, 1000000));
  TSDFPP_RETURN_IF_ERROR(InRange("min_points", min_points, 6, 1000000));
  TSDFPP_RETURN_IF_ERROR(
      CheckOrder("tracking", "min_points", min_points, "max_points", max_points));
  TSDFPP_RETURN_IF_ERROR(InRange("axial_m", axial_m, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("axial_growth", axial_growth, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("lateral_px", lateral_px, 0, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("model_voxels", model_voxels, 0.001, 10));
  TSDFPP_RETURN_IF_ERROR(InRange("max_slope", max_slope, 0, 1e6));
  TSDFPP_RETURN_IF_ERROR(InRange("max_fall", max_fall, 0, 1e6));
  TSDFPP_RETURN_IF_ERROR(InRange("certain_slope", certain_slope, 0, 1e6));
  TSDFPP_RETURN_IF_ERROR(InRange("huber_voxels", huber_voxels, 0.001, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("huber_deviations", huber_deviations, 0.1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("coarse_points", coarse_points, 10, 1000000));
  TSDFPP_RETURN_IF_ERROR(InRange("middle_points", middle_points, 10, 1000000));
  TSDFPP_RETURN_IF_ERROR(InRange("max_iterations", max_iterations, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("settled_voxels", settled_voxels, 1e-6, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("weak_share", weak_share, 0, 0.1));
  TSDFPP_RETURN_IF_ERROR(InRange("keyframe_turn_rad", keyframe_turn_rad, 0, EIGEN_PI));
  TSDFPP_RETURN_IF_ERROR(InRange("anchor_turn_rad", anchor_turn_rad, 0, EIGEN_PI));
  TSDFPP_RETURN_IF_ERROR(InRange("rest_turn_rad", rest_turn_rad, 0, EIGEN_PI));
  TSDFPP_RETURN_IF_ERROR(InRange("keyframe_points", keyframe_points, 10, 1000000));
  TSDFPP_RETURN_IF_ERROR(InRange("free_space_weight", free_space_weight, 0, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("outline_weight", outline_weight, 0, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("colour_weight", colour_weight, 0, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("colour_points", colour_points, 20, 1000000));
  for (const auto& [field, weight] :
       {std::pair{"outline_weight", outline_weight}, std::pair{"colour_weight", colour_weight}}) {
    if (weight == 0 || keyframe_turn_rad > 0) continue;
    return UsageError(
        "tracking setting '{}' is {}, and there is no keyframe to compare with: expected "
        "keyframe_turn_rad above 0",
        field, weight);
  }
  TSDFPP_RETURN_IF_ERROR(InRange("inlier_voxels", inlier_voxels, 0.01, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("min_inlier_share", min_inlier_share, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("min_observed_share", min_observed_share, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("max_translation_voxels", max_translation_voxels, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("max_rotation_rad", max_rotation_rad, 0, EIGEN_PI));
  TSDFPP_RETURN_IF_ERROR(InRange("min_shown_share", min_shown_share, 0, 1));
  TSDFPP_RETURN_IF_ERROR(
      InRange("max_hidden_deviation_voxels", max_hidden_deviation_voxels, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("return_frames", return_frames, 0, 10000));
  TSDFPP_RETURN_IF_ERROR(InRange("rest_voxels", rest_voxels, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("rest_evidence", rest_evidence, 0, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("rest_frames", rest_frames, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("rest_trend", rest_trend, 0, 1e6));
  if (rest_trend > 0 && rest_frames < 2) {
    return UsageError(
        "tracking setting 'rest_trend' is {}, and {} frames have no trend: expected rest_frames of "
        "at least 2",
        rest_trend, rest_frames);
  }
  TSDFPP_RETURN_IF_ERROR(InRange("motion_voxels", motion_voxels, 0.1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("motion_frames", motion_frames, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("motion_evidence", motion_evidence, 0, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("motion_evidence_sum", motion_evidence_sum, 0, 100000));
  TSDFPP_RETURN_IF_ERROR(InRange("motion_points", motion_points, 1, 1000000));
  return {};
}

Expected<SdfTrackConfig> SdfTrackConfig::FromToml(const toml::table& table,
                                                  const std::string& where) {
  SdfTrackConfig config;
  TomlReader reader(table, where);
  reader.Get("mask_erosion_px", config.mask_erosion_px)
      .Get("max_step_voxels", config.max_step_voxels)
      .Get("max_points", config.max_points)
      .Get("min_points", config.min_points)
      .Get("axial_m", config.axial_m)
      .Get("axial_growth", config.axial_growth)
      .Get("lateral_px", config.lateral_px)
      .Get("model_voxels", config.model_voxels)
      .Get("curved", config.curved)
      .Get("max_slope", config.max_slope)
      .Get("max_fall", config.max_fall)
      .Get("certain_slope", config.certain_slope)
      .Get("huber_voxels", config.huber_voxels)
      .Get("huber_deviations", config.huber_deviations)
      .Get("coarse_points", config.coarse_points)
      .Get("middle_points", config.middle_points)
      .Get("max_iterations", config.max_iterations)
      .Get("settled_voxels", config.settled_voxels)
      .Get("weak_share", config.weak_share)
      .Get("keyframe_turn_rad", config.keyframe_turn_rad)
      .Get("keyframe_points", config.keyframe_points)
      .Get("anchor_turn_rad", config.anchor_turn_rad)
      .Get("rest_turn_rad", config.rest_turn_rad)
      .Get("free_space_weight", config.free_space_weight)
      .Get("outline_weight", config.outline_weight)
      .Get("colour_weight", config.colour_weight)
      .Get("colour_points", config.colour_points)
      .Get("inlier_voxels", config.inlier_voxels)
      .Get("min_inlier_share", config.min_inlier_share)
      .Get("min_observed_share", config.min_observed_share)
      .Get("max_translation_voxels", config.max_translation_voxels)
      .Get("max_rotation_rad", config.max_rotation_rad)
      .Get("min_shown_share", config.min_shown_share)
      .Get("max_hidden_deviation_voxels", config.max_hidden_deviation_voxels)
      .Get("return_frames", config.return_frames)
      .Get("rest_voxels", config.rest_voxels)
      .Get("rest_evidence", config.rest_evidence)
      .Get("rest_frames", config.rest_frames)
      .Get("rest_trend", config.rest_trend)
      .Get("motion_voxels", config.motion_voxels)
      .Get("motion_frames", config.motion_frames)
      .Get("motion_evidence", config.motion_evidence)
      .Get("motion_evidence_sum", config.motion_evidence_sum)
      .Get("motion_points", config.motion_points);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table SdfTrackConfig::ToToml() const {
  return toml::table{{"mask_erosion_px", mask_erosion_px},
                     {"max_step_voxels", max_step_voxels},
                     {"max_points", max_points},
                     {"min_points", min_points},
                     {"axial_m", axial_m},
                     {"axial_growth", axial_growth},
                     {"lateral_px", lateral_px},
                     {"model_voxels", model_voxels},
                     {"curved", curved},
                     {"max_slope", max_slope},
                     {"max_fall", max_fall},
                     {"certain_slope", certain_slope},
                     {"huber_voxels", huber_voxels},
                     {"huber_deviations", huber_deviations},
                     {"coarse_points", coarse_points},
                     {"middle_points", middle_points},
                     {"max_iterations", max_iterations},
                     {"settled_voxels", settled_voxels},
                     {"weak_share", weak_share},
                     {"keyframe_turn_rad", keyframe_turn_rad},
                     {"keyframe_points", keyframe_points},
                     {"anchor_turn_rad", anchor_turn_rad},
                     {"rest_turn_rad", rest_turn_rad},
                     {"free_space_weight", free_space_weight},
                     {"outline_weight", outline_weight},
                     {"colour_weight", colour_weight},
                     {"colour_points", colour_points},
                     {"inlier_voxels", inlier_voxels},
                     {"min_inlier_share", min_inlier_share},
                     {"min_observed_share", min_observed_share},
                     {"max_translation_voxels", max_translation_voxels},
                     {"max_rotation_rad", max_rotation_rad},
                     {"min_shown_share", min_shown_share},
                     {"max_hidden_deviation_voxels", max_hidden_deviation_voxels},
                     {"return_frames", return_frames},
                     {"rest_voxels", rest_voxels},
                     {"rest_evidence", rest_evidence},
                     {"rest_frames", rest_frames},
                     {"rest_trend", rest_trend},
                     {"motion_voxels", motion_voxels},
                     {"motion_frames", motion_frames},
                     {"motion_evidence", motion_evidence},
                     {"motion_evidence_sum", motion_evidence_sum},
                     {"motion_points", motion_points}};
}

}  // namespace tsdfpp
