#include "bench/figure_runs.h"

#include <cmath>
#include <cstdlib>

#include "core/files.h"
#include "core/intrinsics.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {

Expected<Footage> Film(const FilmPlan& plan) {
  TSDFPP_ASSIGN(SceneConfig scene, LoadSceneConfig(plan.scene));
  scene.intrinsics = Scaled(scene.intrinsics, plan.scale);
  SimOptions options;
  options.render.antialias = false;
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, options));
  Footage footage;
  footage.info = source->info();
  const int first = footage.info.first_index;
  const int last = std::min(plan.last, first + footage.info.frame_count - 1);
  for (const int wanted : plan.evaluated) {
    const int filmed = first + (std::min(wanted, last) - first) / plan.step * plan.step;
    TSDFPP_ASSIGN(SceneTruth truth, SceneTruth::Create(*source));
    footage.truth_from[filmed] = std::make_unique<SceneTruth>(std::move(truth));
  }
  if (!footage.truth_from.empty()) {
    const SceneTruth& truth = *footage.truth_from.begin()->second;
    for (std::size_t i = 0; i < truth.trackers().size(); ++i) {
      footage.names.push_back(truth.surface(i).model().info);
    }
  }
  for (int index = first; index <= last; index += plan.step) {
    TSDFPP_ASSIGN(Frame frame, source->Read(index));
    for (const auto& [number, truth] : footage.truth_from) {
      if (index <= number) TSDFPP_RETURN_IF_ERROR(truth->Observe(frame));
    }
    footage.frames.push_back(std::move(frame));
  }
  return footage;
}

void MapFootage(const Footage& footage, const PipelineConfig& config,
                const std::set<int>& looked_at, const Look& look) {
  Pipeline pipeline(config, footage.info.objects);
  for (const Frame& frame : footage.frames) {
    if (frame.index > *looked_at.rbegin()) return;
    pipeline.Process(frame).value();
    if (looked_at.contains(frame.index)) look(frame.index, pipeline.map());
  }
}

std::set<int> TruthFrames(const Footage& footage) {
  std::set<int> frames;
  for (const auto& [number, truth] : footage.truth_from) frames.insert(number);
  return frames;
}

void FigureTable::Add(std::vector<std::string> row) {
  if (row.size() != columns_.size()) std::abort();
  rows_.push_back(std::move(row));
}

Expected<void> FigureTable::Write(const std::filesystem::path& out, const std::string& name) const {
  std::string csv;
  const auto line = [&](const std::vector<std::string>& cells) {
    for (std::size_t i = 0; i < cells.size(); ++i) csv += (i == 0 ? "" : ",") + cells[i];
    csv += "\n";
  };
  line(columns_);
  for (const auto& row : rows_) line(row);
  return WriteFile(out / (name + ".csv"), csv);
}

std::string Cell(const Measured& measured) {
  return measured.value ? fmt::format("{:.3f}", *measured.value) : std::string();
}

std::string Cell(double value, int digits) {
  const double scale = std::pow(10, digits);
  return fmt::format("{:.{}f}", std::round(value * scale) / scale + 0.0, digits);  // never -0
}

}  // namespace tsdfpp
