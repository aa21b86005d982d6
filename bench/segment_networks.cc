#include "bench/segment_networks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>

#include "core/folders.h"
#include "eval/score/segment_scores.h"
#include "mapper/instance_network.h"
#include "mapper/segment/segmenter.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr std::array<Segmentation, 3> kWays{Segmentation::kDepth, Segmentation::kNetwork,
                                            Segmentation::kFull};
constexpr const char* kSensor = "nguyen2012+colour_noise";

std::string Text(const Measured& value) {
  return value.value ? fmt::format("{:.3f}", *value.value) : "-";
}

Expected<std::string> RowOf(const fs::path& file, int frames,
                            const std::shared_ptr<InstanceFinder>& finder) {
  TSDFPP_ASSIGN(SceneConfig scene, LoadSceneConfig(file));
  TSDFPP_ASSIGN(scene.sensor, SensorPresetNamed(kSensor));
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, {}));
  const SequenceInfo& info = source->info();
  std::array<SegmentScorer, kWays.size()> scorers;
  for (int i = 0; i < frames; ++i) {
    const int index = info.first_index + (info.frame_count - 1) * i / std::max(1, frames - 1);
    TSDFPP_ASSIGN(const Frame truth, source->ReadTrue(index));
    TSDFPP_ASSIGN(const Frame frame, source->Read(index));
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      const auto segmenter = MakeSegmenter(kWays[way], {}, {.finder = finder});
      TSDFPP_ASSIGN(const Segments segments, segmenter->Segment(frame));
      TSDFPP_RETURN_IF_ERROR(
          scorers[way].Observe(truth.mask, segments.IdsOfObjects(), frame.depth));
    }
  }
  std::string row = info.name;
  for (const SegmentScorer& scorer : scorers) {
    const SegmentScores scores = scorer.Result();
    row += fmt::format(",{},{},{}", Text(scores.quality.pq), Text(scores.objects.pq),
                       Text(scores.sequence_iou));
  }
  return row + "\n";
}

}  // namespace

Expected<std::string> NetworkScoresCsv(const fs::path& scenes, int frames) {
  TSDFPP_ASSIGN(const std::shared_ptr<InstanceFinder> finder, OwnInstanceNetwork({}));
  std::string csv = "scene";
  for (const Segmentation way : kWays) {
    const std::string_view name = SegmentationName(way);
    csv += fmt::format(",`{}`: PQ,PQ of objects,IoU over time", name);
  }
  csv += "\n";
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListFolder(scenes));
  for (const fs::path& file : files) {
    if (file.extension() != ".toml") continue;
    TSDFPP_ASSIGN(const std::string row, RowOf(file, frames, finder));
    std::fputs(row.c_str(), stdout);
    csv += row;
  }
  return csv;
}

}  // namespace tsdfpp
