// A frozen benchmark: sequences whose scenes, motions and true surfaces have stated hashes, and the
// settings that every method keeps to, so that the numbers of two papers compare
// (docs/results-schema.md).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "eval/sweep/sweep.h"

namespace tsdfpp {

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

  // Reads `folder`/`name`/set.toml. Errors: kUsage, with file, line and key, also where a value is
  // out of its axis's range, a metric or a sequence is there twice, or the name is not the
  // folder's; naming the sets there are where there is none of this name.
  static Expected<BenchSet> Load(const std::filesystem::path& folder, const std::string& name);
};

// The sequence's hashes as they are now, without rendering. Errors: those of scenes.
Expected<BenchSequence> HashSequence(const BenchSet& set, const BenchSequence& sequence);

// Errors: kData, naming the first sequence that is not what was frozen, with both hashes.
Expected<void> CheckFrozen(const BenchSet& set);

// The set as an experiment of these methods of ours, each scene with its own seed. Errors: kUsage,
// a method that is none of them or, in whatever words, there twice; those of scenes.
Expected<ExperimentConfig> ExperimentOf(const BenchSet& set,
                                        const std::vector<std::string>& methods);

}  // namespace tsdfpp
