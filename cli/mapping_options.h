// What `tsdfpp map` and `compare` may be told of votes, of tracking and of the repair of masks.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// --vote-config, a file's name.
void AddVoteOption(CLI::App& app, std::string& file);
// Nothing where there is no file. Errors: those of the file.
Expected<std::optional<VoteConfig>> ReadVotes(const std::string& file);
// Errors: kUsage where there are settings of votes, and no votes.
Expected<void> CheckVotes(const std::optional<VoteConfig>& votes, AssociationMode mode);

struct TrackingOptions {
  std::string track = "auto";
  std::string config;

  std::string Text() const;  // " --track all" and so on, as typed; empty where nothing was
};

// Of poses that are tracked.
struct TrackWishes {
  TrackChoice tracked = TrackChoice::kAuto;
  std::optional<SdfTrackConfig> config;
};

// --track and --track-config.
void AddTrackingOptions(CLI::App& app, TrackingOptions& options);
// Errors: kUsage; those of the file.
Expected<TrackWishes> ReadTracking(const TrackingOptions& options);
// Errors: kUsage where none of the poses and no camera is tracked by what is wished.
Expected<void> CheckTracking(const TrackWishes& wishes, const std::vector<PoseSource>& poses,
                             CameraSource camera);

struct RepairOptions {
  std::string mode = "off";
  std::string config;

  std::string Text() const;
};

// Of masks that are repaired.
struct RepairWishes {
  MaskRepairMode mode = MaskRepairMode::kOff;
  MaskRepairConfig config{};
};

// --mask-repair and --mask-repair-config.
void AddRepairOptions(CLI::App& app, RepairOptions& options);
// Errors: kUsage where there are settings and no repair; those of the file.
Expected<RepairWishes> ReadRepair(const RepairOptions& options);

}  // namespace tsdfpp
