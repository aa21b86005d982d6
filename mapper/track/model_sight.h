// What a frame shows of an object's model where it is taken to be.
#pragma once

#include <cmath>
#include <opencv2/core.hpp>

#include "core/types.h"
#include "mapper/volume/block_grid.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A surface voxel of a model, to within this many voxels.
inline constexpr float kSurface_voxels = 0.75F;

// Calls visit(place in the block, voxel of the lattice) for the block's surface voxels, in order.
template <typename Visit>
void ForEachSurfaceVoxel(const TsdfGrid::Entry& entry, double voxel_m, const Visit& visit) {
  const TsdfBlock& block = *entry.block;
  if (!block.AnyNegative()) return;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const auto place = static_cast<std::size_t>(i);
    if (block.weight[place] == 0 ||
        std::abs(float{block.distance[place]}) > kSurface_voxels * static_cast<float>(voxel_m)) {
      continue;
    }
    visit(place, VoxelAt(entry.index, i));
  }
}

// Numbers of surface voxels of a model in the picture, by the depth around their pixel (three by
// three: outlines are a pixel off).
struct ModelSight {
  int matched = 0;  // a depth is theirs
  int beside = 0;   // so it is, but of pixels that cannot be of the object
  int through = 0;  // all depths are farther: nothing is there
  int hidden = 0;   // depth is nearer: something is before it, the model itself perhaps
};

// `T_WL` is where the model's lattice is; depth may be off by `margin_m`. Pixels of `may_be`
// (CV_8UC1, of the depth's size) that are 0 cannot be of the object; an empty one allows all.
ModelSight LookAtModel(const Frame& frame, const TsdfGrid& model, const Pose& T_WL, double voxel_m,
                       double margin_m, const cv::Mat& may_be = {});

// Numbers of the surface voxels that face the camera and are in the picture.
struct FacingVoxels {
  int shown = 0;    // their pixel is the object's
  int covered = 0;  // it is another's, and its depth is nearer

  // Of all of them; 1 where there are none.
  double ShownShare() const {
    return shown + covered == 0 ? 1 : static_cast<double>(shown) / (shown + covered);
  }
};

// `T_WL` is where the model's lattice is; `labels` (CV_16UC1, of the depth's size) has `id` at the
// object's pixels, and kBackground at those of what covers no object: where the background is
// before a voxel, or is farther, the model or its place is wrong there. Depth is nearer by more
// than `margin_m`. All other voxels count as neither.
FacingVoxels LookAtFacing(const Frame& frame, const cv::Mat& labels, InstanceId id,
                          const TsdfGrid& model, const Pose& T_WL, double voxel_m, double margin_m);

}  // namespace tsdfpp
