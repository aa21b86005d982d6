#include "eval/sweep/sweep.h"

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/sweep_progress.h"
#include "eval/sweep/sweep_report.h"

namespace tsdfpp {
namespace {

struct SweepArguments {
  std::string experiment;
  std::string out;
  int jobs = 0;
  double scale = 0;
  int stride = 0;
  bool list = false;
};

Expected<ExperimentConfig> LoadExperiment(const SweepArguments& options) {
  TSDFPP_ASSIGN(ExperimentConfig config, ExperimentConfig::Load(options.experiment));
  if (options.scale > 0) config.frames.scale = options.scale;
  if (options.stride > 0) config.frames.stride = options.stride;
  return config;
}

Expected<CommandResult> ListCells(const ExperimentConfig& config) {
  TSDFPP_ASSIGN(const SweepPlan plan, PlanSweep(config));
  CommandResult result{nlohmann::json::array(), ""};
  for (const SweepPlan::Entry& entry : plan.entries) {
    const CellSettings& settings = entry.cell.settings;
    result.json.push_back({{"cell", entry.cell.id},
                           {"sequence", entry.cell.sequence},
                           {"grid", entry.grid},
                           {"settings", SettingsJson(settings)}});
    result.text += fmt::format("{} {} {} seed {} {}\n", entry.cell.id, entry.grid, settings.scene,
                               settings.seed, MapKey(settings));
  }
  result.text +=
      fmt::format("{} entries, {} sequences\n", plan.entries.size(), plan.sequences.size());
  return result;
}

Expected<CommandResult> RunSweepCommand(const SweepArguments& options) {
  TSDFPP_ASSIGN(const ExperimentConfig config, LoadExperiment(options));
  if (options.list) return ListCells(config);
  SweepOptions sweep;
  sweep.out = options.out.empty() ? std::filesystem::path("out") / "experiments" / config.name
                                  : std::filesystem::path(options.out);
  sweep.jobs = JobsOrCores(options.jobs);
  TSDFPP_ASSIGN(const SweepResult made,
                WithSweepBar("sweep", sweep, [&] { return RunSweep(config, sweep); }));
  const std::vector<Condition> conditions = ConditionsOf(made);
  nlohmann::json json = SweepJson(made, conditions);
  json["run_now"] = made.run_now;
  return CommandResult{std::move(json),
                       SweepText(made, conditions) +
                           fmt::format("{}: {} of {} cells were run now, the others were there\n",
                                       sweep.out.string(), made.run_now, made.cells)};
}

}  // namespace

Run AddSweep(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<SweepArguments>();
  app.add_option("EXPERIMENT", options->experiment, "Experiment file (.toml, docs/experiments.md)")
      ->required();
  app.add_option("--out", options->out,
                 "Folder of the results; cells that it has are not run again. By default "
                 "out/experiments/<name>")
      ->check(NotEmpty("a folder"));
  app.add_option("--jobs", options->jobs,
                 "Processes, each with a sequence at a time; one a core by default. The figures do "
                 "not depend on it")
      ->check(WholeBetween(1, 256));
  app.add_option("--scale", options->scale,
                 "Images this many times the scenes' size, in place of "
                 "the experiment's")
      ->check(Between(0.05, 4.0));
  app.add_option("--stride", options->stride, "Every n-th frame, in place of the experiment's")
      ->check(WholeBetween(1, 1000));
  app.add_flag("--list", options->list, "List the cells and run nothing");
  return [options] { return RunSweepCommand(*options); };
}

}  // namespace tsdfpp
