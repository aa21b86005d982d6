#include "mapper/cover.h"

#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <map>
#include <optional>

#include "mapper/cover_kernels.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 64;
constexpr std::size_t kCoversPerTask = 64;
constexpr std::size_t kCoversAhead = 3;  // more than a few do not stay in the cache

constexpr BlockMask kNoVoxels{};

// What the cover of these slices of a block depends on. To find it is to wait for memory: find
// several, then compute their covers.
struct Surroundings {
  MasksAround observed{};
  MasksAround negative{};
  const BlockMask* band = nullptr;
  SliceRange slices;
};

Surroundings FindSurroundings(const TsdfGrid& grid, const Index3& block, const SliceRange& slices) {
  Surroundings around;
  around.observed.fill(&kNoVoxels);
  around.negative.fill(&kNoVoxels);
  around.band = &kNoVoxels;
  around.slices = slices;
  const std::array<std::int32_t, 27> numbers = grid.directory().FindAround(block);
  const std::size_t first = slices.first == 0 ? 0 : 9;
  const std::size_t last = slices.last + 1 == kBlockSide ? 26 : 17;
  for (std::size_t i = first; i <= last; ++i) {
    if (numbers[i] == BlockDirectory::kNone) continue;
    const TsdfBlock& at = *grid.entries()[static_cast<std::size_t>(numbers[i])].block;
    around.observed[i] = &at.observed;
    around.negative[i] = &at.negative;
    hwy::Prefetch(&at.observed);
    hwy::Prefetch(&at.negative);
    if (i == 13) around.band = &at.band;
  }
  return around;
}

// The cover in these slices; nothing in the others.
BlockMask CoverOf(const Surroundings& around) {
  BlockMask cover = CornersOfCrossedCubes(around.observed, around.negative, around.slices);
  for (std::size_t z = around.slices.first; z <= around.slices.last; ++z) {
    cover[z] |= (*around.band)[z];
  }
  return cover;
}

// A block whose cover may have changed, in these slices.
struct StaleCover {
  InstanceId id = kNoInstance;
  Index3 index;
  TsdfBlock* block = nullptr;
  const TsdfGrid* grid = nullptr;
  SliceRange slices;
};

// The slices of the block whose cover may have changed, for each of the 27 blocks around.
std::uint8_t SlicesTouched(const FusedBlock& from, int around) {
  const unsigned own = from.sign_slices;
  if (around < 9) return 1U << (kBlockSide - 1);
  if (around >= 18) return 1;
  const unsigned band = around == kItselfAround ? from.band_slices : 0U;
  return static_cast<std::uint8_t>(own | own << 1U | own >> 1U | band);
}

std::vector<StaleCover> StaleCovers(const std::vector<FusedBlock>& fused,
                                    const ObjectVolumes& volumes) {
  using Slices = std::atomic<std::uint8_t>;
  struct Marks {
    const TsdfGrid* grid;
    std::vector<Slices> of_entry;
  };
  std::map<InstanceId, Marks> marks;
  for (const auto& [id, volume] : volumes) {
    if (!volume.lattice_is_world) continue;
    marks.try_emplace(id, Marks{&volume.grid, std::vector<Slices>(volume.grid.size())});
  }
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, fused.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const FusedBlock& from = fused[i];
          const auto of = marks.find(from.id);
          if (from.touched == 0 || of == marks.end()) continue;
          const auto numbers = of->second.grid->directory().FindAround(from.index);
          for (std::uint32_t bits = from.touched; bits != 0; bits &= bits - 1) {
            const int around = std::countr_zero(bits);
            const std::int32_t number = numbers[static_cast<std::size_t>(around)];
            if (number == BlockDirectory::kNone) continue;
            of->second.of_entry[static_cast<std::size_t>(number)].fetch_or(
                SlicesTouched(from, around), std::memory_order_relaxed);
          }
        }
      },
      tbb::simple_partitioner());
  std::vector<StaleCover> stale;
  for (const auto& [id, of] : marks) {
    for (std::size_t i = 0; i < of.of_entry.size(); ++i) {
      const std::uint8_t slices = of.of_entry[i].load(std::memory_order_relaxed);
      if (slices == 0) continue;
      const auto& entry = of.grid->entries()[i];
      const auto first = static_cast<std::size_t>(std::countr_zero(slices));
      const auto end = static_cast<std::size_t>(std::bit_width(slices));
      stale.push_back({id, entry.index, entry.block.get(), of.grid, {first, end - 1}});
    }
  }
  return stale;
}

// Nothing where the cover is what it was.
std::optional<CoverChange> PutCover(const StaleCover& stale, const BlockMask& now) {
  BlockMask& cover = stale.block->cover;
  const auto first = static_cast<std::ptrdiff_t>(stale.slices.first);
  const auto end = static_cast<std::ptrdiff_t>(stale.slices.last) + 1;
  if (std::equal(cover.begin() + first, cover.begin() + end, now.begin() + first)) return {};
  CoverChange change{stale.id, stale.index};
  for (std::size_t z = stale.slices.first; z <= stale.slices.last; ++z) {
    change.lost[z] = cover[z] & ~now[z];
    change.gained[z] = now[z] & ~cover[z];
    cover[z] = now[z];
  }
  return change;
}

}  // namespace

BlockMask FindCover(const TsdfGrid& grid, const Index3& block) {
  return CoverOf(FindSurroundings(grid, block, {}));
}

std::vector<CoverChange> UpdateCovers(const std::vector<FusedBlock>& fused,
                                      const ObjectVolumes& volumes) {
  const std::vector<StaleCover> stale = StaleCovers(fused, volumes);
  const std::size_t tasks = (stale.size() + kCoversPerTask - 1) / kCoversPerTask;
  std::vector<std::vector<CoverChange>> of_task(tasks);
  // Covers read the neighbours' other masks, which no longer change.
  tbb::parallel_for(std::size_t{0}, tasks, [&](std::size_t task) {
    const std::size_t begin = task * kCoversPerTask;
    const std::size_t end = std::min(begin + kCoversPerTask, stale.size());
    // What is found is fetched while the ones before are worked on.
    std::array<Surroundings, kCoversAhead> around;
    const auto find = [&](std::size_t i) {
      if (i >= end) return;
      hwy::Prefetch(&stale[i].block->cover);
      around[i % kCoversAhead] = FindSurroundings(*stale[i].grid, stale[i].index, stale[i].slices);
    };
    for (std::size_t i = begin; i < begin + kCoversAhead; ++i) find(i);
    for (std::size_t i = begin; i != end; ++i) {
      const BlockMask now = CoverOf(around[i % kCoversAhead]);
      if (const auto change = PutCover(stale[i], now)) of_task[task].push_back(*change);
      find(i + kCoversAhead);
    }
  });
  std::vector<CoverChange> changes;
  for (const auto& more : of_task) changes.insert(changes.end(), more.begin(), more.end());
  return changes;
}

}  // namespace tsdfpp
