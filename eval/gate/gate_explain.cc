#include "eval/gate/gate_explain.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/encode_image.h"
#include "core/files.h"
#include "eval/gate/gate_times.h"
#include "eval/picture/draw_scene.h"
#include "eval/sweep/cell_run.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

constexpr int kPictureHeight = 270;
constexpr double kTablePixel_m = 0.0025;

// How far out of the bounds; negative within them.
double Excess(double value, const Bounds& bounds) {
  double excess = -1e300;
  if (bounds.low) excess = std::max(excess, *bounds.low - value);
  if (bounds.high) excess = std::max(excess, value - *bounds.high);
  return excess;
}

const CellFrame* FrameOf(const CellResult& cell, int frame) {
  for (const CellFrame& one : cell.frames) {
    if (one.frame == frame) return &one;
  }
  return nullptr;
}

// What the gate looks at, at an evaluated frame; nothing where it is not known there.
std::optional<double> ValueAt(const GateOutcome& outcome, const std::string& replicate,
                              const CellFrame& frame, const GateReference* reference) {
  const std::size_t metric = MetricIndex(outcome.gate.metric);
  if (metric >= frame.values.size() || !frame.values[metric].value) return std::nullopt;
  const double ours = *frame.values[metric].value;
  std::optional<double> other;
  if (outcome.gate.kind == Gate::Kind::kAbsolute) return ours;
  if (outcome.gate.kind == Gate::Kind::kPaired) {
    const CellFrame* theirs = FrameOf(*outcome.data.at(replicate).theirs, frame.frame);
    if (theirs != nullptr) other = theirs->values[metric].value;
  } else if (reference != nullptr && reference->by_frame.contains(replicate)) {
    const auto& curve = reference->by_frame.at(replicate);
    if (const auto stored = curve.find(frame.frame); stored != curve.end()) other = stored->second;
  }
  if (!other || (outcome.gate.ratio && !(*other > 0))) return std::nullopt;
  return outcome.gate.ratio ? ours / *other : ours - *other;
}

// The object with the greatest badness, nothing where none has one.
template <typename Badness>
const ObjectScores* Worst(const Evaluation& evaluation, const Badness& badness) {
  const ObjectScores* worst = nullptr;
  double most = 0;
  for (const ObjectScores& object : evaluation.objects) {
    const std::optional<double> bad = badness(object);
    if (bad && (worst == nullptr || *bad > most)) {
      worst = &object;
      most = *bad;
    }
  }
  return worst;
}

std::optional<double> Negative(const Measured& measured) {
  return measured.value ? std::optional(-*measured.value) : std::nullopt;
}

const ObjectScores* ObjectBehind(const std::string& metric, const Evaluation& evaluation,
                                 const std::set<InstanceId>& movers) {
  const auto begins = [&](const char* word) { return metric.rfind(word, 0) == 0; };
  if (begins("table_")) return &evaluation.objects.front();
  const auto of_movers = [&](const auto& badness) {
    return Worst(evaluation, [&](const ObjectScores& object) {
      return movers.contains(object.info.id) ? badness(object) : std::nullopt;
    });
  };
  if (metric == "movers_completion") {
    return of_movers([](const ObjectScores& o) { return Negative(o.preserved.completion); });
  }
  if (begins("movers_accuracy")) {
    return of_movers([](const ObjectScores& o) { return o.accuracy.distance.rmse_m.value; });
  }
  if (begins("sanity")) {
    return Worst(evaluation, [&](const ObjectScores& o) -> std::optional<double> {
      const auto share = evaluation.sanity.by_object.find(o.info.id);
      return share == evaluation.sanity.by_object.end() ? std::nullopt : Negative(share->second);
    });
  }
  if (metric == "visible_completion") {
    return Worst(evaluation, [](const ObjectScores& o) { return Negative(o.visible_completion); });
  }
  if (metric.find("ghost") != std::string::npos) {
    return Worst(evaluation,
                 [](const ObjectScores& o) { return Negative(o.accuracy.precision[1]); });
  }
  return nullptr;
}

struct Seen {
  Frame frame;
  Evaluation evaluation;
  std::optional<SceneTruth> truth;
  std::set<InstanceId> movers;
};

// Maps the cell's frames up to `last` and evaluates there. Errors: also kData where there is none.
Expected<Seen> MapAgain(const ExperimentConfig& config, const CellSettings& settings, int last) {
  VariantMaker maker(config.file.parent_path(), config.frames);
  TSDFPP_ASSIGN(const SequenceVariant variant, maker.Make(settings));
  if (last < variant.frames.front()) {
    return DataError("{}: no frame up to {} is mapped, the first one is {}", config.file.string(),
                     last, variant.frames.front());
  }
  TSDFPP_ASSIGN(VariantSource source, VariantSource::Open(variant));
  Seen seen;
  TSDFPP_ASSIGN(seen.truth, SabotagedTruth(variant.sabotage, source.source(), variant.voxel_m));
  TSDFPP_ASSIGN(CellMapper mapper, CellMapper::Make(settings, source.info().objects));
  std::vector<ObjectInfo> names;
  for (std::size_t i = 0; i < seen.truth->trackers().size(); ++i) {
    names.push_back(seen.truth->surface(i).model().info);
  }
  LastSeenStores last_seen = MakeLastSeenStores(*seen.truth);
  for (const int index : variant.frames) {
    if (index > last) break;
    TSDFPP_ASSIGN(VariantFrame both, source.Read(index));
    TSDFPP_RETURN_IF_ERROR(seen.truth->Observe(both.truth));
    TSDFPP_RETURN_IF_ERROR(mapper.Process(both));
    if (variant.IsEvaluated(index)) mapper.SettleIds();
    seen.frame = std::move(both.frame);
  }
  mapper.SettleIds();
  seen.movers = MoversNow(source.info(), *seen.truth);
  SceneMeshes meshes = mapper.Meshes(seen.movers);
  SabotageMeshes(settings.sabotage, meshes);
  seen.evaluation = EvaluateMeshes(std::move(meshes), *seen.truth, names, seen.movers,
                                   mapper.voxel_m(), last_seen);
  return seen;
}

cv::Mat Titled(const cv::Mat& image, const std::string& title) {
  cv::Mat scaled;
  cv::resize(image, scaled, {std::max(1, image.cols * kPictureHeight / image.rows), kPictureHeight},
             0, 0, image.rows < kPictureHeight ? cv::INTER_NEAREST : cv::INTER_AREA);
  cv::copyMakeBorder(scaled, scaled, 26, 6, 3, 3, cv::BORDER_CONSTANT, cv::Scalar(255, 255, 255));
  cv::putText(scaled, title, {4, 18}, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar(30, 30, 30), 1,
              cv::LINE_AA);
  return scaled;
}

Expected<void> Draw(const Seen& seen, const std::filesystem::path& file) {
  const Frame& frame = seen.frame;
  std::vector<cv::Mat> parts;
  if (!frame.colour.empty()) {
    parts.push_back(Titled(frame.colour, fmt::format("frame {}", frame.index)));
  }
  parts.push_back(
      Titled(DrawScene(seen.evaluation.scene, frame.intrinsics, frame.T_WC, 1), "the map"));
  parts.push_back(Titled(DrawScene(seen.evaluation.revealed, frame.intrinsics, frame.T_WC, 1),
                         "without the moving objects"));
  const cv::Mat table = DrawTable(*seen.truth, seen.evaluation.table_reconstructed, kTablePixel_m);
  if (!table.empty()) parts.push_back(Titled(table, "table: red is missing"));
  cv::Mat all;
  cv::hconcat(parts, all);
  cv::cvtColor(all, all, cv::COLOR_RGB2BGR);
  TSDFPP_ASSIGN(const std::string bytes, EncodeImage(all, ".png", file.string()));
  return WriteFile(file, bytes);
}

}  // namespace

WorstPlace FindWorst(const GateOutcome& outcome, const GateReference* reference) {
  WorstPlace worst;
  const std::vector<double>& values = outcome.judgement.values;
  double most = 0;
  std::size_t i = 0;
  const GatePair* pair = &outcome.data.begin()->second;  // a gate that was judged has some
  for (const auto& [replicate, of_replicate] : outcome.data) {
    const double excess = Excess(values.at(i++), outcome.gate.bounds);
    if (i > 1 && excess <= most) continue;
    most = excess;
    worst.replicate = replicate;
    pair = &of_replicate;
  }
  for (const CellFrame& frame : pair->ours->frames) {
    if (frame.examined) worst.frame = frame.frame;
  }
  worst.which = "the examined one";
  if (outcome.gate.metric == kFrameTimeMetric) {
    const std::map<int, double> ratios = FrameTimeRatios(*pair->ours, *pair->theirs);
    const auto slowest =
        std::max_element(ratios.begin(), ratios.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    if (slowest == ratios.end()) return worst;
    worst.which = "the slowest against the other's time";
    worst.frame = slowest->first;
    return worst;
  }
  for (const CellFrame& frame : pair->ours->frames) {
    const std::optional<double> value = ValueAt(outcome, worst.replicate, frame, reference);
    if (!value || outcome.gate.bounds.Hold(*value)) continue;
    if (!frame.examined) worst.which = "the first evaluated one out of the bounds";
    worst.frame = frame.frame;
    break;
  }
  return worst;
}

Expected<GateExplanation> ExplainGate(const GateRun& run, const GateOutcome& outcome,
                                      const References& references,
                                      const std::filesystem::path& folder) {
  const Gate& gate = outcome.gate;
  GateExplanation explanation;
  if (outcome.judgement.values.empty()) {
    explanation.sentence = fmt::format(
        "{} is {}: {}", gate.name, VerdictName(outcome.judgement.verdict), outcome.judgement.why);
    return explanation;
  }
  const auto found = references.find(gate.name);
  const WorstPlace worst = FindWorst(outcome, found == references.end() ? nullptr : &found->second);
  explanation.replicate = worst.replicate;
  explanation.frame = worst.frame;

  const ExperimentConfig& config = run.config.FindExperiment(gate.experiment)->config;
  CellSettings settings;
  const auto cells = ChosenCells(config, gate.where, {});
  for (const auto& [replicate, chosen] : *cells) {
    if (replicate == worst.replicate) settings = chosen;
  }
  if (run.options.sabotage != Sabotage::kNone) settings.sabotage = run.options.sabotage;
  TSDFPP_ASSIGN(const Seen seen, MapAgain(config, settings, worst.frame));
  const ObjectScores* object = ObjectBehind(gate.metric, seen.evaluation, seen.movers);
  if (object != nullptr) {
    explanation.object = object->info.id == kBackground && gate.metric.rfind("table_", 0) == 0
                             ? "table"
                             : object->info.name;
  }
  explanation.picture = gate.name + ".png";
  TSDFPP_RETURN_IF_ERROR(Draw(seen, folder / explanation.picture));
  explanation.sentence = fmt::format(
      "{} is {}: worst at {}{}frame {} ({}){}; picture {}", gate.name,
      VerdictName(outcome.judgement.verdict), worst.replicate, worst.replicate.empty() ? "" : " ",
      worst.frame, worst.which, explanation.object.empty() ? "" : ", object " + explanation.object,
      (folder / explanation.picture).string());
  return explanation;
}

}  // namespace tsdfpp
