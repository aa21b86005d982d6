#include "bench/motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "bench/figure_runs.h"
#include "bench/return_scenes.h"
#include "core/toml_reader.h"
#include "mapper/pipeline.h"
#include "metrics/statistics.h"
#include "sim/sensor/sensor.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr double kMoved_m = 0.02;
constexpr double kFoundShare = 0.5;
constexpr int kSoon_frames = 10;

struct Plan {
  SensorConfig sensor{};
  PipelineConfig pipeline{};
};

Expected<Plan> PlanOf(const MotionBenchOptions& options) {
  Plan plan;
  if (options.depth != "noise" && options.depth != "exact") {
    return UsageError("--depth: expected exact or noise, found '{}'", options.depth);
  }
  const bool is_exact = options.depth == "exact";
  TSDFPP_ASSIGN(plan.sensor, SensorPresetNamed(is_exact ? "none" : "nguyen2012"));
  TSDFPP_ASSIGN(plan.pipeline.method, MethodFromName(options.method));
  plan.pipeline.segmentation = Segmentation::kDepth;
  if (is_exact) plan.pipeline.segmenter.depth.noise = DepthNoise::kExact;
  plan.pipeline.associate = AssociationMode::kVotes;
  plan.pipeline.poses = PoseSource::kTrack;
  plan.pipeline.tracked = TrackChoice::kMoving;
  if (!options.settings.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.settings));
    TSDFPP_ASSIGN(plan.pipeline.track, SdfTrackConfig::FromToml(table, options.settings));
  }
  TSDFPP_RETURN_IF_ERROR(plan.pipeline.Validate());
  return plan;
}

struct Row {
  ReturnKind kind{};
  std::uint64_t seed = 0;
  std::string object{};
  double speed_m = 0;
  std::optional<int> delay{};  // frames from the first 2 cm until it is found
  int parts = 0;
  int falsely = 0;
};

// How many pixels with depth each label has on each true object, the background included.
using Shares = std::map<InstanceId, std::map<InstanceId, int>>;

Shares SharesOf(const Frame& frame, const cv::Mat& truth, const cv::Mat& labels) {
  Shares shares;
  for (int v = 0; v < truth.rows; ++v) {
    for (int u = 0; u < truth.cols; ++u) {
      if (!IsValidDepth(frame.depth.at<float>(v, u))) continue;
      ++shares[labels.at<InstanceId>(v, u)][truth.at<InstanceId>(v, u)];
    }
  }
  return shares;
}

InstanceId MostOf(const std::map<InstanceId, int>& counts) {
  return std::ranges::max_element(counts, {}, [](const auto& entry) { return entry.second; })
      ->first;
}

// Of the labels in `moved` that are mostly this object: how many, and their share of its pixels.
struct Found {
  int parts = 0;
  double share = 0;
};
Found FoundOf(InstanceId of, const Shares& shares, const std::set<InstanceId>& moved) {
  Found found;
  int all = 0;
  int own = 0;
  for (const auto& [label, counts] : shares) {
    const auto count = counts.find(of);
    if (count == counts.end()) continue;
    all += count->second;
    if (!moved.contains(label) || MostOf(counts) != of) continue;
    ++found.parts;
    own += count->second;
  }
  if (all > 0) found.share = static_cast<double>(own) / all;
  return found;
}

Expected<Row> RunCase(const ReturnScene& drawn, const Plan& plan) {
  Row row{drawn.kind, drawn.scene.seed, "", drawn.speed_m};
  for (const SceneObject& object : drawn.scene.objects) {
    if (object.id == drawn.pushed) row.object = object.name;
  }
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(drawn.scene, {}));
  Pipeline pipeline(plan.pipeline, {});
  const SequenceInfo& info = source->info();
  std::optional<Pose> T_WO_first;
  std::optional<int> first_moved;
  std::optional<int> first_found;
  std::set<InstanceId> moved;
  Shares of_moved;  // since they are known to have moved
  for (int index = info.first_index; index < info.first_index + info.frame_count; ++index) {
    TSDFPP_ASSIGN(Frame frame, source->ReadTrue(index));
    const cv::Mat truth = frame.mask.clone();
    if (drawn.pushed != kNoInstance) {
      const Pose& T_WO = frame.T_WO.at(drawn.pushed);
      if (!T_WO_first) T_WO_first = T_WO;
      const double way_m = (T_WO.translation() - T_WO_first->translation()).norm();
      if (!first_moved && way_m >= kMoved_m) first_moved = index;
    }
    TSDFPP_ASSIGN(const SensedTruth ignored,
                  ApplySensor(plan.sensor, drawn.scene.seed, info, frame));
    frame.T_WO.clear();
    TSDFPP_RETURN_IF_ERROR(pipeline.Process(frame));
    for (const auto& [id, span] : pipeline.track_log().objects()) {
      if (span.moved) moved.insert(id);
    }
    const Shares shares = SharesOf(frame, truth, pipeline.labels());
    for (const auto& [label, counts] : shares) {
      if (!moved.contains(label)) continue;
      for (const auto& [of, count] : counts) of_moved[label][of] += count;
    }
    if (drawn.pushed == kNoInstance || index <= drawn.last_before || first_found) continue;
    const Found found = FoundOf(drawn.pushed, shares, moved);
    if (found.share < kFoundShare) continue;
    first_found = index;
    row.parts = found.parts;
  }
  if (first_found && first_moved) row.delay = *first_found - *first_moved;
  for (const InstanceId id : moved) {
    const auto counts = of_moved.find(id);
    const bool is_early = *pipeline.track_log().objects().at(id).moved <= drawn.last_before;
    if (is_early || counts == of_moved.end() || MostOf(counts->second) != drawn.pushed) {
      ++row.falsely;
    }
  }
  return row;
}

Expected<void> WriteCases(const std::vector<Row>& rows, const std::string& out) {
  FigureTable table(
      {"case", "seed", "object", "cm a second", "frames after 2 cm", "parts", "false"});
  for (const Row& row : rows) {
    const bool is_pushed = row.kind == ReturnKind::kPushed;
    table.Add({std::string(ReturnKindName(row.kind)), std::to_string(row.seed), row.object,
               is_pushed ? Cell(100 * row.speed_m, 1) : "",
               row.delay ? std::to_string(*row.delay) : "",
               row.delay ? std::to_string(row.parts) : "", std::to_string(row.falsely)});
  }
  return table.Write(out, "cases");
}

Expected<void> WriteMotion(const std::vector<Row>& rows, const std::string& out) {
  FigureTable table({"case", "sequences", "found within 10 frames", "found later", "not found",
                     "frames after 2 cm: median", "most", "in one part", "with a false object"});
  for (const ReturnKind kind : {ReturnKind::kPushed, ReturnKind::kStill}) {
    int all = 0;
    int soon = 0;
    int whole = 0;
    int falsely = 0;
    std::vector<double> delays;
    for (const Row& row : rows) {
      if (row.kind != kind) continue;
      ++all;
      falsely += row.falsely > 0 ? 1 : 0;
      if (!row.delay) continue;
      delays.push_back(*row.delay);
      soon += *row.delay <= kSoon_frames ? 1 : 0;
      whole += row.parts == 1 ? 1 : 0;
    }
    const bool is_pushed = kind == ReturnKind::kPushed;
    const auto only_pushed = [&](const std::string& text) { return is_pushed ? text : ""; };
    const int found = static_cast<int>(delays.size());
    table.Add({std::string(ReturnKindName(kind)), std::to_string(all),
               only_pushed(std::to_string(soon)), only_pushed(std::to_string(found - soon)),
               only_pushed(std::to_string(all - found)),
               delays.empty() ? "" : Cell(MedianOf(delays), 0),
               delays.empty() ? "" : Cell(*std::ranges::max_element(delays), 0),
               only_pushed(std::to_string(whole)), std::to_string(falsely)});
  }
  return table.Write(out, "motion");
}

}  // namespace

Expected<void> RunMotionBench(const MotionBenchOptions& options) {
  TSDFPP_ASSIGN(const Plan plan, PlanOf(options));
  std::vector<Row> rows;
  for (const ReturnKind kind : {ReturnKind::kPushed, ReturnKind::kStill}) {
    for (int i = 0; i < options.cases; ++i) {
      const auto seed = static_cast<std::uint64_t>(options.first_seed) + rows.size();
      TSDFPP_ASSIGN(const Row row, RunCase(DrawReturnScene(kind, seed), plan));
      rows.push_back(row);
      std::printf("%s, seed %d: %s, %d frames, %d parts, %d false\n",
                  std::string(ReturnKindName(kind)).c_str(), static_cast<int>(seed),
                  row.object.c_str(), row.delay.value_or(-999), row.parts, row.falsely);
      std::fflush(stdout);
    }
  }
  TSDFPP_RETURN_IF_ERROR(WriteCases(rows, options.out));
  return WriteMotion(rows, options.out);
}

}  // namespace tsdfpp
