// The observation of voxels by a frame (docs/map.md, "Observation of a voxel"; paper III-F).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/types.h"
#include "mapper/map_config.h"
#include "mapper/volume/frame_kernels.h"
#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {

// A frame and the labels associated with it, as the inner loops read them. The images must outlive
// it.
class FrameView {
 public:
  // Aborts where the images' sizes or types are not those that core/types.h states.
  FrameView(const Frame& frame, const cv::Mat& labels, Distances distances = Distances::kRay);

  int width = 0;
  int height = 0;
  KernelFrame kernel;
  Intrinsics intrinsics;
  Pose T_WC = Pose::Identity();
  int tiles_per_row = 0;
  std::vector<Tile> tiles;  // row-major

  // Whether the pixel has a valid depth and a label.
  bool IsUsable(std::size_t pixel) const {
    return IsValidDepth(kernel.depth[pixel]) && kernel.label[pixel] != kNoInstance;
  }

 private:
  cv::Mat depth_;  // continuous
  cv::Mat label_;
  cv::Mat facing_;
  cv::Mat colour_;
};

// T_CL as float rows, exactly T_WC^-1 where the lattice is the world's.
struct CameraFromLattice {
  CameraFromLattice(const Pose& T_WC, const Pose& T_WL, bool lattice_is_world);
  std::array<std::array<float, 4>, 3> rows{};
};

// A block that may have to be looked at, in a lattice seen from the camera.
struct BlockCandidate {
  Index3 index;
  const CameraFromLattice* T_CL = nullptr;
  InstanceId id = kNoInstance;  // of the object whose block it is
  bool of_any_label = false;    // whether other labels' pixels matter as well
  // Or where they do if one of its voxels is negative.
  const TsdfBlock* of_any_label_if_negative = nullptr;
};

struct PlannedBlock {
  std::uint32_t number;  // of the candidate
  // The one label of all pixels that the block's voxels can fall on, kNoInstance where there may be
  // several.
  InstanceId label = kNoInstance;
  float behind_m = 0;        // see BlockPlace
  bool all_in_view = false;  // see BlockPlace
};

// The candidates i of [0, count), given by `candidate_at(i)`, of which the frame may observe a
// voxel: neither out of view, nor wholly behind what is seen, nor without a pixel of a label that
// matters. Ordered by the part of the image that a block's middle falls into (then by i), so that
// one after the other read neighbouring pixels. `voxel` and `back` in metres.
std::vector<PlannedBlock> PlanBlocks(
    const FrameView& frame, std::size_t count, float voxel, float back,
    const std::function<BlockCandidate(std::size_t)>& candidate_at);

// A planned block as the kernels take it; `T_CL` must outlive the result.
BlockPlace PlaceOf(const CameraFromLattice& T_CL, const Index3& block, float voxel,
                   const PlannedBlock& planned);

}  // namespace tsdfpp
