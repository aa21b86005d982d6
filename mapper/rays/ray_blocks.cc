#include "mapper/rays/ray_blocks.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>

#include "mapper/rays/ray_kernels.h"
#include "mapper/volume/cube_masks.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 64;

// The block and those one further along x, y, z (bits 0, 1, 2 of the place).
using UpperBlocks = std::array<const TsdfBlock*, 8>;

UpperMasks MasksOf(const UpperBlocks& blocks, BlockMask TsdfBlock::*mask) {
  UpperMasks masks;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    masks[i] = blocks[i] == nullptr ? &kNoVoxels : &(blocks[i]->*mask);
  }
  return masks;
}

// Fills `crossed` and its box; false where no cube is crossed.
bool FindCrossed(const UpperBlocks& blocks, CrossedCubes& out) {
  const BlockMask crossed =
      FindCubeMasks(MasksOf(blocks, &TsdfBlock::observed), MasksOf(blocks, &TsdfBlock::negative))
          .crossed;
  std::uint64_t any = 0;
  std::uint32_t slices = 0;
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    out.bits[2 * z] = static_cast<std::uint32_t>(crossed[z]);
    out.bits[2 * z + 1] = static_cast<std::uint32_t>(crossed[z] >> 32U);
    any |= crossed[z];
    if (crossed[z] != 0) slices |= 1U << z;
  }
  if (any == 0) return false;
  std::uint64_t columns = any | any >> 32U;
  columns |= columns >> 16U;
  columns = (columns | columns >> 8U) & 0xFFU;
  const auto set = [&](std::size_t axis, int low, int high) {
    out.low[axis] = static_cast<std::uint8_t>(low);
    out.high[axis] = static_cast<std::uint8_t>(high);
  };
  set(0, std::countr_zero(columns), static_cast<int>(std::bit_width(columns)));
  set(1, std::countr_zero(any) / 8, static_cast<int>(std::bit_width(any) + 7) / 8);
  set(2, std::countr_zero(slices), static_cast<int>(std::bit_width(slices)));
  return true;
}

void CopyDistances(const UpperBlocks& blocks, RayBlock& out) {
  static constexpr std::array<Half, kBlockVoxels> kZeros{};
  std::array<const Half*, 8> from;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    from[i] = (blocks[i] == nullptr ? kZeros : blocks[i]->distance).data();
  }
  CopyCorners(from, out);
}

// A camera before one lattice, lengths in voxels.
class LatticeView {
 public:
  LatticeView(const RayCamera& camera, const RayVolume& volume, double voxel_m, double near_m)
      : camera_(camera.intrinsics), voxel_m_(voxel_m), near_m_(near_m) {
    const Pose T_CL =
        volume.lattice_is_world ? camera.T_WC.inverse() : Pose(camera.T_WC.inverse() * volume.T_WL);
    rotation_ = T_CL.linear() * voxel_m;
    translation_ = T_CL.translation();
    // Unit normals of the image's sides, inwards.
    const Intrinsics& k = camera_;
    sides_ = {Eigen::Vector3d(k.fx, 0, k.cx + 0.5), Eigen::Vector3d(-k.fx, 0, k.width - 0.5 - k.cx),
              Eigen::Vector3d(0, k.fy, k.cy + 0.5),
              Eigen::Vector3d(0, -k.fy, k.height - 0.5 - k.cy)};
    for (Eigen::Vector3d& side : sides_) side.normalize();
  }

  // Whether the ball around a block's cubes may be in view.
  bool MaySee(const Index3& block) const {
    const Eigen::Vector3d middle =
        rotation_ * Eigen::Vector3d(block.x * kBlockSide + 4, block.y * kBlockSide + 4,
                                    block.z * kBlockSide + 4) +
        translation_;
    const double radius = 4 * std::sqrt(3.0) * voxel_m_;
    if (middle.z() < near_m_ - radius) return false;
    return std::all_of(sides_.begin(), sides_.end(),
                       [&](const Eigen::Vector3d& side) { return side.dot(middle) >= -radius; });
  }

  BlockFootprint FootprintOf(const Index3& block, const CrossedCubes& cubes) const {
    constexpr double kNearestCorner_m = 1e-3;
    constexpr double kMargin_pixels = 0.01;  // of rounding
    double near = 1e30;
    double far = -1e30;
    double u_low = 1e30;
    double u_high = -1e30;
    double v_low = 1e30;
    double v_high = -1e30;
    for (unsigned i = 0; i < 8; ++i) {
      const auto along = [&](unsigned axis, int index) {
        return index * kBlockSide + ((i >> axis & 1U) != 0 ? cubes.high[axis] : cubes.low[axis]);
      };
      const Eigen::Vector3d p_C =
          rotation_ * Eigen::Vector3d(along(0, block.x), along(1, block.y), along(2, block.z)) +
          translation_;
      near = std::min(near, p_C.z());
      far = std::max(far, p_C.z());
      const double u = camera_.fx * p_C.x() / p_C.z() + camera_.cx;
      const double v = camera_.fy * p_C.y() / p_C.z() + camera_.cy;
      u_low = std::min(u_low, u);
      u_high = std::max(u_high, u);
      v_low = std::min(v_low, v);
      v_high = std::max(v_high, v);
    }
    BlockFootprint footprint;
    if (far < near_m_) return footprint;
    footprint.near_m = static_cast<float>(std::max(near, 0.0) * (1 - 1e-6));
    if (near < kNearestCorner_m) {  // reaches behind the camera: no bounds
      footprint.u_high = camera_.width - 1;
      footprint.v_high = camera_.height - 1;
      return footprint;
    }
    const auto first = [](double low) {
      return static_cast<int>(std::max(0.0, std::ceil(low - kMargin_pixels)));
    };
    const auto last = [](double high, int size) {
      return static_cast<int>(std::min(size - 1.0, std::floor(high + kMargin_pixels)));
    };
    footprint.u_low = first(std::min(u_low, 1e9));
    footprint.u_high = last(std::max(u_high, -1.0), camera_.width);
    footprint.v_low = first(std::min(v_low, 1e9));
    footprint.v_high = last(std::max(v_high, -1.0), camera_.height);
    return footprint;
  }

 private:
  const Intrinsics& camera_;
  double voxel_m_;
  double near_m_;
  Eigen::Matrix3d rotation_;     // metres a voxel
  Eigen::Vector3d translation_;  // metres
  std::array<Eigen::Vector3d, 4> sides_;
};

struct Candidate {
  std::uint32_t volume;
  const TsdfGrid::Entry* entry;
};

// The blocks that may be in view, by volume, then index.
std::vector<Candidate> FindCandidates(const std::vector<RayVolume>& volumes,
                                      const std::vector<LatticeView>& views) {
  std::vector<Candidate> candidates;
  for (std::uint32_t i = 0; i < volumes.size(); ++i) {
    const LatticeView& view = views[i];
    const std::size_t first = candidates.size();
    for (const auto& entry : volumes[i].grid->entries()) {
      if (view.MaySee(entry.index)) candidates.push_back({i, &entry});
    }
    std::sort(
        candidates.begin() + static_cast<std::ptrdiff_t>(first), candidates.end(),
        [](const Candidate& a, const Candidate& b) { return a.entry->index < b.entry->index; });
  }
  return candidates;
}

template <typename Function>
void ForEachInParallel(std::size_t count, const Function& function) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) function(i);
      },
      tbb::simple_partitioner());
}

constexpr std::uint32_t kOutOfView = 0xFFFFFFFFU;

// Each candidate's number among those in view, or kOutOfView; `in_view` gets their footprints.
std::vector<std::uint32_t> NumberInView(const std::vector<BlockFootprint>& footprints,
                                        std::vector<BlockFootprint>& in_view) {
  std::vector<std::uint32_t> number(footprints.size(), kOutOfView);
  for (std::size_t i = 0; i < footprints.size(); ++i) {
    const BlockFootprint& footprint = footprints[i];
    if (footprint.u_high < footprint.u_low || footprint.v_high < footprint.v_low) continue;
    number[i] = static_cast<std::uint32_t>(in_view.size());
    in_view.push_back(footprint);
  }
  return number;
}

}  // namespace

RayBlocks FindRayBlocks(const std::vector<RayVolume>& volumes, const RayCamera& camera,
                        double voxel_m, double near_m, const ContestedBox& contested) {
  std::vector<LatticeView> views;
  views.reserve(volumes.size());
  for (const RayVolume& volume : volumes) views.emplace_back(camera, volume, voxel_m, near_m);
  const std::vector<Candidate> candidates = FindCandidates(volumes, views);
  // First the crossed cubes, then, for the blocks that have some, the distances.
  std::vector<UpperBlocks> upper(candidates.size());
  std::vector<CrossedCubes> crossed(candidates.size());
  std::vector<BlockFootprint> footprints(candidates.size());
  ForEachInParallel(candidates.size(), [&](std::size_t i) {
    const auto& [volume, entry] = candidates[i];
    upper[i] = volumes[volume].grid->FindUpper(entry->index);
    if (!FindCrossed(upper[i], crossed[i])) return;
    footprints[i] = views[volume].FootprintOf(entry->index, crossed[i]);
  });
  RayBlocks found;
  const std::vector<std::uint32_t> number = NumberInView(footprints, found.footprints);
  found.blocks = std::make_unique_for_overwrite<RayBlock[]>(found.footprints.size());
  ForEachInParallel(candidates.size(), [&](std::size_t i) {
    if (number[i] == kOutOfView) return;
    const auto& [volume, entry] = candidates[i];
    RayBlock& block = found.blocks[number[i]];
    block.index = entry->index;
    block.volume = volume;
    block.cubes = crossed[i];
    const Index3 first = VoxelAt(block.index, 0);
    const auto& [low, high, bits] = block.cubes;
    block.contested =
        contested && contested(volumes[volume], first + Index3{low[0], low[1], low[2]},
                               first + Index3{high[0], high[1], high[2]});
    CopyDistances(upper[i], block);
  });
  return found;
}

}  // namespace tsdfpp
