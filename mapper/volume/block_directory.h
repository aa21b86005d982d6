// Where the blocks of a grid are: their numbers by index, kept in cells of 4x4x4 blocks, so that a
// block and its neighbours are found with few searches.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace tsdfpp {

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

// Blocks of maps are at most this far from the origin along each axis
// (mapper/volume/lattice_range.h), which at 1 cm are 84 km; no grid stores one beyond
// kFurthestStored, whose neighbours are packed as well.
inline constexpr int kFurthestBlock = (1 << 20) - 16;
inline constexpr int kFurthestStored = (1 << 20) - 2;

// 21 bits an axis.
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

class BlockDirectory {
 public:
  static constexpr std::int32_t kNone = -1;

  BlockDirectory() : slots_(kFirstSlots) {}

  // kNone where there is no such block.
  std::int32_t Find(const Index3& block) const {
    const Cell* cell = CellOf(block);
    return cell == nullptr ? kNone : cell->number[PlaceOf(block)];
  }

  // The numbers of a block and of the seven further along x, y, z (bits 0, 1, 2 of the place).
  std::array<std::int32_t, 8> FindUpper(const Index3& block) const {
    // Along each axis the two lie in one cell but at its end.
    const unsigned leaves = ((block.x & 3) == 3 ? 1U : 0U) | ((block.y & 3) == 3 ? 2U : 0U) |
                            ((block.z & 3) == 3 ? 4U : 0U);
    std::array<const Cell*, 8> cells{};
    std::array<std::int32_t, 8> numbers;
    for (unsigned i = 0; i < 8; ++i) {
      const Index3 at = block + Index3{static_cast<int>(i & 1U), static_cast<int>((i >> 1U) & 1U),
                                       static_cast<int>(i >> 2U)};
      if ((i & leaves) == i) cells[i] = CellOf(at);
      const Cell* of = cells[i & leaves];
      numbers[i] = of == nullptr ? kNone : of->number[PlaceOf(at)];
    }
    return numbers;
  }

  // Enters a block, or changes its number.
  void Set(const Index3& block, std::int32_t number) {
    Cell& cell = CellToWrite(block);
    std::int32_t& at = cell.number[PlaceOf(block)];
    if (at == kNone) ++cell.used;
    at = number;
  }

  // The block must be there.
  void Erase(const Index3& block) {
    std::size_t slot = SlotOf(block);
    Cell& cell = cells_[static_cast<std::size_t>(slots_[slot].cell)];
    cell.number[PlaceOf(block)] = kNone;
    if (--cell.used > 0) return;
    cell.number[0] = std::exchange(first_free_, slots_[slot].cell);
    --used_cells_;
    Vacate(slot);
  }

  std::size_t Bytes() const {
    return slots_.size() * sizeof(Slot) + cells_.capacity() * sizeof(Cell);
  }

 private:
  struct Cell {
    std::int32_t used = 0;
    std::array<std::int32_t, 64> number{};
  };
  struct Slot {
    std::uint64_t key = 0;
    std::int32_t cell = kNone;
  };
  static constexpr std::size_t kFirstSlots = 32;

  static std::size_t PlaceOf(const Index3& block) {
    return static_cast<std::size_t>((block.z & 3) * 16 + (block.y & 3) * 4 + (block.x & 3));
  }
  static std::uint64_t KeyOf(const Index3& block) {
    return PackIndex({block.x >> 2, block.y >> 2, block.z >> 2});
  }
  std::size_t HomeOf(std::uint64_t key) const {
    key ^= key >> 31U;
    key *= 0x9E3779B97F4A7C15ULL;
    key ^= key >> 29U;
    return static_cast<std::size_t>(key) & (slots_.size() - 1);
  }
  std::size_t Next(std::size_t slot) const { return (slot + 1) & (slots_.size() - 1); }

  // The slot of the block's cell, or the empty one where it would be.
  std::size_t SlotOf(const Index3& block) const {
    const std::uint64_t key = KeyOf(block);
    std::size_t slot = HomeOf(key);
    while (slots_[slot].cell != kNone && slots_[slot].key != key) slot = Next(slot);
    return slot;
  }
  const Cell* CellOf(const Index3& block) const {
    const std::int32_t cell = slots_[SlotOf(block)].cell;
    return cell == kNone ? nullptr : &cells_[static_cast<std::size_t>(cell)];
  }
  Cell& CellToWrite(const Index3& block) {
    std::size_t slot = SlotOf(block);
    if (slots_[slot].cell == kNone) {
      if ((used_cells_ + 1) * 2 > slots_.size()) {
        Grow();
        slot = SlotOf(block);
      }
      slots_[slot] = {KeyOf(block), NewCell()};
    }
    return cells_[static_cast<std::size_t>(slots_[slot].cell)];
  }
  std::int32_t NewCell() {
    if (first_free_ == kNone) {
      first_free_ = static_cast<std::int32_t>(cells_.size());
      cells_.emplace_back().number[0] = kNone;
    }
    Cell& cell = cells_[static_cast<std::size_t>(first_free_)];
    const std::int32_t taken = std::exchange(first_free_, cell.number[0]);
    cell.number.fill(kNone);
    ++used_cells_;
    return taken;
  }
  void Grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.cell == kNone) continue;
      std::size_t at = HomeOf(slot.key);
      while (slots_[at].cell != kNone) at = Next(at);
      slots_[at] = slot;
    }
  }
  // Empties a slot and pulls the ones behind it forward, so that no search ends too early.
  void Vacate(std::size_t slot) {
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t next = Next(slot); slots_[next].cell != kNone; next = Next(next)) {
      const std::size_t home = HomeOf(slots_[next].key);
      if (((next - home) & mask) < ((next - slot) & mask)) continue;
      slots_[slot] = slots_[next];
      slot = next;
    }
    slots_[slot] = {};
  }

  std::vector<Slot> slots_;
  std::vector<Cell> cells_;
  std::size_t used_cells_ = 0;
  std::int32_t first_free_ = kNone;  // of the cells without a block, which name the next one
};

}  // namespace tsdfpp
