#include "mapper/volume/rims.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "mapper/volume/cube_masks.h"
#include "mapper/volume/outlines.h"

namespace tsdfpp {
namespace {

const IsOwnVoxel kAllAreOwn;
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

// Reads voxels of one grid, which lie near each other.
class NearbyVoxels {
 public:
  NearbyVoxels(const TsdfGrid& grid, InstanceId id, const IsOwnVoxel& is_own)
      : grid_(&grid), id_(id), is_own_(is_own ? &is_own : nullptr) {}
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
  // Whether all corners of a cube are; may say no of a cube that reaches into another block.
  bool IsSurelyObserved(const Index3& cube) {
    constexpr std::uint64_t kCorners = 0x303;  // in a slice, from the lowest on
    const Index3 within{cube.x & (kBlockSide - 1), cube.y & (kBlockSide - 1),
                        cube.z & (kBlockSide - 1)};
    if (std::max({within.x, within.y, within.z}) == kBlockSide - 1) return false;
    const TsdfBlock* block = BlockWith(cube);
    if (block == nullptr) return false;
    const auto lowest = static_cast<unsigned>(within.y * kBlockSide + within.x);
    const auto slice = static_cast<std::size_t>(within.z);
    return (((block->observed[slice] & block->observed[slice + 1]) >> lowest) & kCorners) ==
           kCorners;
  }
  // Nothing where it is unobserved, or another object's.
  std::optional<float> DistanceOf(const Index3& voxel) {
    const TsdfBlock* block = BlockWith(voxel);
    const int place = PlaceInBlock(voxel);
    if (block == nullptr || !Bit(block->observed, place)) return std::nullopt;
    if (is_own_ != nullptr && !(*is_own_)(id_, voxel)) return std::nullopt;
    return block->distance[static_cast<std::size_t>(place)];
  }

 private:
  const TsdfGrid* grid_;
  InstanceId id_;
  const IsOwnVoxel* is_own_;
  bool known_ = false;
  Index3 index_;
  const TsdfBlock* block_ = nullptr;
};

// Finds rim voxels at a row's pixels that are near an outline.
class RowSearch {
 public:
  RowSearch(const FrameView& frame, const MapConfig& config, const RimVolumeOf& volume_of)
      : frame_(frame),
        voxel_m_(config.voxel_m),
        volume_of_(volume_of),
        near_(PixelsAtOutlines(frame, config.voxel_m)) {
    const Intrinsics& k = frame.intrinsics;
    for (int u = 0; u < frame.width; ++u) slope_of_column_.push_back((u - k.cx) / k.fx);
  }

  void Visit(int v, std::vector<RimVoxel>& out) const {
    const FrameView& frame = frame_;
    const double slope_of_row = (v - frame.intrinsics.cy) / frame.intrinsics.fy;
    const std::size_t first = static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width);
    const auto row = near_.begin() + static_cast<std::ptrdiff_t>(first);
    InstanceId id = kNoInstance;
    Pose T_LC = Pose::Identity();
    std::optional<NearbyVoxels> voxels;
    Index3 last{std::numeric_limits<int>::max(), 0, 0};
    for (int u = 0; u < frame.width; ++u) {
      if (row[u] == 0) u = static_cast<int>(std::find(row + u, row + frame.width, 1) - row);
      if (u == frame.width) break;
      const std::size_t pixel = first + static_cast<std::size_t>(u);
      if (!frame.IsUsable(pixel)) continue;
      if (frame.kernel.label[pixel] != id) {
        id = frame.kernel.label[pixel];
        const std::optional<RimVolume> volume = volume_of_(id);
        voxels.reset();
        last.x = std::numeric_limits<int>::max();
        if (!volume) continue;
        T_LC = volume->T_WL.inverse() * frame.T_WC;
        voxels.emplace(*volume->grid, id, kAllAreOwn);
      }
      if (!voxels) continue;
      const double z = frame.kernel.depth[pixel];
      const Eigen::Vector3d p_L =
          T_LC *
          Eigen::Vector3d(slope_of_column_[static_cast<std::size_t>(u)] * z, slope_of_row * z, z);
      const Index3 cube = FloorOf(p_L / voxel_m_);
      if (cube == last) continue;
      last = cube;
      AddUnobserved(*voxels, cube, id, pixel, out);
    }
  }

 private:
  static void AddUnobserved(NearbyVoxels& voxels, const Index3& cube, InstanceId id,
                            std::size_t pixel, std::vector<RimVoxel>& out) {
    if (voxels.IsSurelyObserved(cube)) return;
    for (int i = 0; i < 8; ++i) {
      const Index3 corner = cube + Index3{i & 1, (i >> 1) & 1, i >> 2};
      if (voxels.IsObserved(corner)) continue;
      out.push_back({id, corner, static_cast<std::uint32_t>(pixel)});
    }
  }

  const FrameView& frame_;
  double voxel_m_;
  const RimVolumeOf& volume_of_;
  std::vector<std::uint8_t> near_;
  std::vector<double> slope_of_column_;
};

// By object and voxel, each once, with its first pixel.
std::vector<RimVoxel> FindRimVoxels(const FrameView& frame, const MapConfig& config,
                                    const RimVolumeOf& volume_of) {
  const RowSearch search(frame, config, volume_of);
  const int tasks = (frame.height + kRowsPerTask - 1) / kRowsPerTask;
  std::vector<std::vector<RimVoxel>> found(static_cast<std::size_t>(tasks));
  tbb::parallel_for(
      tbb::blocked_range<int>(0, tasks, 1),
      [&](const tbb::blocked_range<int>& range) {
        for (int task = range.begin(); task != range.end(); ++task) {
          const int end = std::min(frame.height, (task + 1) * kRowsPerTask);
          for (int v = task * kRowsPerTask; v < end; ++v) {
            search.Visit(v, found[static_cast<std::size_t>(task)]);
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

template <typename Blocks, typename Function>
void ForEachInParallel(Blocks& blocks, const Function& function) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, blocks.size(), kBlocksPerRimTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) function(blocks[i]);
      },
      tbb::simple_partitioner());
}

std::vector<RimBlock> ByBlock(const std::vector<RimVoxel>& rim) {
  std::vector<RimBlock> blocks;
  std::map<std::pair<InstanceId, Index3>, std::size_t> at;
  for (const RimVoxel& voxel : rim) {
    const Index3 index = BlockOf(voxel.voxel);
    const auto [block, is_new] = at.try_emplace({voxel.id, index}, blocks.size());
    if (is_new) blocks.push_back({voxel.id, index, {}});
    blocks[block->second].voxels.push_back({PlaceInBlock(voxel.voxel), voxel.pixel, 0});
  }
  return blocks;
}

}  // namespace

std::vector<RimBlock> FindRims(const FrameView& frame, const MapConfig& config,
                               const RimVolumeOf& volume_of, const IsOwnVoxel& is_own) {
  std::vector<RimBlock> blocks = ByBlock(FindRimVoxels(frame, config, volume_of));
  if (blocks.empty()) return blocks;
  struct Known {
    const TsdfGrid* grid;
    CameraFromLattice T_CL;
  };
  std::map<InstanceId, Known> known;
  for (const RimBlock& block : blocks) {
    if (known.contains(block.id)) continue;
    const RimVolume volume = *volume_of(block.id);
    known.try_emplace(block.id, Known{volume.grid, CameraFromLattice(frame.T_WC, volume.T_WL,
                                                                     volume.lattice_is_world)});
  }
  const float front = config.front();
  const float back = config.back();
  ForEachInParallel(blocks, [&](RimBlock& block) {
    const Known& volume = known.at(block.id);
    NearbyVoxels voxels(*volume.grid, block.id, is_own);
    PlannedBlock planned{};
    planned.behind_m = std::numeric_limits<float>::infinity();
    const BlockPlace place = PlaceOf(volume.T_CL, block.index, config.voxel(), planned);
    BlockObservation seen;
    const bool any_seen = ObserveVoxels(frame.kernel, place, back, seen);
    std::vector<RimValue> values;
    for (RimValue value : block.voxels) {
      const auto at = static_cast<std::size_t>(value.place);
      std::optional<float> distance = Continued(voxels, VoxelAt(block.index, value.place),
                                                kLargestStep_voxels * config.voxel());
      if (!distance) continue;
      if (any_seen && seen.pixel[at] >= 0 && seen.distance[at] > 0) {
        // The space is free so far in front of what is there; a voxel of it is enough, and does
        // not bend the surface beside it more.
        distance = std::max(*distance, std::min(seen.distance[at], config.voxel()));
      }
      value.distance_m = RoundToHalf(std::min(std::max(*distance, -back), front));
      values.push_back(value);
    }
    block.voxels = std::move(values);
  });
  std::erase_if(blocks, [](const RimBlock& block) { return block.voxels.empty(); });
  return blocks;
}

void FuseRim(const FrameView& frame, const MapConfig& config, const RimValue& value,
             TsdfBlock& block) {
  const bool coloured = std::abs(value.distance_m) <= config.first_colour_band();
  FuseVoxel(block, static_cast<std::size_t>(value.place), value.distance_m,
            coloured ? frame.kernel.colour + 3 * std::size_t{value.pixel} : nullptr,
            static_cast<float>(config.weight_cap));
}

void FuseRims(const FrameView& frame, const MapConfig& config, ObjectVolumes& volumes,
              std::vector<FusedBlock>& fused) {
  const auto volume_of = [&](InstanceId id) -> std::optional<RimVolume> {
    const auto volume = volumes.find(id);
    if (volume == volumes.end()) return std::nullopt;
    return RimVolume{&volume->second.grid, volume->second.T_WL, volume->second.lattice_is_world};
  };
  const std::vector<RimBlock> rims = FindRims(frame, config, volume_of, kAllAreOwn);
  if (rims.empty()) return;
  struct Target {
    const RimBlock* rim;
    TsdfBlock* block;
    FusionResult result;
  };
  std::vector<Target> targets;
  targets.reserve(rims.size());
  for (const RimBlock& rim : rims) {
    targets.push_back({&rim, &volumes.at(rim.id).grid.FindOrAdd(rim.index), {}});
  }
  ForEachInParallel(targets, [&](Target& target) {
    TsdfBlock& block = *target.block;
    const BlockMask observed = block.observed;
    const BlockMask negative = block.negative;
    const BlockMask band = block.band;
    const BlockMask full = block.full;
    for (const RimValue& value : target.rim->voxels) FuseRim(frame, config, value, block);
    block.UpdateMasks(config.back());
    block.full = full;  // of other voxels
    target.result.changed_signs = ChangedSigns(observed, negative, block.observed, block.negative);
    target.result.band_changed = band != block.band;
  });
  static const BlockMask kNoVotes{};
  std::map<std::pair<InstanceId, std::uint32_t>, std::size_t> fused_at;
  for (std::size_t i = 0; i < fused.size(); ++i) fused_at[{fused[i].id, fused[i].number}] = i;
  for (const Target& target : targets) {
    const InstanceId id = target.rim->id;
    const auto number =
        static_cast<std::uint32_t>(*volumes.at(id).grid.NumberOf(target.rim->index));
    const auto known = fused_at.find({id, number});
    if (known == fused_at.end()) {
      fused.push_back({id, target.rim->index, number, target.block, &kNoVotes,
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
