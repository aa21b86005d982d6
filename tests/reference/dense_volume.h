// A dense signed-distance volume with the blocks that a sparse one would hold (docs/map.md,
// "Allocation"), its crossed cubes, cover and resampling.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <set>
#include <vector>

#include "tests/reference/dense_grid.h"
#include "tests/reference/dense_voxel.h"

namespace tsdfpp::reference {

// Coordinates of an 8x8x8 block; ordered by (z, y, x).
class BlockSet {
 public:
  static Eigen::Vector3i BlockOf(const Eigen::Vector3i& voxel);
  bool HasBlockOf(const Eigen::Vector3i& voxel) const;
  void AddBlockOf(const Eigen::Vector3i& voxel);
  void Clear() { blocks_.clear(); }
  // Frees the blocks none of whose voxels are `held`.
  void FreeUnless(const std::function<bool(const Eigen::Vector3i&)>& held);
  std::size_t size() const { return blocks_.size(); }
  // As (z, y, x).
  const std::set<std::array<int, 3>>& blocks() const { return blocks_; }

  template <typename Function>
  void ForEachVoxelOfBlocks(Function&& function) const {
    for (const auto& [z, y, x] : blocks_) {
      const Eigen::Vector3i low = 8 * Eigen::Vector3i(x, y, z);
      ForEachVoxel(Box{low, low + Eigen::Vector3i::Constant(7)}, function);
    }
  }

 private:
  std::set<std::array<int, 3>> blocks_;
};

// Adds the blocks in which pixels with a wanted label have a point of their band.
void Allocate(const Frame& frame, const cv::Mat& labels, const Pose& T_WL, const MapConfig& config,
              const std::function<bool(InstanceId)>& wanted, BlockSet& blocks);

struct DenseVolume {
  explicit DenseVolume(const Box& box) : grid(box) {}

  // docs/map.md, "Freeing".
  void FreeEmptyBlocks() {
    blocks.FreeUnless([this](const Eigen::Vector3i& v) { return grid(v).observed(); });
  }

  DenseGrid<DenseVoxel> grid;
  BlockSet blocks;
};

std::vector<Eigen::Vector3i> ObservedVoxels(const DenseGrid<DenseVoxel>& grid);

bool IsCrossed(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3i& cube);
// All of them, ordered by (z, y, x).
std::vector<Eigen::Vector3i> CrossedCubes(const DenseGrid<DenseVoxel>& grid);

// The trilinear distance at q (in voxels); nothing where a corner that counts is unobserved.
std::optional<float> DistanceAt(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3d& q);
// docs/map.md, "Cover".
bool Covers(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3d& q, const MapConfig& config);
// Covers() at every lattice point, found from the crossed cubes.
DenseGrid<std::uint8_t> CoverOfLattice(const DenseGrid<DenseVoxel>& grid, const MapConfig& config);

// The source point of a destination voxel, in voxels: T_rel^-1 * (h v') / h.
Eigen::Vector3d SourcePoint(const Pose& T_rel_inverse, const Eigen::Vector3i& voxel, double h);

// docs/map.md, tsdf++ "resample".
DenseVolume Resample(const DenseVolume& old, const Pose& T_rel, const MapConfig& config);

// One frame into one object's volume, contradiction included (docs/map.md, tsdf++ "Fusion"). Marks
// the voxels that vote for the object in `votes`, unless that is null.
void FuseObject(InstanceId id, const View& view, const MapConfig& config, DenseVolume& volume,
                DenseGrid<std::uint8_t>* votes);

// docs/map.md, "Rims", of one object, after FuseObject of the same frame: the voxels that it
// completes and their values. `grid` holds the object's voxels alone, and `is_free` says where a
// value may be put.
struct RimVoxel {
  Eigen::Vector3i voxel;
  DenseVoxel value;
};
std::vector<RimVoxel> RimsOf(InstanceId id, const Frame& frame, const cv::Mat& labels,
                             const Pose& T_WL, const MapConfig& config,
                             const DenseGrid<DenseVoxel>& grid,
                             const std::function<bool(const Eigen::Vector3i&)>& is_free);
// Puts them into the object's volume.
void CompleteRims(InstanceId id, const Frame& frame, const cv::Mat& labels, const Pose& T_WL,
                  const MapConfig& config, DenseVolume& volume);

}  // namespace tsdfpp::reference
