#include "mapper/cover.h"

#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>

#include "mapper/cube_masks.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 64;
constexpr std::size_t kAhead = 4;  // more than a few do not stay in the cache

// What is to be found anew of a block, a bit each.
constexpr std::uint8_t kCubes = 1;
constexpr std::uint8_t kCover = 2;

// The blocks of one volume, by their numbers.
struct Stale {
  InstanceId id = kNoInstance;
  const TsdfGrid* grid = nullptr;
  std::vector<std::uint8_t> what;

  // From any thread.
  void Mark(std::size_t number, std::uint8_t bit) {
    const std::atomic_ref<std::uint8_t> at(what[number]);
    if ((at.load(std::memory_order_relaxed) & bit) == 0) {
      at.fetch_or(bit, std::memory_order_relaxed);
    }
  }
};

struct Place {
  Stale* volume = nullptr;
  std::size_t number = 0;

  const TsdfGrid& grid() const { return *volume->grid; }
  const Index3& index() const { return grid().entries()[number].index; }
  TsdfBlock& block() const { return *grid().entries()[number].block; }
};

// By volume and number.
std::vector<Place> PlacesOf(std::vector<Stale>& volumes, std::uint8_t bit) {
  std::vector<Place> places;
  for (Stale& volume : volumes) {
    const std::vector<std::uint8_t>& what = volume.what;
    constexpr std::size_t kStep = sizeof(std::uint64_t);  // most are not stale
    for (std::size_t first = 0; first < what.size(); first += kStep) {
      const std::size_t end = std::min(first + kStep, what.size());
      std::uint64_t any = 0;
      std::memcpy(&any, &what[first], end - first);
      if (any == 0) continue;
      for (std::size_t i = first; i < end; ++i) {
        if ((what[i] & bit) != 0) places.push_back({&volume, i});
      }
    }
  }
  return places;
}

using Numbers = std::array<std::int32_t, 8>;

// Of a block and of the seven lower ones: bits 0, 1, 2 of the place are steps back along x, y, z.
Numbers FindLower(const TsdfGrid& grid, const Index3& block) {
  Numbers numbers = grid.directory().FindUpper(block + Index3{-1, -1, -1});
  std::reverse(numbers.begin(), numbers.end());
  return numbers;
}

// One mask of these blocks, fetched; none of its voxels where there is no block.
std::array<const BlockMask*, 8> MasksOf(const TsdfGrid& grid, const Numbers& numbers,
                                        BlockMask TsdfBlock::*mask) {
  std::array<const BlockMask*, 8> masks;
  for (std::size_t i = 0; i < masks.size(); ++i) {
    masks[i] = &kNoVoxels;
    if (numbers[i] == BlockDirectory::kNone) continue;
    masks[i] = &(grid.entries()[static_cast<std::size_t>(numbers[i])].block.get()->*mask);
    hwy::Prefetch(masks[i]);
  }
  return masks;
}

struct UpperBlocks {
  Numbers numbers{};
  UpperMasks observed{};
  UpperMasks negative{};
};
UpperBlocks FindUpper(const TsdfGrid& grid, const Index3& block) {
  const Numbers numbers = grid.directory().FindUpper(block);
  return {numbers, MasksOf(grid, numbers, &TsdfBlock::observed),
          MasksOf(grid, numbers, &TsdfBlock::negative)};
}

// Work on each of the places, in parallel, with what is found of it: to find that is to wait for
// memory, and so it is done some places ahead.
template <typename Find, typename Work>
void ForEachFound(const std::vector<Place>& places, const Find& find, const Work& work) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, places.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        std::array<decltype(find(places.front())), kAhead> found;
        const auto find_at = [&](std::size_t i) {
          if (i < range.end()) found[i % kAhead] = find(places[i]);
        };
        for (std::size_t i = range.begin(); i < range.begin() + kAhead; ++i) find_at(i);
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          work(i, found[i % kAhead]);
          find_at(i + kAhead);
        }
      },
      tbb::simple_partitioner());
}

// Marks the blocks with a corner of one of these cubes; `upper` are the cubes' block and those
// above.
void MarkCovers(Stale& volume, const Numbers& upper, const BlockMask& cubes) {
  std::uint64_t any = 0;
  for (const std::uint64_t slice : cubes) any |= slice;
  constexpr std::uint64_t kLastColumn = kFirstColumn << 7U;
  const unsigned beyond = ((any & kLastColumn) != 0 ? 1U : 0U) | (any >> 56U != 0 ? 2U : 0U) |
                          (cubes.back() != 0 ? 4U : 0U);
  for (unsigned step = 0; step < upper.size(); ++step) {
    const std::int32_t number = upper[step];
    if ((step & ~beyond) != 0 || number == BlockDirectory::kNone) continue;
    volume.Mark(static_cast<std::size_t>(number), kCover);
  }
}

// Finds the marked blocks' crossed cubes, and marks the covers that change with them.
void RenewCubes(std::vector<Stale>& volumes) {
  const std::vector<Place> places = PlacesOf(volumes, kCubes);
  ForEachFound(
      places, [](const Place& place) { return FindUpper(place.grid(), place.index()); },
      [&](std::size_t i, const UpperBlocks& upper) {
        BlockMask& crossed = places[i].block().crossed;
        const BlockMask now = FindCubeMasks(upper.observed, upper.negative).crossed;
        if (crossed == now) return;
        BlockMask changed;
        for (std::size_t z = 0; z < changed.size(); ++z) changed[z] = crossed[z] ^ now[z];
        crossed = now;
        MarkCovers(*places[i].volume, upper.numbers, changed);
      });
}

BlockMask CoverOf(const BlockMask& band, const LowerMasks& crossed) {
  BlockMask cover = CornersOfCubes(crossed);
  for (std::size_t z = 0; z < cover.size(); ++z) cover[z] |= band[z];
  return cover;
}

LowerMasks FindLowerCubes(const Place& place) {
  const TsdfGrid& grid = place.grid();
  return MasksOf(grid, FindLower(grid, place.index()), &TsdfBlock::crossed);
}

// Finds the marked blocks' covers.
std::vector<CoverChange> RenewCovers(std::vector<Stale>& volumes) {
  const std::vector<Place> places = PlacesOf(volumes, kCover);
  std::vector<CoverChange> changes(places.size());
  ForEachFound(places, FindLowerCubes, [&](std::size_t i, const LowerMasks& crossed) {
    TsdfBlock& block = places[i].block();
    const BlockMask now = CoverOf(block.band, crossed);
    if (block.cover == now) return;
    CoverChange& change = changes[i];
    change.id = places[i].volume->id;
    change.index = places[i].index();
    for (std::size_t z = 0; z < now.size(); ++z) {
      change.lost[z] = block.cover[z] & ~now[z];
      change.gained[z] = now[z] & ~block.cover[z];
    }
    block.cover = now;
  });
  std::erase_if(changes, [](const CoverChange& change) { return change.id == kNoInstance; });
  return changes;
}

Stale NothingStale(InstanceId id, const TsdfGrid& grid) {
  return {id, &grid, std::vector<std::uint8_t>(grid.size())};
}

// Marks what a fused block may have changed.
void MarkStale(const FusedBlock& from, Stale& volume) {
  if (from.band_changed) volume.Mark(from.number, kCover);
  if (from.stale_cubes == 0) return;
  volume.Mark(from.number, kCubes);
  if (from.stale_cubes == 1) return;  // its own
  const Numbers lower = FindLower(*volume.grid, from.index);
  for (unsigned bits = from.stale_cubes; bits != 0; bits &= bits - 1) {
    const std::int32_t number = lower[static_cast<std::size_t>(std::countr_zero(bits))];
    if (number != BlockDirectory::kNone) volume.Mark(static_cast<std::size_t>(number), kCubes);
  }
}

}  // namespace

BlockMask FindCover(const TsdfGrid& grid, const Index3& block) {
  BlockMask band{};
  if (const TsdfBlock* at = grid.Find(block)) band = at->band;
  std::array<BlockMask, 8> crossed;
  LowerMasks lower;
  for (int step = 0; step < 8; ++step) {
    const Index3 back{-(step & 1), -((step >> 1) & 1), -(step >> 2)};
    const UpperBlocks upper = FindUpper(grid, block + back);
    const auto i = static_cast<std::size_t>(step);
    crossed[i] = FindCubeMasks(upper.observed, upper.negative).crossed;
    lower[i] = &crossed[i];
  }
  return CoverOf(band, lower);
}

void RenewCovers(const TsdfGrid& grid) {
  Stale stale = NothingStale(kNoInstance, grid);
  std::fill(stale.what.begin(), stale.what.end(), kCubes | kCover);
  std::vector<Stale> volumes{std::move(stale)};
  RenewCubes(volumes);
  RenewCovers(volumes);
}

std::vector<CoverChange> UpdateCovers(const std::vector<FusedBlock>& fused,
                                      const ObjectVolumes& volumes) {
  std::vector<Stale> stale;
  for (const auto& [id, volume] : volumes) {
    if (volume.lattice_is_world) stale.push_back(NothingStale(id, volume.grid));
  }
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, fused.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const FusedBlock& from = fused[i];
          if (from.stale_cubes == 0 && !from.band_changed) continue;
          const auto of =
              std::lower_bound(stale.begin(), stale.end(), from.id,
                               [](const Stale& a, InstanceId wanted) { return a.id < wanted; });
          if (of != stale.end() && of->id == from.id) MarkStale(from, *of);
        }
      },
      tbb::simple_partitioner());
  RenewCubes(stale);
  return RenewCovers(stale);
}

}  // namespace tsdfpp
