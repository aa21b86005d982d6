// Sparse grids of 8x8x8 voxel blocks on the common lattice (docs/map.md, "Lattice").
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "mapper/volume/block_directory.h"

namespace tsdfpp {

inline constexpr int kBlockSide = 8;
inline constexpr int kBlockVoxels = kBlockSide * kBlockSide * kBlockSide;

inline Index3 ToIndex3(const Eigen::Vector3i& v) { return {v.x(), v.y(), v.z()}; }

// The block that holds a voxel; right shifts floor negative numbers too.
inline Index3 BlockOf(const Index3& voxel) { return {voxel.x >> 3, voxel.y >> 3, voxel.z >> 3}; }
// The voxel's place in its block: x fastest, then y, then z.
inline int PlaceInBlock(const Index3& voxel) {
  return (voxel.z & 7) * 64 + (voxel.y & 7) * 8 + (voxel.x & 7);
}
inline Index3 VoxelAt(const Index3& block, int place) {
  return {block.x * kBlockSide + (place & 7), block.y * kBlockSide + ((place >> 3) & 7),
          block.z * kBlockSide + (place >> 6)};
}

// A hash of blocks. References to blocks stay valid until the block is erased.
template <typename Block>
class BlockGrid {
 public:
  struct Entry {
    Index3 index;
    std::unique_ptr<Block> block;
  };

  BlockGrid() = default;
  BlockGrid(BlockGrid&&) noexcept = default;
  BlockGrid& operator=(BlockGrid&&) noexcept = default;
  BlockGrid(const BlockGrid& other) : directory_(other.directory_) {
    entries_.reserve(other.entries_.size());
    for (const Entry& entry : other.entries_) {
      entries_.push_back({entry.index, std::make_unique<Block>(*entry.block)});
    }
  }
  BlockGrid& operator=(const BlockGrid& other) {
    if (this != &other) *this = BlockGrid(other);
    return *this;
  }
  ~BlockGrid() = default;

  // The block's place in entries(), or nothing.
  std::optional<std::size_t> NumberOf(const Index3& index) const {
    const std::int32_t number = directory_.Find(index);
    if (number == BlockDirectory::kNone) return std::nullopt;
    return static_cast<std::size_t>(number);
  }

  // The block, or nullptr.
  Block* Find(const Index3& index) const { return BlockOrNone(directory_.Find(index)); }

  // A block and the seven further along x, y, z (bits 0, 1, 2 of the place); nullptr where there is
  // none.
  std::array<const Block*, 8> FindUpper(const Index3& index) const {
    const std::array<std::int32_t, 8> numbers = directory_.FindUpper(index);
    std::array<const Block*, 8> blocks;
    for (std::size_t i = 0; i < numbers.size(); ++i) blocks[i] = BlockOrNone(numbers[i]);
    return blocks;
  }

  Block& FindOrAdd(const Index3& index) {
    if (Block* block = Find(index)) return *block;
    return Add(index, std::make_unique<Block>());
  }

  // The block must not be there yet. Aborts beyond kFurthestStored, where neighbours would wrap.
  Block& Add(const Index3& index, std::unique_ptr<Block> block) {
    for (const int along : {index.x, index.y, index.z}) {
      if (along < -kFurthestStored || along > kFurthestStored) std::abort();
    }
    directory_.Set(index, static_cast<std::int32_t>(entries_.size()));
    entries_.push_back({index, std::move(block)});
    return *entries_.back().block;
  }

  // Erases blocks that are there, each named once; the others keep their order.
  void Erase(const std::vector<Index3>& indices) {
    if (indices.empty()) return;
    std::size_t first = entries_.size();
    for (const Index3& index : indices) {
      const auto entry = static_cast<std::size_t>(directory_.Find(index));
      entries_[entry].block.reset();
      first = std::min(first, entry);
      directory_.Erase(index);
    }
    // What was made last goes first, as a rule, so that there is little to move.
    std::size_t kept = first;
    for (std::size_t i = first; i < entries_.size(); ++i) {
      if (entries_[i].block == nullptr) continue;
      if (i != kept) {
        directory_.Set(entries_[i].index, static_cast<std::int32_t>(kept));
        entries_[kept] = std::move(entries_[i]);
      }
      ++kept;
    }
    entries_.resize(kept);
  }

  // Where the blocks are in entries().
  const BlockDirectory& directory() const { return directory_; }

  // In the order of insertion.
  const std::vector<Entry>& entries() const { return entries_; }
  std::size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }

  // Pointers to the entries, ordered by index.
  std::vector<const Entry*> Sorted() const {
    std::vector<const Entry*> sorted;
    sorted.reserve(entries_.size());
    for (const Entry& entry : entries_) sorted.push_back(&entry);
    std::sort(sorted.begin(), sorted.end(),
              [](const Entry* a, const Entry* b) { return a->index < b->index; });
    return sorted;
  }

  std::size_t TableBytes() const {
    return directory_.Bytes() + entries_.capacity() * sizeof(Entry);
  }

 private:
  Block* BlockOrNone(std::int32_t number) const {
    return number == BlockDirectory::kNone ? nullptr
                                           : entries_[static_cast<std::size_t>(number)].block.get();
  }

  BlockDirectory directory_;
  std::vector<Entry> entries_;
};

}  // namespace tsdfpp
