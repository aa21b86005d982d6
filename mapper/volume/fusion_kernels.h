// The arithmetic of observation and fusion over the voxels of one block (docs/map.md, "Observation
// of a voxel" and "Fusion of an observation into a voxel"), in loops that compilers vectorise.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

inline constexpr float kNearest_m = 0.05F;  // voxels closer to the camera's plane are not in view

// A frame as the kernels read it: row-major images.
struct KernelFrame {
  const float* depth = nullptr;          // metres, -infinity where it is not valid
  const std::uint16_t* label = nullptr;  // kNoInstance where the pixel is not to be used
  const std::uint8_t* colour = nullptr;  // three bytes a pixel
  float width = 0;                       // pixels
  float height = 0;
  std::array<float, 4> intrinsics{};  // fx, fy, cx, cy
  // By what distances in front of a pixel are multiplied (FacingOf()), or nullptr: by 1. That of
  // the background's pixels is 1.
  const float* facing = nullptr;
};

// What a frame says of the voxels of a block.
struct BlockObservation {
  std::array<float, kBlockVoxels> distance;  // s, metres; meaningless without a pixel
  Lanes pixel;                               // row-major pixel, or -1 where there is no observation
                                             // or s < -back
};

// Where a block lies, seen from the camera.
struct BlockPlace {
  const float* T_CL = nullptr;  // rows of a 3x4 matrix
  float voxel = 0;              // metres
  Index3 first;                 // the block's lowest voxel
  // p_C.z from which on a voxel is certainly farther behind what is seen than the back band.
  float behind_m = std::numeric_limits<float>::infinity();
  bool all_in_view = false;  // it is known that every voxel falls on a pixel
};

// Projects the voxels of a block and reads what the frame has there. False where no voxel is
// observed.
bool ObserveVoxels(const KernelFrame& frame, const BlockPlace& place, float back,
                   BlockObservation& out);

// Which of the observed voxels are to take the observation, and how.
struct FusionRule {
  std::uint16_t id = 0;        // those that see this label; with votes, all of them
  bool contradiction = false;  // whether the others are to be looked at (docs/map.md)
  bool one_label = false;      // it is known that the block's pixels have no label but `id`
  float front = 0;             // metres
  float back = 0;
  float colour_band = 0;
  float first_colour_band = 0;  // of what has no colour yet
  float weight_cap = 0;
};

struct FusionResult {
  bool changed = false;  // a voxel took an observation or was cleared
  BlockMask in_band{};   // voxels that took an observation in band
  // Voxels whose `observed` or `negative` changed, but for those that have neighbours of one sign
  // only: these are corners of no cube that is, or was, crossed.
  BlockMask changed_signs{};
  bool band_changed = false;  // of a voxel
};

// Labels of the voxels of a block and the votes for them (docs/map.md, "`tsdf`: one field").
struct LabelVotes {
  std::uint16_t* id = nullptr;
  std::uint16_t* confidence = nullptr;
  std::int32_t cap = 0;
  float band = std::numeric_limits<float>::infinity();  // metres: farther observations do not vote
  // A voxel of another label whose distance is at most this takes nothing from behind a surface.
  float guard = -std::numeric_limits<float>::infinity();  // metres
  bool any_label_changed = false;
};

// Observes the voxels of the block and fuses what it sees into it; its masks but for `crossed`
// and `cover` are then up to date. `next`, or nullptr, is the block that will be fused after it,
// and fetched into the cache meanwhile. `votes`, where given, lets the observations in band vote.
FusionResult FuseVoxels(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                        TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes = nullptr);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::ObserveVoxels) ObserveVoxels;
decltype(tsdfpp::FuseVoxels) FuseVoxels;
}  // namespace plain

}  // namespace tsdfpp
