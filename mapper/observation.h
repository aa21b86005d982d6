// The observation of voxels by a frame (docs/map.md, "Observation of a voxel"; paper III-F).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/types.h"
#include "mapper/fusion_kernels.h"

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
  KernelFrame kernel;
  Intrinsics intrinsics;
  Pose T_WC = Pose::Identity();

 private:
  std::vector<DepthAndLabel> pixels_;
  std::vector<std::int32_t> packed_colour_;
  cv::Mat depth_;  // cleaned copy
  cv::Mat label_;  // continuous
};

// T_CL as float rows, exactly T_WC^-1 where the lattice is the world's.
struct CameraFromLattice {
  CameraFromLattice(const Pose& T_WC, const Pose& T_WL, bool lattice_is_world);
  std::array<std::array<float, 4>, 3> rows{};
};

// A block to be observed, in a lattice seen from the camera.
struct BlockInView {
  Index3 block;
  const CameraFromLattice* T_CL = nullptr;
};

// Numbers i of [0, count) whose block `block_at(i)` is not certainly out of view, ordered by the
// part of the image that the block's middle falls into (then by i), so that one after the other
// read neighbouring pixels. `voxel` in metres.
std::vector<std::uint32_t> BlocksInView(const FrameView& frame, std::size_t count, float voxel,
                                        const std::function<BlockInView(std::size_t)>& block_at);

// False where no voxel of the block is observed. `voxel`, `back` in metres.
bool ObserveBlock(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
                  float voxel, float back, BlockObservation& out);

}  // namespace tsdfpp
