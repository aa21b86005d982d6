#include "bench/rays.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>

#include "bench/clocks.h"
#include "bench/median.h"
#include "bench/open3d_rays.h"
#include "bench/ray_ids.h"
#include "eval/run/open_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
namespace {

RayTiming Cast(const MapRepresentation& map, const Frame& frame, int repeats) {
  RayCastOptions options;
  options.colour = false;
  RayTiming best;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    const double wall = WallMilliseconds();
    const double cpu = CpuMilliseconds();
    const std::vector<RaySurface> surfaces = map.CastRays(frame.intrinsics, frame.T_WC, options);
    const double took = WallMilliseconds() - wall;
    const double cpu_took = CpuMilliseconds() - cpu;
    if (repeat > 0 && took >= best.wall_ms) continue;
    best.wall_ms = took;
    best.cpu_ms = cpu_took;
    ScoreDepth(surfaces.front().depth, frame, best);
  }
  return best;
}

double MedianOf(const std::vector<RayTiming>& timings, double RayTiming::*field) {
  std::vector<double> values;
  for (const RayTiming& timing : timings) values.push_back(timing.*field);
  return Median(std::move(values));
}

void PrintLine(const std::string& name, const std::vector<RayTiming>& timings,
               const std::optional<double>& peer_ms) {
  const double wall = MedianOf(timings, &RayTiming::wall_ms);
  std::printf("%-28s %9.1f %9.1f %12s %12.2f %8.3f\n", name.c_str(), wall,
              MedianOf(timings, &RayTiming::cpu_ms),
              peer_ms ? fmt::format("{:.1f}", *peer_ms / wall).c_str() : "-",
              MedianOf(timings, &RayTiming::median_error_mm), MedianOf(timings, &RayTiming::seen));
}

void PrintSplitIds(const std::vector<Frame>& frames, const MapConfig& config, int repeats) {
  std::printf("\nthe same visible geometry under many ids, ms wall (CPU)\n%-28s", "");
  for (const int side : kSplitSides) std::printf(" %16d", side * side);
  std::printf(" %12s\n", "64 over 1");
  for (const SplitTiming& timing : CastSplitIds(frames, config, repeats)) {
    std::printf("%-28s", timing.name.c_str());
    for (std::size_t i = 0; i < timing.wall_ms.size(); ++i) {
      std::printf(" %16s",
                  fmt::format("{:.1f} ({:.1f})", timing.wall_ms[i], timing.cpu_ms[i]).c_str());
    }
    std::printf(" %12s\n",
                fmt::format("{:.2f} ({:.2f})", timing.wall_ms.back() / timing.wall_ms.front(),
                            timing.cpu_ms.back() / timing.cpu_ms.front())
                    .c_str());
  }
}

}  // namespace

Expected<void> RunRaysBench(const RaysBenchOptions& options) {
  std::vector<Frame> frames;
  SequenceInfo info;
  {
    TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
    info = source->info();
    const int count = std::min(info.frame_count, options.frames);
    for (int i = 0; i < count; ++i) {
      TSDFPP_ASSIGN(Frame frame, source->Read(info.first_index + i));
      frames.push_back(std::move(frame));
    }
  }
  std::vector<bool> cast;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    cast.push_back(static_cast<int>(i + 1) % options.every == 0);
  }
  MapConfig map;
  TSDFPP_RETURN_IF_ERROR(map.SetProfile(options.profile));
  std::map<int, Expected<std::vector<RayTiming>>> peers;  // by the side of its blocks
  std::optional<double> peer_ms;                          // the fastest one's
  for (const int side : {8, 16}) {
    auto peer = CastWithOpen3d(frames, cast, map.voxel_m, options.open3d_band, side,
                               options.threads, options.repeats, options.limit_s);
    if (peer && !peer->empty()) {
      const double wall_ms = MedianOf(*peer, &RayTiming::wall_ms);
      peer_ms = std::min(wall_ms, peer_ms.value_or(wall_ms));
    }
    peers.emplace(side, std::move(peer));
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(options.threads));
  std::printf(
      "%s, frames %d to %d, a cast every %d, %dx%d, profile %s (bands of %g voxels in front, %g "
      "behind; Open3D's of %g), %d threads; medians\n",
      info.name.c_str(), frames.front().index, frames.back().index, options.every,
      info.intrinsics.width, info.intrinsics.height, options.profile.c_str(),
      map.trunc_front_voxels, map.trunc_back_voxels, options.open3d_band, options.threads);
  std::printf("%-28s %9s %9s %12s %12s %8s\n", "", "wall ms", "CPU ms", "Open3D over", "error mm",
              "seen");
  for (const auto& [side, peer] : peers) {
    const std::string name = fmt::format("Open3D VoxelBlockGrid {}^3", side);
    if (peer && !peer->empty()) {
      PrintLine(name, *peer, peer_ms);
    } else {
      std::printf("%-28s %s\n", name.c_str(), peer ? "no casts" : peer.error().message.c_str());
    }
  }
  for (const Method method : AllMethods()) {
    Pipeline pipeline(PipelineConfig{.method = method, .map = map}, info.objects);
    std::vector<RayTiming> timings;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      TSDFPP_RETURN_IF_ERROR(pipeline.Process(frames[i]));
      if (cast[i]) timings.push_back(Cast(pipeline.map(), frames[i], options.repeats));
    }
    PrintLine(std::string(MethodName(method)), timings, peer_ms);
  }
  PrintSplitIds(frames, map, 3 * options.repeats);
  return {};
}

}  // namespace tsdfpp
