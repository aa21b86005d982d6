// The observation of voxels by a frame (docs/map.md, "Observation of a voxel"; paper III-F).
#pragma once

#include <array>
#include <cstdint>

#include "core/types.h"
#include "mapper/block_grid.h"

namespace tsdfpp {

// A frame and the labels associated with it, as the inner loops read them. The images must outlive
// it.
class FrameView {
 public:
  // Aborts where the images' sizes or types are not those that core/types.h states.
  FrameView(const Frame& frame, const cv::Mat& labels);

  int width = 0;
  int height = 0;
  float fx = 0;
  float fy = 0;
  float cx = 0;
  float cy = 0;
  const float* depth = nullptr;  // 0 where invalid or labelled kNoInstance
  const std::uint16_t* label = nullptr;
  const std::uint8_t* colour = nullptr;  // three channels
  Intrinsics intrinsics;
  Pose T_WC = Pose::Identity();

 private:
  cv::Mat depth_;   // cleaned copy
  cv::Mat label_;   // continuous
  cv::Mat colour_;  // continuous
};

// T_CL as float rows, exactly T_WC^-1 where the lattice is the world's.
struct CameraFromLattice {
  CameraFromLattice(const Pose& T_WC, const Pose& T_WL, bool lattice_is_world);
  std::array<std::array<float, 4>, 3> rows{};
};

struct BlockObservation {
  std::array<float, kBlockVoxels> distance{};  // s, metres
  std::array<std::int32_t, kBlockVoxels>
      pixel{};  // row-major pixel, or -1 where not in view or s < -back
};

// False where the whole block is certainly out of view (then `out` is untouched).
// `voxel`, `back` in metres.
bool ObserveBlock(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
                  float voxel, float back, BlockObservation& out);

}  // namespace tsdfpp
