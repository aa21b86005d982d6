// Figures of an earlier run that gates compare with (docs/gates.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/gate/gate_config.h"

namespace tsdfpp {

inline constexpr int kReferencesSchema = 1;

// What made figures.
struct GateEnvironment {
  std::string program;   // ProgramIdentity()
  std::string renderer;  // of SweepPlan
  std::string mujoco;    // version
  std::string machine;   // processor

  // Whether the same program gives the same bytes in both: renderer, MuJoCo and processor are the
  // same. Elsewhere figures are compared by tolerance alone.
  bool SameBytesExpected(const GateEnvironment& other) const;
  bool operator==(const GateEnvironment&) const = default;
};
// The processor's name, as /proc/cpuinfo has it; "unknown" where it does not say.
std::string MachineName();

struct GateReference {
  std::string question;                  // QuestionOf the gate that it was made for
  std::map<std::string, double> values;  // at the examined frame, by replicate ("seed=2;")
  std::map<std::string, std::string> map_digests;         // the same, of the map's bytes
  std::map<std::string, std::map<int, double>> by_frame;  // where evaluated
  GateEnvironment environment;
  std::string command;
  std::string reason;
  std::string date;  // UTC
  bool operator==(const GateReference&) const = default;
};

// The mean of its values, of which there is one at least.
double MeanValue(const GateReference& reference);

// What a reference is of: experiment, metric, cells and frames. A reference of another question is
// none.
std::string QuestionOf(const Gate& gate);

using References = std::map<std::string, GateReference>;  // by gate

// Nothing where there is no such file. Errors: kData, in a sentence.
Expected<References> LoadReferences(const std::filesystem::path& file);
// Errors: kEnvironment.
Expected<void> SaveReferences(const References& references, const std::filesystem::path& file);

// A line a value that differs, "gate seed=2; 0.91 -> 0.95 (+0.04)", and a line a gate that has come
// or gone; empty where nothing differs.
std::string ReferencesDifference(const References& before, const References& after);

}  // namespace tsdfpp
