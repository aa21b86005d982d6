// How good are the gates themselves? The smallest regression that each is sure to detect, and how
// often it is wrong on fresh seeds (docs/gates.md).
#pragma once

#include <string>
#include <vector>

#include "eval/gate/gate_run.h"

namespace tsdfpp {

struct GateAudit {
  GateOutcome outcome;  // on the gate's own seeds
  Detects detects;
  int trials = 0;  // each with as many fresh seeds as the gate has
  int failed = 0;
  int inconclusive = 0;  // or invalid
};

// Runs the gates of the profile on their own seeds, and again on `fresh` others, counted from
// `first_seed`. A trial takes as many neighbouring fresh seeds as the gate has of its own, the
// first following the last, so there are `fresh` trials. Errors: those of RunGates;
// kUsage where an experiment has no replicates by seed.
Expected<std::vector<GateAudit>> AuditGates(const GatesConfig& config, const References& references,
                                            const GateOptions& options, int fresh,
                                            std::uint64_t first_seed);

// A table in Markdown, a line a gate.
std::string AuditMarkdown(const std::vector<GateAudit>& audits);
nlohmann::json AuditJson(const std::vector<GateAudit>& audits);

}  // namespace tsdfpp
