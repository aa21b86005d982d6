#include "mapper/index/cover.h"

#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>

#include "mapper/volume/cube_masks.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 64;  // that were fused
// After a frame few are stale; in a whole grid all are.
constexpr std::size_t kMostBlocksPerChunk = 512;
constexpr std::size_t kStaleBlocksPerChunk = 64;
constexpr std::size_t kAhead = 4;  // more than a few do not stay in the cache

// A mark for each block of a volume, by its number.
class Marks {
 public:
  explicit Marks(std::size_t blocks) : marks_(blocks) {}

  // From any thread.
  void Set(std::size_t number) {
    const std::atomic_ref<std::uint8_t> mark(marks_[number]);
    if (mark.load(std::memory_order_relaxed) == 0) mark.store(1, std::memory_order_relaxed);
  }
  void SetAll() { std::fill(marks_.begin(), marks_.end(), 1); }

  // Writes the marked numbers from `first` up to `end`, in order; returns how many there are.
  std::size_t Collect(std::size_t first, std::size_t end, std::uint32_t* numbers) const {
    std::size_t count = 0;
    constexpr std::size_t kStep = sizeof(std::uint64_t);  // most are not marked
    for (std::size_t from = first; from < end; from += kStep) {
      const std::size_t to = std::min(from + kStep, end);
      std::uint64_t any = 0;
      std::memcpy(&any, &marks_[from], to - from);
      if (any == 0) continue;
      for (std::size_t i = from; i < to; ++i) {
        if (marks_[i] != 0) numbers[count++] = static_cast<std::uint32_t>(i);
      }
    }
    return count;
  }

 private:
  std::vector<std::uint8_t> marks_;
};

// What is to be found anew of a volume's blocks.
struct Stale {
  InstanceId id = kNoInstance;
  const TsdfGrid* grid = nullptr;
  Marks cubes;
  Marks covers;
};

struct Place {
  Stale* volume = nullptr;
  std::size_t number = 0;

  const TsdfGrid& grid() const { return *volume->grid; }
  const Index3& index() const { return grid().entries()[number].index; }
  TsdfBlock& block() const { return *grid().entries()[number].block; }
};

// Some blocks of one volume.
struct Chunk {
  Stale* volume;
  std::size_t first;
  std::size_t end;
};

std::vector<Chunk> ChunksOf(std::vector<Stale>& volumes, std::size_t blocks_per_chunk) {
  std::vector<Chunk> chunks;
  for (Stale& volume : volumes) {
    const std::size_t size = volume.grid->size();
    for (std::size_t first = 0; first < size; first += blocks_per_chunk) {
      chunks.push_back({&volume, first, std::min(first + blocks_per_chunk, size)});
    }
  }
  return chunks;
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

// Calls work(number of the chunk, place, found) for each of the marked blocks, chunks in parallel.
// To find is to wait for memory, and so it is done some blocks ahead.
template <typename Find, typename Work>
void ForEachFound(const std::vector<Chunk>& chunks, Marks Stale::*marks, const Find& find,
                  const Work& work) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t c = range.begin(); c != range.end(); ++c) {
          const Chunk& chunk = chunks[c];
          std::array<std::uint32_t, kMostBlocksPerChunk> numbers;
          const std::size_t count =
              (chunk.volume->*marks).Collect(chunk.first, chunk.end, numbers.data());
          std::array<decltype(find(Place{})), kAhead> found;
          const auto find_at = [&](std::size_t i) {
            if (i < count) found[i % kAhead] = find(Place{chunk.volume, numbers[i]});
          };
          for (std::size_t i = 0; i < kAhead; ++i) find_at(i);
          for (std::size_t i = 0; i < count; ++i) {
            work(c, Place{chunk.volume, numbers[i]}, found[i % kAhead]);
            find_at(i + kAhead);
          }
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
    volume.covers.Set(static_cast<std::size_t>(number));
  }
}

// Finds the marked blocks' crossed cubes, and marks the covers that change with them.
void RenewCubes(const std::vector<Chunk>& chunks) {
  ForEachFound(
      chunks, &Stale::cubes,
      [](const Place& place) { return FindUpper(place.grid(), place.index()); },
      [](std::size_t, const Place& place, const UpperBlocks& upper) {
        BlockMask& crossed = place.block().crossed;
        const BlockMask now = FindCubeMasks(upper.observed, upper.negative).crossed;
        if (crossed == now) return;
        BlockMask changed;
        for (std::size_t z = 0; z < changed.size(); ++z) changed[z] = crossed[z] ^ now[z];
        crossed = now;
        MarkCovers(*place.volume, upper.numbers, changed);
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

// Finds the marked blocks' covers; `changes`, if any, gets those that changed, by chunk.
void RenewCovers(const std::vector<Chunk>& chunks, std::vector<std::vector<CoverChange>>* changes) {
  ForEachFound(chunks, &Stale::covers, FindLowerCubes,
               [&](std::size_t c, const Place& place, const LowerMasks& crossed) {
                 TsdfBlock& block = place.block();
                 const BlockMask now = CoverOf(block.band, crossed);
                 if (block.cover == now) return;
                 if (changes != nullptr) {
                   CoverChange& change = (*changes)[c].emplace_back();
                   change.id = place.volume->id;
                   change.index = place.index();
                   for (std::size_t z = 0; z < now.size(); ++z) {
                     change.lost[z] = block.cover[z] & ~now[z];
                     change.gained[z] = now[z] & ~block.cover[z];
                   }
                 }
                 block.cover = now;
               });
}

Stale NothingStale(InstanceId id, const TsdfGrid& grid) {
  return {id, &grid, Marks(grid.size()), Marks(grid.size())};
}

// Marks what a fused block may have changed.
void MarkStale(const FusedBlock& from, Stale& volume) {
  if (from.band_changed) volume.covers.Set(from.number);
  if (from.stale_cubes == 0) return;
  volume.cubes.Set(from.number);
  if (from.stale_cubes == 1) return;  // its own
  const Numbers lower = FindLower(*volume.grid, from.index);
  for (unsigned bits = from.stale_cubes; bits != 0; bits &= bits - 1) {
    const std::int32_t number = lower[static_cast<std::size_t>(std::countr_zero(bits))];
    if (number != BlockDirectory::kNone) volume.cubes.Set(static_cast<std::size_t>(number));
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
  std::vector<Stale> volumes{NothingStale(kNoInstance, grid)};
  volumes.front().cubes.SetAll();
  volumes.front().covers.SetAll();
  const std::vector<Chunk> chunks = ChunksOf(volumes, kStaleBlocksPerChunk);
  RenewCubes(chunks);
  RenewCovers(chunks, nullptr);
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
  const std::vector<Chunk> chunks = ChunksOf(stale, kMostBlocksPerChunk);
  RenewCubes(chunks);
  std::vector<std::vector<CoverChange>> by_chunk(chunks.size());
  RenewCovers(chunks, &by_chunk);
  std::size_t count = 0;
  for (const auto& some : by_chunk) count += some.size();
  std::vector<CoverChange> changes;
  changes.reserve(count);
  for (const auto& some : by_chunk) changes.insert(changes.end(), some.begin(), some.end());
  return changes;
}

}  // namespace tsdfpp
