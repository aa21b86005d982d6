#include "bench/segment.h"

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "bench/segment_networks.h"
#include "bench/segment_shelf.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/random.h"
#include "eval/score/segment_scores.h"
#include "mapper/segment/depth_segments.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

std::string Text(const Measured& value) {
  return value.value ? fmt::format("{:.3f}", *value.value) : "-";
}

Expected<void> ScoreInto(SegmentScorer& scorer, const cv::Mat& truth, const Frame& frame) {
  DepthSegments segmenter;
  TSDFPP_ASSIGN(const Segments segments, segmenter.Segment(frame));
  return scorer.Observe(truth, segments.ids, frame.depth);
}

Expected<std::string> ScoreScene(const fs::path& file, int frames) {
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(file));
  SimOptions options;
  options.render_colour = false;
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, options));
  TSDFPP_ASSIGN(const SensorConfig noisy, SensorPresetNamed("nguyen2012"));
  SegmentScorer exact;
  SegmentScorer sensed;
  const SequenceInfo& info = source->info();
  for (int i = 0; i < frames; ++i) {
    const int last = info.frame_count - 1;
    const int index = info.first_index + last * i / std::max(1, frames - 1);
    TSDFPP_ASSIGN(Frame frame, source->ReadTrue(index));
    const cv::Mat truth = frame.mask;
    TSDFPP_RETURN_IF_ERROR(ScoreInto(exact, truth, frame));
    TSDFPP_ASSIGN(const SensedTruth ignored, ApplySensor(noisy, scene.seed, info, frame));
    TSDFPP_RETURN_IF_ERROR(ScoreInto(sensed, truth, frame));
  }
  std::string row = info.name;
  for (const SegmentScorer* scorer : {&exact, &sensed}) {
    const SegmentScores scores = scorer->Result();
    row += fmt::format(",{},{},{},{}", Text(scores.mean_iou), Text(scores.quality.pq),
                       Text(scores.objects.pq), Text(scores.sequence_iou));
  }
  return row + "\n";
}

Expected<void> WriteScenes(const SegmentBenchOptions& options) {
  std::string csv =
      "scene,exact: mean IoU,exact: PQ,exact: PQ of objects,exact: IoU over time,"
      "noise: mean IoU,noise: PQ,noise: PQ of objects,noise: IoU over time\n";
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListFolder(options.scenes));
  for (const fs::path& file : files) {
    if (file.extension() != ".toml") continue;
    TSDFPP_ASSIGN(const std::string row, ScoreScene(file, options.frames));
    std::fputs(row.c_str(), stdout);
    csv += row;
  }
  return WriteFile(fs::path(options.out) / "scenes.csv", csv);
}

Expected<void> WriteShelf(const SegmentBenchOptions& options) {
  TSDFPP_ASSIGN(const ShelfScores shelf, ScoreShelf(options.shelf));
  std::string csv =
      "segments,in the bin: PQ,in the bin: PQ of objects,in the bin: mean IoU,all: PQ,"
      "all: PQ of objects,all: mean IoU\n";
  const auto add = [&](const char* name, const ShelfScores::Of& of) {
    csv += name;
    for (const SegmentScores& scores : {of.in_bin, of.all}) {
      csv += fmt::format(",{},{},{}", Text(scores.quality.pq), Text(scores.objects.pq),
                         Text(scores.mean_iou));
    }
    csv += "\n";
  };
  add("`depth`", shelf.depth);
  add("the network's masks", shelf.network);
  std::fputs(csv.c_str(), stdout);
  return WriteFile(fs::path(options.out) / "shelf.csv", csv);
}

// 960x540: boxes of three sizes before a wall, all slanted, in noise of nguyen2012's size.
Frame BoxesInNoise() {
  Frame frame;
  frame.intrinsics = {960, 540, 564.3, 564.3, 480, 270};
  frame.depth = cv::Mat(540, 960, CV_32FC1);
  const NoiseModel noise(DepthNoise::kNguyen2012, 1);
  for (int v = 0; v < 540; ++v) {
    for (int u = 0; u < 960; ++u) {
      double z = 1.5 + 0.0003 * u + 0.0005 * v;
      if (cv::Rect(400, 200, 160, 140).contains({u, v})) z = 1.2 + 0.0004 * u;
      if (u % 240 < 60 && v % 180 < 50) z -= 0.15;
      const auto pixel = static_cast<std::uint64_t>(v * 960 + u);
      z += noise.HeadOn_m(static_cast<float>(z)) * GaussianDraw(1, 1, pixel)[0];
      frame.depth.at<float>(v, u) = static_cast<float>(z);
    }
  }
  return frame;
}

void SegmentDepth(benchmark::State& state) {
  const Frame frame = BoxesInNoise();
  DepthSegments segmenter;
  for (auto _ : state) benchmark::DoNotOptimize(segmenter.Segment(frame));
}
BENCHMARK(SegmentDepth)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace

Expected<void> RunSegmentBench(const SegmentBenchOptions& options) {
  for (const std::string& part : options.parts) {
    if (part == "scenes") {
      TSDFPP_RETURN_IF_ERROR(WriteScenes(options));
    } else if (part == "networks") {
      TSDFPP_ASSIGN(const std::string csv, NetworkScoresCsv(options.scenes, options.frames));
      TSDFPP_RETURN_IF_ERROR(WriteFile(fs::path(options.out) / "networks.csv", csv));
    } else {
      TSDFPP_RETURN_IF_ERROR(WriteShelf(options));
    }
  }
  return {};
}

}  // namespace tsdfpp
