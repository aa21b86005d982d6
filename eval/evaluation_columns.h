// The figures of an evaluation that tables and frames.csv show, in one place (docs/metrics.md).
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "eval/evaluation.h"

namespace tsdfpp {

struct EvaluationColumn {
  std::string title;  // in tables
  std::string csv;    // in frames.csv
  // Of the evaluation, where these objects are the ones that the experiment removes.
  std::function<Measured(const std::set<InstanceId>& movers, const Evaluation&)> value;
  int decimals;
};

const std::vector<EvaluationColumn>& EvaluationColumns();

}  // namespace tsdfpp
