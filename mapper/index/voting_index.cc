#include "mapper/index/voting_index.h"

#include <fmt/format.h>
#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <utility>

#include "mapper/index/grid_invariants.h"
#include "mapper/index/index_kernels.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

constexpr std::size_t kAhead = 4;  // groups, while one is worked on

constexpr std::size_t kLookUpsPerTask = 512;

template <typename Function>
void ForEachVoxel(const BlockMask& mask, const Function& function) {
  int first = 0;
  for (std::uint64_t slice : mask) {
    for (; slice != 0; slice &= slice - 1) function(first + std::countr_zero(slice));
    first += 64;
  }
}

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

// What a frame did at each block of the index, by increasing id. A block that nothing covers, or
// did, has no lists.
class VotingIndex::Groups {
 public:
  struct Group {
    Index3 index;
    ListBlock* lists = nullptr;
    std::int32_t first_change = kNone;
    std::int32_t first_vote = kNone;
    bool relisted = false;  // other objects are active than were
    bool emptied = false;
  };
  static constexpr std::int32_t kNone = -1;

  Groups(VotingIndex& of_index, const std::vector<FusedBlock>& fused,
         const std::vector<CoverChange>& changes)
      : next_change_(changes.size(), kNone), next_vote_(fused.size(), kNone) {
    const auto numbers = [&of_index](const auto& of, const auto& has_lists) {
      std::vector<std::int32_t> found(of.size(), kNone);
      tbb::parallel_for(
          tbb::blocked_range<std::size_t>(0, of.size(), kLookUpsPerTask),
          [&](const tbb::blocked_range<std::size_t>& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
              if (!has_lists(of[i])) continue;
              const auto number = of_index.blocks_.NumberOf(of[i].index);
              found[i] = number ? static_cast<std::int32_t>(*number) : kNone;
            }
          },
          tbb::simple_partitioner());
      for (std::size_t i = 0; i < of.size(); ++i) {
        if (found[i] != kNone || !has_lists(of[i])) continue;
        of_index.ListsOf(of[i].index);
        found[i] = static_cast<std::int32_t>(*of_index.blocks_.NumberOf(of[i].index));
      }
      return found;
    };
    const std::vector<std::int32_t> change_at =
        numbers(changes, [](const CoverChange&) { return true; });
    const std::vector<std::int32_t> vote_at =
        numbers(fused, [](const FusedBlock& from) { return Any(from.block->cover); });
    std::vector<std::int32_t> group_of(of_index.blocks_.size(), kNone);
    const auto group_at = [&](std::int32_t number) -> Group& {
      std::int32_t& group = group_of[static_cast<std::size_t>(number)];
      if (group == kNone) {
        group = static_cast<std::int32_t>(groups_.size());
        const auto& entry = of_index.blocks_.entries()[static_cast<std::size_t>(number)];
        groups_.push_back({entry.index, entry.block.get()});
      }
      return groups_[static_cast<std::size_t>(group)];
    };
    for (std::size_t i = 0; i < changes.size(); ++i) {
      Chain(changes, i, group_at(change_at[i]).first_change, next_change_);
    }
    for (std::size_t i = 0; i < fused.size(); ++i) {
      if (vote_at[i] == kNone) continue;
      Chain(fused, i, group_at(vote_at[i]).first_vote, next_vote_);
    }
  }

  std::vector<Group>& all() { return groups_; }
  // What the votes at the group read first.
  void Prefetch(const Group& group, const std::vector<FusedBlock>& fused) const {
    hwy::Prefetch(&group.lists->settled);
    if (group.first_vote == kNone) return;
    const FusedBlock& from = fused[static_cast<std::size_t>(group.first_vote)];
    hwy::Prefetch(from.votes);
    hwy::Prefetch(&from.block->cover);
  }
  template <typename Function>
  void ForEachChange(const Group& group, const Function& function) const {
    ForEach(group.first_change, next_change_, function);
  }
  template <typename Function>
  void ForEachVote(const Group& group, const Function& function) const {
    ForEach(group.first_vote, next_vote_, function);
  }

 private:
  using Links = std::vector<std::int32_t>;

  // Into a chain by increasing id.
  template <typename Item>
  static void Chain(const std::vector<Item>& items, std::size_t i, std::int32_t& first,
                    Links& next) {
    std::int32_t* link = &first;
    while (*link != kNone && items[static_cast<std::size_t>(*link)].id < items[i].id) {
      link = &next[static_cast<std::size_t>(*link)];
    }
    next[i] = std::exchange(*link, static_cast<std::int32_t>(i));
  }
  template <typename Function>
  static void ForEach(std::int32_t first, const Links& next, const Function& function) {
    for (std::int32_t i = first; i != kNone; i = next[static_cast<std::size_t>(i)]) {
      function(static_cast<std::size_t>(i));
    }
  }

  std::vector<Group> groups_;
  Links next_change_;
  Links next_vote_;
};

VotingIndex::ListBlock& VotingIndex::ListsOf(const Index3& block) {
  ListBlock& lists = blocks_.FindOrAdd(block);
  if (lists.ids.empty()) lists.Resize(1);
  return lists;
}

VoxelList VotingIndex::ListOf(ListBlock& lists, int place) {
  lists.settled[static_cast<std::size_t>(place >> 6)] &=
      ~(1ULL << static_cast<unsigned>(place & 63));
  const auto at = static_cast<std::size_t>(place);
  return {&lists.ids[at], &lists.confidences[at], static_cast<int>(lists.layers()), kBlockVoxels};
}

VoxelList VotingIndex::ListWithRoom(ListBlock& lists, int place) const {
  const std::size_t layers = lists.layers();
  const std::size_t last = (layers - 1) * kBlockVoxels + static_cast<std::size_t>(place);
  if (lists.ids[last] != kNoInstance && layers < static_cast<std::size_t>(layers_)) {
    lists.Resize(layers + 1);
  }
  return ListOf(lists, place);
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

bool VotingIndex::Vote(ListBlock& lists, InstanceId id, BlockMask votes) const {
  if (lists.settled_id != id) {
    lists.settled_id = id;
    lists.settled = {};
  }
  for (std::size_t z = 0; z < votes.size(); ++z) votes[z] &= ~lists.settled[z];
  if (!Any(votes)) return false;
  // Nearly every vote is for the active object.
  const VotesCounted counted =
      VoteForActive(votes, id, config_.confidence_cap, lists.ids.data(), lists.confidences.data());
  for (std::size_t z = 0; z < votes.size(); ++z) lists.settled[z] |= counted.saturated[z];
  bool other_active = false;
  ForEachVoxel(counted.others, [&](int place) {
    const InstanceId before = lists.ActiveAt(place);
    const bool is_listed = ListOf(lists, place).Lists(id);
    (is_listed ? ListOf(lists, place) : ListWithRoom(lists, place))
        .Vote(id, config_.confidence_cap);
    other_active = other_active || lists.ActiveAt(place) != before;
  });
  return other_active;
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

void VotingIndex::Update(const std::vector<FusedBlock>& fused,
                         const std::vector<CoverChange>& changes) {
  Groups groups(*this, fused, changes);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, groups.all().size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          if (i + kAhead < range.end()) groups.Prefetch(groups.all()[i + kAhead], fused);
          Groups::Group& group = groups.all()[i];
          ListBlock& lists = *group.lists;
          bool lost_any = false;
          groups.ForEachChange(group, [&](std::size_t k) {
            ForEachVoxel(changes[k].lost, [&](int place) {
              group.relisted = group.relisted || lists.ActiveAt(place) == changes[k].id;
              ListOf(lists, place).Remove(changes[k].id);
            });
            lost_any = lost_any || Any(changes[k].lost);
          });
          groups.ForEachVote(group, [&](std::size_t k) {
            const FusedBlock& from = fused[k];
            BlockMask votes = *from.votes;
            for (std::size_t z = 0; z < votes.size(); ++z) votes[z] &= from.block->cover[z];
            if (Vote(lists, from.id, votes)) group.relisted = true;
          });
          groups.ForEachChange(group, [&](std::size_t k) {
            ForEachVoxel(changes[k].gained, [&](int place) {
              if (ListOf(lists, place).Lists(changes[k].id)) return;
              group.relisted = group.relisted || lists.ActiveAt(place) == kNoInstance;
              ListWithRoom(lists, place).Append(changes[k].id, 1);
            });
          });
          group.emptied = lost_any && IsEmpty(lists);
          if (lost_any && !group.emptied) FreeEmptyLayers(lists);
        }
      },
      tbb::simple_partitioner());
  std::vector<Index3> empty;
  for (const Groups::Group& group : groups.all()) {
    if (group.relisted) changes_.Note(group.index);
    if (group.emptied) empty.push_back(group.index);
  }
  blocks_.Erase(empty);
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
