// What the cells of an experiment say together: means with intervals, and each method against the
// baseline, pair by pair.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "eval/sweep/sweep.h"
#include "metrics/statistics.h"

namespace tsdfpp {

struct MeanFigure {
  std::size_t count = 0;  // of replicates in which it is defined
  Measured mean;
  MeasuredInterval interval;  // undefined for fewer than two
};

// Cells that differ in method and replicate alone (ExperimentConfig::replicates).
struct Condition {
  std::string grid;
  std::map<std::string, AxisValue> settings;  // of the axes that are neither
  std::size_t replicates = 0;
  std::vector<std::string> methods;  // in the experiment's order
  // By method and metric. The figures are those of the examined frame.
  std::map<std::pair<std::string, std::string>, MeanFigure> means;
  // Of method minus baseline, over the replicates in which both are defined; none of the baseline.
  std::map<std::pair<std::string, std::string>, PairedComparison> paired;
};

// In the order in which the conditions first appear; for every metric of SweepMetrics().
std::vector<Condition> ConditionsOf(const SweepResult& result);

// The axes, method and replicates left out, that have several values in the experiment.
std::vector<std::string> VariedAxes(const std::vector<Condition>& conditions);

// "voxel_m 0.01, speed 2": the varied axes of a condition; with its grid's name before them where
// the experiment has several.
std::string ConditionText(const Condition& condition, const std::vector<std::string>& varied,
                          bool several_grids);

}  // namespace tsdfpp
