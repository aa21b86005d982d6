#include "eval/gate/gate_verdict.h"

#include <fmt/format.h>

#include <algorithm>

namespace tsdfpp {

std::string_view VerdictName(Verdict verdict) {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kFail:
      return "fail";
    case Verdict::kInconclusive:
      return "inconclusive";
    case Verdict::kInvalid:
      return "invalid";
  }
  std::abort();
}

std::string Bounds::Text() const {
  if (low && high) return fmt::format("from {:.6g} to {:.6g}", *low, *high);
  if (low) return fmt::format("at least {:.6g}", *low);
  if (high) return fmt::format("at most {:.6g}", *high);
  return "anything";
}

Judgement Invalid(std::string why) {
  Judgement judgement;
  judgement.mean = Measured::Undefined(why);
  judgement.interval.why_not = why;
  judgement.why = std::move(why);
  return judgement;
}

Judgement Judge(std::span<const double> values, const Bounds& bounds, double confidence,
                const BootstrapConfig& statistics) {
  if (values.empty()) return Invalid("there are no values");
  Judgement judgement;
  judgement.values.assign(values.begin(), values.end());
  judgement.mean = Measured::Of(MeanOf(values));
  const bool every_one = confidence >= kEveryOne;
  if (every_one) {
    const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
    judgement.interval.value = Interval{*least, *greatest};
  } else {
    BootstrapConfig config = statistics;
    config.confidence = confidence;
    judgement.interval = BootstrapInterval(values, MeanOf, config);
  }
  if (!judgement.interval.value) {
    judgement.why = fmt::format("the mean has no interval: {}", judgement.interval.why_not);
    return judgement;
  }
  const auto [low, high] = *judgement.interval.value;
  const auto outside = [&](double number) { return !bounds.Hold(number); };
  const bool beyond = (bounds.low && high < *bounds.low) || (bounds.high && low > *bounds.high);
  if (!outside(low) && !outside(high)) {
    judgement.verdict = Verdict::kPass;
  } else if (beyond || every_one) {
    judgement.verdict = Verdict::kFail;
    judgement.why = fmt::format("{:.6g} to {:.6g}, expected {}", low, high, bounds.Text());
  } else {
    judgement.verdict = Verdict::kInconclusive;
    judgement.why =
        fmt::format("{:.6g} to {:.6g} straddles a bound, expected {}", low, high, bounds.Text());
  }
  return judgement;
}

Detects SmallestDetected(const Judgement& judgement, const Bounds& bounds, double confidence) {
  Detects detects;
  if (!judgement.interval.value) return detects;
  const auto [low, high] = *judgement.interval.value;
  const bool every_one = confidence >= kEveryOne;
  if (bounds.low) detects.fall = std::max(0.0, (every_one ? low : high) - *bounds.low);
  if (bounds.high) detects.rise = std::max(0.0, *bounds.high - (every_one ? high : low));
  return detects;
}

int ExitCodeOf(std::span<const Verdict> verdicts) {
  if (std::find(verdicts.begin(), verdicts.end(), Verdict::kFail) != verdicts.end()) return 1;
  const bool all = std::all_of(verdicts.begin(), verdicts.end(),
                               [](Verdict verdict) { return verdict == Verdict::kPass; });
  return all && !verdicts.empty() ? 0 : 4;
}

Judgement JudgeAgreement(std::span<const double> values, double spread, const Bounds& bounds) {
  if (values.size() < 2) return Invalid("fewer than two methods have a value");
  Judgement judgement = Judge(values, bounds, kEveryOne, {});
  const auto [least, greatest] = *judgement.interval.value;
  if (judgement.verdict == Verdict::kPass && greatest - least > spread) {
    judgement.verdict = Verdict::kFail;
    judgement.why = fmt::format("the methods differ by {:.6g}, expected at most {:.6g}",
                                greatest - least, spread);
  }
  return judgement;
}

}  // namespace tsdfpp
