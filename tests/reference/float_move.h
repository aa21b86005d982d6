// What the moves of the floating-point references share.
#pragma once

#include <algorithm>
#include <tuple>
#include <vector>

#include "core/types.h"
#include "tests/reference/dense_grid.h"
#include "tests/reference/sparse_voxels.h"

namespace tsdfpp::reference {

// The voxels that fulfil condition(voxel), in the order (z, y, x) of the whole lattice.
template <typename Voxel, typename Condition>
std::vector<Eigen::Vector3i> VoxelsWith(const SparseVoxels<Voxel>& voxels,
                                        const Condition& condition) {
  std::vector<Eigen::Vector3i> found;
  voxels.ForEach([&](const Eigen::Vector3i& v, const Voxel& voxel) {
    if (condition(voxel)) found.push_back(v);
  });
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
    return std::tuple(a.z(), a.y(), a.x()) < std::tuple(b.z(), b.y(), b.x());
  });
  return found;
}

// Those voxels alone, quick to look into; there must be one at least.
template <typename Voxel>
DenseGrid<Voxel> CopyOf(const SparseVoxels<Voxel>& from,
                        const std::vector<Eigen::Vector3i>& voxels) {
  Box box{voxels.front(), voxels.front()};
  for (const Eigen::Vector3i& v : voxels) {
    box.low = box.low.cwiseMin(v);
    box.high = box.high.cwiseMax(v);
  }
  DenseGrid<Voxel> copy(box);
  for (const Eigen::Vector3i& v : voxels) copy.At(v) = from(v);
  return copy;
}

// All voxels of the lattice that what lies in a box may reach when it moves by T_rel.
inline Box MovedBox(const Box& box, const Pose& T_rel, double voxel_m) {
  Eigen::AlignedBox3d moved;
  for (int i = 0; i < 8; ++i) {
    Eigen::Vector3d corner;
    for (int a = 0; a < 3; ++a) corner[a] = ((i >> a) & 1) != 0 ? box.high[a] : box.low[a];
    moved.extend(Eigen::Vector3d(T_rel * (voxel_m * corner) / voxel_m));
  }
  return {moved.min().array().floor().matrix().cast<int>() - Eigen::Vector3i::Ones(),
          moved.max().array().ceil().matrix().cast<int>() + Eigen::Vector3i::Ones()};
}

}  // namespace tsdfpp::reference
