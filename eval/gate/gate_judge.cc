#include "eval/gate/gate_judge.h"

#include <fmt/format.h>

#include "eval/gate/gate_times.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

// Why a gate has no reference to compare with; empty where it has, or needs none.
std::string ReferenceFault(const Gate& gate, const GateReference* reference) {
  if (gate.kind != Gate::Kind::kReference) return "";
  if (reference == nullptr || reference->values.empty()) {
    return "there is no reference: make one with --update --reason TEXT";
  }
  if (reference->question != QuestionOf(gate)) {
    return fmt::format("the reference is of another question ({}): --update it",
                       reference->question);
  }
  return "";
}

// Why the times of a replicate say nothing; empty where they do.
std::string TimesFault(const std::string& replicate, const GatePair& pair) {
  if (pair.theirs == nullptr) return fmt::format("{} has no pair", replicate);
  if (!WereTimedTogether(*pair.ours, *pair.theirs)) {
    return fmt::format("{}: the two were not timed in one run", replicate);
  }
  return "";
}

// What a replicate's value is compared with. Undefined with the reason as a sentence for people.
Measured OtherValue(const Gate& gate, const std::string& replicate, const GatePair& pair,
                    const GateReference* reference) {
  if (gate.kind == Gate::Kind::kReference) {
    const auto stored = reference->values.find(replicate);
    if (stored != reference->values.end()) return Measured::Of(stored->second);
    return Measured::Undefined(
        fmt::format("the reference has no value for {}: --update it", replicate));
  }
  if (pair.theirs == nullptr) return Measured::Undefined(fmt::format("{} has no pair", replicate));
  const Measured& theirs = pair.theirs->examined[MetricIndex(gate.metric)];
  if (theirs.value) return theirs;
  return Measured::Undefined(fmt::format("{} of {} is undefined at {}: {}", gate.metric,
                                         ChoiceText(gate.against), replicate, theirs.why_not));
}

// What the gate's bounds are of: a replicate's value, its difference or its ratio. Undefined as
// OtherValue.
Measured ComparedValue(const Gate& gate, const std::string& replicate, const GatePair& pair,
                       const GateReference* reference) {
  if (gate.metric == kFrameTimeMetric) {
    Measured ratio = TimeRatio(*pair.ours, *pair.theirs);
    if (ratio.value) return ratio;
    return Measured::Undefined(fmt::format("{}: {}", replicate, ratio.why_not));
  }
  const Measured& ours = pair.ours->examined[MetricIndex(gate.metric)];
  if (!ours.value) {
    return Measured::Undefined(
        fmt::format("{} is undefined at {}: {}", gate.metric, replicate, ours.why_not));
  }
  if (gate.kind == Gate::Kind::kAbsolute) return ours;
  Measured other = OtherValue(gate, replicate, pair, reference);
  if (!other.value) return other;
  if (!gate.ratio) return Measured::Of(*ours.value - *other.value);
  if (*other.value > 0) return Measured::Of(*ours.value / *other.value);
  return Measured::Undefined(
      fmt::format("a ratio to {} at {} says nothing", *other.value, replicate));
}

}  // namespace

bool IsOfTimes(const Gate& gate) { return FindMetric(gate.metric)->unit == "ms"; }

GateReference ReferenceOfFreshSeeds(GateReference reference, const GateData& data) {
  if (reference.values.empty()) return reference;  // which is judged as none
  const double mean = MeanValue(reference);
  for (const auto& [replicate, pair] : data) reference.values.try_emplace(replicate, mean);
  return reference;
}

Judgement JudgeGate(const Gate& gate, const GateData& data, const GateReference* reference,
                    const BootstrapConfig& statistics) {
  if (std::string fault = ReferenceFault(gate, reference); !fault.empty()) return Invalid(fault);
  std::vector<double> values;
  int timed = 0;
  for (const auto& [replicate, pair] : data) {
    if (pair.ours == nullptr) return Invalid(fmt::format("{} was not run", replicate));
    if (IsOfTimes(gate)) {
      if (std::string fault = TimesFault(replicate, pair); !fault.empty()) return Invalid(fault);
      timed += static_cast<int>(FrameTimeRatios(*pair.ours, *pair.theirs).size());
    }
    const Measured value = ComparedValue(gate, replicate, pair, reference);
    if (!value.value) return Invalid(value.why_not);
    values.push_back(*value.value);
  }
  Judgement judgement = Judge(values, gate.bounds, gate.confidence, statistics);
  if (IsOfTimes(gate) && timed < kLeastTimedFrames) {
    judgement.verdict = Verdict::kInconclusive;
    judgement.why = fmt::format("{} frames were timed, {} are needed", timed, kLeastTimedFrames);
  }
  return judgement;
}

}  // namespace tsdfpp
