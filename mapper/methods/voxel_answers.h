// Answers of VoxelInspection from grids.
#pragma once

#include <optional>
#include <vector>

#include "mapper/voxel_inspection.h"

namespace tsdfpp {

// The observed voxels of a grid, sorted by (z, y, x).
std::vector<Eigen::Vector3i> ObservedVoxelsOf(const TsdfGrid& grid);
// Whether a grid can store the voxel. Beyond, the keys of blocks wrap.
bool CanBeStored(const Index3& voxel);
// The voxel's value, nothing where it is unobserved.
std::optional<VoxelValue> ValueOf(const TsdfGrid& grid, const Index3& voxel);
// Sorts by (z, y, x).
std::vector<Eigen::Vector3i> SortedVoxels(std::vector<Index3> voxels);

}  // namespace tsdfpp
