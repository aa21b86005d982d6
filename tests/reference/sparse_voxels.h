// Voxels in blocks of 8x8x8, of which only some are there: what a dense array of a whole scene
// would hold, in the room that its surfaces take.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <map>

namespace tsdfpp::reference {

template <typename Voxel>
class SparseVoxels {
 public:
  using Key = std::array<int, 3>;  // of a block, as (z, y, x): blocks are kept in this order
  using Block = std::array<Voxel, 512>;

  static Key KeyOf(const Eigen::Vector3i& v) { return {v.z() >> 3, v.y() >> 3, v.x() >> 3}; }
  static std::size_t PlaceOf(const Eigen::Vector3i& v) {
    return static_cast<std::size_t>(((v.z() & 7) * 8 + (v.y() & 7)) * 8 + (v.x() & 7));
  }
  static Eigen::Vector3i VoxelAt(const Key& key, std::size_t place) {
    const auto p = static_cast<int>(place);
    return {8 * key[2] + (p & 7), 8 * key[1] + ((p >> 3) & 7), 8 * key[0] + (p >> 6)};
  }

  const Block* Find(const Key& key) const {
    const auto found = blocks_.find(key);
    return found == blocks_.end() ? nullptr : &found->second;
  }
  Block* Find(const Key& key) {
    const auto found = blocks_.find(key);
    return found == blocks_.end() ? nullptr : &found->second;
  }
  Block& FindOrAdd(const Key& key) { return blocks_[key]; }

  // The default value where there is no block.
  const Voxel& operator()(const Eigen::Vector3i& v) const {
    static const Voxel kNone{};
    const Block* block = Find(KeyOf(v));
    return block == nullptr ? kNone : (*block)[PlaceOf(v)];
  }
  // Makes the block where there is none.
  Voxel& At(const Eigen::Vector3i& v) { return FindOrAdd(KeyOf(v))[PlaceOf(v)]; }

  // Drops the blocks none of whose voxels are `held`.
  template <typename Held>
  void DropUnless(const Held& held) {
    std::erase_if(blocks_, [&](const auto& entry) {
      for (const Voxel& voxel : entry.second) {
        if (held(voxel)) return false;
      }
      return true;
    });
  }

  const std::map<Key, Block>& blocks() const { return blocks_; }
  std::map<Key, Block>& blocks() { return blocks_; }

  // Calls function(v, voxel) block by block, in a block in the order (z, y, x).
  template <typename Function>
  void ForEach(const Function& function) const {
    for (const auto& [key, block] : blocks_) {
      for (std::size_t place = 0; place < block.size(); ++place) {
        function(VoxelAt(key, place), block[place]);
      }
    }
  }
  template <typename Function>
  void ForEach(const Function& function) {
    for (auto& [key, block] : blocks_) {
      for (std::size_t place = 0; place < block.size(); ++place) {
        function(VoxelAt(key, place), block[place]);
      }
    }
  }

 private:
  std::map<Key, Block> blocks_;
};

// The cubes that a block's voxels name: their corners lie in it and in seven blocks around.
template <typename Voxel>
class CubesOfBlock {
 public:
  using Key = typename SparseVoxels<Voxel>::Key;

  CubesOfBlock(const SparseVoxels<Voxel>& voxels, const Key& key) {
    for (int i = 0; i < 8; ++i) {
      blocks_[static_cast<std::size_t>(i)] =
          voxels.Find({key[0] + (i >> 2), key[1] + ((i >> 1) & 1), key[2] + (i & 1)});
    }
  }

  // Corner 0..7 of the cube at a place of the block: bit 0 is x, bit 1 is y, bit 2 is z.
  const Voxel& Corner(std::size_t place, int corner) const {
    static const Voxel kNone{};
    const auto p = static_cast<int>(place);
    const int x = (p & 7) + (corner & 1);
    const int y = ((p >> 3) & 7) + ((corner >> 1) & 1);
    const int z = (p >> 6) + (corner >> 2);
    const auto* block =
        blocks_[static_cast<std::size_t>(((z >> 3) << 2) | ((y >> 3) << 1) | (x >> 3))];
    if (block == nullptr) return kNone;
    return (*block)[static_cast<std::size_t>(((z & 7) * 8 + (y & 7)) * 8 + (x & 7))];
  }

 private:
  std::array<const typename SparseVoxels<Voxel>::Block*, 8> blocks_{};
};

}  // namespace tsdfpp::reference
