// A frozen benchmark: sequences whose scenes, motions and true surfaces have stated hashes, and the
// settings that every method keeps to, so that the numbers of two papers compare
// (docs/results-schema.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/sweep/sweep.h"

namespace tsdfpp {

inline constexpr int kBenchResultSchema = 1;

struct BenchSequence {
  std::string name;
  std::string scene;  // a file beside the set's own, with everything drawn that was random
  // HashText of SceneToToml, and of the true surfaces and all poses in units of 10 micrometres
  // (which another machine's last bits do not reach).
  std::string scene_hash;
  std::string truth_hash;
};

struct BenchSet {
  std::filesystem::path file;
  std::string name;
  std::string hash;  // HashText of the file: two results of one hash are about the same benchmark
  double scale = 1;
  double voxel_m = 0.01;
  double trunc_front = 10;
  double trunc_back = 3;
  std::vector<std::string> metrics;
  std::vector<BenchSequence> sequences;

  // Reads `folder`/`name`/set.toml. Errors: kUsage, with file, line and key; naming the sets there
  // are where there is none of this name.
  static Expected<BenchSet> Load(const std::filesystem::path& folder, const std::string& name);
};

// The sequence's hashes as they are now, without rendering. Errors: those of scenes.
Expected<BenchSequence> HashSequence(const BenchSet& set, const BenchSequence& sequence);

// Errors: kData, naming the first sequence that is not what was frozen, with both hashes.
Expected<void> CheckFrozen(const BenchSet& set);

// The set as an experiment of these methods.
Expected<ExperimentConfig> ExperimentOf(const BenchSet& set,
                                        const std::vector<std::string>& methods);

// One method's result (docs/results-schema.md), of an experiment that ExperimentOf made.
// `commit` is the method's; hardware is this machine's.
nlohmann::json BenchResultJson(const BenchSet& set, const SweepResult& result,
                               const std::string& method, const std::string& commit);

// A result as a leaderboard reads it.
struct BenchResult {
  std::string file;
  std::string method;
  std::string version;
  std::string commit;
  std::string hardware;
  // By sequence and metric.
  std::map<std::string, std::map<std::string, Measured>> scores;
};

// Errors: kData, in one sentence with file and field: not JSON, another schema, set or hash, a
// sequence or metric that is missing or unknown, a value that is neither a number nor an undefined
// one with its reason.
Expected<BenchResult> ReadBenchResult(const BenchSet& set, const std::filesystem::path& file);

// A page in Markdown: the set, a row a result with the mean over the sequences and its bootstrap
// interval, best first by the set's first metric, and every figure. Errors: those of
// ReadBenchResult for any *.json of `folder`; kUsage where there is none.
Expected<std::string> Leaderboard(const BenchSet& set, const std::filesystem::path& folder);

}  // namespace tsdfpp
