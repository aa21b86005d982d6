#include "mapper/volume/block_set.h"

#include <algorithm>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {

void BlockBox::Extend(const Index3& index) {
  if (is_empty) low = high = index;
  is_empty = false;
  low = {std::min(low.x, index.x), std::min(low.y, index.y), std::min(low.z, index.z)};
  high = {std::max(high.x, index.x), std::max(high.y, index.y), std::max(high.z, index.z)};
}

bool BlockBox::Meets(const BlockBox& other) const {
  return !is_empty && !other.is_empty && low.x <= other.high.x && low.y <= other.high.y &&
         low.z <= other.high.z && other.low.x <= high.x && other.low.y <= high.y &&
         other.low.z <= high.z;
}

BlockBox MovedBox(const BlockBox& box, const Pose* T, double voxel_m, int margin) {
  BlockBox moved;
  if (box.is_empty) return moved;
  const Index3 low{box.low.x * kBlockSide - margin, box.low.y * kBlockSide - margin,
                   box.low.z * kBlockSide - margin};
  const Index3 high{(box.high.x + 1) * kBlockSide + margin, (box.high.y + 1) * kBlockSide + margin,
                    (box.high.z + 1) * kBlockSide + margin};
  if (T == nullptr) {
    moved.Extend(BlockOf(low));
    moved.Extend(BlockOf(high + Index3{-1, -1, -1}));
    return moved;
  }
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner((i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y,
                                 (i & 4) != 0 ? high.z : low.z);
    moved.Extend(BlockOf(FloorOf(*T * (corner * voxel_m) / voxel_m)));
  }
  return moved;
}

std::optional<BlockSet> BlockSet::Of(const std::vector<BlockBox>& boxes, int margin) {
  constexpr double kMost = 1 << 22;  // blocks in the bounds, a byte each
  BlockSet set;
  BlockBox& bounds = set.bounds_;
  const Index3 down{-margin, -margin, -margin};
  const Index3 up{margin, margin, margin};
  for (const BlockBox& box : boxes) {
    if (box.is_empty) continue;
    bounds.Extend(box.low + down);
    bounds.Extend(box.high + up);
  }
  if (bounds.is_empty) return set;
  const auto side = [](int low, int high) { return double{1} + high - low; };
  if (side(bounds.low.x, bounds.high.x) * side(bounds.low.y, bounds.high.y) *
          side(bounds.low.z, bounds.high.z) >
      kMost) {
    return std::nullopt;
  }
  set.held_.assign(set.PlaceOf(bounds.high) + 1, 0);
  for (const BlockBox& box : boxes) {
    if (box.is_empty) continue;
    const Index3 low = box.low + down;
    const Index3 high = box.high + up;
    for (int z = low.z; z <= high.z; ++z) {
      for (int y = low.y; y <= high.y; ++y) {
        const std::size_t first = set.PlaceOf({low.x, y, z});
        std::fill_n(set.held_.begin() + static_cast<std::ptrdiff_t>(first), high.x - low.x + 1,
                    std::uint8_t{1});
      }
    }
  }
  return set;
}

std::size_t BlockSet::PlaceOf(const Index3& index) const {
  const auto along = [](int at, int low) { return static_cast<std::size_t>(at - low); };
  const std::size_t width = along(bounds_.high.x, bounds_.low.x) + 1;
  const std::size_t depth = along(bounds_.high.y, bounds_.low.y) + 1;
  return along(index.x, bounds_.low.x) +
         width * (along(index.y, bounds_.low.y) + depth * along(index.z, bounds_.low.z));
}

bool BlockSet::Holds(const Index3& index) const {
  return bounds_.Holds(index) && held_[PlaceOf(index)] != 0;
}

bool BlockSet::Meets(const BlockBox& box) const {
  if (!bounds_.Meets(box)) return false;
  const Index3 low{std::max(box.low.x, bounds_.low.x), std::max(box.low.y, bounds_.low.y),
                   std::max(box.low.z, bounds_.low.z)};
  const Index3 high{std::min(box.high.x, bounds_.high.x), std::min(box.high.y, bounds_.high.y),
                    std::min(box.high.z, bounds_.high.z)};
  for (int z = low.z; z <= high.z; ++z) {
    for (int y = low.y; y <= high.y; ++y) {
      const auto first = held_.begin() + static_cast<std::ptrdiff_t>(PlaceOf({low.x, y, z}));
      const auto end = first + (high.x - low.x + 1);
      if (std::find(first, end, 1) != end) return true;
    }
  }
  return false;
}

}  // namespace tsdfpp
