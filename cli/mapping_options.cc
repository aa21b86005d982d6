#include "cli/mapping_options.h"

#include <algorithm>

#include "cli/command.h"
#include "core/toml_reader.h"

namespace tsdfpp {

void AddVoteOption(CLI::App& app, std::string& file) {
  app.add_option("--vote-config", file,
                 "Settings of --associate votes, a TOML file (mapper/associate/vote_config.h)")
      ->check(NotEmpty("a file"));
}

Expected<std::optional<VoteConfig>> ReadVotes(const std::string& file) {
  if (file.empty()) return std::nullopt;
  TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(file));
  return VoteConfig::FromToml(table, file);
}

Expected<void> CheckVotes(const std::optional<VoteConfig>& votes, AssociationMode mode) {
  if (!votes || mode == AssociationMode::kVotes) return {};
  return UsageError("--vote-config needs votes, and the objects' ids are given");
}

std::string TrackingOptions::Text() const {
  std::string text;
  if (track != TrackChoiceName(TrackChoice::kAuto)) text += " --track " + track;
  if (!config.empty()) text += " --track-config " + config;
  return text;
}

void AddTrackingOptions(CLI::App& app, TrackingOptions& options) {
  app.add_option(
         "--track", options.track,
         "Which objects are tracked: classified (those with a class), all (whatever is not "
         "background), moving (the same, once it is seen to move), auto (moving with "
         "--segmentation depth --poses track; else classified where a class is known, else all)")
      ->check(OneOf({"auto", "classified", "all", "moving"}))
      ->capture_default_str();
  app.add_option("--track-config", options.config,
                 "Settings of --poses track and --camera, a TOML file (docs/tracking.md)")
      ->check(NotEmpty("a file"));
}

Expected<TrackWishes> ReadTracking(const TrackingOptions& options) {
  TrackWishes wishes;
  TSDFPP_ASSIGN(wishes.tracked, TrackChoiceFromName(options.track));
  if (options.config.empty()) return wishes;
  TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.config));
  TSDFPP_ASSIGN(wishes.config, SdfTrackConfig::FromToml(table, options.config));
  return wishes;
}

Expected<void> CheckTracking(const TrackWishes& wishes, const std::vector<PoseSource>& poses,
                             CameraSource camera) {
  const auto are = [&](PoseSource source) {
    return std::find(poses.begin(), poses.end(), source) != poses.end();
  };
  if (wishes.tracked != TrackChoice::kAuto && !are(PoseSource::kIcp) && !are(PoseSource::kTrack)) {
    return UsageError("--track {} needs --poses {}: given poses are not tracked",
                      TrackChoiceName(wishes.tracked),
                      wishes.tracked == TrackChoice::kMoving ? "track" : "icp or track");
  }
  if (wishes.config && !are(PoseSource::kTrack) && camera == CameraSource::kGiven) {
    return UsageError("--track-config needs --poses track, or --camera refine or track");
  }
  return {};
}

std::string RepairOptions::Text() const {
  std::string text;
  if (mode != MaskRepairModeName(MaskRepairMode::kOff)) text += " --mask-repair " + mode;
  if (!config.empty()) text += " --mask-repair-config " + config;
  return text;
}

void AddRepairOptions(CLI::App& app, RepairOptions& options) {
  app.add_option("--mask-repair", options.mode,
                 "Whether the map's surfaces and steps in depth correct masks before they are "
                 "mapped: off or on (docs/segmentation.md); of compare, for our maps")
      ->check(OneOf({"off", "on"}))
      ->capture_default_str();
  app.add_option("--mask-repair-config", options.config,
                 "Settings of --mask-repair on, a TOML file (docs/segmentation.md)")
      ->check(NotEmpty("a file"));
}

Expected<RepairWishes> ReadRepair(const RepairOptions& options) {
  RepairWishes wishes;
  TSDFPP_ASSIGN(wishes.mode, MaskRepairModeFromName(options.mode));
  if (options.config.empty()) return wishes;
  if (wishes.mode == MaskRepairMode::kOff) {
    return UsageError("--mask-repair-config needs --mask-repair on");
  }
  TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.config));
  TSDFPP_ASSIGN(wishes.config, MaskRepairConfig::FromToml(table, options.config));
  return wishes;
}

}  // namespace tsdfpp
