#include "mapper/volume/allocation.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "mapper/volume/frame_kernels.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kGrids = 4;      // of pixels: all, every 2nd, 4th and 8th
constexpr double kSpacing_voxels = 3;  // the most between two pixels of a grid, at their depth
constexpr int kTileRowsPerTask = 3;
static_assert(kTile_px % (1 << (kGrids - 1)) == 0);

struct Found {
  InstanceId label = kNoInstance;
  std::uint64_t key = ~0ULL;  // of PackIndex
  auto operator<=>(const Found&) const = default;
};

// Remembers what was met lately, so that most repetitions are dropped before they are looked up.
class RecentlyFound {
 public:
  RecentlyFound() : slots_(kSlots, kNothing) {}
  bool Insert(std::uint64_t key) {
    return std::exchange(slots_[(key * 0x9E3779B97F4A7C15ULL) >> kShift], key) != key;
  }

 private:
  static constexpr unsigned kShift = 53;
  static constexpr std::size_t kSlots = 1U << (64U - kShift);
  static constexpr std::uint64_t kNothing = ~0ULL;  // no block's key
  std::vector<std::uint64_t> slots_;
};

struct Lattice {
  CameraInLattice camera;
  const BlockDirectory* known = nullptr;
  RecentlyFound recent;
};

RayPoints PointsOf(const MapConfig& config) {
  RayPoints points;
  points.front = config.trunc_front_voxels * config.voxel_m;
  points.back = config.trunc_back_voxels * config.voxel_m;
  points.step = 2 * config.voxel_m;
  // Two more than whole steps fit: the first one, and the last that reaches `back`; one for
  // rounding.
  points.points = static_cast<std::size_t>((points.front + points.back) / points.step) + 3;
  return points;
}

// Collects the blocks along the rays of one thread's part of the image.
class Collector {
 public:
  Collector(const FrameView& frame, const MapConfig& config,
            const std::function<LatticeOfLabel(InstanceId)>& lattice_of,
            const std::vector<double>& ray_x)
      : frame_(frame),
        lattice_of_(lattice_of),
        ray_x_(ray_x),
        voxel_m_(config.voxel_m),
        points_(PointsOf(config)),
        keys_(kRaysAtOnce * points_.points + kKeysPerStep) {
    const Intrinsics& k = frame.intrinsics;
    for (std::size_t i = 0; i < reach_.size(); ++i) {
      reach_[i] = kSpacing_voxels * config.voxel_m * std::min(k.fx, k.fy) / (1 << i);
    }
  }

  // All the pixels of a tile that its grids need.
  void VisitTile(int tile_column, int tile_row) {
    const Tile& tile =
        frame_.tiles[static_cast<std::size_t>(tile_row * frame_.tiles_per_row + tile_column)];
    if (tile.farthest <= 0) return;
    std::size_t finest = kGrids - 1;
    while (finest > 0 && tile.farthest > reach_[finest]) --finest;
    const int step = 1 << finest;
    const int right = std::min(frame_.width, (tile_column + 1) * kTile_px);
    const int bottom = std::min(frame_.height, (tile_row + 1) * kTile_px);
    for (int v = tile_row * kTile_px; v < bottom; v += step) {
      for (int u = tile_column * kTile_px; u < right; u += step) Visit(u, v);
    }
  }

  // Each once, in order.
  std::vector<Found> Take() {
    Flush();
    std::sort(found_.begin(), found_.end());
    found_.erase(std::unique(found_.begin(), found_.end()), found_.end());
    return std::move(found_);
  }

 private:
  // The coarsest grid that a pixel belongs to, as a power of two.
  static std::size_t GridOf(int u, int v) {
    const auto either = static_cast<unsigned>(u | v) | 1U << (kGrids - 1);
    return static_cast<std::size_t>(std::countr_zero(either));
  }

  void Visit(int u, int v) {
    const auto pixel = static_cast<std::size_t>(v) * static_cast<std::size_t>(frame_.width) +
                       static_cast<std::size_t>(u);
    if (!frame_.IsUsable(pixel)) return;
    const double depth = frame_.kernel.depth[pixel];
    const std::size_t grid = GridOf(u, v);
    if (grid + 1 < kGrids && depth <= reach_[grid + 1]) return;
    const InstanceId label = frame_.kernel.label[pixel];
    if (label != label_ || rays_.count == kRaysAtOnce) Flush();
    label_ = label;
    const Intrinsics& k = frame_.intrinsics;
    const std::size_t i = rays_.count++;
    rays_.x[i] = ray_x_[static_cast<std::size_t>(u)];
    rays_.y[i] = (v - k.cy) / k.fy;
    rays_.depth[i] = depth;
  }

  // Finds the blocks along the rays that were visited.
  void Flush() {
    if (rays_.count == 0) return;
    Lattice& lattice = LatticeOf(label_);
    const std::size_t found = BlocksAtPoints(lattice.camera, points_, rays_, keys_.data());
    rays_.count = 0;
    for (std::size_t i = 0; i < found; ++i) {
      if (!lattice.recent.Insert(keys_[i])) continue;
      if (lattice.known == nullptr ||
          lattice.known->Find(UnpackIndex(keys_[i])) == BlockDirectory::kNone) {
        found_.push_back({label_, keys_[i]});
      }
    }
  }

  Lattice& LatticeOf(InstanceId label) {
    const auto [at, added] = lattices_.try_emplace(label);
    if (added) {
      const LatticeOfLabel of = lattice_of_(label);
      const Pose T_LC = of.T_WL.inverse() * frame_.T_WC;
      CameraInLattice& camera = at->second.camera;
      camera.inverse_voxel = 1.0 / voxel_m_;
      for (int r = 0; r < 3; ++r) {
        const auto row = static_cast<std::size_t>(r);
        for (int c = 0; c < 3; ++c) {
          camera.R_LC[row][static_cast<std::size_t>(c)] = T_LC.linear()(r, c);
        }
        camera.origin[row] = T_LC.translation()[r] * camera.inverse_voxel;
      }
      at->second.known = of.known;
    }
    return at->second;
  }

  const FrameView& frame_;
  const std::function<LatticeOfLabel(InstanceId)>& lattice_of_;
  const std::vector<double>& ray_x_;  // at depth 1, by column
  double voxel_m_;
  RayPoints points_;
  std::array<double, kGrids> reach_{};  // metres: farther than this, the grid is too coarse
  InstanceId label_ = kNoInstance;      // of the rays
  RayBatch rays_;
  std::vector<std::uint64_t> keys_;  // of the blocks along them
  std::map<InstanceId, Lattice> lattices_;
  std::vector<Found> found_;
};

}  // namespace

std::map<InstanceId, std::vector<Index3>> BlocksAlongRays(
    const FrameView& frame, const MapConfig& config,
    const std::function<LatticeOfLabel(InstanceId)>& lattice_of) {
  const int rows = static_cast<int>(frame.tiles.size()) / frame.tiles_per_row;
  const int tasks = (rows + kTileRowsPerTask - 1) / kTileRowsPerTask;
  std::vector<std::vector<Found>> found(static_cast<std::size_t>(tasks));
  std::vector<double> ray_x;
  for (int u = 0; u < frame.width; ++u) {
    ray_x.push_back((u - frame.intrinsics.cx) / frame.intrinsics.fx);
  }
  tbb::parallel_for(
      tbb::blocked_range<int>(0, tasks, 1),
      [&](const tbb::blocked_range<int>& range) {
        for (int task = range.begin(); task != range.end(); ++task) {
          Collector collector(frame, config, lattice_of, ray_x);
          const int end = std::min(rows, (task + 1) * kTileRowsPerTask);
          for (int row = task * kTileRowsPerTask; row < end; ++row) {
            for (int column = 0; column < frame.tiles_per_row; ++column) {
              collector.VisitTile(column, row);
            }
          }
          found[static_cast<std::size_t>(task)] = collector.Take();
        }
      },
      tbb::simple_partitioner());

  std::vector<Found> all;
  for (const auto& task : found) all.insert(all.end(), task.begin(), task.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  // The key's order is Index3's.
  std::map<InstanceId, std::vector<Index3>> blocks;
  for (const Found& of : all) blocks[of.label].push_back(UnpackIndex(of.key));
  return blocks;
}

}  // namespace tsdfpp
