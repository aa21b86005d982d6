// Boxes and sets of blocks.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/types.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp {

// Blocks of a lattice, both ends included.
struct BlockBox {
  Index3 low;
  Index3 high;
  bool is_empty = true;

  void Extend(const Index3& index);
  bool Holds(const Index3& index) const {
    return !is_empty && index.x >= low.x && index.y >= low.y && index.z >= low.z &&
           index.x <= high.x && index.y <= high.y && index.z <= high.z;
  }
  // Whether they have a block in common.
  bool Meets(const BlockBox& other) const;
};

// The blocks that a box of blocks touches when `margin` voxels are added on each side and it is
// moved by T (in metres). No motion where T is nullptr.
BlockBox MovedBox(const BlockBox& box, const Pose* T, double voxel_m, int margin);

// A set of blocks.
class BlockSet {
 public:
  // All blocks of the boxes and, with a margin, those at most so many blocks away along each axis.
  // Nothing where they are so far apart that this takes more than some megabytes.
  static std::optional<BlockSet> Of(const std::vector<BlockBox>& boxes, int margin);

  bool Holds(const Index3& index) const;
  // Whether it holds a block of the box.
  bool Meets(const BlockBox& box) const;
  bool empty() const { return bounds_.is_empty; }
  // Around all that it holds.
  const BlockBox& bounds() const { return bounds_; }

 private:
  std::size_t PlaceOf(const Index3& index) const;

  BlockBox bounds_;
  std::vector<std::uint8_t> held_;  // of the bounds
};

}  // namespace tsdfpp
