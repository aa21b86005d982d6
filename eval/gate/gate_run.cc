#include "eval/gate/gate_run.h"

#include <mujoco/mujoco.h>

#include <algorithm>

#include "core/folders.h"
#include "core/json_text.h"
#include "eval/gate/gate_times.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

std::string KeyOf(const std::string& experiment, const CellSettings& settings) {
  return experiment + " " + JsonText(SettingsJson(settings));
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

using PlannedCells = std::map<std::string, PlannedPair>;  // by replicate

struct PlannedGate {
  const Gate* gate;
  PlannedCells cells;
};

struct PlannedSabotage {
  Sabotage sabotage = Sabotage::kNone;
  std::vector<PlannedGate> gates;  // that are to notice it; none where all are of other profiles
};

struct GatePlan {
  Needs needs;
  std::vector<PlannedGate> gates;
  std::vector<PlannedSabotage> sabotages;
};

// Both choices were checked with the file, but for other seeds, which take the place of one that
// the gate chose, too. Errors: kUsage, naming the gate, where they leave no cells of one kind.
Expected<PlannedCells> CellsOfGate(const GatesConfig& config, const Gate& gate, Sabotage sabotage,
                                   const std::vector<std::uint64_t>& seeds) {
  ExperimentConfig experiment = config.FindExperiment(gate.experiment)->config;
  AxisChoice where = gate.where;
  AxisChoice against = gate.against;
  if (!seeds.empty()) {
    experiment = WithSeeds(std::move(experiment), seeds);
    where.erase("seed");
    against.erase("seed");
  }
  const auto chosen = [&](const AxisChoice& changed) {
    return ChosenCells(experiment, where, changed).map_error([&](const Error& error) {
      return Error{error.kind, fmt::format("{}: gate '{}', with the audit's seeds, {}",
                                           config.file.string(), gate.name, error.message)};
    });
  };
  const auto sabotaged = [&](CellSettings settings) {
    if (sabotage != Sabotage::kNone) settings.sabotage = sabotage;
    return settings;
  };
  PlannedCells plan;
  TSDFPP_ASSIGN(const auto ours, chosen({}));
  for (const auto& [replicate, settings] : ours) plan[replicate].ours = sabotaged(settings);
  if (gate.kind != Gate::Kind::kPaired) return plan;
  TSDFPP_ASSIGN(const auto theirs, chosen(against));
  for (const auto& [replicate, settings] : theirs) {
    if (plan.contains(replicate)) plan[replicate].theirs = sabotaged(settings);
  }
  return plan;
}

// Plans the gate and adds what it needs.
Expected<PlannedGate> PlanGate(const GatesConfig& config, const Gate& gate, Sabotage sabotage,
                               const std::vector<std::uint64_t>& seeds, Needs& needs) {
  TSDFPP_ASSIGN(PlannedCells cells, CellsOfGate(config, gate, sabotage, seeds));
  PlannedGate planned{&gate, std::move(cells)};
  for (const auto& [replicate, pair] : planned.cells) {
    needs.Add(gate.experiment, pair.ours);
    if (pair.theirs) needs.Add(gate.experiment, *pair.theirs);
    if (pair.theirs && IsOfTimes(gate)) needs.AddTimedTogether(gate.experiment, pair);
  }
  return planned;
}

// A method's cells of a control, by replicate; they were checked with the file.
std::map<std::string, CellSettings> CellsOfControl(const GatesConfig& config,
                                                   const GateControl& control,
                                                   const std::string& method) {
  return *ChosenCells(config.FindExperiment(control.experiment)->config, control.where,
                      {{"method", AxisValue(method)}});
}

// The controls, gates and sabotages of the profile. Errors: kUsage, it has no gate; those of
// CellsOfGate.
Expected<GatePlan> PlanRun(const GatesConfig& config, const GateOptions& options) {
  GatePlan plan;
  const auto in_profile = [&](const std::string& experiment) {
    return config.IsIn(experiment, options.profile);
  };
  for (const GateControl& control : config.controls) {
    if (!in_profile(control.experiment)) continue;
    for (const std::string& method : control.methods) {
      for (const auto& [replicate, settings] : CellsOfControl(config, control, method)) {
        plan.needs.Add(control.experiment, settings);
      }
    }
  }
  for (const Gate& gate : config.gates) {
    if (!options.only.empty() ? gate.name != options.only : !in_profile(gate.experiment)) continue;
    TSDFPP_ASSIGN(PlannedGate planned,
                  PlanGate(config, gate, options.sabotage, options.seeds, plan.needs));
    plan.gates.push_back(std::move(planned));
  }
  if (plan.gates.empty()) {
    return UsageError("{}: no gate is in profile '{}'", config.file.string(), options.profile);
  }
  if (!options.sabotages) return plan;
  for (const GateSabotage& sabotage : config.sabotages) {
    PlannedSabotage& planned =
        plan.sabotages.emplace_back(PlannedSabotage{*SabotageFromName(sabotage.name), {}});
    for (const std::string& name : sabotage.caught_by) {
      const Gate* gate = config.FindGate(name);
      if (!in_profile(gate->experiment)) continue;
      TSDFPP_ASSIGN(PlannedGate of_gate, PlanGate(config, *gate, planned.sabotage, {}, plan.needs));
      planned.gates.push_back(std::move(of_gate));
    }
  }
  return plan;
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

GateOutcome Decide(const PlannedGate& planned, const References& references, const GateRun& run) {
  const Gate& gate = *planned.gate;
  GateOutcome outcome;
  outcome.gate = gate;
  for (const auto& [replicate, pair] : planned.cells) {
    outcome.data[replicate] = {
        run.cells->Find(gate.experiment, pair.ours),
        pair.theirs ? run.cells->Find(gate.experiment, *pair.theirs) : nullptr};
  }
  const auto found = references.find(gate.name);
  const GateReference* reference = found == references.end() ? nullptr : &found->second;
  outcome.judgement = JudgeGate(gate, outcome.data, reference,
                                run.config.FindExperiment(gate.experiment)->config.statistics);
  if (gate.kind == Gate::Kind::kReference && reference != nullptr && !reference->values.empty()) {
    outcome.reference_mean = MeanValue(*reference);
    outcome.bytes = CompareBytes(outcome.data, *reference, run.environment);
  }
  if (!run.controls_hold()) {
    outcome.judgement.verdict = Verdict::kInvalid;
    outcome.judgement.why = "a control failed";
  }
  return outcome;
}

ControlOutcome DecideControl(const GatesConfig& config, const GateControl& control,
                             const GateCells& cells) {
  ControlOutcome outcome{control, Verdict::kPass, 0, ""};
  const std::size_t metric = MetricIndex(control.metric);
  std::map<std::string, std::vector<double>> by_replicate;
  for (const std::string& method : control.methods) {
    for (const auto& [replicate, settings] : CellsOfControl(config, control, method)) {
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

// Cells that were not timed in one run, such as those of an experiment that got a method later, and
// all that are to be timed with one of them. They leave the folder, so that the next run makes them
// together. Whether there were any.
bool ForgetTimedApart(const std::vector<PlannedPair>& together, const SweepResult& result,
                      const std::filesystem::path& out) {
  const CellStore store(out / "cells");
  const auto entry_of = [&](const CellSettings& settings) {
    return std::find_if(result.entries.begin(), result.entries.end(), [&](const auto& entry) {
      return SettingsJson(entry.cell.settings) == SettingsJson(settings);
    });
  };
  std::set<std::string> forgotten;
  for (bool goes_on = true; goes_on;) {
    goes_on = false;
    for (const PlannedPair& pair : together) {
      const auto ours = entry_of(pair.ours);
      const auto theirs = entry_of(*pair.theirs);
      const bool stays = !forgotten.contains(ours->cell.id) &&
                         !forgotten.contains(theirs->cell.id) &&
                         WereTimedTogether(ours->result, theirs->result);
      if (stays) continue;
      for (const auto& entry : {ours, theirs}) goes_on |= forgotten.insert(entry->cell.id).second;
    }
  }
  for (const std::string& id : forgotten) {
    std::error_code ignored;
    std::filesystem::remove(store.PathOf(id), ignored);
  }
  return !forgotten.empty();
}

Expected<void> RunNeeds(const GatesConfig& config, const Needs& needs, const SweepOptions& options,
                        GateCells& cells, GateEnvironment& environment) {
  for (const auto& [name, settings] : needs.cells()) {
    SweepOptions sweep = options;
    sweep.out = options.out / name;
    sweep.threads = 1;  // Open3D's, so that a ratio of times means the same on any machine
    const ExperimentConfig experiment = WithCells(config.FindExperiment(name)->config, settings);
    TSDFPP_RETURN_IF_ERROR(CheckWay(options.out, std::filesystem::path(name) / "any"));
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
  TSDFPP_ASSIGN(const GatePlan plan, PlanRun(config, options));
  GateRun run;
  run.config = config;
  run.options = options;
  auto cells = std::make_shared<GateCells>();
  TSDFPP_RETURN_IF_ERROR(RunNeeds(config, plan.needs, options.sweep, *cells, run.environment));
  run.cells = cells;
  for (const GateControl& control : config.controls) {
    if (!config.IsIn(control.experiment, options.profile)) continue;
    run.controls.push_back(DecideControl(config, control, *cells));
  }
  for (const PlannedGate& gate : plan.gates) run.gates.push_back(Decide(gate, references, run));
  for (const PlannedSabotage& planned : plan.sabotages) {
    if (planned.gates.empty()) continue;  // of another profile
    SabotageOutcome outcome;
    outcome.sabotage = planned.sabotage;
    for (const PlannedGate& gate : planned.gates) {
      outcome.gates.push_back(Decide(gate, references, run));
    }
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
