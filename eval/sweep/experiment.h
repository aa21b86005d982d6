// An experiment: methods x scenes x seeds x settings, as a TOML file says (docs/experiments.md).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/toml_reader.h"
#include "eval/sweep/sweep_settings.h"
#include "metrics/statistics.h"

namespace tsdfpp {

// Which frames of a sequence are used, and which of them evaluated.
struct FrameChoice {
  double scale = 1;  // of the images
  int stride = 1;    // every stride-th frame; CellSettings::speed multiplies it
  int every = 0;     // used frames between evaluations; 0: only the examined frame
  // "reveal": the reveal frame (the last one where a scene has none) is the last; "end": goes on to
  // the last frame; or a frame's number.
  std::string until = "reveal";
};

// All combinations of the values of its axes but those excepted; an axis that is absent has its
// default.
struct ExperimentGrid {
  using Values = std::map<std::string, std::vector<AxisValue>>;  // by the name of the axis

  std::string name;
  Values values;
  std::vector<Values> except{};  // a cell that has one of each of these values is left out
};

// How the plot shows the experiment: a panel a metric, a line a method.
struct PlotPlan {
  // An axis; "frame"; or "difference": each method's paired difference to the baseline, a row a
  // condition.
  std::string x;
  std::string x_label;
  bool log_x = false;
  std::vector<std::string> metrics;
};

struct ExperimentConfig {
  std::filesystem::path file;
  std::string name;
  std::string question;  // one sentence
  // Figures that the paired comparisons and the text are about; the first one leads.
  std::vector<std::string> metrics;
  std::string baseline = "tsdf";  // the method that the others are compared with, pair by pair
  // Axes over whose values figures are averaged; a pair is one value of each.
  std::vector<std::string> replicates{"scene", "seed"};
  BootstrapConfig statistics{BootstrapConfig::Method::kPercentile};
  FrameChoice frames;
  std::vector<ExperimentGrid> grids;
  std::optional<PlotPlan> plot;

  // Errors: kUsage, one sentence with file, line and key: an unknown key, metric, axis or method, a
  // value that is impossible, twice there or of the wrong type, more than 100,000 cells before
  // exceptions.
  static Expected<ExperimentConfig> Load(const std::filesystem::path& file);
  static Expected<ExperimentConfig> Parse(std::string_view text, const std::filesystem::path& file);
};

struct PlannedCell {
  std::string grid;
  CellSettings settings;
};

// The cells in the order of the grids, the last axis (eval/sweep/sweep_settings.h) running fastest.
std::vector<PlannedCell> CellsOf(const ExperimentConfig& config);

}  // namespace tsdfpp
