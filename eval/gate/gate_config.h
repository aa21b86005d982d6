// What gates ask, as a TOML file says (docs/gates.md).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "eval/gate/axis_choice.h"
#include "eval/gate/gate_verdict.h"
#include "eval/sweep/experiment.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {

struct GateExperiment {
  std::string name;  // in the gates' file
  std::set<std::string> profiles;
  ExperimentConfig config;
};

struct Gate {
  enum class Kind {
    kAbsolute,   // the values themselves
    kReference,  // minus (or over) the stored ones
    kPaired,     // minus (or over) those of other cells on the same frames
  };
  std::string name;
  std::string experiment;
  FrameChoice frames;  // the experiment's
  std::string metric;
  AxisChoice where;    // the cells of the experiment that it looks at
  AxisChoice against;  // kPaired: what differs in the others
  Kind kind = Kind::kAbsolute;
  bool ratio = false;
  Bounds bounds;  // of the value, the difference or the ratio
  double confidence = 0.95;
  std::string why;  // the bounds are what they are
};

// A fact that must hold for any gate to mean something: these methods agree on each replicate.
struct GateControl {
  std::string name;
  std::string experiment;
  std::string metric;
  AxisChoice where;
  std::vector<std::string> methods;
  double spread = 0;  // greatest minus least
  Bounds bounds;      // of each
  std::string why;
};

// A thing broken on purpose, and the gates that must fail then.
struct GateSabotage {
  std::string name;  // eval/sweep/sabotage.h
  std::vector<std::string> caught_by;
  std::string why;
};

struct GatesConfig {
  std::filesystem::path file;
  std::filesystem::path references;  // beside it
  std::vector<GateExperiment> experiments;
  std::vector<GateControl> controls;
  std::vector<Gate> gates;
  std::vector<GateSabotage> sabotages;

  // Errors: kUsage, one sentence with file, line and key: an unknown key, metric, experiment, axis,
  // method, gate or sabotage, a bound that nothing can meet or miss, cells that are compared with
  // themselves, a name that is there twice, a choice that leaves no cell or cells that differ in
  // more than replicates, a time that is compared with anything but another of the same run.
  static Expected<GatesConfig> Load(const std::filesystem::path& file);
  static Expected<GatesConfig> Parse(std::string_view text, const std::filesystem::path& file);

  // nullptr where there is none of this name.
  const GateExperiment* FindExperiment(std::string_view name) const;
  const Gate* FindGate(std::string_view name) const;
  bool IsIn(const std::string& experiment, const std::string& profile) const;
};

// Numbers that the metric can have.
Bounds RangeOf(const SweepMetric& metric);

}  // namespace tsdfpp
