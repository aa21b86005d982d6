// One object's volume at the voxels of a block of another lattice: what covers them, and what their
// values are when the volume moves there (docs/map.md, "Cover" and "Resampling"; paper III-E).
#pragma once

#include "mapper/map_config.h"
#include "mapper/volume/object_volume.h"
#include "mapper/volume/pull_back_kernels.h"

namespace tsdfpp {

// The rows of a pose.
std::array<double, 12> RowsOf(const Pose& T);

struct PulledCover {
  BlockMask covered;                         // where the object covers the voxel
  std::array<float, kBlockVoxels> distance;  // metres, where it does
};

// The cover of the global block `index` by the volume behind `reader`; `T_LW` takes its voxels into
// the volume's lattice. False where no voxel is covered (then `out` is not to be read).
bool CoverOfBlock(const VoxelReader& reader, const std::array<double, 12>& T_LW, double voxel_m,
                  float back, const Index3& index, PulledCover& out);

// The values at the voxels of the block `index`, unobserved where one of the eight neighbours is
// (or, by `resampling`, the nearest one); masks are not set. False where no voxel is observed.
bool ResampleBlock(const VoxelReader& reader, const std::array<double, 12>& T_inverse,
                   double voxel_m, const Index3& index, TsdfBlock& out,
                   Resampling resampling = Resampling::kAll);

// Moves the values of a volume by T_rel (paper III-E): the new grid, masks up to date but for
// `crossed` and `cover`.
TsdfGrid ResampleGrid(const TsdfGrid& grid, const Pose& T_rel, double voxel_m, float back,
                      Resampling resampling = Resampling::kAll);

}  // namespace tsdfpp
