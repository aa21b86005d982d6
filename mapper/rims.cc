#include "mapper/rims.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "mapper/cube_masks.h"

namespace tsdfpp {
namespace {

// A cube's corners are within its diagonal of a point in it: 1.8 voxels, and the rounding of
// pixels.
constexpr double kRimReach_voxels = 2;
constexpr int kRowsPerTask = 16;
constexpr std::size_t kBlocksPerRimTask = 8;
// Distances of neighbours, or of their neighbours, that differ by more are of two surfaces: where
// one is seen at 75 degrees, a voxel's step changes the distance along the ray by four.
constexpr float kLargestStep_voxels = 4;

// A voxel without an observation in a cube in which the pixel sees the surface of `id`.
struct RimVoxel {
  InstanceId id = kNoInstance;
  Index3 voxel;
  std::uint32_t pixel = 0;
  auto Key() const { return std::tuple(id, voxel, pixel); }
};

// An object that is farther than this in front of what is beside it in the image ends there: what
// its surface goes on to is out of sight, and nobody knows whether it does.
constexpr float kInFront_voxels = 2;

// The pixels within reach of an outline of their own object, one byte each.
std::vector<std::uint8_t> PixelsAtOutlines(const FrameView& frame, double voxel_m) {
  const auto width = static_cast<std::size_t>(frame.width);
  std::vector<std::uint8_t> near(width * static_cast<std::size_t>(frame.height), 0);
  const double reach_px =
      kRimReach_voxels * voxel_m * std::max(frame.intrinsics.fx, frame.intrinsics.fy);
  const std::uint16_t* label = frame.kernel.label;
  const auto in_front_m = static_cast<float>(kInFront_voxels * voxel_m);
  // Of a pixel, and the one beside it, which has another label.
  const auto stamp = [&](std::size_t pixel, std::size_t beside) {
    if (!frame.IsUsable(pixel) || !frame.IsUsable(beside)) return;
    if (frame.kernel.depth[pixel] + in_front_m < frame.kernel.depth[beside]) return;
    const int u = static_cast<int>(pixel % width);
    const int v = static_cast<int>(pixel / width);
    const auto reach = static_cast<int>(
        std::min(std::ceil(reach_px / double{frame.kernel.depth[pixel]}), double{1 << 14}));
    const int left = std::max(0, u - reach);
    const int right = std::min(frame.width - 1, u + reach);
    for (int row = std::max(0, v - reach); row <= std::min(frame.height - 1, v + reach); ++row) {
      const std::size_t first = static_cast<std::size_t>(row) * width;
      for (std::size_t i = first + static_cast<std::size_t>(left);
           i <= first + static_cast<std::size_t>(right); ++i) {
        if (label[i] == label[pixel]) near[i] = 1;
      }
    }
  };
  const int columns = frame.tiles_per_row;
  const int rows = static_cast<int>(frame.tiles.size()) / columns;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      // Outlines run through the tile, or along its right or lower side.
      const auto tile = [&](int dx, int dy) -> const Tile& {
        const int x = std::min(column + dx, columns - 1);
        const int y = std::min(row + dy, rows - 1);
        return frame.tiles[static_cast<std::size_t>(y * columns + x)];
      };
      const Tile& own = tile(0, 0);
      const auto is_as_own = [&](const Tile& of) {
        return of.least_label == own.least_label && of.greatest_label == own.least_label;
      };
      if (is_as_own(own) && is_as_own(tile(1, 0)) && is_as_own(tile(0, 1))) continue;
      for (int v = row * kTile_px; v < std::min((row + 1) * kTile_px, frame.height); ++v) {
        for (int u = column * kTile_px; u < std::min((column + 1) * kTile_px, frame.width); ++u) {
          const std::size_t pixel =
              static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
          if (u + 1 < frame.width && label[pixel] != label[pixel + 1]) {
            stamp(pixel, pixel + 1);
            stamp(pixel + 1, pixel);
          }
          if (v + 1 < frame.height && label[pixel] != label[pixel + width]) {
            stamp(pixel, pixel + width);
            stamp(pixel + width, pixel);
          }
        }
      }
    }
  }
  return near;
}

// Reads voxels of one grid, which lie near each other.
class NearbyVoxels {
 public:
  explicit NearbyVoxels(const TsdfGrid& grid) : grid_(&grid) {}
  const TsdfBlock* BlockWith(const Index3& voxel) {
    const Index3 index = BlockOf(voxel);
    if (!known_ || index != index_) {
      known_ = true;
      index_ = index;
      block_ = grid_->Find(index);
    }
    return block_;
  }
  bool IsObserved(const Index3& voxel) {
    const TsdfBlock* block = BlockWith(voxel);
    return block != nullptr && Bit(block->observed, PlaceInBlock(voxel));
  }
  // Nothing where it is unobserved.
  std::optional<float> DistanceOf(const Index3& voxel) {
    const TsdfBlock* block = BlockWith(voxel);
    const int place = PlaceInBlock(voxel);
    if (block == nullptr || !Bit(block->observed, place)) return std::nullopt;
    return block->distance[static_cast<std::size_t>(place)];
  }

 private:
  const TsdfGrid* grid_;
  bool known_ = false;
  Index3 index_;
  const TsdfBlock* block_ = nullptr;
};

// By object and voxel, each once, with its first pixel.
std::vector<RimVoxel> FindRimVoxels(const FrameView& frame, const MapConfig& config,
                                    const ObjectVolumes& volumes) {
  const std::vector<std::uint8_t> near = PixelsAtOutlines(frame, config.voxel_m);
  const int tasks = (frame.height + kRowsPerTask - 1) / kRowsPerTask;
  std::vector<std::vector<RimVoxel>> found(static_cast<std::size_t>(tasks));
  const auto visit_row = [&](int v, std::vector<RimVoxel>& out) {
    InstanceId id = kNoInstance;
    Pose T_LC = Pose::Identity();
    std::optional<NearbyVoxels> voxels;
    Index3 last{std::numeric_limits<int>::max(), 0, 0};
    for (int u = 0; u < frame.width; ++u) {
      const std::size_t pixel =
          static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width) +
          static_cast<std::size_t>(u);
      if (near[pixel] == 0 || !frame.IsUsable(pixel)) continue;
      if (frame.kernel.label[pixel] != id) {
        id = frame.kernel.label[pixel];
        const auto volume = volumes.find(id);
        voxels.reset();
        last.x = std::numeric_limits<int>::max();
        if (volume == volumes.end()) continue;
        T_LC = volume->second.T_WL.inverse() * frame.T_WC;
        voxels.emplace(volume->second.grid);
      }
      if (!voxels) continue;
      const Intrinsics& k = frame.intrinsics;
      const double z = frame.kernel.depth[pixel];
      const Eigen::Vector3d p_L =
          T_LC * Eigen::Vector3d((u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z);
      const Index3 cube = FloorOf(p_L / config.voxel_m);
      if (cube == last) continue;
      last = cube;
      for (int i = 0; i < 8; ++i) {
        const Index3 corner = cube + Index3{i & 1, (i >> 1) & 1, i >> 2};
        if (voxels->IsObserved(corner)) continue;
        out.push_back({id, corner, static_cast<std::uint32_t>(pixel)});
      }
    }
  };
  tbb::parallel_for(
      tbb::blocked_range<int>(0, tasks, 1),
      [&](const tbb::blocked_range<int>& range) {
        for (int task = range.begin(); task != range.end(); ++task) {
          const int end = std::min(frame.height, (task + 1) * kRowsPerTask);
          for (int v = task * kRowsPerTask; v < end; ++v) {
            visit_row(v, found[static_cast<std::size_t>(task)]);
          }
        }
      },
      tbb::simple_partitioner());
  std::vector<RimVoxel> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  std::sort(all.begin(), all.end(),
            [](const RimVoxel& a, const RimVoxel& b) { return a.Key() < b.Key(); });
  const auto same = [](const RimVoxel& a, const RimVoxel& b) {
    return a.id == b.id && a.voxel == b.voxel;
  };
  all.erase(std::unique(all.begin(), all.end(), same), all.end());
  return all;
}

// The mean of what the distances along the 26 directions go on to, from the next voxel and the one
// after it.
std::optional<float> Continued(NearbyVoxels& voxels, const Index3& voxel, float largest_step) {
  float sum = 0;
  float count = 0;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        if (x == 0 && y == 0 && z == 0) continue;
        const auto next = voxels.DistanceOf(voxel + Index3{x, y, z});
        if (!next) continue;
        const auto after = voxels.DistanceOf(voxel + Index3{2 * x, 2 * y, 2 * z});
        if (!after || !(std::abs(*next - *after) <= largest_step)) continue;
        sum += (*next + *next) - *after;
        count += 1;
      }
    }
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

}  // namespace

void FuseRims(const FrameView& frame, const MapConfig& config, ObjectVolumes& volumes,
              std::vector<FusedBlock>& fused) {
  const std::vector<RimVoxel> rim = FindRimVoxels(frame, config, volumes);
  if (rim.empty()) return;
  // By block.
  struct Target {
    InstanceId id;
    Index3 index;
    std::vector<std::uint32_t> voxels;  // in `rim`
    TsdfBlock* block = nullptr;
    FusionResult result;
  };
  std::vector<Target> targets;
  {
    std::map<std::pair<InstanceId, Index3>, std::size_t> at;
    for (std::uint32_t i = 0; i < rim.size(); ++i) {
      const auto [target, is_new] =
          at.try_emplace({rim[i].id, BlockOf(rim[i].voxel)}, targets.size());
      if (is_new) targets.push_back({rim[i].id, BlockOf(rim[i].voxel), {}, nullptr, {}});
      targets[target->second].voxels.push_back(i);
    }
  }
  // All values are of the map before its rims.
  std::vector<std::optional<float>> distance(rim.size());
  const float front = config.front();
  const float back = config.back();
  std::map<InstanceId, CameraFromLattice> cameras;
  for (const auto& [id, volume] : volumes) {
    cameras.try_emplace(id, frame.T_WC, volume.T_WL, volume.lattice_is_world);
  }
  const auto in_parallel = [&](const auto& function) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, targets.size(), kBlocksPerRimTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) function(targets[i]);
        },
        tbb::simple_partitioner());
  };
  in_parallel([&](const Target& target) {
    NearbyVoxels voxels(volumes.at(target.id).grid);
    PlannedBlock planned{};
    planned.behind_m = std::numeric_limits<float>::infinity();
    const BlockPlace place = PlaceOf(cameras.at(target.id), target.index, config.voxel(), planned);
    BlockObservation seen;
    const bool any_seen = ObserveVoxels(frame.kernel, place, back, seen);
    for (const std::uint32_t i : target.voxels) {
      const auto at = static_cast<std::size_t>(PlaceInBlock(rim[i].voxel));
      distance[i] = Continued(voxels, rim[i].voxel, kLargestStep_voxels * config.voxel());
      if (!distance[i]) continue;
      if (any_seen && seen.pixel[at] >= 0 && seen.distance[at] > 0) {
        // The space is free so far in front of what is there; a voxel of it is enough, and does
        // not bend the surface beside it more.
        distance[i] = std::max(*distance[i], std::min(seen.distance[at], config.voxel()));
      }
      distance[i] = RoundToHalf(std::min(std::max(*distance[i], -back), front));
    }
  });
  for (Target& target : targets) {
    const auto has_value = [&](std::uint32_t i) { return distance[i].has_value(); };
    if (std::none_of(target.voxels.begin(), target.voxels.end(), has_value)) continue;
    target.block = &volumes.at(target.id).grid.FindOrAdd(target.index);
  }
  in_parallel([&](Target& target) {
    if (target.block == nullptr) return;
    TsdfBlock& block = *target.block;
    const BlockMask observed = block.observed;
    const BlockMask negative = block.negative;
    const BlockMask band = block.band;
    const BlockMask full = block.full;
    for (const std::uint32_t i : target.voxels) {
      if (!distance[i]) continue;
      const float d = *distance[i];
      const auto at = static_cast<std::size_t>(PlaceInBlock(rim[i].voxel));
      const bool coloured = std::abs(d) <= config.first_colour_band();
      FuseVoxel(block, at, d,
                coloured ? frame.kernel.colour + 3 * std::size_t{rim[i].pixel} : nullptr,
                static_cast<float>(config.weight_cap));
    }
    block.UpdateMasks(back);
    block.full = full;  // of other voxels
    target.result.changed_signs = ChangedSigns(observed, negative, block.observed, block.negative);
    target.result.band_changed = band != block.band;
  });
  static const BlockMask kNoVotes{};
  std::map<std::pair<InstanceId, std::uint32_t>, std::size_t> fused_at;
  for (std::size_t i = 0; i < fused.size(); ++i) fused_at[{fused[i].id, fused[i].number}] = i;
  for (const Target& target : targets) {
    if (target.block == nullptr) continue;
    const auto number =
        static_cast<std::uint32_t>(*volumes.at(target.id).grid.NumberOf(target.index));
    const auto known = fused_at.find({target.id, number});
    if (known == fused_at.end()) {
      fused.push_back({target.id, target.index, number, target.block, &kNoVotes,
                       BlocksOfCubesAt(target.result.changed_signs), target.result.band_changed,
                       target.block->is_listed_with_others, false});
    } else {
      FusedBlock& block = fused[known->second];
      block.stale_cubes |= BlocksOfCubesAt(target.result.changed_signs);
      block.band_changed = block.band_changed || target.result.band_changed;
      block.is_empty = false;
    }
  }
}

}  // namespace tsdfpp
