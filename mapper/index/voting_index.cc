#include "mapper/index/voting_index.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>

#include "mapper/index/grid_invariants.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

// A matrix row by row, from one column by column of `columns` columns; and the other way round with
// the number of rows.
std::vector<ListEntry> Transposed(const std::vector<ListEntry>& entries, std::size_t columns) {
  const std::size_t rows = entries.size() / columns;
  std::vector<ListEntry> transposed(entries.size());
  for (std::size_t column = 0; column < columns; ++column) {
    for (std::size_t row = 0; row < rows; ++row) {
      transposed[row * columns + column] = entries[column * rows + row];
    }
  }
  return transposed;
}

}  // namespace

VotingIndex::ListBlock& VotingIndex::ListsOf(const Index3& block) {
  ListBlock& lists = blocks_.FindOrAdd(block);
  if (lists.ids.empty()) lists.Resize(1);
  return lists;
}

void VotingIndex::FreeEmptyLayers(ListBlock& lists) {
  std::size_t layers = lists.layers();
  const auto lists_nothing = [&](std::size_t layer) {
    const auto first = lists.ids.begin() + static_cast<std::ptrdiff_t>(layer * kBlockVoxels);
    return std::all_of(first, first + kBlockVoxels,
                       [](InstanceId id) { return id == kNoInstance; });
  };
  while (layers > 1 && lists_nothing(layers - 1)) --layers;
  if (layers != lists.layers()) lists.Resize(layers);
}

void VotingIndex::ListBlock::Resize(std::size_t layers) {
  const std::size_t size = layers * kBlockVoxels;
  ids.reserve(size);
  ids.resize(size, kNoInstance);
  ids.shrink_to_fit();
  confidences.reserve(size);
  confidences.resize(size);
  confidences.shrink_to_fit();
}

std::vector<Index3> VotingIndex::Deactivate(InstanceId id, const TsdfGrid& volume) {
  std::vector<Index3> blocks;
  for (const auto& entry : volume.entries()) {
    ListBlock* lists = blocks_.Find(entry.index);
    if (lists == nullptr) continue;
    // Overflow may have dropped the object from some of these; Remove() knows.
    ForEachVoxel(entry.block->cover, [&](int place) { ListOf(*lists, place).Remove(id); });
    if (!Any(entry.block->cover)) continue;
    blocks.push_back(entry.index);
  }
  return blocks;
}

bool VotingIndex::IsEmpty(const ListBlock& lists) {
  return std::all_of(lists.ids.begin(), lists.ids.begin() + kBlockVoxels,
                     [](InstanceId active) { return active == kNoInstance; });
}

void VotingIndex::FreeEmptyLists(const std::vector<Index3>& blocks) {
  std::vector<Index3> empty;
  for (const Index3& index : blocks) {
    ListBlock* lists = blocks_.Find(index);
    if (lists == nullptr) continue;
    if (IsEmpty(*lists)) {
      empty.push_back(index);
    } else {
      FreeEmptyLayers(*lists);
    }
  }
  blocks_.Erase(empty);
}

void VotingIndex::Activate(InstanceId id, const TsdfGrid& volume) {
  const auto in_parallel = [&](const auto& function) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, volume.size(), kBlocksPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) function(i);
        },
        tbb::simple_partitioner());
  };
  RenewCovers(volume);
  std::vector<ListBlock*> lists(volume.size(), nullptr);
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const TsdfGrid::Entry& entry = volume.entries()[i];
    if (!Any(entry.block->cover)) continue;
    lists[i] = &ListsOf(entry.index);
    changes_.Note(entry.index);
  }
  in_parallel([&](std::size_t i) {
    if (lists[i] == nullptr) return;
    ForEachVoxel(volume.entries()[i].block->cover, [&](int place) {
      ListWithRoom(*lists[i], place).PushFront(id, config_.moved_confidence);
    });
  });
}

void VotingIndex::Remove(InstanceId id, const TsdfGrid& volume, const ObjectVolumes& others) {
  struct Vacated {
    Index3 block;
    int place;
  };
  std::vector<Vacated> vacated;
  for (const auto& entry : volume.entries()) {
    ListBlock* lists = blocks_.Find(entry.index);
    if (lists == nullptr) continue;
    ForEachVoxel(entry.block->cover, [&](int place) {
      VoxelList list = ListOf(*lists, place);
      if (!list.Lists(id)) return;
      list.Remove(id);
      vacated.push_back({entry.index, place});
    });
  }
  std::vector<Index3> blocks;
  for (const Vacated& voxel : vacated) {
    if (blocks.empty() || blocks.back() != voxel.block) blocks.push_back(voxel.block);
    if (!config_.relist_on_removal) continue;
    ListBlock& lists = *blocks_.Find(voxel.block);
    for (const auto& [other, of] : others) {
      const TsdfBlock* block = of.grid.Find(voxel.block);
      if (block == nullptr || !Bit(block->cover, voxel.place)) continue;
      if (ListOf(lists, voxel.place).Lists(other)) continue;
      ListWithRoom(lists, voxel.place).Append(other, 1);
    }
  }
  FreeEmptyLists(blocks);
}

const InstanceId* VotingIndex::ActiveIn(const Index3& block) const {
  const ListBlock* lists = blocks_.Find(block);
  return lists == nullptr || lists->ids.empty() ? nullptr : lists->ids.data();
}

std::vector<Listing> VotingIndex::ListedAt(const Index3& voxel) const {
  std::vector<Listing> listings;
  const ListBlock* lists = blocks_.Find(BlockOf(voxel));
  if (lists == nullptr) return listings;
  const int place = PlaceInBlock(voxel);
  for (auto i = static_cast<std::size_t>(place); i < lists->ids.size(); i += kBlockVoxels) {
    const ListEntry entry = lists->At(i);
    if (entry.id == kNoInstance) break;
    listings.push_back({entry.id, entry.confidence});
  }
  return listings;
}

std::vector<Index3> VotingIndex::ListedVoxels() const {
  std::vector<Index3> voxels;
  for (const auto& entry : blocks_.entries()) {
    for (int place = 0; place < kBlockVoxels && !entry.block->ids.empty(); ++place) {
      if (entry.block->ids[static_cast<std::size_t>(place)] != kNoInstance)
        voxels.push_back(VoxelAt(entry.index, place));
    }
  }
  return voxels;
}

void VotingIndex::Rename(InstanceId from, InstanceId to, const TsdfGrid& volume) {
  for (const auto& entry : volume.entries()) {
    ListBlock* lists = Any(entry.block->cover) ? blocks_.Find(entry.index) : nullptr;
    if (lists == nullptr) continue;
    std::replace(lists->ids.begin(), lists->ids.end(), from, to);
    if (lists->settled_id == from) lists->settled_id = to;
  }
  changes_.NoteAll();
}

std::size_t VotingIndex::Bytes() const {
  std::size_t bytes = blocks_.TableBytes();
  for (const auto& entry : blocks_.entries()) {
    bytes +=
        sizeof(ListBlock) + entry.block->ids.size() * (sizeof(InstanceId) + sizeof(std::uint8_t));
  }
  return bytes;
}

std::vector<ListsOfBlock> VotingIndex::Lists() const {
  std::vector<ListsOfBlock> lists;
  for (const auto* entry : blocks_.Sorted()) {
    std::vector<ListEntry> entries(static_cast<std::size_t>(kBlockVoxels * layers_));
    for (std::size_t i = 0; i < entry->block->ids.size(); ++i) entries[i] = entry->block->At(i);
    lists.push_back({entry->index, Transposed(entries, static_cast<std::size_t>(layers_))});
  }
  return lists;
}

void VotingIndex::SetLists(const std::vector<ListsOfBlock>& lists) {
  for (const ListsOfBlock& block : lists) {
    ListBlock& added = ListsOf(block.index);
    added.Resize(static_cast<std::size_t>(layers_));
    const std::vector<ListEntry> entries = Transposed(block.entries, kBlockVoxels);
    for (std::size_t i = 0; i < entries.size(); ++i) {
      added.ids[i] = entries[i].id;
      added.confidences[i] = static_cast<std::uint8_t>(entries[i].confidence);
    }
    FreeEmptyLayers(added);
  }
  changes_.NoteAll();
}

Fault VotingIndex::FindFault() const {
  if (Fault fault = FindHashFault("the index", blocks_)) return fault;
  for (const auto& [index, lists] : blocks_.entries()) {
    if (IsEmpty(*lists)) return fmt::format("block {} of the index is empty", BlockText(index));
    if (lists->ids.size() % kBlockVoxels != 0 || lists->confidences.size() != lists->ids.size() ||
        lists->ids.size() > static_cast<std::size_t>(kBlockVoxels * layers_)) {
      return fmt::format("block {} of the index has {} listings", BlockText(index),
                         lists->ids.size());
    }
    ListBlock shortest = *lists;
    FreeEmptyLayers(shortest);
    if (shortest.ids.size() != lists->ids.size()) {
      return fmt::format("block {} of the index has a layer that lists nothing", BlockText(index));
    }
    for (std::size_t i = kBlockVoxels; i < lists->ids.size(); ++i) {
      const InstanceId before = lists->ids[i - kBlockVoxels];
      if (before == kNoInstance && lists->ids[i] != kNoInstance) {
        return fmt::format("a list in block {} of the index has a gap", BlockText(index));
      }
    }
    for (int place = 0; place < kBlockVoxels; ++place) {
      const ListEntry active = lists->At(static_cast<std::size_t>(place));
      // A vote there would be passed over.
      if (Bit(lists->settled, place) &&
          (active.id != lists->settled_id || active.confidence < config_.confidence_cap)) {
        return fmt::format("voxel {} is taken for settled and is not",
                           BlockText(VoxelAt(index, place)));
      }
    }
  }
  return std::nullopt;
}

}  // namespace tsdfpp
