// A block of signed distances, weights and colours, and the bit masks derived from them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "core/types.h"
#include "mapper/block_grid.h"
#include "mapper/block_pool.h"
#include "mapper/half.h"

namespace tsdfpp {

// One bit a voxel: slice z holds bit 8 y + x.
using BlockMask = std::array<std::uint64_t, kBlockSide>;

inline bool Bit(const BlockMask& mask, int place) {
  return ((mask[static_cast<std::size_t>(place >> 6)] >> static_cast<unsigned>(place & 63)) & 1U) !=
         0;
}
inline bool Any(const BlockMask& mask) {
  std::uint64_t any = 0;
  for (const std::uint64_t slice : mask) any |= slice;
  return any != 0;
}
inline void SetBit(BlockMask& mask, int place) {
  mask[static_cast<std::size_t>(place >> 6)] |= 1ULL << static_cast<unsigned>(place & 63);
}

// One number a voxel for the vectorised loops; -1 is yes and 0 is no where they answer a question.
using Lanes = std::array<std::int32_t, kBlockVoxels>;

using FixedColour = std::array<std::uint16_t, 3>;  // 8.8 fixed point

// A number that no call in this process has returned before, above 0. Only its being new means
// anything: it depends on threads.
std::uint64_t NewRevision();

struct alignas(64) BlockColours {
  std::array<std::array<std::uint16_t, kBlockVoxels>, 3> channel{};  // 8.8 fixed point
  std::array<std::uint8_t, kBlockVoxels> count{};

  static void* operator new(std::size_t);
  static void operator delete(void* block);
};
inline void* BlockColours::operator new(std::size_t) {
  return ObjectPool<sizeof(BlockColours), alignof(BlockColours)>::Take();
}
inline void BlockColours::operator delete(void* block) {
  ObjectPool<sizeof(BlockColours), alignof(BlockColours)>::Give(block);
}

// A unique_ptr that copies what it points at.
template <typename T>
class Copied : public std::unique_ptr<T> {
 public:
  Copied() = default;
  Copied(const Copied& other)
      : std::unique_ptr<T>(other == nullptr ? nullptr : std::make_unique<T>(*other)) {}
  Copied(Copied&&) noexcept = default;
  Copied& operator=(Copied other) noexcept {
    this->swap(other);
    return *this;
  }
  ~Copied() = default;
};

// Aligned to cache lines, which whole vectors then do not straddle.
struct alignas(64) TsdfBlock {
  std::array<Half, kBlockVoxels> distance{};        // metres, positive in front of the surface
  std::array<std::uint8_t, kBlockVoxels> weight{};  // observations; 0 is unobserved

  // Each fills a cache line.
  BlockMask observed{};  // weight > 0
  BlockMask negative{};  // observed and distance < 0
  BlockMask band{};      // observed and distance in [-back, 0)
  BlockMask cover{};     // docs/map.md, "Cover", at the lattice points; see FindCover
  BlockMask full{};      // of these it is known that the weight is at its cap

  // Only while a voxel has a colour: most blocks lie too far from a surface.
  Copied<BlockColours> colours;

  // Names the values: blocks of the same revision hold the same ones, 0 is an empty block. Whoever
  // changes values gives the block a new one (UpdateMasks does), which is how the cached meshes see
  // it.
  std::uint64_t revision = 0;

  // Kept by AnchoredMap where the object's lattice is the world's: other objects are listed in the
  // index's block as well.
  bool is_listed_with_others = false;

  static void* operator new(std::size_t);
  static void operator delete(void* block);

  // Brings the masks but for `cover` in line with the values, and gives the block a new revision;
  // true where one of observed, negative and band changed. `back` in metres. Frees the colours
  // where none is left.
  bool UpdateMasks(float back);
  bool AnyNegative() const { return Any(negative); }
  bool AnyObserved() const { return Any(observed); }
  void Clear(int place) {
    const auto i = static_cast<std::size_t>(place);
    distance[i] = 0;
    weight[i] = 0;
    SetColour(i, {}, 0);
  }
  int ColourCount(std::size_t i) const { return colours == nullptr ? 0 : colours->count[i]; }
  FixedColour FixedColourAt(std::size_t i) const {
    if (colours == nullptr) return {};
    return {colours->channel[0][i], colours->channel[1][i], colours->channel[2][i]};
  }
  BlockColours& MakeColours() {
    if (colours == nullptr) colours.reset(new BlockColours);
    return *colours;
  }
  void SetColour(std::size_t i, const FixedColour& fixed, int count) {
    if (count == 0 && colours == nullptr) return;
    BlockColours& into = MakeColours();
    for (std::size_t c = 0; c < 3; ++c) into.channel[c][i] = fixed[c];
    into.count[i] = static_cast<std::uint8_t>(count);
  }
  void FreeColoursIfNone() {
    if (colours == nullptr) return;
    const auto& count = colours->count;
    if (std::all_of(count.begin(), count.end(), [](auto n) { return n == 0; })) colours.reset();
  }
  std::size_t Bytes() const {
    return sizeof(TsdfBlock) + (colours == nullptr ? 0 : sizeof(BlockColours));
  }
  Colour ColourAt(int place) const {
    const FixedColour c = FixedColourAt(static_cast<std::size_t>(place));
    return {Level(c[0]), Level(c[1]), Level(c[2])};
  }
  static std::uint8_t Level(std::uint16_t fixed) {
    return static_cast<std::uint8_t>(std::min(255, (fixed + 128) >> 8));
  }
};

inline void* TsdfBlock::operator new(std::size_t) {
  return ObjectPool<sizeof(TsdfBlock), alignof(TsdfBlock)>::Take();
}
inline void TsdfBlock::operator delete(void* block) {
  ObjectPool<sizeof(TsdfBlock), alignof(TsdfBlock)>::Give(block);
}

using TsdfGrid = BlockGrid<TsdfBlock>;

// Of the blocks and the tables that find them.
std::size_t BytesOf(const TsdfGrid& grid);

// The masks of a block (number 13) and of the 26 around it, x fastest, then y, then z; never
// nullptr.
using MasksAround = std::array<const BlockMask*, 27>;

// What the cover of a block depends on. To find it is to wait for memory: find several, then
// compute their covers.
struct Surroundings {
  MasksAround observed;
  MasksAround negative;
  const BlockMask* band = nullptr;
};
Surroundings FindSurroundings(const TsdfGrid& grid, const Index3& block);

// The cover mask at the lattice points of the block: band, or corner of a crossed cube.
BlockMask CoverOf(const Surroundings& around);
inline BlockMask FindCover(const TsdfGrid& grid, const Index3& block) {
  return CoverOf(FindSurroundings(grid, block));
}

}  // namespace tsdfpp
