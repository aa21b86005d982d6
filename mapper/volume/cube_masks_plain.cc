// The cubes of a block and the corners of cubes, one voxel after the other.
#include "mapper/volume/cube_masks.h"

namespace tsdfpp::plain {
namespace {

std::size_t Number(int i) { return static_cast<std::size_t>(i); }

// The bit of a voxel given from the block's first one, which may lie in a block around it: along
// each axis at most one step up (for UpperMasks) or back (for LowerMasks).
bool BitAround(const std::array<const BlockMask*, 8>& masks, const Index3& voxel) {
  const Index3 block = BlockOf(voxel);
  const int which = (block.x != 0 ? 1 : 0) + (block.y != 0 ? 2 : 0) + (block.z != 0 ? 4 : 0);
  return Bit(*masks[Number(which)], PlaceInBlock(voxel));
}

Index3 Corner(int k) { return {k & 1, (k >> 1) & 1, k >> 2}; }

// What a voxel and its neighbours are.
struct Signs {
  bool inside = false;   // one is observed and negative
  bool outside = false;  // one is observed and not negative
};

// Of the voxel at the place and its neighbours within the block.
Signs SignsAround(const BlockMask& observed, const BlockMask& negative, int place) {
  Signs signs;
  for (int k = 0; k < 27; ++k) {
    const Index3 voxel = VoxelAt({0, 0, 0}, place) + Index3{k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
    if (BlockOf(voxel) != Index3{0, 0, 0}) continue;
    const int at = PlaceInBlock(voxel);
    signs.inside = signs.inside || Bit(negative, at);
    signs.outside = signs.outside || (Bit(observed, at) && !Bit(negative, at));
  }
  return signs;
}

bool IsAtRim(int place) {
  const Index3 voxel = VoxelAt({0, 0, 0}, place);
  const auto at_end = [](int i) { return i == 0 || i == kBlockSide - 1; };
  return at_end(voxel.x) || at_end(voxel.y) || at_end(voxel.z);
}

}  // namespace

CubeMasks FindCubeMasks(const UpperMasks& observed, const UpperMasks& negative) {
  CubeMasks cubes{};
  for (int place = 0; place < kBlockVoxels; ++place) {
    int corners_observed = 0;
    int corners_negative = 0;
    for (int k = 0; k < 8; ++k) {
      const Index3 corner = VoxelAt({0, 0, 0}, place) + Corner(k);
      corners_observed += BitAround(observed, corner) ? 1 : 0;
      corners_negative += BitAround(negative, corner) ? 1 : 0;
    }
    if (corners_observed < 8) continue;
    SetBit(cubes.complete, place);
    if (corners_negative > 0 && corners_negative < 8) SetBit(cubes.crossed, place);
  }
  return cubes;
}

BlockMask CornersOfCubes(const LowerMasks& cubes) {
  BlockMask corners{};
  for (int place = 0; place < kBlockVoxels; ++place) {
    for (int k = 0; k < 8; ++k) {
      const Index3 back = Corner(k);
      const Index3 cube = VoxelAt({0, 0, 0}, place) + Index3{-back.x, -back.y, -back.z};
      if (BitAround(cubes, cube)) SetBit(corners, place);
    }
  }
  return corners;
}

BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                       const BlockMask& observed, const BlockMask& negative) {
  BlockMask changed{};
  for (int place = 0; place < kBlockVoxels; ++place) {
    if (Bit(old_observed, place) == Bit(observed, place) &&
        Bit(old_negative, place) == Bit(negative, place)) {
      continue;
    }
    const Signs before = SignsAround(old_observed, old_negative, place);
    const Signs after = SignsAround(observed, negative, place);
    const bool both = (before.inside || after.inside) && (before.outside || after.outside);
    if (both || IsAtRim(place)) SetBit(changed, place);
  }
  return changed;
}

}  // namespace tsdfpp::plain
