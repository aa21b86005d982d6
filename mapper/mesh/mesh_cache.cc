#include "mapper/mesh/mesh_cache.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <tuple>
#include <utility>

namespace tsdfpp {
namespace {

constexpr std::size_t kPartsPerTask = 8;
constexpr std::size_t kPartsPerLink = 1024;
constexpr std::size_t kPartsPerComparison = 1024;
constexpr std::uint64_t kNeverSeen = ~0ULL;  // no block has this revision

// Bits of MeshPart::todo.
constexpr std::uint32_t kCubes = 1;
constexpr std::uint32_t kEdges = 2;
constexpr std::uint32_t kVertices = 4;
constexpr std::uint32_t kTriangles = 8;

// Places in `around`. A part's vertices are made from the values of its block and of the next ones
// along each axis, its cubes and triangles from the masks and edges of all upper ones.
constexpr std::size_t kSelf = 13;
constexpr std::array<std::size_t, 4> kReadMyValues{kSelf, 12, 10, 4};
constexpr std::array<std::size_t, 8> kReadMyMasks{kSelf, 12, 10, 9, 4, 3, 1, 0};
constexpr std::array<std::size_t, 7> kReadMyCubes{kSelf, 14, 16, 22, 17, 23, 25};

template <typename Function>
void ForEachInParallel(std::size_t count, const Function& function,
                       std::size_t per_task = kPartsPerTask) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, per_task),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) function(i);
      },
      tbb::simple_partitioner());
}

}  // namespace

void GridMesh::Mark(MeshPart* part, std::uint32_t what, Parts& list) {
  if (part == nullptr || (part->todo & what) != 0) return;
  part->todo |= what;
  list.push_back(part);
}

void GridMesh::Unsettle(MeshPart& part) {
  if (!part.is_settled) return;
  part.is_settled = false;
  unsettled_.push_back(&part);
}

std::vector<MeshPart*> GridMesh::TakeUnsettled() { return std::exchange(unsettled_, {}); }

void GridMesh::NoteChanges(const std::vector<MeshPart*>& parts) {
  if (!is_followed_) return;
  for (MeshPart* part : parts) {
    if (!std::exchange(part->is_pending, true)) pending_.push_back(part);
  }
}

GridMesh::Changes GridMesh::TakeChanges() {
  if (!std::exchange(is_followed_, true)) return {order_, {}};
  Changes changes;
  for (const Index3& index : std::exchange(gone_, {})) {
    // A block may be there again.
    MeshPart* part = PartAt(index);
    if (part == nullptr) {
      changes.gone.push_back(index);
      continue;
    }
    part->is_shown = true;
    NoteChanges({part});
  }
  changes.parts = std::exchange(pending_, {});
  for (MeshPart* part : changes.parts) part->is_pending = false;
  std::sort(changes.parts.begin(), changes.parts.end(),
            [](const MeshPart* a, const MeshPart* b) { return a->index < b->index; });
  std::sort(changes.gone.begin(), changes.gone.end());
  return changes;
}

std::vector<Index3> GridMesh::ShownBlocks() const {
  std::vector<Index3> blocks = gone_;
  for (const MeshPart* part : order_) {
    if (part->is_shown) blocks.push_back(part->index);
  }
  return blocks;
}

MeshPart* GridMesh::PartAt(const Index3& block) const {
  const std::uint64_t key = PackIndex(block);
  const auto at = std::lower_bound(keys_.begin(), keys_.end(), key);
  if (at == keys_.end() || *at != key) return nullptr;
  return order_[static_cast<std::size_t>(at - keys_.begin())];
}

template <typename Offsets>
void GridMesh::MarkAround(MeshPart& part, const Offsets& offsets, std::uint32_t what, Parts& list) {
  for (const std::size_t place : offsets) Mark(part.around[place], what, list);
}

// How many parts, from the first on, are where they were: blocks were added behind, or some were
// erased, or this is another grid.
std::size_t GridMesh::CountInPlace(const TsdfGrid& grid) const {
  const auto& entries = grid.entries();
  std::size_t same = 0;
  while (same < owned_.size() && same < entries.size() &&
         seen_[same].index == entries[same].index) {
    ++same;
  }
  return same;
}

// By key, the parts from number `first` on.
std::vector<GridMesh::Spare> GridMesh::TakeSpares(std::size_t first) {
  std::vector<Spare> spares;
  for (std::size_t i = first; i < owned_.size(); ++i) {
    spares.push_back({PackIndex(seen_[i].index), seen_[i], std::move(owned_[i])});
  }
  std::sort(spares.begin(), spares.end(),
            [](const Spare& a, const Spare& b) { return a.key < b.key; });
  return spares;
}

// What lay around an erased block has lost what it was made from.
void GridMesh::Forget(const std::vector<Spare>& erased) {
  for (const Spare& spare : erased) spare.part->block = nullptr;
  for (const Spare& spare : erased) {
    changed_.push_back(spare.part->index);
    if (spare.part->is_shown) gone_.push_back(spare.part->index);
    for (MeshPart* part : spare.part->around) {
      if (part == nullptr || part->block == nullptr) continue;
      Mark(part, kCubes, cubes_todo_);
      Mark(part, kEdges, edges_todo_);
    }
  }
  if (erased.empty()) return;
  for (Parts* list : {&unsettled_, &pending_}) {
    std::erase_if(*list, [](const MeshPart* part) { return part->block == nullptr; });
  }
}

// Makes `order_` and `keys_` those of `owned_`.
void GridMesh::Order() {
  std::vector<std::pair<std::uint64_t, MeshPart*>> sorted(owned_.size());
  for (std::size_t i = 0; i < owned_.size(); ++i) {
    sorted[i] = {PackIndex(owned_[i]->index), owned_[i].get()};
  }
  std::sort(sorted.begin(), sorted.end());
  order_.resize(sorted.size());
  keys_.resize(sorted.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) std::tie(keys_[i], order_[i]) = sorted[i];
}

// Makes `owned_` and `order_` those of the grid's blocks.
void GridMesh::MatchBlocks(const TsdfGrid& grid) {
  const auto& entries = grid.entries();
  const std::size_t same = CountInPlace(grid);
  std::vector<Spare> spares = TakeSpares(same);
  owned_.resize(entries.size());
  seen_.resize(entries.size());
  ForEachInParallel(entries.size() - same, [&](std::size_t k) {
    const Index3& index = entries[same + k].index;
    const std::uint64_t key = PackIndex(index);
    const auto spare =
        std::lower_bound(spares.begin(), spares.end(), key,
                         [](const Spare& a, std::uint64_t wanted) { return a.key < wanted; });
    std::unique_ptr<MeshPart>& part = owned_[same + k];
    if (spare != spares.end() && spare->key == key) {
      part = std::move(spare->part);
      seen_[same + k] = spare->seen;
    } else {
      part = std::make_unique<MeshPart>();
      part->index = index;
      seen_[same + k] = {index, nullptr, kNeverSeen};
    }
  });
  std::erase_if(spares, [](const Spare& spare) { return spare.part == nullptr; });
  Forget(spares);
  Order();
  Link();
}

// Tells each part which ones are around it. The nine rows of blocks along x that surround a part
// are met in order as the parts are walked in order.
void GridMesh::Link() {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, order_.size(), kPartsPerLink),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (int row = 0; row < 9; ++row) {
          const auto key_left_of = [&](std::size_t i) {
            const Index3 index = UnpackIndex(keys_[i]);
            return PackIndex(index + Index3{-1, row % 3 - 1, row / 3 - 1});
          };
          auto at = std::lower_bound(keys_.begin(), keys_.end(), key_left_of(range.begin()));
          for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const std::uint64_t left = key_left_of(i);
            while (at != keys_.end() && *at < left) ++at;
            auto near = at;
            for (std::size_t x = 0; x < 3; ++x) {
              const bool found = near != keys_.end() && *near == left + x;
              order_[i]->around[3 * static_cast<std::size_t>(row) + x] =
                  found ? order_[static_cast<std::size_t>(near - keys_.begin())] : nullptr;
              if (found) ++near;
            }
          }
        }
      },
      tbb::simple_partitioner());
}

// Compares the parts with their blocks and brings their masks up to date. False where the parts are
// not those of the grid's blocks; the rest is done then.
bool GridMesh::Compare(const TsdfGrid& grid, std::vector<Change>& change) {
  const auto& entries = grid.entries();
  if (entries.size() != owned_.size()) return false;
  std::atomic<bool> matches = true;
  const auto compare = [&](std::size_t i) {
    const TsdfBlock& block = *entries[i].block;
    Seen& seen = seen_[i];
    if (entries[i].index != seen.index) {
      matches.store(false, std::memory_order_relaxed);
      return;
    }
    if (block.revision == seen.revision && &block == seen.block) return;
    const bool is_same = block.revision == seen.revision;
    seen.revision = block.revision;
    seen.block = &block;
    MeshPart& part = *owned_[i];
    part.block = &block;
    if (is_same) return;
    change[i] = kValues;
    if (part.observed == block.observed && part.negative == block.negative) return;
    part.observed = block.observed;
    part.negative = block.negative;
    part.any_negative = block.AnyNegative();
    change[i] = kMasks;
  };
  ForEachInParallel(entries.size(), compare, kPartsPerComparison);
  return matches.load(std::memory_order_relaxed);
}

// Notes what has to be made again.
void GridMesh::MarkChanged(const std::vector<Change>& change) {
  if (std::find_if(change.begin(), change.end(), [](Change c) { return c != kMasks; }) ==
      change.end()) {
    // All is new: no need to ask who reads what.
    for (MeshPart* part : order_) {
      part->todo = kCubes | kEdges | kVertices | kTriangles;
      changed_.push_back(part->index);
    }
    for (Parts* list : {&cubes_todo_, &edges_todo_, &vertices_todo_, &triangles_todo_}) {
      *list = order_;
    }
    return;
  }
  for (std::size_t i = 0; i < change.size(); ++i) {
    if (change[i] == kSame) continue;
    changed_.push_back(seen_[i].index);
    MarkAround(*owned_[i], kReadMyValues, kVertices, vertices_todo_);
    for (const std::size_t place : kReadMyMasks) {
      if (MeshPart* part = owned_[i]->around[place]) Unsettle(*part);
    }
    if (change[i] == kValues) continue;
    MarkAround(*owned_[i], kReadMyMasks, kCubes, cubes_todo_);
    MarkAround(*owned_[i], kReadMyValues, kEdges, edges_todo_);
  }
}

// Whether a block of the grid is another one than at the last update.
bool GridMesh::Misses(const TsdfGrid& grid) {
  std::vector<Change> missed(grid.size(), kSame);
  return !Compare(grid, missed) ||
         std::any_of(missed.begin(), missed.end(), [](Change c) { return c != kSame; });
}

// Cubes, then edges, which note what is to be made again because these changed.
void GridMesh::RemakeCubesAndEdges() {
  std::vector<std::uint8_t> changed(cubes_todo_.size());
  ForEachInParallel(cubes_todo_.size(),
                    [&](std::size_t i) { changed[i] = FindCubes(*cubes_todo_[i]) ? 1 : 0; });
  for (std::size_t i = 0; i < cubes_todo_.size(); ++i) {
    Mark(cubes_todo_[i], kTriangles, triangles_todo_);
    if (changed[i] != 0) MarkAround(*cubes_todo_[i], kReadMyCubes, kEdges, edges_todo_);
  }

  changed.assign(edges_todo_.size(), 0);
  ForEachInParallel(edges_todo_.size(),
                    [&](std::size_t i) { changed[i] = FindEdges(*edges_todo_[i]) ? 1 : 0; });
  for (std::size_t i = 0; i < edges_todo_.size(); ++i) {
    if (changed[i] == 0) continue;
    Mark(edges_todo_[i], kVertices, vertices_todo_);
    MarkAround(*edges_todo_[i], kReadMyMasks, kTriangles, triangles_todo_);
  }
}

// Nothing of what is in the list is to be done any more.
void GridMesh::Finish(Parts& list) {
  for (MeshPart* part : list) {
    if ((part->todo & (kVertices | kTriangles)) != 0) {
      remade_.push_back(part);
      Unsettle(*part);
    }
    part->todo = 0;
  }
  list.clear();
}

MeshWork GridMesh::Update(const TsdfGrid& grid, float voxel,
                          std::optional<std::uint64_t> revision) {
  MeshWork work;
  work.blocks = grid.size();
  changed_.clear();
  remade_.clear();
  if (revision && revision_ == revision) {
#ifndef NDEBUG
    // Somebody changed blocks and did not say so.
    if (Misses(grid)) std::abort();
#endif
    return work;
  }
  revision_ = revision;
  std::vector<Change> change(grid.size(), kSame);
  if (!Compare(grid, change)) {
    MatchBlocks(grid);
    Compare(grid, change);
  }
  MarkChanged(change);
  work.changed = changed_.size();

  RemakeCubesAndEdges();
  ForEachInParallel(vertices_todo_.size(),
                    [&](std::size_t i) { MakeVertices(*vertices_todo_[i], voxel); });
  ForEachInParallel(triangles_todo_.size(),
                    [&](std::size_t i) { MakeTriangles(*triangles_todo_[i]); });
  for (Parts* list : {&vertices_todo_, &triangles_todo_, &cubes_todo_, &edges_todo_}) Finish(*list);
  work.remade = remade_.size();
  return work;
}

std::size_t GridMesh::Bytes() const {
  std::size_t bytes =
      order_.capacity() * (sizeof(void*) + sizeof(std::uint64_t)) +
      (remade_.capacity() + unsettled_.capacity() + pending_.capacity()) * sizeof(void*) +
      (changed_.capacity() + gone_.capacity()) * sizeof(Index3) +
      owned_.capacity() * (sizeof(owned_[0]) + sizeof(Seen));
  for (const MeshPart* part : order_) {
    bytes += sizeof(MeshPart) + part->positions.capacity() * sizeof(part->positions[0]) +
             part->colours.capacity() * sizeof(part->colours[0]) +
             part->triangles.capacity() * sizeof(part->triangles[0]) +
             part->placed.capacity() * sizeof(part->placed[0]) +
             part->face_ids.capacity() * sizeof(part->face_ids[0]) + part->hidden.capacity() +
             part->renamed.capacity() * sizeof(part->renamed[0]);
  }
  return bytes;
}

}  // namespace tsdfpp
