#include "bench/rays.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "bench/clocks.h"
#include "bench/median.h"
#include "bench/open3d_rays.h"
#include "eval/open_source.h"
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

// Pixels by the cell of a grid over the ground that their point is in: side x side ids from 0 on.
cv::Mat SplitLabels(const Frame& frame, const Eigen::AlignedBox2d& ground, int side) {
  cv::Mat labels(frame.depth.size(), CV_16UC1, cv::Scalar(kNoInstance));
  const Intrinsics& k = frame.intrinsics;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const double z = frame.depth.at<float>(v, u);
      if (!IsValidDepth(static_cast<float>(z))) continue;
      const Eigen::Vector3d p_W =
          frame.T_WC * Eigen::Vector3d(z * (u - k.cx) / k.fx, z * (v - k.cy) / k.fy, z);
      const Eigen::Vector2d share =
          (p_W.head<2>() - ground.min()).cwiseQuotient(ground.sizes()) * side;
      const int x = std::clamp(static_cast<int>(std::floor(share.x())), 0, side - 1);
      const int y = std::clamp(static_cast<int>(std::floor(share.y())), 0, side - 1);
      labels.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(y * side + x);
    }
  }
  return labels;
}

// The middle 90 % of the points that a frame shows, along each axis of the ground.
Eigen::AlignedBox2d GroundOf(const Frame& frame) {
  std::array<std::vector<double>, 2> along;
  const Intrinsics& k = frame.intrinsics;
  for (int v = 0; v < k.height; v += 4) {
    for (int u = 0; u < k.width; u += 4) {
      const double z = frame.depth.at<float>(v, u);
      if (!IsValidDepth(static_cast<float>(z))) continue;
      const Eigen::Vector3d p_W =
          frame.T_WC * Eigen::Vector3d(z * (u - k.cx) / k.fx, z * (v - k.cy) / k.fy, z);
      along[0].push_back(p_W.x());
      along[1].push_back(p_W.y());
    }
  }
  Eigen::AlignedBox2d ground(Eigen::Vector2d::Zero().eval());
  for (int a = 0; a < 2; ++a) {
    std::vector<double>& values = along[static_cast<std::size_t>(a)];
    std::sort(values.begin(), values.end());
    ground.min()[a] = values[values.size() / 20];
    ground.max()[a] = values[values.size() - 1 - values.size() / 20];
  }
  return ground;
}

// The same frames under 1, 4, 16 and 64 ids.
void SplitIds(const std::vector<Frame>& frames, const MapConfig& config, int repeats) {
  constexpr std::size_t kFrames = 8;  // in which nothing moves far
  constexpr std::array<int, 4> kSides{1, 2, 4, 8};
  const std::size_t count = std::min(kFrames, frames.size());
  const Eigen::AlignedBox2d ground = GroundOf(frames.front());
  struct Row {
    std::string name;
    Method method;
    bool moved;
  };
  const std::vector<Row> rows{{"tsdf++", Method::kTsdfpp, false},
                              {"tsdf++/anchored", Method::kTsdfppAnchored, false},
                              {"tsdf++/anchored, all moved", Method::kTsdfppAnchored, true},
                              {"volumes", Method::kVolumes, false},
                              {"volumes, all moved", Method::kVolumes, true}};
  std::printf("\nthe same visible geometry under many ids, ms wall (CPU), frame %d\n%-28s",
              frames[count - 1].index, "");
  for (const int side : kSides) std::printf(" %16d", side * side);
  std::printf(" %12s\n", "64 over 1");
  for (const Row& row : rows) {
    std::vector<std::unique_ptr<MapRepresentation>> maps;
    for (const int side : kSides) {
      maps.push_back(MakeMap(row.method, config));
      for (std::size_t i = 0; i < count; ++i) {
        maps.back()->Fuse(frames[i], SplitLabels(frames[i], ground, side));
      }
      for (int id = 0; row.moved && id < side * side; ++id) {
        // By so little that the geometry stays, and by enough that no lattice is the world's.
        Pose T_WO = Pose::Identity();
        maps.back()->SetObjectPose(static_cast<InstanceId>(id), T_WO);
        T_WO.rotate(Eigen::AngleAxisd(1e-6 * (id + 1), Eigen::Vector3d::UnitZ()));
        maps.back()->SetObjectPose(static_cast<InstanceId>(id), T_WO);
      }
      maps.back()->SceneMesh();  // brings the index up to date
    }
    // In turn, so that what else the machine does meets all of them.
    std::vector<RayTiming> best(maps.size());
    for (int repeat = 0; repeat < 3 * repeats; ++repeat) {
      for (std::size_t m = 0; m < maps.size(); ++m) {
        const RayTiming timing = Cast(*maps[m], frames[count - 1], 1);
        if (repeat == 0 || timing.wall_ms < best[m].wall_ms) best[m].wall_ms = timing.wall_ms;
        if (repeat == 0 || timing.cpu_ms < best[m].cpu_ms) best[m].cpu_ms = timing.cpu_ms;
      }
    }
    std::printf("%-28s", row.name.c_str());
    for (const RayTiming& timing : best) {
      std::printf(" %16s", fmt::format("{:.1f} ({:.1f})", timing.wall_ms, timing.cpu_ms).c_str());
    }
    std::printf(" %12s\n", fmt::format("{:.2f} ({:.2f})", best.back().wall_ms / best[0].wall_ms,
                                       best.back().cpu_ms / best[0].cpu_ms)
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
  const auto peer = CastWithOpen3d(frames, cast, map.voxel_m, map.trunc_front_voxels,
                                   options.threads, options.repeats, options.limit_s);
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(options.threads));
  std::printf("%s, frames %d to %d, a cast every %d, %dx%d, profile %s, %d threads; medians\n",
              info.name.c_str(), frames.front().index, frames.back().index, options.every,
              info.intrinsics.width, info.intrinsics.height, options.profile.c_str(),
              options.threads);
  std::printf("%-28s %9s %9s %12s %12s %8s\n", "", "wall ms", "CPU ms", "Open3D over", "error mm",
              "seen");
  std::optional<double> peer_ms;
  if (peer && !peer->empty()) {
    peer_ms = MedianOf(*peer, &RayTiming::wall_ms);
    PrintLine("Open3D VoxelBlockGrid", *peer, peer_ms);
  } else {
    std::printf("%-28s %s\n", "Open3D VoxelBlockGrid",
                peer ? "no casts" : peer.error().message.c_str());
  }
  for (const Method method : AllMethods()) {
    Pipeline pipeline(PipelineConfig{method, map, PoseSource::kGiven, {}}, info.objects);
    std::vector<RayTiming> timings;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      pipeline.Process(frames[i]);
      if (cast[i]) timings.push_back(Cast(pipeline.map(), frames[i], options.repeats));
    }
    PrintLine(std::string(MethodName(method)), timings, peer_ms);
  }
  SplitIds(frames, map, options.repeats);
  return {};
}

}  // namespace tsdfpp
