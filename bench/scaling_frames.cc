// Ten thousand frames: is the last one as cheap as an early one, and the map as small?
#include <unistd.h>

#include <array>
#include <fstream>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/scaling.h"
#include "bench/scaling_runs.h"

namespace tsdfpp {
namespace {

// Small, so that ten thousand frames of eight maps take minutes.
constexpr double kImageScale = 0.25;  // 240x135
constexpr double kVoxel_m = 0.02;

// 51 frames there and 49 back: a hundred a round, so that every tenth of a long run shows the same.
struct Film100 {
  const char* name;
  const char* scene;
  int step;
};
constexpr int kTenths = 10;
constexpr int kFilmed = 51;
constexpr int kRound = 2 * (kFilmed - 1);
static_assert(kLongRunUnit == kTenths * kRound);
constexpr std::array<Film100, 2> kFilms{{{"two cars drive", kMovingScene, 6},  // to frame 301
                                         {"nothing moves", kStaticScene, 2}}};

double ResidentMegabytes() {
  std::ifstream statm("/proc/self/statm");
  double size = 0;
  double resident = 0;
  statm >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

struct Tenth {
  double median_ms = 0;
  double cpu_ms = 0;  // median
  double p99_ms = 0;
  double worst_ms = 0;
  MapMemory memory;
  double process_mb = 0;
};

std::vector<Tenth> RunLong(Method method, const MapConfig& config, const Footage& footage,
                           int frames) {
  Pipeline pipeline = ScalingPipeline(method, config, footage.info.objects);
  const int a_tenth = frames / kTenths;
  std::vector<Tenth> tenths;
  for (int i = 0; i < kTenths; ++i) {
    Times times;
    Times cpu;
    for (int k = 0; k < a_tenth; ++k) {
      const int at = k % kRound;
      const int filmed = at < kFilmed ? at : kRound - at;
      const double start = WallMilliseconds();
      const double cpu_start = CpuMilliseconds();
      pipeline.Process(footage.frames[static_cast<std::size_t>(filmed)]).value();
      times.ms.push_back(WallMilliseconds() - start);
      cpu.ms.push_back(CpuMilliseconds() - cpu_start);
    }
    tenths.push_back({times.Median(), cpu.Median(), times.Quantile(0.99), times.Worst(),
                      pipeline.map().Memory(), ResidentMegabytes()});
  }
  return tenths;
}

}  // namespace

Expected<void> MeasureLongRuns(const ScalingOptions& options) {
  TSDFPP_ASSIGN(MapConfig config, ScalingConfig());
  config.voxel_m = kVoxel_m;
  TSDFPP_RETURN_IF_ERROR(config.Validate());
  FigureTable table({"scene", "map", "tenth", "median ms", "CPU ms", "p99 ms", "worst ms", "blocks",
                     "map MB", "process MB"});
  FigureTable summary({"scene", "map", "first ms", "last ms", "last over first", "first CPU ms",
                       "last CPU ms", "CPU last over first", "blocks after the first",
                       "blocks at the end", "map MB", "process grew MB"});
  for (const Film100& film : kFilms) {
    TSDFPP_ASSIGN(const Footage footage,
                  Film({film.scene, kImageScale, film.step, 1 + film.step * (kFilmed - 1), {}}));
    if (footage.frames.size() != kFilmed) {
      return UsageError("{} has {} frames from which every {}th is taken, expected {}", film.scene,
                        footage.frames.size(), film.step, kFilmed);
    }
    for (const Method method : kScalingMethods) {
      const std::string name(MethodName(method));
      const std::vector<Tenth> tenths = RunLong(method, config, footage, options.frames);
      for (std::size_t i = 0; i < tenths.size(); ++i) {
        const Tenth& tenth = tenths[i];
        table.Add({film.name, name, std::to_string(i + 1), Cell(tenth.median_ms, 2),
                   Cell(tenth.cpu_ms, 2), Cell(tenth.p99_ms, 2), Cell(tenth.worst_ms, 2),
                   std::to_string(tenth.memory.blocks),
                   Cell(static_cast<double>(tenth.memory.bytes) / 1e6, 1),
                   Cell(tenth.process_mb, 0)});
      }
      const Tenth& first = tenths.front();
      const Tenth& last = tenths.back();
      summary.Add({film.name, name, Cell(first.median_ms, 2), Cell(last.median_ms, 2),
                   Cell(last.median_ms / first.median_ms, 2), Cell(first.cpu_ms, 2),
                   Cell(last.cpu_ms, 2), Cell(last.cpu_ms / first.cpu_ms, 2),
                   std::to_string(first.memory.blocks), std::to_string(last.memory.blocks),
                   Cell(static_cast<double>(last.memory.bytes) / 1e6, 1),
                   Cell(last.process_mb - first.process_mb, 1)});
    }
  }
  TSDFPP_RETURN_IF_ERROR(table.Write(options.out, "frames"));
  return summary.Write(options.out, "frames_summary");
}

}  // namespace tsdfpp
