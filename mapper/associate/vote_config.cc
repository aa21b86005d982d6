#include "mapper/associate/vote_config.h"

#include <cmath>

#include "core/setting_order.h"

namespace tsdfpp {
namespace {

Expected<void> CheckVote(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("association setting '{}' is {}, expected {} to {}", field, value, lowest,
                    highest);
}

}  // namespace

Expected<void> VoteConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(CheckVote("at_voxels", at_voxels, 0.5, 100));
  TSDFPP_RETURN_IF_ERROR(CheckVote("min_share", min_share, 0.01, 1));
  TSDFPP_RETURN_IF_ERROR(CheckVote("cut_share", cut_share, 0.01, 1));
  TSDFPP_RETURN_IF_ERROR(CheckVote("near_voxels", near_voxels, 0.5, 100));
  TSDFPP_RETURN_IF_ERROR(
      CheckOrder("association", "at_voxels", at_voxels, "near_voxels", near_voxels));
  TSDFPP_RETURN_IF_ERROR(CheckVote("near_share", near_share, 0.01, 1));
  TSDFPP_RETURN_IF_ERROR(CheckVote("recent_frames", recent_frames, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckVote("max_points", max_points, 1, 1'000'000));
  TSDFPP_RETURN_IF_ERROR(CheckVote("min_points", min_points, 1, 1'000'000));
  TSDFPP_RETURN_IF_ERROR(
      CheckOrder("association", "min_points", min_points, "max_points", max_points));
  TSDFPP_RETURN_IF_ERROR(CheckVote("confirm_frames", confirm_frames, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckVote("confirm_window", confirm_window, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckOrder("association", "confirm_frames", confirm_frames,
                                    "confirm_window", confirm_window));
  TSDFPP_RETURN_IF_ERROR(CheckVote("hold_frames", hold_frames, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckVote("far_share", far_share, -1, 100));
  return {};
}

Expected<VoteConfig> VoteConfig::FromToml(const toml::table& table, const std::string& where) {
  VoteConfig config;
  TomlReader reader(table, where);
  reader.Get("at_voxels", config.at_voxels)
      .Get("min_share", config.min_share)
      .Get("cut_share", config.cut_share)
      .Get("near_voxels", config.near_voxels)
      .Get("near_share", config.near_share)
      .Get("recent_frames", config.recent_frames)
      .Get("max_points", config.max_points)
      .Get("min_points", config.min_points)
      .Get("confirm_frames", config.confirm_frames)
      .Get("confirm_window", config.confirm_window)
      .Get("hold_frames", config.hold_frames)
      .Get("far_share", config.far_share);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table VoteConfig::ToToml() const {
  return toml::table{{"at_voxels", at_voxels},           {"min_share", min_share},
                     {"cut_share", cut_share},           {"near_voxels", near_voxels},
                     {"near_share", near_share},         {"recent_frames", recent_frames},
                     {"max_points", max_points},         {"min_points", min_points},
                     {"confirm_frames", confirm_frames}, {"confirm_window", confirm_window},
                     {"hold_frames", hold_frames},       {"far_share", far_share}};
}

}  // namespace tsdfpp
