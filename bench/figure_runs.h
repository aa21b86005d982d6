// What the measurements behind docs/map-figures.md share: frames of a scene in memory, maps of
// them, scores, tables.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "eval/score/evaluation.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// Frames of a scene, rendered small, with the truth as it stood at some of them.
struct Footage {
  SequenceInfo info;
  std::vector<Frame> frames;
  std::vector<ObjectInfo> names;                          // of the truth's trackers, in order
  std::map<int, std::unique_ptr<SceneTruth>> truth_from;  // by frame number
};

struct FilmPlan {
  std::string scene;
  double scale = 1;            // of the images
  int step = 1;                // every step-th frame, from the first on
  int last = 0;                // frame number
  std::vector<int> evaluated;  // frame numbers; the nearest earlier one that is filmed counts
};

// Errors: those of the scene and of the renderer.
Expected<Footage> Film(const FilmPlan& plan);

// Maps the footage up to the last of `looked_at` (frame numbers) and calls look(number, map) after
// each of these.
using Look = std::function<void(int, const MapRepresentation&)>;
void MapFootage(const Footage& footage, const PipelineConfig& config,
                const std::set<int>& looked_at, const Look& look);
// The frames that the truth is known at.
std::set<int> TruthFrames(const Footage& footage);

// Rows of text without commas or quotes, under named columns.
class FigureTable {
 public:
  explicit FigureTable(std::vector<std::string> columns) : columns_(std::move(columns)) {}

  // As many cells as there are columns.
  void Add(std::vector<std::string> row);
  // As OUT/name.csv. Errors: kEnvironment where it cannot be written.
  Expected<void> Write(const std::filesystem::path& out, const std::string& name) const;

 private:
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// Three digits after the point; empty where undefined.
std::string Cell(const Measured& measured);
std::string Cell(double value, int digits);

}  // namespace tsdfpp
