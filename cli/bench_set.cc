#include <fmt/format.h>

#include <algorithm>

#include "cli/command.h"
#include "cli/sweep_progress.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "eval/sweep/bench_result.h"

namespace tsdfpp {
namespace {

struct BenchSetArguments {
  std::string name;
  std::string sets = "eval/bench-sets";
  std::string run;
  std::string out;
  std::string commit = "unknown";
  std::string leaderboard;
  int jobs = 0;
};

Expected<CommandResult> Describe(const BenchSet& set) {
  CommandResult result{{{"bench_set", set.name},
                        {"bench_hash", set.hash},
                        {"scale", set.scale},
                        {"voxel_m", set.voxel_m},
                        {"trunc_front", set.trunc_front},
                        {"trunc_back", set.trunc_back},
                        {"metrics", set.metrics},
                        {"sequences", nlohmann::json::array()}},
                       ""};
  for (const BenchSequence& frozen : set.sequences) {
    TSDFPP_ASSIGN(const BenchSequence now, HashSequence(set, frozen));
    const bool same = now.scene_hash == frozen.scene_hash && now.truth_hash == frozen.truth_hash;
    result.json["sequences"].push_back({{"name", now.name},
                                        {"scene", now.scene},
                                        {"scene_hash", now.scene_hash},
                                        {"truth_hash", now.truth_hash},
                                        {"as_frozen", same}});
    result.text += fmt::format("{:<12} scene {} truth {} {}\n", now.name, now.scene_hash,
                               now.truth_hash, same ? "as frozen" : "NOT as frozen");
  }
  return result;
}

// Where a method's result is written.
std::filesystem::path FileOf(std::string method, const BenchSetArguments& options) {
  std::replace(method.begin(), method.end(), '/', '-');
  return std::filesystem::path(options.out) / (method + ".json");
}

Expected<CommandResult> RunMethods(const BenchSet& set, const BenchSetArguments& options) {
  if (options.out.empty()) return UsageError("--out is required with --run");
  TSDFPP_ASSIGN(const ExperimentConfig config, ExperimentOf(set, SplitList(options.run)));
  const std::vector<AxisValue>& methods = config.grids.front().values.at("method");
  const std::filesystem::path work = "work";
  TSDFPP_RETURN_IF_ERROR(CheckWay(options.out, work / "any"));
  for (const AxisValue& method : methods) {
    const std::string name = AxisText(method);
    TSDFPP_RETURN_IF_ERROR(CheckPlaceOfResult(set, name, FileOf(name, options)));
  }
  TSDFPP_RETURN_IF_ERROR(CheckFrozen(set));
  SweepOptions sweep;
  sweep.out = options.out / work;
  sweep.jobs = JobsOrCores(options.jobs);
  TSDFPP_ASSIGN(const SweepResult made,
                WithSweepBar("bench-set", sweep, [&] { return RunSweep(config, sweep); }));
  CommandResult result{nlohmann::json::array(), ""};
  for (const AxisValue& method : methods) {
    const std::string name = AxisText(method);
    const std::filesystem::path file = FileOf(name, options);
    nlohmann::json json = BenchResultJson(set, made, name, options.commit);
    TSDFPP_RETURN_IF_ERROR(WriteFile(file, JsonText(json, 1) + "\n"));
    result.json.push_back(std::move(json));
    result.text += fmt::format("{}\n", file.string());
  }
  return result;
}

// Errors: kUsage where what is written would change the benchmark, in whose folder nothing ever
// changes.
Expected<void> CheckOutsideOfSet(const BenchSet& set, const BenchSetArguments& options) {
  const std::filesystem::path folder = set.file.parent_path();
  std::vector<std::filesystem::path> places{folder, set.file};
  for (const BenchSequence& sequence : set.sequences) places.push_back(folder / sequence.scene);
  for (const std::filesystem::path& read : places) {
    if (!LiesIn(options.out, read)) continue;
    return UsageError("--out '{}' lies in '{}', which is read, expected another place", options.out,
                      read.string());
  }
  return {};
}

// Errors: kUsage where the page would be one of the results that it is made of, now or when it is
// made again.
Expected<void> CheckPlaceOfPage(const BenchSetArguments& options) {
  const std::filesystem::path out(options.out);
  const std::filesystem::path folder = AbsolutePath(out).parent_path();
  bool is_result = out.extension() == ".json" && TruePath(folder) == TruePath(options.leaderboard);
  for (const std::filesystem::path& entry : EntriesOf(options.leaderboard)) {
    is_result |= entry.extension() == ".json" && LiesIn(out, entry);
  }
  if (!is_result) return {};
  return UsageError("--out '{}' would be one of the results of '{}', expected another place",
                    options.out, options.leaderboard);
}

Expected<CommandResult> RunBenchSet(const BenchSetArguments& options) {
  TSDFPP_ASSIGN(const BenchSet set, BenchSet::Load(options.sets, options.name));
  if (!options.out.empty()) TSDFPP_RETURN_IF_ERROR(CheckOutsideOfSet(set, options));
  if (!options.run.empty()) return RunMethods(set, options);
  if (!options.leaderboard.empty()) {
    if (!options.out.empty()) TSDFPP_RETURN_IF_ERROR(CheckPlaceOfPage(options));
    TSDFPP_ASSIGN(const std::string page, Leaderboard(set, options.leaderboard));
    if (options.out.empty()) return CommandResult{{{"page", page}}, page};
    TSDFPP_RETURN_IF_ERROR(WriteFile(options.out, page));
    return CommandResult{{{"page", options.out}}, fmt::format("{}\n", options.out)};
  }
  if (!options.out.empty()) {
    return UsageError("--out needs --run or --leaderboard: there is nothing to write");
  }
  return Describe(set);
}

}  // namespace

Run AddBenchSet(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<BenchSetArguments>();
  app.add_option("NAME", options->name, "A benchmark, e.g. v1")->required();
  app.add_option("--sets", options->sets, "Folder of the benchmarks")->capture_default_str();
  CLI::Option* run =
      app.add_option("--run", options->run, "Run these methods of ours on it, by commas")
          ->check(NotEmpty("names of methods"));
  app.add_option("--commit", options->commit, "The methods' commit, noted in the results")
      ->capture_default_str()
      ->needs(run);
  app.add_option("--jobs", options->jobs, "Processes; one a core by default")
      ->check(WholeBetween(1, 256))
      ->needs(run);
  app.add_option("--leaderboard", options->leaderboard,
                 "Print the page of all results (*.json) in this folder")
      ->check(NotEmpty("a folder"))
      ->excludes(run);
  app.add_option("--out", options->out,
                 "With --run the folder of the results, with --leaderboard the page's file")
      ->check(NotEmpty("a folder or a file"));
  return [options] { return RunBenchSet(*options); };
}

}  // namespace tsdfpp
