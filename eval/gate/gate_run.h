// Runs the experiments behind gates and decides (docs/gates.md).
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "eval/gate/gate_config.h"
#include "eval/gate/gate_judge.h"
#include "eval/gate/gate_reference.h"
#include "eval/sweep/sabotage.h"
#include "eval/sweep/sweep.h"

namespace tsdfpp {

// By experiment and settings.
class GateCells {
 public:
  void Add(const std::string& experiment, const CellSettings& settings, CellResult result);
  // nullptr where it was not run.
  const CellResult* Find(const std::string& experiment, const CellSettings& settings) const;

 private:
  std::map<std::string, CellResult> cells_;
};

struct GateOutcome {
  Gate gate;
  Judgement judgement;
  GateData data;
  std::string bytes;  // of the map, against the reference: "same", "differ" or why not compared
  std::optional<double> reference_mean;
  bool passed() const { return judgement.verdict == Verdict::kPass; }
};

struct ControlOutcome {
  GateControl control;
  Verdict verdict = Verdict::kInvalid;
  double greatest_spread = 0;  // over the replicates
  std::string why;
};

struct SabotageOutcome {
  Sabotage sabotage = Sabotage::kNone;
  std::vector<GateOutcome> gates;  // that are to fail
  bool caught() const;             // all of them do
};

struct GateOptions {
  std::string profile = "quick";
  std::string only;                     // a gate's name; empty: all of the profile
  Sabotage sabotage = Sabotage::kNone;  // in all but the controls
  bool sabotages = false;               // run the suite as well
  std::vector<std::uint64_t> seeds;     // in place of the experiments' own, where not empty
  SweepOptions sweep;                   // `out` gets a folder an experiment
};

struct GateRun {
  GatesConfig config;
  GateOptions options;
  GateEnvironment environment;
  std::vector<ControlOutcome> controls;
  std::vector<GateOutcome> gates;
  std::vector<SabotageOutcome> sabotages;
  // What the outcomes point into.
  std::shared_ptr<const GateCells> cells;

  bool controls_hold() const;
  // 0, 1 or 4; a sabotage that is not caught counts as a failed gate.
  int exit_code() const;
};

// Runs what is not yet below `options.sweep.out`. Call it while the process has one thread. Errors:
// those of RunSweep; kUsage where the profile has no gate.
Expected<GateRun> RunGates(const GatesConfig& config, const References& references,
                           const GateOptions& options);

// The references that the run's gates would have; those of other gates of the file stay as they
// are, those of gates that the file has no more go.
References UpdatedReferences(const References& before, const GateRun& run,
                             const std::string& command, const std::string& reason,
                             const std::string& date);

}  // namespace tsdfpp
