#include "bench/open3d_rays.h"

#include <omp.h>
#include <open3d/core/Tensor.h>
#include <open3d/t/geometry/Image.h>
#include <open3d/t/geometry/VoxelBlockGrid.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstring>

#include "bench/clocks.h"
#include "bench/median.h"

namespace tsdfpp {
namespace {

namespace o3c = open3d::core;
using open3d::t::geometry::Image;
using open3d::t::geometry::VoxelBlockGrid;

o3c::Tensor Matrix(const Eigen::MatrixXd& matrix) {
  o3c::Tensor tensor = o3c::Tensor::Zeros({matrix.rows(), matrix.cols()}, o3c::Float64);
  auto* out = tensor.GetDataPtr<double>();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) *out++ = matrix(r, c);
  }
  return tensor;
}

Image ImageOf(const cv::Mat& mat, int channels) {
  cv::Mat floats;
  mat.convertTo(floats, CV_32F);
  return Image(o3c::Tensor(floats.ptr<float>(), {mat.rows, mat.cols, channels}, o3c::Float32));
}

// Pixels to a side of the tiles whose depth ranges it finds first: its default of 8 or one near it
// that divides both sides. Where it does not, the last rows read beyond the ranges, and a ray may
// have no end.
int RangeFactor(const Intrinsics& k) {
  for (const int factor : {8, 10, 12, 6, 5, 4, 3, 2}) {
    if (k.width % factor == 0 && k.height % factor == 0) return factor;
  }
  return 1;
}

std::vector<RayTiming> Measure(const std::vector<Frame>& frames, const std::vector<bool>& cast,
                               double voxel_m, double truncation_voxels, int side, int threads,
                               int repeats) {
  omp_set_num_threads(threads);
  constexpr float kFar_m = 10;
  constexpr int kReserve = 20000;  // of blocks of 16; of 8 they are as many as take half as much
  const auto truncation = static_cast<float>(truncation_voxels);
  VoxelBlockGrid grid({"tsdf", "weight", "color"}, {o3c::Float32, o3c::UInt16, o3c::UInt16},
                      {{1}, {1}, {3}}, static_cast<float>(voxel_m), side,
                      side < 16 ? 4 * kReserve : kReserve);
  std::vector<RayTiming> timings;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Frame& frame = frames[i];
    const Intrinsics& k = frame.intrinsics;
    Eigen::Matrix3d K;
    K << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1;
    const o3c::Tensor intrinsic = Matrix(K);
    const o3c::Tensor extrinsic = Matrix(frame.T_WC.inverse().matrix());
    const Image depth = ImageOf(frame.depth, 1);
    const Image colour = ImageOf(frame.colour, 3);
    const o3c::Tensor blocks =
        grid.GetUniqueBlockCoordinates(depth, intrinsic, extrinsic, 1.0F, kFar_m, truncation);
    grid.Integrate(blocks, depth, colour, intrinsic, extrinsic, 1.0F, kFar_m, truncation);
    if (!cast[i]) continue;
    RayTiming best;
    for (int repeat = 0; repeat < repeats; ++repeat) {
      const double wall = WallMilliseconds();
      const double cpu = CpuMilliseconds();
      const auto images =
          grid.RayCast(blocks, intrinsic, extrinsic, k.width, k.height, {"depth", "normal"}, 1.0F,
                       0.1F, kFar_m, 1.0F, truncation, RangeFactor(k));
      const double took = WallMilliseconds() - wall;
      const double cpu_took = CpuMilliseconds() - cpu;
      if (repeat > 0 && took >= best.wall_ms) continue;
      best.wall_ms = took;
      best.cpu_ms = cpu_took;
      o3c::Tensor seen = images.at("depth").Contiguous();
      ScoreDepth(cv::Mat(k.height, k.width, CV_32FC1, seen.GetDataPtr()), frame, best);
    }
    timings.push_back(best);
  }
  return timings;
}

}  // namespace

void ScoreDepth(const cv::Mat& depth, const Frame& frame, RayTiming& timing) {
  std::vector<double> errors;
  std::size_t valid = 0;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float z = frame.depth.at<float>(v, u);
      if (!IsValidDepth(z)) continue;
      ++valid;
      const float seen = depth.at<float>(v, u);
      if (seen > 0) errors.push_back(1e3 * std::abs(double{seen} - z));
    }
  }
  timing.seen = valid == 0 ? 0 : static_cast<double>(errors.size()) / static_cast<double>(valid);
  timing.median_error_mm = errors.empty() ? 0 : Median(std::move(errors));
}

Expected<std::vector<RayTiming>> CastWithOpen3d(const std::vector<Frame>& frames,
                                                const std::vector<bool>& cast, double voxel_m,
                                                double truncation_voxels, int side, int threads,
                                                int repeats, double limit_s) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return EnvironmentError("no pipe to the Open3D process");
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) return EnvironmentError("the Open3D process could not be started");
  if (child == 0) {
    close(ends[0]);
    const auto timings = Measure(frames, cast, voxel_m, truncation_voxels, side, threads, repeats);
    const std::size_t bytes = timings.size() * sizeof(RayTiming);
    // Far below what a pipe holds, so that this never waits for a reader.
    const bool written = write(ends[1], timings.data(), bytes) == static_cast<ssize_t>(bytes);
    _exit(written ? 0 : 1);
  }
  close(ends[1]);
  pollfd waiting{ends[0], POLLIN, 0};
  const bool in_time = poll(&waiting, 1, static_cast<int>(1e3 * limit_s)) > 0;
  if (!in_time) kill(child, SIGKILL);
  std::vector<RayTiming> timings(frames.size());
  const ssize_t bytes =
      in_time ? read(ends[0], timings.data(), timings.size() * sizeof(RayTiming)) : 0;
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (!in_time) return EnvironmentError("Open3D's RayCast took longer than {} s", limit_s);
  if (bytes <= 0) return EnvironmentError("the Open3D process ended without a result");
  timings.resize(static_cast<std::size_t>(bytes) / sizeof(RayTiming));
  return timings;
}

}  // namespace tsdfpp
