// The TSDF of one object in its own lattice (paper III-A, "object volume").
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

struct ObjectVolume {
  TsdfGrid grid;
  std::optional<Pose> T_WO_birth;  // the first pose that the object was given
  std::optional<Pose> T_WO;        // the last
  Pose T_WL = Pose::Identity();    // where the lattice is; moves only for anchored volumes
  bool lattice_is_world = true;    // T_WL is exactly the identity
  // Names the grid's values, as TsdfBlock::revision does a block's: whoever changes a block's, or
  // has other blocks, gives the volume a new one, without which kept meshes are not looked at.
  std::uint64_t revision = NewRevision();
};

// Whether the numbers of two poses are the same.
inline bool SameNumbers(const Pose& a, const Pose& b) { return a.matrix() == b.matrix(); }

// T_WL from the poses at birth and now, where the volume stays in its object's frame.
inline void PlaceLattice(ObjectVolume& volume) {
  volume.lattice_is_world = !volume.T_WO_birth || SameNumbers(*volume.T_WO_birth, *volume.T_WO);
  volume.T_WL =
      volume.lattice_is_world ? Pose::Identity() : *volume.T_WO * volume.T_WO_birth->inverse();
}

// What a pose would do to what a map holds of an object.
struct ObjectMove {
  Pose T_WL = Pose::Identity();  // where the object's lattice would be
  // What would move, by T, from its lattice to the world; nullptr where nothing does.
  const TsdfGrid* blocks = nullptr;
  Pose T = Pose::Identity();
  std::function<bool(const Index3&)> is_moved;  // of the blocks; empty where all are
};

// What a new pose does where values move and the lattice is always the world's.
inline ObjectMove MoveOfValues(const ObjectVolume& volume, const Pose& T_WO) {
  ObjectMove move;
  if (!volume.T_WO || SameNumbers(*volume.T_WO, T_WO)) return move;
  move.T = T_WO * volume.T_WO->inverse();
  move.blocks = &volume.grid;
  return move;
}

// What a new pose does where the volume stays in its object's lattice.
inline ObjectMove MoveOfLattice(const ObjectVolume& volume, const Pose& T_WO) {
  ObjectMove move;
  if (!volume.T_WO_birth || SameNumbers(*volume.T_WO_birth, T_WO)) return move;
  if (SameNumbers(*volume.T_WO, T_WO)) {
    move.T_WL = volume.T_WL;
    return move;
  }
  move.T_WL = move.T = T_WO * volume.T_WO_birth->inverse();
  move.blocks = &volume.grid;
  return move;
}

// Reads voxels of a grid by index through a dense table of block pointers over the grid's bounding
// box: for many reads of one object. The grid must not change meanwhile.
class VoxelReader {
 public:
  explicit VoxelReader(const TsdfGrid& grid);

  // The block, or nullptr.
  const TsdfBlock* BlockAt(const Index3& block) const {
    const Index3 at{block.x - low_.x, block.y - low_.y, block.z - low_.z};
    if (at.x < 0 || at.y < 0 || at.z < 0 || at.x >= size_.x || at.y >= size_.y || at.z >= size_.z) {
      return nullptr;
    }
    if (blocks_.empty()) return grid_->Find(block);
    return blocks_[(static_cast<std::size_t>(at.z) * static_cast<std::size_t>(size_.y) +
                    static_cast<std::size_t>(at.y)) *
                       static_cast<std::size_t>(size_.x) +
                   static_cast<std::size_t>(at.x)];
  }
  bool empty() const { return grid_->empty(); }
  const TsdfGrid& grid() const { return *grid_; }
  // Lowest and highest block index, both included.
  Index3 low() const { return low_; }
  Index3 high() const { return {low_.x + size_.x - 1, low_.y + size_.y - 1, low_.z + size_.z - 1}; }

 private:
  const TsdfGrid* grid_;
  Index3 low_;
  Index3 size_;
  std::vector<const TsdfBlock*> blocks_;  // empty where the box is too large for a table
};

// The eight corners around a point, and where it lies between them.
struct Corners {
  std::array<const TsdfBlock*, 8> block{};  // corner x + 2 y + 4 z; nullptr where there is none
  std::array<int, 8> place{};
  std::array<float, 3> fraction{};
  Index3 base;
};

// The floor of each coordinate, without a call into the mathematical library.
inline Index3 FloorOf(const Eigen::Vector3d& q) {
  const auto floor = [](double x) {
    const int truncated = static_cast<int>(x);
    return truncated - (x < truncated ? 1 : 0);
  };
  return {floor(q.x()), floor(q.y()), floor(q.z())};
}

// Corners of the point q, in voxels of the lattice.
Corners FindCorners(const VoxelReader& reader, const Eigen::Vector3d& q);
// Of the voxel itself: fractions are 0.
Corners FindCorners(const VoxelReader& reader, const Index3& base);

// The order of operations of docs/map.md, "Resampling".
float Trilinear(const std::array<float, 8>& corner, const std::array<float, 3>& fraction);

// The distance at a point, from the corners with a non-zero coefficient; nothing where one of these
// is unobserved.
std::optional<float> DistanceAt(const Corners& corners);

// Blocks (in Index3's order) whose voxels T * (voxels of the reader's blocks) can touch: the box of
// the transformed blocks' corners, one voxel larger on all sides. `only_negative` leaves out the
// reader's blocks that hold no negative voxel, near which nothing is covered.
std::vector<Index3> BlocksTouchedBy(const VoxelReader& reader, const Pose& T, double voxel_m,
                                    bool only_negative = false);

}  // namespace tsdfpp
