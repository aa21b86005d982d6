// Somebody else's mapper in a comparison: what to run, and how to read what it wrote
// (docs/adapters.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/frame_source.h"
#include "eval/adapters/child_process.h"
#include "eval/score/evaluate_meshes.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

struct AdapterConfig {
  std::string name;                                 // of the method
  std::vector<std::string> command;                 // with words in braces, see docs/adapters.md
  DatasetFormat layout = DatasetFormat::kCofusion;  // of the sequence; or tum, klg, 7scenes
  double time_limit_s = 600;
  double memory_limit_mb = 4000;
  int process_limit = 500;      // at once
  double log_limit_mb = 10;     // kept of what it prints: half the beginning, half the end
  double disk_limit_mb = 8000;  // of its output folder; of any file that it writes
  double scale = 1;             // metres a unit of the meshes
  MatchMode match = MatchMode::kNames;
  std::filesystem::path folder;  // where its file is: {adapter}

  // Errors: kUsage, naming the key.
  Expected<void> Validate() const;
  std::string ToToml() const;
};

// Errors: kUsage, naming file and key: no such file, not TOML, a key that is unknown, missing or
// wrong.
Expected<AdapterConfig> ReadAdapter(const std::filesystem::path& toml);

// "adapters/<name>.toml" beside the running program, the adapters that come with the project.
// Errors: kUsage, naming those there are.
Expected<AdapterConfig> FindAdapter(const std::string& name);
std::vector<std::string> AdapterNames();

// What a mapper may know of an experiment.
struct AdapterTask {
  std::filesystem::path sequence;
  int first_frame = 0;
  int last_frame = 0;
  std::vector<int> frames;       // after which meshes are wanted
  std::set<InstanceId> removed;  // objects to remove from the map
  double voxel_m = 0.01;
  double truncation_m = 0.1;  // in front of the surface
  double truncation_back_m = 0.1;
};

// The command with the words in braces replaced. Errors: kUsage where a word is unknown.
Expected<std::vector<std::string>> CommandOf(const AdapterConfig& config, const AdapterTask& task,
                                             const std::filesystem::path& out);

// One adapter in a comparison.
struct AdapterRun {
  explicit AdapterRun(AdapterConfig adapter) : config(std::move(adapter)) {}

  // It has no scores then, those of earlier frames neither: they would be the easier ones.
  void Fail(Error error) {
    failure = std::move(error);
    evaluations.clear();
    matches.clear();
    trajectories.reset();
  }

  AdapterConfig config;
  std::filesystem::path folder;  // what it wrote: meshes/, trajectories/, timing.json; log.txt
  std::filesystem::path shown;   // what that folder will be called
  ChildOutcome outcome;
  std::optional<Error> failure;  // Fail()'s: the outcome's, or what is wrong with its files
  nlohmann::json timing;         // its own words; null where it wrote none
  LastSeenStores last_seen;
  std::vector<Evaluation> evaluations;
  std::vector<std::vector<PartMatch>> matches;  // an evaluation
  std::vector<std::string> remarks;
  std::optional<TrajectoryEvaluation> trajectories;
};

// Runs it into `out`, which is made anew. A failure of the adapter is the run's, not an error; so
// is anything but files and folders where its meshes, trajectories and times should be. Elsewhere
// in its folder such things (links, pipes, devices, names that cannot be printed) are removed, with
// a remark. `shown` is what `out` will be called, for messages. Errors: kUsage of CommandOf;
// kEnvironment where `out` cannot be made.
Expected<void> RunAdapter(AdapterRun& run, const AdapterTask& task,
                          const std::filesystem::path& out, const std::filesystem::path& shown);

// Scores its meshes at the truth's current frame, unless it failed before; what is wrong with them
// becomes the run's failure.
void EvaluateAdapter(AdapterRun& run, const SceneTruth& truth, const std::vector<ObjectInfo>& names,
                     const AdapterTask& task);

// Writes the frames up to `last` as an adapter gets them: what the sensor gave, without the true
// surfaces. Errors: those of the source and of writing.
Expected<void> WriteForAdapters(FrameSource& source, DatasetFormat layout, int last,
                                const std::filesystem::path& out);

// The text with the folder's name as it will be.
std::string WithShownFolder(const AdapterRun& run, std::string text);

nlohmann::json ToJson(const AdapterRun& run);

}  // namespace tsdfpp
