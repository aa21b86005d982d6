#include "bench/scaling.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <thread>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/ray_ids.h"
#include "bench/scaling_runs.h"
#include "core/files.h"
#include "eval/gate/gate_reference.h"

namespace tsdfpp {
namespace {

const std::vector<std::string> kMachineColumns{"part",    "processor",   "cores",
                                               "seconds", "load before", "load after"};

// How many programs wanted a core, over the last minute; 0 where the system does not say.
double LoadAverage() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

// The row of each part in machine.csv, those of parts that an earlier run measured there included.
using MachineRows = std::map<std::string, std::vector<std::string>>;

MachineRows EarlierRows(const std::string& out) {
  MachineRows rows;
  std::ifstream file(out + "/machine.csv");
  std::string line;
  std::getline(file, line);  // the columns
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    std::vector<std::string> row;
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
    if (row.size() == kMachineColumns.size()) rows[row.front()] = row;
  }
  return rows;
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
  constexpr std::array<Part, 5> kParts{{{"ids", MeasureIds},
                                        {"poses", MeasurePoses},
                                        {"threads", MeasureThreads},
                                        {"surface", MeasureSurface},
                                        {"frames", MeasureLongRuns}}};
  for (const std::string& wanted : options.parts) {
    const auto is_wanted = [&](const Part& part) { return part.name == wanted; };
    if (std::none_of(kParts.begin(), kParts.end(), is_wanted)) {
      return UsageError(
          "--parts has '{}', expected some of ids, poses, threads, surface and frames", wanted);
    }
  }
  if (options.frames < kLongRunUnit || options.frames % kLongRunUnit != 0) {
    return UsageError("--frames is {}, expected a multiple of {}", options.frames, kLongRunUnit);
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));
  MachineRows rows = EarlierRows(options.out);
  for (const Part& part : kParts) {
    if (std::find(options.parts.begin(), options.parts.end(), part.name) == options.parts.end()) {
      continue;
    }
    const double start = WallMilliseconds();
    const double load = LoadAverage();
    TSDFPP_RETURN_IF_ERROR(part.measure(options));
    rows[part.name] = {part.name,
                       MachineName(),
                       std::to_string(std::thread::hardware_concurrency()),
                       Cell(1e-3 * (WallMilliseconds() - start), 0),
                       Cell(load, 1),
                       Cell(LoadAverage(), 1)};
    fmt::print("{}: {} ({:.0f} s)\n", part.name, options.out, 1e-3 * (WallMilliseconds() - start));
    std::fflush(stdout);
  }
  FigureTable machine(kMachineColumns);
  for (const auto& [part, row] : rows) machine.Add(row);
  return machine.Write(options.out, "machine");
}

}  // namespace tsdfpp
