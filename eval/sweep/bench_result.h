// Results of a frozen benchmark, one a method, and the leaderboard that is made of them
// (docs/results-schema.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "eval/sweep/bench_set.h"

namespace tsdfpp {

inline constexpr int kBenchResultSchema = 1;

// One method's result (docs/results-schema.md), of an experiment that ExperimentOf made.
// `commit` is the method's; hardware is this machine's.
nlohmann::json BenchResultJson(const BenchSet& set, const SweepResult& result,
                               const std::string& method, const std::string& commit);

// Whether the result of a method can be written to `file`. Errors: kUsage where something else is
// there than a result of this method on a benchmark of this name.
Expected<void> CheckPlaceOfResult(const BenchSet& set, const std::string& method,
                                  const std::filesystem::path& file);

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
// interval, best first by the set's first metric, and every figure. Those come first that have that
// metric of more sequences. Errors: those of ReadBenchResult for any *.json of `folder`; kUsage
// where there is none.
Expected<std::string> Leaderboard(const BenchSet& set, const std::filesystem::path& folder);

}  // namespace tsdfpp
