#include "eval/gate/gate_audit.h"

#include <algorithm>

#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

// The seeds of the gate's own cells.
std::set<std::uint64_t> OwnSeeds(const GatesConfig& config, const Gate& gate) {
  std::set<std::uint64_t> seeds;
  const auto cells = ChosenCells(config.FindExperiment(gate.experiment)->config, gate.where, {});
  for (const auto& [replicate, settings] : *cells) {
    seeds.insert(settings.seed);
  }
  return seeds;
}

GateData OfSeeds(const GateData& data, const std::set<std::uint64_t>& seeds) {
  GateData chosen;
  for (const auto& [replicate, pair] : data) {
    for (const std::uint64_t seed : seeds) {
      if ((";" + replicate).find(fmt::format(";seed={};", seed)) != std::string::npos) {
        chosen.emplace(replicate, pair);
      }
    }
  }
  return chosen;
}

// Fresh seeds are no others than the replicates that a gate tells apart. Errors: kUsage.
Expected<void> CheckSeedsAreReplicates(const GatesConfig& config, const std::string& profile) {
  for (const Gate& gate : config.gates) {
    if (!config.IsIn(gate.experiment, profile)) continue;
    const auto& axes = config.FindExperiment(gate.experiment)->config.replicates;
    if (std::find(axes.begin(), axes.end(), "seed") != axes.end()) continue;
    return UsageError(
        "{}: gate '{}' cannot be audited on other seeds: expected 'seed' among the replicates of "
        "experiment '{}'",
        config.file.string(), gate.name, gate.experiment);
  }
  return {};
}

std::string Number(const std::optional<double>& number, const Gate& gate) {
  if (!number) return "-";
  const std::string unit = gate.ratio ? "" : FindMetric(gate.metric)->unit;
  return fmt::format("{:.3g}{}{}", *number, unit.empty() ? "" : " ", unit);
}

}  // namespace

Expected<std::vector<GateAudit>> AuditGates(const GatesConfig& config, const References& references,
                                            const GateOptions& options, int fresh,
                                            std::uint64_t first_seed) {
  TSDFPP_RETURN_IF_ERROR(CheckSeedsAreReplicates(config, options.profile));
  TSDFPP_ASSIGN(const GateRun own, RunGates(config, references, options));
  GateOptions other = options;
  for (int i = 0; i < fresh; ++i) {
    other.seeds.push_back(first_seed + static_cast<std::uint64_t>(i));
  }
  TSDFPP_ASSIGN(const GateRun again, RunGates(config, references, other));
  std::vector<GateAudit> audits;
  for (std::size_t g = 0; g < own.gates.size(); ++g) {
    const Gate& gate = own.gates[g].gate;
    GateAudit audit;
    audit.outcome = own.gates[g];
    audit.outcome.data.clear();  // points into the run
    audit.detects = SmallestDetected(audit.outcome.judgement, gate.bounds, gate.confidence);
    const std::size_t count = OwnSeeds(config, gate).size();
    const auto found = references.find(gate.name);
    for (std::size_t trial = 0; trial < other.seeds.size(); ++trial) {
      std::set<std::uint64_t> seeds;
      for (std::size_t k = 0; k < count; ++k) {
        seeds.insert(other.seeds[(trial + k) % other.seeds.size()]);
      }
      const GateData data = OfSeeds(again.gates[g].data, seeds);
      const auto reference = found == references.end()
                                 ? std::nullopt
                                 : std::optional(ReferenceOfFreshSeeds(found->second, data));
      const Judgement judgement =
          JudgeGate(gate, data, reference ? &*reference : nullptr,
                    config.FindExperiment(gate.experiment)->config.statistics);
      ++audit.trials;
      if (judgement.verdict == Verdict::kFail) {
        ++audit.failed;
      } else if (judgement.verdict != Verdict::kPass) {
        ++audit.inconclusive;
      }
    }
    audits.push_back(std::move(audit));
  }
  return audits;
}

std::string AuditMarkdown(const std::vector<GateAudit>& audits) {
  std::string text =
      "| gate | metric | now | bounds | detects a fall of | a rise of | fails on fresh seeds | "
      "inconclusive |\n|---|---|---|---|---|---|---|---|\n";
  for (const GateAudit& audit : audits) {
    const Gate& gate = audit.outcome.gate;
    const Measured& mean = audit.outcome.judgement.mean;
    text += fmt::format("| {} | {} | {} | {} | {} | {} | {} of {} | {} of {} |\n", gate.name,
                        gate.metric, mean.value ? fmt::format("{:.4g}", *mean.value) : "-",
                        gate.bounds.Text(), Number(audit.detects.fall, gate),
                        Number(audit.detects.rise, gate), audit.failed, audit.trials,
                        audit.inconclusive, audit.trials);
  }
  return text;
}

nlohmann::json AuditJson(const std::vector<GateAudit>& audits) {
  nlohmann::json json = nlohmann::json::array();
  for (const GateAudit& audit : audits) {
    const auto number = [](const std::optional<double>& value) {
      return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
    };
    json.push_back({{"gate", audit.outcome.gate.name},
                    {"detects_fall_of", number(audit.detects.fall)},
                    {"detects_rise_of", number(audit.detects.rise)},
                    {"trials", audit.trials},
                    {"failed", audit.failed},
                    {"inconclusive", audit.inconclusive}});
  }
  return json;
}

}  // namespace tsdfpp
