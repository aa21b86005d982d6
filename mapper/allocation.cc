#include "mapper/allocation.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <set>

#include "mapper/fusion_kernels.h"

namespace tsdfpp {
namespace {

constexpr int kPixelStride = 4;  // a block is far larger than four pixels
constexpr int kRowsPerTask = 32;
constexpr int kNowhere = std::numeric_limits<int>::max();

// Remembers the keys met lately, so that most repetitions are dropped before sorting.
class RecentKeys {
 public:
  RecentKeys() : keys_(kSlots, ~0ULL) {}
  bool Insert(std::uint64_t key) {
    std::uint64_t& slot = keys_[(key * 0x9E3779B97F4A7C15ULL) >> 52U];
    if (slot == key) return false;
    slot = key;
    return true;
  }

 private:
  static constexpr std::size_t kSlots = 4096;
  std::vector<std::uint64_t> keys_;
};

struct Lattice {
  Eigen::Matrix3d R_LC;
  Eigen::Vector3d camera_L;
};

// Appends (label, packed block) of the rows [begin, end).
void CollectRows(const FrameView& frame, const MapConfig& config,
                 const std::map<InstanceId, Lattice>& lattices, int begin, int end,
                 std::vector<std::pair<InstanceId, std::uint64_t>>& out) {
  const double inverse_voxel = 1.0 / config.voxel_m;
  const double front = config.trunc_front_voxels * config.voxel_m;
  const double back = config.trunc_back_voxels * config.voxel_m;
  const double step = 2 * config.voxel_m;
  const Intrinsics& k = frame.intrinsics;
  std::map<InstanceId, RecentKeys> recent;
  BlocksOfPoints blocks(static_cast<std::size_t>((front + back) / step) + 3);
  InstanceId last_label = kNoInstance;
  const Lattice* lattice = nullptr;
  RecentKeys* keys = nullptr;
  for (int v = begin; v < end; v += kPixelStride) {
    for (int u = 0; u < frame.width; u += kPixelStride) {
      const auto pixel = static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width) +
                         static_cast<std::size_t>(u);
      const double depth = frame.depth[pixel];
      if (depth <= 0) continue;
      const InstanceId label = frame.label[pixel];
      if (label != last_label) {
        last_label = label;
        lattice = &lattices.at(label);
        keys = &recent[label];
      }
      Eigen::Vector3d ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
      const double length = ray.norm();
      const double range = depth * length;
      ray /= length;
      const Eigen::Vector3d direction = lattice->R_LC * ray * inverse_voxel;
      const Eigen::Vector3d origin = lattice->camera_L * inverse_voxel;
      Index3 last_block{kNowhere, kNowhere, kNowhere};
      const auto visit = [&](const Index3& block) {
        if (block == last_block) return;
        last_block = block;
        const std::uint64_t key = PackIndex(block);
        if (keys->Insert(key)) out.emplace_back(label, key);
      };
      const double first = range - front;
      const double last = range + back;
      std::size_t points = 1;  // the last one included
      while (first + step * static_cast<double>(points - 1) < last) ++points;
      BlocksAtPoints({origin.x(), origin.y(), origin.z()},
                     {direction.x(), direction.y(), direction.z()}, {first, step, last}, points,
                     blocks);
      for (std::size_t i = 0; i < points; ++i) {
        if (first + step * static_cast<double>(i) >= 0) {
          visit({blocks.x[i], blocks.y[i], blocks.z[i]});
        }
      }
    }
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

}  // namespace

std::map<InstanceId, std::vector<Index3>> BlocksAlongRays(
    const FrameView& frame, const MapConfig& config,
    const std::function<Pose(InstanceId)>& T_WL_of) {
  std::set<InstanceId> labels;
  InstanceId last_label = kNoInstance;
  for (int v = 0; v < frame.height; v += kPixelStride) {
    const auto row = static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width);
    for (int u = 0; u < frame.width; u += kPixelStride) {
      const InstanceId label = frame.label[row + static_cast<std::size_t>(u)];
      if (label != last_label) labels.insert(last_label = label);
    }
  }
  std::map<InstanceId, Lattice> lattices;
  for (const InstanceId label : labels) {
    const Pose T_LC = T_WL_of(label).inverse() * frame.T_WC;
    lattices[label] = {T_LC.linear(), T_LC.translation()};
  }

  const int tasks = (frame.height + kRowsPerTask - 1) / kRowsPerTask;
  std::vector<std::vector<std::pair<InstanceId, std::uint64_t>>> found(
      static_cast<std::size_t>(tasks));
  tbb::parallel_for(
      tbb::blocked_range<int>(0, tasks, 1),
      [&](const tbb::blocked_range<int>& range) {
        for (int task = range.begin(); task != range.end(); ++task) {
          CollectRows(frame, config, lattices, task * kRowsPerTask,
                      std::min(frame.height, (task + 1) * kRowsPerTask),
                      found[static_cast<std::size_t>(task)]);
        }
      },
      tbb::simple_partitioner());

  std::map<InstanceId, std::vector<Index3>> blocks;
  std::map<InstanceId, std::vector<std::uint64_t>> keys;
  for (const auto& task : found) {
    for (const auto& [label, key] : task) keys[label].push_back(key);
  }
  for (auto& [label, list] : keys) {
    // The key's order is Index3's.
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    std::vector<Index3>& indices = blocks[label];
    indices.reserve(list.size());
    for (const std::uint64_t key : list) indices.push_back(UnpackIndex(key));
  }
  return blocks;
}

}  // namespace tsdfpp
