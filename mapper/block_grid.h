// Sparse grids of 8x8x8 voxel blocks on the common lattice (docs/map.md, "Lattice").
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace tsdfpp {

inline constexpr int kBlockSide = 8;
inline constexpr int kBlockVoxels = kBlockSide * kBlockSide * kBlockSide;

// Index of a voxel or of a block; ordered by z, then y, then x.
struct Index3 {
  int x = 0;
  int y = 0;
  int z = 0;

  Index3 operator+(const Index3& other) const { return {x + other.x, y + other.y, z + other.z}; }
  bool operator==(const Index3&) const = default;
  std::strong_ordering operator<=>(const Index3& other) const {
    if (z != other.z) return z <=> other.z;
    if (y != other.y) return y <=> other.y;
    return x <=> other.x;
  }
};

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

// 21 bits an axis, which at 1 cm reaches 80 km from the origin.
inline std::uint64_t PackIndex(const Index3& index) {
  constexpr std::int64_t kOffset = 1 << 20;
  constexpr std::uint64_t kMask = (1ULL << 21U) - 1;
  return (static_cast<std::uint64_t>(index.z + kOffset) & kMask) << 42U |
         (static_cast<std::uint64_t>(index.y + kOffset) & kMask) << 21U |
         (static_cast<std::uint64_t>(index.x + kOffset) & kMask);
}
inline Index3 UnpackIndex(std::uint64_t key) {
  constexpr int kOffset = 1 << 20;
  constexpr std::uint64_t kMask = (1ULL << 21U) - 1;
  return {static_cast<int>(key & kMask) - kOffset, static_cast<int>((key >> 21U) & kMask) - kOffset,
          static_cast<int>(key >> 42U) - kOffset};
}

// A hash of blocks. References to blocks stay valid until the block is erased.
template <typename Block>
class BlockGrid {
 public:
  struct Entry {
    Index3 index;
    std::unique_ptr<Block> block;
  };

  BlockGrid() { slots_.resize(kInitialSlots, kEmpty); }
  BlockGrid(BlockGrid&&) noexcept = default;
  BlockGrid& operator=(BlockGrid&&) noexcept = default;
  BlockGrid(const BlockGrid& other) : slots_(other.slots_) {
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
    for (std::size_t slot = SlotOf(index);; slot = (slot + 1) & (slots_.size() - 1)) {
      const std::int32_t at = slots_[slot];
      if (at == kEmpty) return std::nullopt;
      if (entries_[static_cast<std::size_t>(at)].index == index)
        return static_cast<std::size_t>(at);
    }
  }

  // The block, or nullptr.
  Block* Find(const Index3& index) const {
    const auto number = NumberOf(index);
    return number ? entries_[*number].block.get() : nullptr;
  }

  Block& FindOrAdd(const Index3& index) {
    if (Block* block = Find(index)) return *block;
    return Add(index, std::make_unique<Block>());
  }

  // The block must not be there yet.
  Block& Add(const Index3& index, std::unique_ptr<Block> block) {
    if ((entries_.size() + 1) * 2 > slots_.size()) {
      slots_.assign(slots_.size() * 2, kEmpty);
      for (std::size_t i = 0; i < entries_.size(); ++i) Place(i);
    }
    entries_.push_back({index, std::move(block)});
    Place(entries_.size() - 1);
    return *entries_.back().block;
  }

  // Erases blocks that are there, each named once; the others keep their order.
  void Erase(const std::vector<Index3>& indices) {
    if (indices.empty()) return;
    std::size_t first = entries_.size();
    for (const Index3& index : indices) {
      const std::size_t slot = FindSlot(index);
      const auto entry = static_cast<std::size_t>(slots_[slot]);
      entries_[entry].block.reset();
      first = std::min(first, entry);
      Vacate(slot);
    }
    // What was made last goes first, as a rule, so that there is little to move.
    std::size_t kept = first;
    for (std::size_t i = first; i < entries_.size(); ++i) {
      if (entries_[i].block == nullptr) continue;
      if (i != kept) {
        slots_[FindSlot(entries_[i].index)] = static_cast<std::int32_t>(kept);
        entries_[kept] = std::move(entries_[i]);
      }
      ++kept;
    }
    entries_.resize(kept);
  }

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
    return slots_.size() * sizeof(std::int32_t) + entries_.capacity() * sizeof(Entry);
  }

 private:
  // Of a block that is there. An entry that was moved, or erased, matches by its index still.
  std::size_t FindSlot(const Index3& index) const {
    std::size_t slot = SlotOf(index);
    while (entries_[static_cast<std::size_t>(slots_[slot])].index != index) {
      slot = (slot + 1) & (slots_.size() - 1);
    }
    return slot;
  }
  // Empties a slot and pulls the ones behind it forward, so that no search ends too early.
  void Vacate(std::size_t slot) {
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t next = (slot + 1) & mask; slots_[next] != kEmpty; next = (next + 1) & mask) {
      const std::size_t home = SlotOf(entries_[static_cast<std::size_t>(slots_[next])].index);
      if (((next - home) & mask) < ((next - slot) & mask)) continue;
      slots_[slot] = slots_[next];
      slot = next;
    }
    slots_[slot] = kEmpty;
  }

  static constexpr std::int32_t kEmpty = -1;
  static constexpr std::size_t kInitialSlots = 64;

  std::size_t SlotOf(const Index3& index) const {
    std::uint64_t key = PackIndex(index);
    key ^= key >> 31U;
    key *= 0x9E3779B97F4A7C15ULL;
    key ^= key >> 29U;
    return static_cast<std::size_t>(key) & (slots_.size() - 1);
  }
  void Place(std::size_t entry) {
    std::size_t slot = SlotOf(entries_[entry].index);
    while (slots_[slot] != kEmpty) slot = (slot + 1) & (slots_.size() - 1);
    slots_[slot] = static_cast<std::int32_t>(entry);
  }

  std::vector<std::int32_t> slots_;
  std::vector<Entry> entries_;
};

}  // namespace tsdfpp
