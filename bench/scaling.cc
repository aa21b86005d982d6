#include "bench/scaling.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/ray_ids.h"
#include "bench/scaling_runs.h"
#include "core/files.h"
#include "eval/gate_reference.h"

namespace tsdfpp {
namespace {

// How many programs wanted a core, over the last minute; 0 where the system does not say.
double LoadAverage() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

}  // namespace

Expected<void> MeasureIds(const ScalingOptions& options) {
  constexpr int kFrames = 8;
  TSDFPP_ASSIGN(const Footage footage, Film({kMovingScene, 1, 1, kFrames, {}}));
  TSDFPP_ASSIGN(const MapConfig config, ScalingConfig());
  FigureTable table({"map", "ids", "ms", "CPU ms", "over one id", "CPU over one id", "pixels hit"});
  for (const SplitTiming& timing : CastSplitIds(footage.frames, config, 3 * options.runs)) {
    for (std::size_t i = 0; i < timing.wall_ms.size(); ++i) {
      table.Add({timing.name, std::to_string(kSplitSides[i] * kSplitSides[i]),
                 Cell(timing.wall_ms[i], 1), Cell(timing.cpu_ms[i], 1),
                 Cell(timing.wall_ms[i] / timing.wall_ms[0], 2),
                 Cell(timing.cpu_ms[i] / timing.cpu_ms[0], 2), Cell(timing.hit[i], 4)});
    }
  }
  return table.Write(options.out, "ids");
}

Expected<void> RunScaling(const ScalingOptions& options) {
  struct Part {
    const char* name;
    Expected<void> (*measure)(const ScalingOptions&);
  };
  constexpr std::array<Part, 5> kParts{{{"frames", MeasureLongRuns},
                                        {"surface", MeasureSurface},
                                        {"threads", MeasureThreads},
                                        {"poses", MeasurePoses},
                                        {"ids", MeasureIds}}};
  for (const std::string& wanted : options.parts) {
    const auto is_wanted = [&](const Part& part) { return part.name == wanted; };
    if (std::none_of(kParts.begin(), kParts.end(), is_wanted)) {
      return UsageError(
          "--parts has '{}', expected some of frames, surface, threads, poses and ids", wanted);
    }
  }
  if (options.frames < kLongRunUnit || options.frames % kLongRunUnit != 0) {
    return UsageError("--frames is {}, expected a multiple of {}", options.frames, kLongRunUnit);
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));
  FigureTable machine({"processor", "cores", "load before", "load at the end"});
  const double load = LoadAverage();
  for (const Part& part : kParts) {
    if (std::find(options.parts.begin(), options.parts.end(), part.name) == options.parts.end()) {
      continue;
    }
    const double start = WallMilliseconds();
    TSDFPP_RETURN_IF_ERROR(part.measure(options));
    fmt::print("{}: {} ({:.0f} s)\n", part.name, options.out, 1e-3 * (WallMilliseconds() - start));
    std::fflush(stdout);
  }
  machine.Add({MachineName(), std::to_string(std::thread::hardware_concurrency()), Cell(load, 1),
               Cell(LoadAverage(), 1)});
  return machine.Write(options.out, "machine");
}

}  // namespace tsdfpp
