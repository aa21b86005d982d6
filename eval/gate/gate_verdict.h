// When does a gate hold? Pure decisions on numbers (docs/gates.md).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "metrics/measured.h"
#include "metrics/statistics.h"

namespace tsdfpp {

enum class Verdict {
  kPass,
  kFail,
  kInconclusive,  // the interval straddles a bound
  kInvalid,       // a control failed, or data is missing: nothing can be said
};
// "pass", "fail", "inconclusive", "invalid".
std::string_view VerdictName(Verdict verdict);

// What a number must be: at least `low`, at most `high`; either may be absent.
struct Bounds {
  std::optional<double> low;
  std::optional<double> high;

  bool Hold(double number) const { return !(low && number < *low) && !(high && number > *high); }
  // "at least 0.9", "from -0.1 to 0.1".
  std::string Text() const;
  bool operator==(const Bounds&) const = default;
};

// How sure a gate must be: with this confidence that the mean over the replicates is within the
// bounds; kEveryOne asks it of every replicate and of no mean.
inline constexpr double kEveryOne = 1;

struct Judgement {
  Verdict verdict = Verdict::kInvalid;
  std::vector<double> values;  // a replicate each
  Measured mean;
  // Where the mean is, with the confidence asked for; with kEveryOne the least and greatest value.
  MeasuredInterval interval;
  std::string why;  // a clause, where it is no pass
};

Judgement Invalid(std::string why);

// Pass where the interval is within the bounds, fail where it is wholly outside (kEveryOne: where
// any value is), else inconclusive. The interval is the bootstrap's (`statistics`, whose confidence
// is replaced) over `values`, which are independent replicates. Invalid without values, and with a
// confidence below 1 for a single one, which has no interval.
Judgement Judge(std::span<const double> values, const Bounds& bounds, double confidence,
                const BootstrapConfig& statistics);

// The smallest amount by which all values must fall (or rise) for the judgement to become fail: the
// smallest regression that the gate is sure to detect. Nothing where that side has no bound, or
// the judgement has no interval.
struct Detects {
  std::optional<double> fall;
  std::optional<double> rise;
};
Detects SmallestDetected(const Judgement& judgement, const Bounds& bounds, double confidence);

// The process's exit code: 1 where a gate fails, else 4 where one is inconclusive or invalid, else
// 0. Of no verdicts 4: nothing was shown.
int ExitCodeOf(std::span<const Verdict> verdicts);

// Do methods agree on one replicate? Pass where every value is within `bounds` and the greatest
// exceeds the least by `spread` at most, else fail; invalid for fewer than two values.
Judgement JudgeAgreement(std::span<const double> values, double spread, const Bounds& bounds);

}  // namespace tsdfpp
