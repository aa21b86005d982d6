// A block of signed distances, weights and colours, and the bit masks derived from them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>

#include "core/half.h"
#include "core/types.h"
#include "mapper/volume/block_grid.h"
#include "mapper/volume/block_pool.h"

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

// The colours of one slice z of a block.
inline constexpr std::size_t kSliceVoxels = kBlockVoxels / kBlockSide;
struct alignas(64) ColourSlice {
  std::array<std::array<std::uint16_t, kSliceVoxels>, 3> channel{};  // 8.8 fixed point
  std::array<std::uint8_t, kSliceVoxels> count{};

  static void* operator new(std::size_t);
  static void operator delete(void* slice);
};
inline void* ColourSlice::operator new(std::size_t) {
  return ObjectPool<sizeof(ColourSlice), alignof(ColourSlice)>::Take();
}
inline void ColourSlice::operator delete(void* slice) {
  ObjectPool<sizeof(ColourSlice), alignof(ColourSlice)>::Give(slice);
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
  BlockMask crossed{};   // the crossed cubes, named by their lowest corners, kept with `cover`
  BlockMask cover{};     // docs/map.md, "Cover", at the lattice points; see cover.h
  BlockMask full{};      // of these it is known that the weight is at its cap

  // Each slice only while a voxel in it has a colour: most lie too far from a surface.
  std::array<Copied<ColourSlice>, kBlockSide> colours;

  // Names the values: blocks of the same revision hold the same ones, 0 is an empty block. Whoever
  // changes values gives the block a new one (UpdateMasks does), which is how the cached meshes see
  // it.
  std::uint64_t revision = 0;

  // Kept by DistanceIndex where the object's lattice is the world's: its block lists other objects
  // as well. Here, because fusion would have to look each block up there.
  bool is_listed_with_others = false;

  static void* operator new(std::size_t);
  static void operator delete(void* block);
  static const std::size_t kRoom;  // bytes that it takes

  // Brings the masks but for `crossed` and `cover` in line with the values, and gives the block a
  // new revision; true where one of observed, negative and band changed. `back` in metres. Frees
  // the colours where none is left.
  bool UpdateMasks(float back);
  bool AnyNegative() const { return Any(negative); }
  bool AnyObserved() const { return Any(observed); }
  void Clear(int place) {
    const auto i = static_cast<std::size_t>(place);
    distance[i] = 0;
    weight[i] = 0;
    SetColour(i, {}, 0);
  }
  bool HasColours() const {
    return std::any_of(colours.begin(), colours.end(), [](const auto& s) { return s != nullptr; });
  }
  int ColourCount(std::size_t i) const {
    const auto& slice = colours[i / kSliceVoxels];
    return slice == nullptr ? 0 : slice->count[i % kSliceVoxels];
  }
  FixedColour FixedColourAt(std::size_t i) const {
    const auto& slice = colours[i / kSliceVoxels];
    if (slice == nullptr) return {};
    const std::size_t k = i % kSliceVoxels;
    return {slice->channel[0][k], slice->channel[1][k], slice->channel[2][k]};
  }
  ColourSlice& MakeColours(std::size_t z) {
    if (colours[z] == nullptr) colours[z].reset(new ColourSlice);
    return *colours[z];
  }
  void SetColour(std::size_t i, const FixedColour& fixed, int count) {
    if (count == 0 && colours[i / kSliceVoxels] == nullptr) return;
    ColourSlice& into = MakeColours(i / kSliceVoxels);
    const std::size_t k = i % kSliceVoxels;
    for (std::size_t c = 0; c < 3; ++c) into.channel[c][k] = fixed[c];
    into.count[k] = static_cast<std::uint8_t>(count);
  }
  void FreeColoursIfNone() {
    for (auto& slice : colours) {
      if (slice == nullptr) continue;
      const auto& count = slice->count;
      if (std::all_of(count.begin(), count.end(), [](auto n) { return n == 0; })) slice.reset();
    }
  }
  std::size_t Bytes() const {
    const auto slices =
        std::count_if(colours.begin(), colours.end(), [](const auto& s) { return s != nullptr; });
    return kRoom + static_cast<std::size_t>(slices) * sizeof(ColourSlice);
  }
  Colour ColourAt(int place) const {
    const FixedColour c = FixedColourAt(static_cast<std::size_t>(place));
    return {Level(c[0]), Level(c[1]), Level(c[2])};
  }
  static std::uint8_t Level(std::uint16_t fixed) {
    return static_cast<std::uint8_t>(std::min(255, (fixed + 128) >> 8));
  }
};

inline constexpr std::size_t TsdfBlock::kRoom =
    ObjectPool<sizeof(TsdfBlock), alignof(TsdfBlock)>::kStride;
inline void* TsdfBlock::operator new(std::size_t) {
  return ObjectPool<sizeof(TsdfBlock), alignof(TsdfBlock)>::Take();
}
inline void TsdfBlock::operator delete(void* block) {
  ObjectPool<sizeof(TsdfBlock), alignof(TsdfBlock)>::Give(block);
}

using TsdfGrid = BlockGrid<TsdfBlock>;

// Of the blocks and the tables that find them.
std::size_t BytesOf(const TsdfGrid& grid);

}  // namespace tsdfpp
