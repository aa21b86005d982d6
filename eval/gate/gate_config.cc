#include "eval/gate/gate_config.h"

#include <algorithm>

#include "core/files.h"
#include "eval/sweep/sabotage.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

constexpr const char* kProfiles[] = {"quick", "full"};

bool IsPlainName(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_';
  });
}

// Names of gates, controls and experiments are used for files and are each there once.
void ReadName(TomlReader& reader, std::set<std::string>& taken, std::string& name) {
  reader.Get("name", name, true);
  if (!IsPlainName(name)) {
    reader.Fault("name", fmt::format("is '{}', expected letters, digits, - and _", name));
  }
  if (!taken.insert(name).second) {
    reader.Fault("name", fmt::format("is '{}', a second time", name));
  }
}

void ReadWhy(TomlReader& reader, std::string& why) {
  reader.Get("why", why, true);
  if (why.empty()) reader.Fault("why", "is empty, expected the reason for the bounds");
}

void ReadBounds(TomlReader& reader, const toml::table& table, Bounds& bounds) {
  double low = 0;
  double high = 0;
  reader.Get("min", low).Get("max", high);
  if (table.contains("min")) bounds.low = low;
  if (table.contains("max")) bounds.high = high;
  if (bounds.low && bounds.high && low > high) {
    reader.Fault("min",
                 fmt::format("is {}, more than max, which is {}: nothing is both", low, high));
  }
}

// Bounds of numbers that are always within `range`.
void CheckPossible(TomlReader& reader, const Bounds& bounds, const Bounds& range,
                   const std::string& what) {
  const auto impossible = [&](const char* key, double bound) {
    reader.Fault(key,
                 fmt::format("is {}, but {} is {}: it can never hold", bound, what, range.Text()));
  };
  if (bounds.low && range.high && *bounds.low > *range.high) impossible("min", *bounds.low);
  if (bounds.high && range.low && *bounds.high < *range.low) impossible("max", *bounds.high);
  const bool low_bites = bounds.low && !(range.low && *bounds.low <= *range.low);
  const bool high_bites = bounds.high && !(range.high && *bounds.high >= *range.high);
  if (!low_bites && !high_bites) {
    reader.Fault(bounds.low ? "min" : "max",
                 fmt::format("can never be missed: {} is always {}", what, range.Text()));
  }
}

const SweepMetric* ReadMetric(TomlReader& reader, std::string& name) {
  reader.Get("metric", name, true);
  const SweepMetric* metric = FindMetric(name);
  if (metric == nullptr) {
    std::string known;
    for (const SweepMetric& one : SweepMetrics()) known += (known.empty() ? "" : ", ") + one.name;
    reader.Fault("metric", fmt::format("is '{}', expected one of {}", name, known));
  }
  return metric;
}

const GateExperiment* ReadExperiment(TomlReader& reader, const GatesConfig& config,
                                     std::string& name) {
  reader.Get("experiment", name, true);
  const GateExperiment* experiment = config.FindExperiment(name);
  if (experiment == nullptr) {
    std::string known;
    for (const auto& one : config.experiments) known += (known.empty() ? "" : ", ") + one.name;
    reader.Fault("experiment",
                 fmt::format("is '{}', expected one of {}", name,
                             known.empty() ? "[[experiment]], which is missing" : known));
  }
  return experiment;
}

Expected<GateExperiment> ReadGateExperiment(const toml::table& table, const std::string& where,
                                            std::set<std::string>& taken) {
  GateExperiment experiment;
  TomlReader reader(table, where, "experiment");
  ReadName(reader, taken, experiment.name);
  std::string file;
  std::vector<std::string> profiles;
  reader.Get("file", file, true).Get("profiles", profiles, true);
  for (const std::string& profile : profiles) {
    if (std::find(std::begin(kProfiles), std::end(kProfiles), profile) == std::end(kProfiles)) {
      reader.Fault("profiles", fmt::format("holds '{}', expected quick or full", profile));
    }
    experiment.profiles.insert(profile);
  }
  if (profiles.empty()) reader.Fault("profiles", "is empty, expected quick, full or both");
  const std::filesystem::path path = std::filesystem::path(where).parent_path() / file;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    reader.Fault("file", fmt::format("is '{}', but there is no file {}", file, path.string()));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  TSDFPP_ASSIGN(experiment.config, ExperimentConfig::Load(path));
  return experiment;
}

void ReadComparison(TomlReader& reader, const toml::table& table, const SweepMetric& metric,
                    Gate& gate) {
  ReadBounds(reader, table, gate.bounds);
  reader.Get("ratio", gate.ratio).Get("confidence", gate.confidence);
  double tolerance = 0;
  reader.Get("tolerance", tolerance);
  const bool has_tolerance = table.contains("tolerance");
  if (!(gate.confidence > 0 && gate.confidence <= 1)) {
    reader.Fault("confidence", fmt::format("is {}, expected above 0, at most 1", gate.confidence));
  }
  const bool has_bounds = gate.bounds.low || gate.bounds.high;
  const Bounds range = RangeOf(metric);
  if (has_tolerance) {
    gate.kind = Gate::Kind::kReference;
    if (!gate.against.empty()) reader.Fault("tolerance", "and 'against' exclude each other");
    if (has_bounds) reader.Fault("tolerance", "is two-sided: 'min' and 'max' do not go with it");
    if (!(tolerance > 0))
      reader.Fault("tolerance", fmt::format("is {}, expected above 0", tolerance));
    if (!gate.ratio && range.low && range.high && tolerance >= *range.high - *range.low) {
      reader.Fault("tolerance", fmt::format("is {}: it can never be missed, {} is {}", tolerance,
                                            metric.name, range.Text()));
    }
    const double middle = gate.ratio ? 1 : 0;
    gate.bounds = {middle - tolerance, middle + tolerance};
  } else if (!has_bounds) {
    reader.Fault(
        "name",
        fmt::format("is '{}', but there is no bound: expected min, max or tolerance", gate.name));
  } else if (!gate.against.empty()) {
    gate.kind = Gate::Kind::kPaired;
    if (gate.ratio) {
      CheckPossible(reader, gate.bounds, {0, {}}, "a ratio");
    } else if (range.low && range.high) {
      const double most = *range.high - *range.low;
      CheckPossible(reader, gate.bounds, {-most, most}, "a difference of " + metric.name);
    }
  } else {
    if (gate.ratio) reader.Fault("ratio", "goes with 'against' or 'tolerance' only");
    CheckPossible(reader, gate.bounds, range, metric.name);
  }
  if (metric.unit == "ms" && !(gate.kind == Gate::Kind::kPaired && gate.ratio)) {
    reader.Fault("metric", fmt::format("is '{}', a time: expected 'against' and 'ratio = true', as "
                                       "seconds differ from machine to machine",
                                       metric.name));
  }
  if (metric.unit == "MB" && !gate.ratio) {
    reader.Fault("metric", fmt::format("is '{}', a size: expected 'ratio = true' with 'against' or "
                                       "'tolerance'",
                                       metric.name));
  }
}

// Whether frames, map and scoring are the same, the map's settings in whatever words.
bool IsOneCell(const CellSettings& a, const CellSettings& b) {
  for (const Axis& axis : Axes()) {
    if (axis.name == "method") break;  // the others are of the map
    if (axis.get(a) != axis.get(b)) return false;
  }
  if (a.sabotage != b.sabotage) return false;
  // Settings that do not go together have no map, and get their sentence when they are to be run.
  return SettingsJson(a) == SettingsJson(b) ||
         (a.Pipeline() && b.Pipeline() && MapKey(a) == MapKey(b));
}

// Which cells, and are there enough?
void CheckCells(TomlReader& reader, const GateExperiment& experiment, const Gate& gate) {
  const auto ours = ChosenCells(experiment.config, gate.where, {});
  if (!ours) {
    reader.Fault("where", ours.error().message);
    return;
  }
  if (gate.confidence < kEveryOne && ours->size() < 2) {
    reader.Fault("confidence",
                 fmt::format("is {}, but there is one replicate, which has no interval: "
                             "expected 1 or more seeds",
                             gate.confidence));
  }
  if (gate.kind != Gate::Kind::kPaired) return;
  const auto theirs = ChosenCells(experiment.config, gate.where, gate.against);
  if (!theirs) {
    reader.Fault("against", theirs.error().message);
    return;
  }
  for (const auto& [replicate, settings] : *ours) {
    const auto other = theirs->find(replicate);
    if (other == theirs->end()) {
      reader.Fault("against", fmt::format("has no cell for {}", replicate));
    } else if (IsOneCell(settings, other->second)) {
      reader.Fault("against", fmt::format("({}) leaves the gate's own cells, which never differ "
                                          "from themselves: expected others",
                                          ChoiceText(gate.against)));
      return;
    }
  }
}

Expected<AxisChoice> ReadSubChoice(TomlReader& reader, const std::string& key) {
  const toml::table* table = reader.Table(key);
  if (table == nullptr) return AxisChoice{};
  return ReadAxisChoice(*table, reader.where(), reader.PathOf(key));
}

Expected<Gate> ReadGate(const toml::table& table, const std::string& where,
                        const GatesConfig& config, std::set<std::string>& taken) {
  Gate gate;
  TomlReader reader(table, where, "gate");
  ReadName(reader, taken, gate.name);
  const GateExperiment* experiment = ReadExperiment(reader, config, gate.experiment);
  const SweepMetric* metric = ReadMetric(reader, gate.metric);
  TSDFPP_ASSIGN(gate.where, ReadSubChoice(reader, "where"));
  TSDFPP_ASSIGN(gate.against, ReadSubChoice(reader, "against"));
  if (metric != nullptr) ReadComparison(reader, table, *metric, gate);
  if (experiment != nullptr) gate.frames = experiment->config.frames;
  if (metric != nullptr && experiment != nullptr) CheckCells(reader, *experiment, gate);
  ReadWhy(reader, gate.why);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return gate;
}

Expected<GateControl> ReadControl(const toml::table& table, const std::string& where,
                                  const GatesConfig& config, std::set<std::string>& taken) {
  GateControl control;
  TomlReader reader(table, where, "control");
  ReadName(reader, taken, control.name);
  const GateExperiment* experiment = ReadExperiment(reader, config, control.experiment);
  const SweepMetric* metric = ReadMetric(reader, control.metric);
  TSDFPP_ASSIGN(control.where, ReadSubChoice(reader, "where"));
  reader.Get("methods", control.methods, true).Get("spread", control.spread, true);
  ReadBounds(reader, table, control.bounds);
  ReadWhy(reader, control.why);
  if (!(control.spread > 0)) {
    reader.Fault("spread", fmt::format("is {}, expected above 0", control.spread));
  }
  if (control.methods.size() < 2) reader.Fault("methods", "holds fewer than two names");
  if (metric != nullptr && (control.bounds.low || control.bounds.high)) {
    CheckPossible(reader, control.bounds, RangeOf(*metric), metric->name);
  } else if (metric != nullptr) {
    reader.Fault("name",
                 fmt::format("is '{}', but there is neither min nor max: methods that agree "
                             "on something wrong prove nothing",
                             control.name));
  }
  std::set<std::string> methods;
  for (std::string& method : control.methods) {
    CellSettings probe;
    if (auto set = FindAxis("method")->set(probe, method); !set) {
      reader.Fault("methods", set.error().message);
      continue;
    }
    method = probe.method;
    if (!methods.insert(method).second) {
      reader.Fault("methods", fmt::format("holds {} twice, which agrees with itself", method));
    }
    if (experiment == nullptr) continue;
    if (const auto cells =
            ChosenCells(experiment->config, control.where, {{"method", AxisValue(method)}});
        !cells) {
      reader.Fault("methods", cells.error().message);
    }
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return control;
}

Expected<GateSabotage> ReadSabotage(const toml::table& table, const std::string& where,
                                    const GatesConfig& config, std::set<std::string>& taken) {
  GateSabotage sabotage;
  TomlReader reader(table, where, "sabotage");
  ReadName(reader, taken, sabotage.name);
  if (auto known = CheckSabotageName(sabotage.name); !known) {
    reader.Fault("name", known.error().message);
  } else if (sabotage.name == SabotageName(Sabotage::kNone)) {
    reader.Fault("name", "is 'none', which breaks nothing");
  }
  reader.Get("caught_by", sabotage.caught_by, true);
  for (const std::string& gate : sabotage.caught_by) {
    if (config.FindGate(gate) == nullptr) {
      reader.Fault("caught_by", fmt::format("holds '{}', which is no gate of this file", gate));
    }
  }
  if (sabotage.caught_by.empty())
    reader.Fault("caught_by", "is empty, expected the name of a gate");
  reader.Get("why", sabotage.why);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return sabotage;
}

}  // namespace

Bounds RangeOf(const SweepMetric& metric) { return {0, MostOf(metric)}; }

Expected<GatesConfig> GatesConfig::Load(const std::filesystem::path& file) {
  auto text = ReadFile(file, &Limits::text_bytes);
  if (!text) return UsageError("{}", text.error().message);
  return Parse(*text, file);
}

Expected<GatesConfig> GatesConfig::Parse(std::string_view text, const std::filesystem::path& file) {
  const std::string where = file.string();
  TSDFPP_ASSIGN(const toml::table root, ParseToml(text, where));
  GatesConfig config;
  config.file = file;
  config.references = file.parent_path() / (file.stem().string() + "-references.json");
  TomlReader reader(root, where);
  std::set<std::string> experiments;
  std::set<std::string> gates;
  std::set<std::string> sabotages;
  for (const toml::table* table : reader.Tables("experiment", true)) {
    TSDFPP_ASSIGN(GateExperiment experiment, ReadGateExperiment(*table, where, experiments));
    config.experiments.push_back(std::move(experiment));
  }
  for (const toml::table* table : reader.Tables("control")) {
    TSDFPP_ASSIGN(GateControl control, ReadControl(*table, where, config, gates));
    config.controls.push_back(std::move(control));
  }
  for (const toml::table* table : reader.Tables("gate", true)) {
    TSDFPP_ASSIGN(Gate gate, ReadGate(*table, where, config, gates));
    config.gates.push_back(std::move(gate));
  }
  for (const toml::table* table : reader.Tables("sabotage")) {
    TSDFPP_ASSIGN(GateSabotage sabotage, ReadSabotage(*table, where, config, sabotages));
    config.sabotages.push_back(std::move(sabotage));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (config.gates.empty()) return UsageError("{}: holds no [[gate]]", where);
  return config;
}

const GateExperiment* GatesConfig::FindExperiment(std::string_view name) const {
  for (const GateExperiment& experiment : experiments) {
    if (experiment.name == name) return &experiment;
  }
  return nullptr;
}

const Gate* GatesConfig::FindGate(std::string_view name) const {
  for (const Gate& gate : gates) {
    if (gate.name == name) return &gate;
  }
  return nullptr;
}

bool GatesConfig::IsIn(const std::string& experiment, const std::string& profile) const {
  const GateExperiment* found = FindExperiment(experiment);
  return found != nullptr && found->profiles.contains(profile);
}

}  // namespace tsdfpp
