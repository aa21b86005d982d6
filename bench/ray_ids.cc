#include "bench/ray_ids.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "bench/clocks.h"
#include "core/pixel_ray.h"
#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

// Pixels by the cell of a grid over the ground that their point is in: side x side ids from 0 on.
cv::Mat SplitLabels(const Frame& frame, const Eigen::AlignedBox2d& ground, int side) {
  cv::Mat labels(frame.depth.size(), CV_16UC1, cv::Scalar(kNoInstance));
  const Intrinsics& k = frame.intrinsics;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const double z = frame.depth.at<float>(v, u);
      if (!IsValidDepth(static_cast<float>(z))) continue;
      const Eigen::Vector3d p_W = frame.T_WC * (z * PixelRay(k, u, v));
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
      const Eigen::Vector3d p_W = frame.T_WC * (z * PixelRay(k, u, v));
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

struct Row {
  const char* name;
  Method method;
  bool moved;
};
constexpr std::array<Row, 7> kRows{{{"tsdf", Method::kTsdf, false},
                                    {"tsdf++/literal", Method::kTsdfppLiteral, false},
                                    {"tsdf++", Method::kTsdfpp, false},
                                    {"tsdf++/anchored", Method::kTsdfppAnchored, false},
                                    {"tsdf++/anchored moved", Method::kTsdfppAnchored, true},
                                    {"volumes", Method::kVolumes, false},
                                    {"volumes moved", Method::kVolumes, true}}};

std::unique_ptr<MapRepresentation> MapSplit(const Row& row, const std::vector<Frame>& frames,
                                            std::size_t count, const MapConfig& config,
                                            const Eigen::AlignedBox2d& ground, int side) {
  auto map = MakeMap(row.method, config);
  for (std::size_t i = 0; i < count; ++i) {
    map->Fuse(frames[i], SplitLabels(frames[i], ground, side));
  }
  for (int id = 0; row.moved && id < side * side; ++id) {
    // By so little that the geometry stays, and by enough that no lattice is the world's.
    Pose T_WO = Pose::Identity();
    map->SetObjectPose(static_cast<InstanceId>(id), T_WO);
    T_WO.rotate(Eigen::AngleAxisd(1e-6 * (id + 1), Eigen::Vector3d::UnitZ()));
    map->SetObjectPose(static_cast<InstanceId>(id), T_WO);
  }
  if (const VoxelInspection* voxels = map->inspection()) {
    voxels->ListAt(Eigen::Vector3i::Zero());  // brings the index up to date
  }
  return map;
}

}  // namespace

std::vector<SplitTiming> CastSplitIds(const std::vector<Frame>& frames, const MapConfig& config,
                                      int repeats) {
  constexpr std::size_t kFrames = 8;
  const std::size_t count = std::min(kFrames, frames.size());
  const Eigen::AlignedBox2d ground = GroundOf(frames.front());
  RayCastOptions options;
  options.colour = false;
  std::vector<SplitTiming> timings;
  for (const Row& row : kRows) {
    std::vector<std::unique_ptr<MapRepresentation>> maps;
    for (const int side : kSplitSides) {
      maps.push_back(MapSplit(row, frames, count, config, ground, side));
    }
    constexpr double kNone = std::numeric_limits<double>::infinity();
    SplitTiming best{row.name, std::vector<double>(maps.size(), kNone),
                     std::vector<double>(maps.size(), kNone), std::vector<double>(maps.size())};
    // In turn, so that what else the machine does meets all of them.
    for (int repeat = 0; repeat < repeats; ++repeat) {
      for (std::size_t m = 0; m < maps.size(); ++m) {
        const double wall = WallMilliseconds();
        const double cpu = CpuMilliseconds();
        const std::vector<RaySurface> surfaces =
            maps[m]->CastRays(frames[count - 1].intrinsics, frames[count - 1].T_WC, options);
        best.wall_ms[m] = std::min(best.wall_ms[m], WallMilliseconds() - wall);
        best.cpu_ms[m] = std::min(best.cpu_ms[m], CpuMilliseconds() - cpu);
        const cv::Mat& depth = surfaces.front().depth;
        best.hit[m] =
            static_cast<double>(cv::countNonZero(depth)) / static_cast<double>(depth.total());
      }
    }
    timings.push_back(std::move(best));
  }
  return timings;
}

}  // namespace tsdfpp
