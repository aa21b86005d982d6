// The arithmetic of observation and fusion over the voxels of one block (docs/map.md, "Observation
// of a voxel" and "Fusion of an observation into a voxel"), in loops that compilers vectorise.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mapper/tsdf_block.h"

namespace tsdfpp {

inline constexpr float kNearest_m = 0.05F;  // voxels closer to the camera's plane are not in view

struct DepthAndLabel {
  float depth;  // metres, 0 where invalid
  std::int32_t label;
};

// A frame as the kernels read it: row-major images.
struct KernelFrame {
  const DepthAndLabel* pixels = nullptr;
  const std::int32_t* colour = nullptr;  // channel c in bits 8 c ... 8 c + 7
  float width = 0;                       // pixels
  float height = 0;
  std::array<float, 4> intrinsics{};  // fx, fy, cx, cy
};

// What a frame says of the voxels of a block.
struct BlockObservation {
  std::array<float, kBlockVoxels> distance;  // s, metres; meaningless without a pixel
  Lanes pixel;  // row-major pixel, or -1 where not in view or s < -back
  Lanes label;  // of that pixel, meaningless without one
};

// Projects the voxels of the block whose lowest voxel is `first` and reads what the frame has
// there. `T_CL` holds the rows of a 3x4 matrix. False where no voxel is observed.
bool ObserveVoxels(const KernelFrame& frame, const float* T_CL, float voxel, const Index3& first,
                   float back, BlockObservation& out);

// Which of the observed voxels are to take the observation.
struct FusionRule {
  std::int32_t id = 0;         // those that see this label, or
  bool every_label = false;    // all of them
  bool contradiction = false;  // whether the others are to be looked at (docs/map.md)
  float front = 0;             // metres
  float half_voxel = 0;
  float weight_cap = 0;
};

struct FusionResult {
  bool any_taken = false;
  bool any_in_band = false;
  bool any_contradicted = false;
};

// Fuses the observations into the block. `in_band` marks the voxels that took one in band;
// `contradicted` those that see another label and hold a solid in front of its surface
//.
FusionResult FuseVoxels(const KernelFrame& frame, const FusionRule& rule,
                        const BlockObservation& observation, TsdfBlock& block, Lanes& in_band,
                        Lanes& contradicted);

// Votes of the baseline's labels (docs/map.md, "`tsdf`: one field"): `in_band` marks the voxels
// that vote for the label of their pixel. True where a label changed.
bool VoteLabels(const BlockObservation& observation, const Lanes& in_band,
                std::int32_t confidence_cap, std::uint16_t* id, std::uint16_t* confidence);

// Points at the ranges min(first + step * i, last), in the units of the ray's direction.
struct RayRanges {
  double first = 0;
  double step = 0;
  double last = 0;
};

// Room for the blocks of `points` points.
struct BlocksOfPoints {
  explicit BlocksOfPoints(std::size_t points) : x(points + 8), y(points + 8), z(points + 8) {}
  std::vector<std::int32_t> x;
  std::vector<std::int32_t> y;
  std::vector<std::int32_t> z;
};

// The blocks of the voxels nearest to `count` points of a ray, origin + direction * range in voxels
// of the lattice; `out` has room for them.
void BlocksAtPoints(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
                    const RayRanges& ranges, std::size_t count, BlocksOfPoints& out);

// Bit i of the mask for every lane that says yes.
BlockMask MaskOf(const Lanes& lanes);

}  // namespace tsdfpp
