#include "eval/gate/gate_run.h"

#include <mujoco/mujoco.h>

#include <algorithm>

#include "core/json_text.h"
#include "eval/gate/gate_times.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

std::string KeyOf(const std::string& experiment, const CellSettings& settings) {
  return experiment + " " + JsonText(SettingsJson(settings));
}

// An experiment of exactly these cells.
ExperimentConfig WithCells(const ExperimentConfig& config, const std::vector<CellSettings>& cells) {
  ExperimentConfig only = config;
  only.grids.clear();
  only.plot.reset();
  const CellSettings defaults;
  for (const CellSettings& settings : cells) {
    ExperimentGrid grid;
    grid.name = std::to_string(only.grids.size() + 1);
    for (const Axis& axis : Axes()) {
      const AxisValue value = axis.get(settings);
      if (value != axis.get(defaults)) grid.values[axis.name] = {value};
    }
    only.grids.push_back(std::move(grid));
  }
  return only;
}

struct PlannedPair {
  CellSettings ours;
  std::optional<CellSettings> theirs;
};

// What is to be run, an experiment.
class Needs {
 public:
  void Add(const std::string& experiment, const CellSettings& settings) {
    if (keys_.insert(KeyOf(experiment, settings)).second) {
      cells_[experiment].push_back(settings);
    }
  }
  // Both were added before.
  void AddTimedTogether(const std::string& experiment, const PlannedPair& pair) {
    together_[experiment].push_back(pair);
  }
  const std::map<std::string, std::vector<CellSettings>>& cells() const { return cells_; }
  const std::vector<PlannedPair>& TimedTogether(const std::string& experiment) const {
    static const std::vector<PlannedPair> none;
    const auto found = together_.find(experiment);
    return found == together_.end() ? none : found->second;
  }

 private:
  std::set<std::string> keys_;
  std::map<std::string, std::vector<PlannedPair>> together_;
  std::map<std::string, std::vector<CellSettings>> cells_;
};

using PlannedGate = std::map<std::string, PlannedPair>;

bool IsOfTimes(const Gate& gate) { return FindMetric(gate.metric)->unit == "ms"; }

PlannedGate PlanGate(const GatesConfig& config, const Gate& gate, Sabotage sabotage,
                     const std::vector<std::uint64_t>& seeds) {
  ExperimentConfig experiment = config.FindExperiment(gate.experiment)->config;
  if (!seeds.empty()) {
    for (ExperimentGrid& grid : experiment.grids) {
      auto& values = grid.values["seed"];
      values.clear();
      for (const std::uint64_t seed : seeds) values.emplace_back(static_cast<double>(seed));
    }
  }
  PlannedGate plan;
  // Both choices were checked with the file.
  const auto ours = ChosenCells(experiment, gate.where, {});
  for (const auto& [replicate, settings] : *ours) {
    plan[replicate].ours = settings;
    plan[replicate].ours.sabotage = sabotage;
  }
  if (gate.kind != Gate::Kind::kPaired) return plan;
  const auto theirs = ChosenCells(experiment, gate.where, gate.against);
  for (const auto& [replicate, settings] : *theirs) {
    if (!plan.contains(replicate)) continue;
    plan[replicate].theirs = settings;
    plan[replicate].theirs->sabotage = sabotage;
  }
  return plan;
}

void AddNeeds(const Gate& gate, const PlannedGate& plan, Needs& needs) {
  for (const auto& [replicate, pair] : plan) {
    needs.Add(gate.experiment, pair.ours);
    if (pair.theirs) needs.Add(gate.experiment, *pair.theirs);
    if (IsOfTimes(gate)) needs.AddTimedTogether(gate.experiment, pair);
  }
}

std::string CompareBytes(const GateData& data, const GateReference& reference,
                         const GateEnvironment& environment) {
  if (!environment.SameBytesExpected(reference.environment)) {
    return "not compared: the reference has another renderer, MuJoCo or processor";
  }
  bool any = false;
  for (const auto& [replicate, pair] : data) {
    const auto stored = reference.map_digests.find(replicate);
    if (stored == reference.map_digests.end()) continue;
    any = true;
    for (const CellFrame& frame : pair.ours->frames) {
      if (frame.examined && frame.map_digest != stored->second) return "differ";
    }
  }
  return any ? "same" : "not compared: no seed of the reference";
}

GateOutcome Decide(const GatesConfig& config, const Gate& gate, const PlannedGate& plan,
                   const GateCells& cells, const References& references,
                   const GateEnvironment& environment) {
  GateOutcome outcome;
  outcome.gate = gate;
  for (const auto& [replicate, pair] : plan) {
    outcome.data[replicate] = {cells.Find(gate.experiment, pair.ours),
                               pair.theirs ? cells.Find(gate.experiment, *pair.theirs) : nullptr};
  }
  const auto found = references.find(gate.name);
  const GateReference* reference = found == references.end() ? nullptr : &found->second;
  outcome.judgement = JudgeGate(gate, outcome.data, reference,
                                config.FindExperiment(gate.experiment)->config.statistics);
  if (gate.kind == Gate::Kind::kReference && reference != nullptr && !reference->values.empty()) {
    double sum = 0;
    for (const auto& [replicate, value] : reference->values) sum += value;
    outcome.reference_mean = sum / static_cast<double>(reference->values.size());
    outcome.bytes = CompareBytes(outcome.data, *reference, environment);
  }
  return outcome;
}

ControlOutcome DecideControl(const GatesConfig& config, const GateControl& control,
                             const GateCells& cells) {
  ControlOutcome outcome{control, Verdict::kPass, 0, ""};
  const std::size_t metric = MetricIndex(control.metric);
  std::map<std::string, std::vector<double>> by_replicate;
  for (const std::string& method : control.methods) {
    const auto chosen = ChosenCells(config.FindExperiment(control.experiment)->config,
                                    control.where, {{"method", AxisValue(method)}});
    for (const auto& [replicate, settings] : *chosen) {
      const CellResult* cell = cells.Find(control.experiment, settings);
      const Measured value =
          cell == nullptr ? Measured::Undefined("was not run") : cell->examined[metric];
      if (!value.value) {
        outcome.verdict = Verdict::kInvalid;
        outcome.why = fmt::format("{} of {} at {} is undefined: {}", control.metric, method,
                                  replicate, value.why_not);
        return outcome;
      }
      by_replicate[replicate].push_back(*value.value);
    }
  }
  for (const auto& [replicate, values] : by_replicate) {
    const Judgement judgement = JudgeAgreement(values, control.spread, control.bounds);
    const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
    outcome.greatest_spread = std::max(outcome.greatest_spread, *greatest - *least);
    if (judgement.verdict == Verdict::kPass || outcome.verdict != Verdict::kPass) continue;
    outcome.verdict = judgement.verdict;
    outcome.why = fmt::format("{} {}: {}", control.metric, replicate, judgement.why);
  }
  return outcome;
}

// Cells that were not timed in one run, such as those of an experiment that got a method later.
// They leave the folder, so that the next run makes them together. Whether there were any.
bool ForgetTimedApart(const std::vector<PlannedPair>& together, const SweepResult& result,
                      const std::filesystem::path& out) {
  const CellStore store(out / "cells");
  const auto entry_of = [&](const CellSettings& settings) {
    return std::find_if(result.entries.begin(), result.entries.end(), [&](const auto& entry) {
      return SettingsJson(entry.cell.settings) == SettingsJson(settings);
    });
  };
  bool any = false;
  for (const PlannedPair& pair : together) {
    const auto ours = entry_of(pair.ours);
    const auto theirs = entry_of(*pair.theirs);
    if (WereTimedTogether(ours->result, theirs->result)) continue;
    any = true;
    for (const auto& entry : {ours, theirs}) {
      std::error_code ignored;
      std::filesystem::remove(store.PathOf(entry->cell.id), ignored);
    }
  }
  return any;
}

Expected<void> RunNeeds(const GatesConfig& config, const Needs& needs, const SweepOptions& options,
                        GateCells& cells, GateEnvironment& environment) {
  for (const auto& [name, settings] : needs.cells()) {
    SweepOptions sweep = options;
    sweep.out = options.out / name;
    sweep.threads = 1;  // Open3D's, so that a ratio of times means the same on any machine
    const ExperimentConfig experiment = WithCells(config.FindExperiment(name)->config, settings);
    TSDFPP_ASSIGN(SweepResult result, RunSweep(experiment, sweep));
    if (ForgetTimedApart(needs.TimedTogether(name), result, sweep.out)) {
      TSDFPP_ASSIGN(result, RunSweep(experiment, sweep));
    }
    environment = {result.program, result.renderer, mj_versionString(), MachineName()};
    for (SweepResult::Entry& entry : result.entries) {
      cells.Add(name, entry.cell.settings, std::move(entry.result));
    }
  }
  return {};
}

}  // namespace

Judgement JudgeGate(const Gate& gate, const GateData& data, const GateReference* reference,
                    const BootstrapConfig& statistics) {
  const std::size_t metric = MetricIndex(gate.metric);
  double reference_mean = 0;
  if (gate.kind == Gate::Kind::kReference) {
    if (reference == nullptr || reference->values.empty()) {
      return Invalid("there is no reference: make one with --update --reason TEXT");
    }
    if (reference->question != QuestionOf(gate)) {
      return Invalid(fmt::format("the reference is of another question ({}): --update it",
                                 reference->question));
    }
    for (const auto& [replicate, value] : reference->values) reference_mean += value;
    reference_mean /= static_cast<double>(reference->values.size());
  }
  std::vector<double> values;
  int timed = 0;
  for (const auto& [replicate, pair] : data) {
    if (pair.ours == nullptr) return Invalid(fmt::format("{} was not run", replicate));
    if (IsOfTimes(gate)) {
      if (pair.theirs == nullptr) return Invalid(fmt::format("{} has no pair", replicate));
      timed += static_cast<int>(FrameTimeRatios(*pair.ours, *pair.theirs).size());
      if (!WereTimedTogether(*pair.ours, *pair.theirs)) {
        return Invalid(fmt::format("{}: the two were not timed in one run", replicate));
      }
      if (gate.metric == kFrameTimeMetric) {
        const Measured ratio = TimeRatio(*pair.ours, *pair.theirs);
        if (!ratio.value) return Invalid(fmt::format("{}: {}", replicate, ratio.why_not));
        values.push_back(*ratio.value);
        continue;
      }
    }
    const Measured& ours = pair.ours->examined[metric];
    if (!ours.value) {
      return Invalid(
          fmt::format("{} is undefined at {}: {}", gate.metric, replicate, ours.why_not));
    }
    if (gate.kind == Gate::Kind::kAbsolute) {
      values.push_back(*ours.value);
      continue;
    }
    double other = 0;
    if (gate.kind == Gate::Kind::kReference) {
      const auto stored = reference->values.find(replicate);
      other = stored == reference->values.end() ? reference_mean : stored->second;
    } else {
      if (pair.theirs == nullptr) return Invalid(fmt::format("{} has no pair", replicate));
      const Measured& theirs = pair.theirs->examined[metric];
      if (!theirs.value) {
        return Invalid(fmt::format("{} of {} is undefined at {}: {}", gate.metric,
                                   ChoiceText(gate.against), replicate, theirs.why_not));
      }
      other = *theirs.value;
    }
    if (gate.ratio && !(other > 0)) {
      return Invalid(fmt::format("a ratio to {} at {} says nothing", other, replicate));
    }
    values.push_back(gate.ratio ? *ours.value / other : *ours.value - other);
  }
  Judgement judgement = Judge(values, gate.bounds, gate.confidence, statistics);
  if (IsOfTimes(gate) && timed < kLeastTimedFrames) {
    judgement.verdict = Verdict::kInconclusive;
    judgement.why = fmt::format("{} frames were timed, {} are needed", timed, kLeastTimedFrames);
  }
  return judgement;
}

void GateCells::Add(const std::string& experiment, const CellSettings& settings,
                    CellResult result) {
  cells_.emplace(KeyOf(experiment, settings), std::move(result));
}

const CellResult* GateCells::Find(const std::string& experiment,
                                  const CellSettings& settings) const {
  const auto found = cells_.find(KeyOf(experiment, settings));
  return found == cells_.end() ? nullptr : &found->second;
}

bool SabotageOutcome::caught() const {
  return !gates.empty() && std::all_of(gates.begin(), gates.end(), [](const GateOutcome& outcome) {
    return outcome.judgement.verdict == Verdict::kFail;
  });
}

bool GateRun::controls_hold() const {
  return std::all_of(controls.begin(), controls.end(), [](const ControlOutcome& control) {
    return control.verdict == Verdict::kPass;
  });
}

int GateRun::exit_code() const {
  std::vector<Verdict> verdicts;
  for (const ControlOutcome& control : controls) {
    verdicts.push_back(control.verdict == Verdict::kPass ? Verdict::kPass : Verdict::kInvalid);
  }
  for (const GateOutcome& gate : gates) verdicts.push_back(gate.judgement.verdict);
  for (const SabotageOutcome& sabotage : sabotages) {
    verdicts.push_back(sabotage.caught() ? Verdict::kPass
                       : controls_hold() ? Verdict::kFail
                                         : Verdict::kInvalid);
  }
  return ExitCodeOf(verdicts);
}

Expected<GateRun> RunGates(const GatesConfig& config, const References& references,
                           const GateOptions& options) {
  GateRun run;
  run.config = config;
  run.options = options;
  struct Planned {
    const Gate* gate;
    PlannedGate cells;
  };
  Needs needs;
  const auto in_profile = [&](const std::string& experiment) {
    return config.IsIn(experiment, options.profile);
  };
  for (const GateControl& control : config.controls) {
    if (!in_profile(control.experiment)) continue;
    for (const std::string& method : control.methods) {
      const auto chosen = ChosenCells(config.FindExperiment(control.experiment)->config,
                                      control.where, {{"method", AxisValue(method)}});
      for (const auto& [replicate, settings] : *chosen) {
        needs.Add(control.experiment, settings);
      }
    }
  }
  std::vector<Planned> planned;
  for (const Gate& gate : config.gates) {
    if (!options.only.empty() ? gate.name != options.only : !in_profile(gate.experiment)) continue;
    planned.push_back({&gate, PlanGate(config, gate, options.sabotage, options.seeds)});
    AddNeeds(gate, planned.back().cells, needs);
  }
  if (planned.empty()) {
    return UsageError("{}: no gate is in profile '{}'", config.file.string(), options.profile);
  }
  std::vector<std::pair<Sabotage, std::vector<Planned>>> suite;
  for (const GateSabotage& sabotage : config.sabotages) {
    if (!options.sabotages) break;
    suite.emplace_back(*SabotageFromName(sabotage.name), std::vector<Planned>{});
    for (const std::string& name : sabotage.caught_by) {
      const Gate* gate = config.FindGate(name);
      if (!in_profile(gate->experiment)) continue;
      suite.back().second.push_back({gate, PlanGate(config, *gate, suite.back().first, {})});
      AddNeeds(*gate, suite.back().second.back().cells, needs);
    }
  }

  auto cells = std::make_shared<GateCells>();
  TSDFPP_RETURN_IF_ERROR(RunNeeds(config, needs, options.sweep, *cells, run.environment));
  run.cells = cells;
  for (const GateControl& control : config.controls) {
    if (in_profile(control.experiment)) {
      run.controls.push_back(DecideControl(config, control, *cells));
    }
  }
  const auto decide = [&](const Planned& gate) {
    GateOutcome outcome =
        Decide(config, *gate.gate, gate.cells, *cells, references, run.environment);
    if (!run.controls_hold()) {
      outcome.judgement.verdict = Verdict::kInvalid;
      outcome.judgement.why = "a control failed";
    }
    return outcome;
  };
  for (const Planned& gate : planned) run.gates.push_back(decide(gate));
  for (const auto& [sabotage, gates] : suite) {
    if (gates.empty()) continue;  // of another profile
    SabotageOutcome outcome;
    outcome.sabotage = sabotage;
    for (const Planned& gate : gates) outcome.gates.push_back(decide(gate));
    run.sabotages.push_back(std::move(outcome));
  }
  return run;
}

References UpdatedReferences(const References& before, const GateRun& run,
                             const std::string& command, const std::string& reason,
                             const std::string& date) {
  References after;
  for (const auto& [name, reference] : before) {
    const Gate* gate = run.config.FindGate(name);
    if (gate != nullptr && gate->kind == Gate::Kind::kReference) after[name] = reference;
  }
  for (const GateOutcome& outcome : run.gates) {
    if (outcome.gate.kind != Gate::Kind::kReference) continue;
    const std::size_t metric = MetricIndex(outcome.gate.metric);
    GateReference reference;
    reference.question = QuestionOf(outcome.gate);
    reference.environment = run.environment;
    reference.command = command;
    reference.reason = reason;
    reference.date = date;
    for (const auto& [replicate, pair] : outcome.data) {
      const Measured& value = pair.ours->examined[metric];
      if (value.value) reference.values[replicate] = *value.value;
      for (const CellFrame& frame : pair.ours->frames) {
        if (frame.examined) reference.map_digests[replicate] = frame.map_digest;
        if (metric >= frame.values.size() || !frame.values[metric].value) continue;
        reference.by_frame[replicate][frame.frame] = *frame.values[metric].value;
      }
    }
    // What is as it was keeps its reason.
    const auto old = before.find(outcome.gate.name);
    if (old != before.end() && old->second.question == reference.question &&
        old->second.values == reference.values &&
        old->second.map_digests == reference.map_digests &&
        old->second.environment.SameBytesExpected(reference.environment)) {
      continue;
    }
    after[outcome.gate.name] = std::move(reference);
  }
  return after;
}

}  // namespace tsdfpp
