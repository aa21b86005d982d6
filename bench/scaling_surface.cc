// Does the cost of a frame grow with what it shows, and no faster?
#include <array>
#include <cmath>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/scaling.h"
#include "bench/scaling_runs.h"
#include "core/pixel_ray.h"

namespace tsdfpp {
namespace {

constexpr int kSurfaceFrames = 20;  // before the cars start
constexpr int kSurfaceWarmUp = 10;  // whose blocks are new
constexpr int kWindows = 8;         // eighths of the image's width
constexpr std::array<double, 2> kVoxels_m{0.01, 0.005};

// The frame with depth in the middle `eighths` of its columns alone.
Frame Windowed(const Frame& frame, int eighths) {
  Frame windowed = frame;
  windowed.depth = cv::Mat(frame.depth.size(), frame.depth.type(), cv::Scalar(0));
  const int width = frame.depth.cols * eighths / kWindows;
  const cv::Rect window((frame.depth.cols - width) / 2, 0, width, frame.depth.rows);
  frame.depth(window).copyTo(windowed.depth(window));
  return windowed;
}

// Surface that the frame shows: the squares between four pixels of nearly the same depth.
double VisibleSurface_m2(const Frame& frame) {
  constexpr double kJump = 0.05;  // of the depth; more is an edge
  const Intrinsics& k = frame.intrinsics;
  const auto point = [&](int u, int v) -> Eigen::Vector3d {
    return frame.depth.at<float>(v, u) * PixelRay(k, u, v);
  };
  double area = 0;
  for (int v = 0; v + 1 < k.height; ++v) {
    for (int u = 0; u + 1 < k.width; ++u) {
      const Eigen::Vector3d p = point(u, v);
      const Eigen::Vector3d right = point(u + 1, v);
      const Eigen::Vector3d below = point(u, v + 1);
      const bool valid = p.z() > 0 && std::abs(right.z() - p.z()) < kJump * p.z() &&
                         std::abs(below.z() - p.z()) < kJump * p.z();
      if (valid) area += (right - p).cross(below - p).norm();
    }
  }
  return area;
}

}  // namespace

Expected<void> MeasureSurface(const ScalingOptions& options) {
  TSDFPP_ASSIGN(const Footage footage, Film({kMovingScene, 1, 1, kSurfaceFrames, {}}));
  std::vector<double> area_m2;
  std::vector<std::vector<Frame>> windowed;
  for (int eighths = 1; eighths <= kWindows; ++eighths) {
    windowed.emplace_back();
    for (const Frame& frame : footage.frames) windowed.back().push_back(Windowed(frame, eighths));
    area_m2.push_back(VisibleSurface_m2(windowed.back().back()));
  }
  TSDFPP_ASSIGN(MapConfig config, ScalingConfig());
  FigureTable table({"voxel mm", "map", "visible m2", "frame ms", "CPU ms"});
  for (const double voxel_m : kVoxels_m) {
    config.voxel_m = voxel_m;
    TSDFPP_RETURN_IF_ERROR(config.Validate());
    for (const Method method : kScalingMethods) {
      for (std::size_t w = 0; w < windowed.size(); ++w) {
        std::vector<Times> wall(static_cast<std::size_t>(options.runs));
        std::vector<Times> cpu(wall.size());
        for (std::size_t run = 0; run < wall.size(); ++run) {
          Pipeline pipeline = ScalingPipeline(method, config, footage.info.objects);
          for (std::size_t i = 0; i < windowed[w].size(); ++i) {
            const double start = WallMilliseconds();
            const double cpu_start = CpuMilliseconds();
            pipeline.Process(windowed[w][i]).value();
            if (i < kSurfaceWarmUp) continue;
            wall[run].ms.push_back(WallMilliseconds() - start);
            cpu[run].ms.push_back(CpuMilliseconds() - cpu_start);
          }
        }
        table.Add({Cell(1e3 * voxel_m, 0), std::string(MethodName(method)), Cell(area_m2[w], 2),
                   Cell(LeastOf(wall).Median(), 2), Cell(LeastOf(cpu).Median(), 2)});
      }
    }
  }
  return table.Write(options.out, "surface");
}

}  // namespace tsdfpp
