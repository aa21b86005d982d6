#include "mapper/index/pair_index.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapper/index/grid_invariants.h"

namespace tsdfpp {
namespace {

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

bool PairIndex::Block::IsEmpty() const {
  return std::all_of(active.begin(), active.end(),
                     [](const Entry& entry) { return entry.id == kNoInstance; });
}

std::vector<Index3> PairIndex::Deactivate(InstanceId id) {
  std::vector<Index3> left;
  for (const auto& entry : blocks_.entries()) {
    Block& block = *entry.block;
    bool listed = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (block.active[i].id == id) {
        block.revision = NewRevision();
        block.active[i] = block.inactive[i];
        block.inactive[i] = {};
        listed = true;
      } else if (block.inactive[i].id == id) {
        block.inactive[i] = {};
      }
    }
    if (listed) left.push_back(entry.index);
  }
  return left;
}

void PairIndex::Activate(InstanceId id, const TsdfGrid& volume) {
  for (const auto& entry : volume.entries()) {
    Block& block = blocks_.FindOrAdd(entry.index);
    block.revision = NewRevision();
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (!Bit(entry.block->observed, place)) continue;
      Entry& active = block.active[At(place)];
      if (active.id != kNoInstance) block.inactive[At(place)] = active;
      active = {id, static_cast<std::int16_t>(config_.moved_confidence)};
    }
  }
}

void PairIndex::FreeEmpty(const std::vector<Index3>& blocks) {
  std::vector<Index3> empty;
  for (const Index3& index : blocks) {
    if (blocks_.Find(index)->IsEmpty()) empty.push_back(index);
  }
  blocks_.Erase(empty);
}

void PairIndex::Rename(InstanceId from, InstanceId to) {
  for (const auto& entry : blocks_.entries()) {
    for (auto* entries : {&entry.block->active, &entry.block->inactive}) {
      for (Entry& listing : *entries) {
        if (listing.id != from) continue;
        listing.id = to;
        entry.block->revision = NewRevision();
      }
    }
  }
}

std::vector<Listing> PairIndex::ListedAt(const Index3& voxel) const {
  std::vector<Listing> listings;
  const Block* block = blocks_.Find(BlockOf(voxel));
  if (block == nullptr) return listings;
  const std::size_t i = At(PlaceInBlock(voxel));
  for (const Entry& entry : {block->active[i], block->inactive[i]}) {
    if (entry.id != kNoInstance) listings.push_back({entry.id, entry.confidence});
  }
  return listings;
}

std::vector<Index3> PairIndex::ListedVoxels() const {
  std::vector<Index3> voxels;
  for (const auto& entry : blocks_.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (entry.block->active[At(place)].id != kNoInstance) {
        voxels.push_back(VoxelAt(entry.index, place));
      }
    }
  }
  return voxels;
}

std::vector<ListsOfBlock> PairIndex::Lists() const {
  std::vector<ListsOfBlock> lists;
  for (const auto* entry : blocks_.Sorted()) {
    ListsOfBlock& block = lists.emplace_back();
    block.index = entry->index;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      for (const Entry& of : {entry->block->active[i], entry->block->inactive[i]}) {
        block.entries.push_back({of.id, of.confidence});
      }
    }
  }
  return lists;
}

void PairIndex::SetLists(const std::vector<ListsOfBlock>& lists) {
  for (const ListsOfBlock& block : lists) {
    Block& to = blocks_.FindOrAdd(block.index);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      to.active[i] = {block.entries[2 * i].id, block.entries[2 * i].confidence};
      to.inactive[i] = {block.entries[2 * i + 1].id, block.entries[2 * i + 1].confidence};
    }
  }
}

Fault PairIndex::FindFault(const ObjectVolumes& volumes) const {
  if (Fault fault = FindHashFault("the lists", blocks_)) return fault;
  const auto is_observed = [&](InstanceId id, const Index3& voxel) {
    const auto volume = volumes.find(id);
    if (volume == volumes.end()) return false;
    const TsdfBlock* block = volume->second.grid.Find(BlockOf(voxel));
    return block != nullptr && block->weight[At(PlaceInBlock(voxel))] > 0;
  };
  for (const auto& [index, lists] : blocks_.entries()) {
    if (lists->IsEmpty()) return fmt::format("block {} of lists is empty", BlockText(index));
    for (int place = 0; place < kBlockVoxels; ++place) {
      const InstanceId active = lists->active[At(place)].id;
      const InstanceId inactive = lists->inactive[At(place)].id;
      const Index3 voxel = VoxelAt(index, place);
      if (active == kNoInstance && inactive != kNoInstance) {
        return fmt::format("voxel {} has an inactive object and no active one", BlockText(voxel));
      }
      for (const InstanceId id : {active, inactive}) {
        if (id == kNoInstance || is_observed(id, voxel)) continue;
        return fmt::format("object {} is listed at voxel {} and is unobserved there", id,
                           BlockText(voxel));
      }
    }
  }
  return std::nullopt;
}

}  // namespace tsdfpp
