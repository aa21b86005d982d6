#include "bench/whole.h"

#include <fmt/ranges.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>
#include <utility>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/median.h"
#include "core/intrinsics.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "mapper/instance_network.h"
#include "mapper/pipeline.h"
#include "metrics/statistics.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr const char* kSensor = "nguyen2012+colour_noise";
constexpr const char* kLive = "live";

struct Shown {
  SequenceInfo info;
  std::vector<Frame> frames;
};

Expected<Shown> Render(const WholeBenchOptions& options, double scale) {
  TSDFPP_ASSIGN(SceneConfig scene, LoadSceneConfig(options.scene));
  TSDFPP_ASSIGN(scene.sensor, SensorPresetNamed(kSensor));
  scene.intrinsics = Scaled(scene.intrinsics, scale);
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, {}));
  Shown shown{source->info(), {}};
  const int end = std::min(shown.info.frame_count, options.first + options.frames);
  if (end - options.first <= options.warm_up) {
    return UsageError("--frames: {} of {}'s {} are left after --first {}, expected more than {}",
                      std::max(end - options.first, 0), options.scene, shown.info.frame_count,
                      options.first, options.warm_up);
  }
  for (int i = options.first; i < end; ++i) {
    TSDFPP_ASSIGN(Frame frame, source->Read(shown.info.first_index + i));
    shown.frames.push_back(std::move(frame));
  }
  return shown;
}

Expected<PipelineConfig> ConfigOf(const std::string& setting, const WholeBenchOptions& options) {
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.poses = PoseSource::kTrack;
  if (setting == "given") return config;
  config.associate = AssociationMode::kVotes;
  if (setting == "depth") {
    config.segmentation = Segmentation::kDepth;
    return config;
  }
  config.segmentation = Segmentation::kFull;
  if (setting == "beside" || setting == kLive) {
    config.segmenter.network.every = options.every;
    config.segmenter.network.latency = options.every;
    config.segmenter.network.gives_way = setting == kLive;
  } else if (setting != "full") {
    return UsageError("--settings: '{}' is unknown, expected given, depth, full or beside",
                      setting);
  }
  TSDFPP_ASSIGN(config.segmenter.finder, OwnInstanceNetwork(config.segmenter.network));
  return config;
}

// Milliseconds of each frame after those that warm up.
struct Times {
  std::vector<double> segment, associate, track, fuse, all;

  void Add(const StepTimes& steps, double all_s) {
    const auto add = [](std::vector<double>& to, double seconds) { to.push_back(1e3 * seconds); };
    add(segment, steps.segment_s);
    add(associate, steps.associate_s);
    add(track, steps.track_s);
    add(fuse, steps.update_poses_s + steps.fuse_s);
    add(all, all_s);
  }
};

// A virtual machine gives memory that was freed back to its host two seconds later, all at once,
// and has no core for tens of milliseconds meanwhile.
void WaitUntilFreedMemoryIsGone() {
  constexpr std::chrono::seconds kLongEnough(4);
  std::this_thread::sleep_for(kLongEnough);
}

// `rate`: frames a second that come, whether or not the one before is done; 0: each comes when that
// is so.
Expected<Times> TimesOf(const Shown& shown, const PipelineConfig& config, int warm_up,
                        double rate) {
  using Clock = std::chrono::steady_clock;
  const bool is_given = config.associate == AssociationMode::kGiven;
  Pipeline pipeline(config, is_given ? shown.info.objects : std::vector<ObjectInfo>{});
  Times times;
  WaitUntilFreedMemoryIsGone();
  const Clock::time_point begin = Clock::now();
  int count = 0;
  for (const Frame& frame : shown.frames) {
    const std::chrono::duration<double> due(rate > 0 ? count++ / rate : 0);
    std::this_thread::sleep_until(begin + due);
    TSDFPP_ASSIGN(const StepTimes steps, pipeline.Process(frame));
    const std::chrono::duration<double> done = Clock::now() - begin;
    if (warm_up-- <= 0) times.Add(steps, rate > 0 ? (done - due).count() : steps.Total_s());
  }
  return times;
}

// The median of the fastest of Open3D's volumes, whose one band is as wide as ours on both sides
// together.
double Open3dMilliseconds(const Shown& shown, const MapConfig& map, int warm_up) {
  const double band_m = (map.trunc_front_voxels + map.trunc_back_voxels) / 2 * map.voxel_m;
  const auto median = [&](auto&& volume) {
    std::vector<double> ms;
    for (const Frame& frame : shown.frames) ms.push_back(1e3 * volume.Integrate(frame));
    return Median({ms.begin() + warm_up, ms.end()});
  };
  return std::min({median(Open3dVolume(map.voxel_m, band_m)),
                   median(VoxelBlockGridPeer(map.voxel_m, band_m, 8)),
                   median(VoxelBlockGridPeer(map.voxel_m, band_m, 16))});
}

// What a row has of one run: its columns without the first three.
std::vector<double> FiguresOf(Times times, double open3d_ms, double rate) {
  std::sort(times.all.begin(), times.all.end());
  const double late_ms = QuantileOfSorted(times.all, 0.95);
  const double median_ms = Median(times.all);
  const auto late = std::ranges::count_if(times.all, [&](double ms) { return ms * rate > 1e3; });
  return {Median(times.segment),
          Median(times.associate),
          Median(times.track),
          Median(times.fuse),
          median_ms,
          late_ms,
          times.all.back(),
          1e3 / late_ms,
          100 * static_cast<double>(late) / static_cast<double>(times.all.size()),
          open3d_ms,
          median_ms / open3d_ms,
          late_ms / open3d_ms};
}

std::vector<std::string> Columns() {
  return {"images",
          "setting",
          "given a second",
          "segment",
          "associate",
          "track",
          "update and fuse",
          "all: median",
          "95th percentile",
          "worst",
          "frames a second at the 95th percentile",
          "late %",
          "Open3D's integration",
          "median over Open3D's",
          "95th percentile over Open3D's"};
}
constexpr std::size_t kLate = 8;    // of the figures, which only frames with a rate can be
constexpr std::size_t kRatios = 2;  // the last columns

// The median of each figure over the runs.
void AddRow(const std::string& size, const std::string& setting, double rate,
            const std::vector<std::vector<double>>& runs, FigureTable& table) {
  std::vector<std::string> row{size, setting, rate > 0 ? fmt::format("{:g}", rate) : "-"};
  const std::size_t figures = runs.front().size();
  for (std::size_t i = 0; i < figures; ++i) {
    std::vector<double> values;
    values.reserve(runs.size());
    for (const std::vector<double>& run : runs) values.push_back(run[i]);
    if (i == kLate && rate == 0) {
      row.emplace_back("-");
      continue;
    }
    row.push_back(Cell(Median(values), i + kRatios < figures ? 1 : 2));
  }
  std::printf("%s\n", fmt::format("{}", fmt::join(row, ",")).c_str());
  std::fflush(stdout);
  table.Add(row);
}

}  // namespace

Expected<void> RunWholeBench(const WholeBenchOptions& options) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(options.threads));
  SetOpen3dThreads(options.threads);
  if (options.rates.size() != options.scales.size()) {
    return UsageError("--rates: {} given, expected one for each of {} scales", options.rates.size(),
                      options.scales.size());
  }
  std::vector<PipelineConfig> configs;
  for (const std::string& setting : options.settings) {
    TSDFPP_ASSIGN(PipelineConfig config, ConfigOf(setting, options));
    configs.push_back(std::move(config));
  }
  FigureTable table(Columns());
  for (std::size_t s = 0; s < options.scales.size(); ++s) {
    TSDFPP_ASSIGN(const Shown shown, Render(options, options.scales[s]));
    const auto rate_of = [&](std::size_t setting) {
      return options.settings[setting] == kLive ? options.rates[s] : 0;
    };
    std::vector<std::vector<std::vector<double>>> figures(configs.size());  // by setting and run
    for (int run = 0; run < options.runs; ++run) {
      const double open3d_ms = Open3dMilliseconds(shown, MapConfig{}, options.warm_up);
      for (std::size_t i = 0; i < configs.size(); ++i) {
        TSDFPP_ASSIGN(Times times, TimesOf(shown, configs[i], options.warm_up, rate_of(i)));
        figures[i].push_back(FiguresOf(std::move(times), open3d_ms, rate_of(i)));
      }
    }
    const Intrinsics& k = shown.info.intrinsics;
    for (std::size_t i = 0; i < configs.size(); ++i) {
      AddRow(fmt::format("{}x{}", k.width, k.height), options.settings[i], rate_of(i), figures[i],
             table);
    }
  }
  if (options.out.empty()) return {};
  return table.Write(options.out, "whole");
}

}  // namespace tsdfpp
