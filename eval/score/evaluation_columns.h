// The figures of an evaluation that tables and frames.csv show, in one place (docs/metrics.md).
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "eval/score/evaluation.h"

namespace tsdfpp {

enum class Better { kHigher, kLower };

// Which values are better. It has no default: a metric without one does not compile.
class Direction {
 public:
  constexpr Direction(Better better) : better_(better) {}
  constexpr operator Better() const { return better_; }

 private:
  Better better_;
};

// All that is known of a metric, in one row.
struct EvaluationColumn {
  std::string title;  // in tables
  std::string csv;    // in frames.csv, JSON and experiments
  std::string words;  // in sentences and on axes, e.g. "hidden table kept"
  std::string unit;   // empty: a share or a ratio, which the report shows in %
  Direction better;
  int decimals;
  // As docs/metrics.md and the report print it; read alone, so "the same" is nothing to say.
  std::string definition;
  // Of the evaluation, where these objects are the ones that the experiment removes.
  std::function<Measured(const std::set<InstanceId>& movers, const Evaluation&)> value;
  // Its standard error, of sampling alone, in the same unit; empty where none is known. In
  // frames.csv the column after it, with "_se" after its name.
  std::function<Measured(const Evaluation&)> error = {};
  // Of what has no unit: a share ends at 1, and results above are refused; a ratio does not.
  bool can_exceed_one = false;
};

const std::vector<EvaluationColumn>& EvaluationColumns();

// The scores of the background, which are those of the table; all undefined where no true
// background is known.
const ObjectScores& TableOf(const Evaluation& evaluation);

// What a table shows of a column: "58", or "58 ±0.6" where there is an error; "-" where undefined.
std::string ColumnText(const EvaluationColumn& column, const std::set<InstanceId>& movers,
                       const Evaluation& evaluation);

}  // namespace tsdfpp
