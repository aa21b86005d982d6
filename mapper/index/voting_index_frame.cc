// What a frame changes in the lists (paper III-F).
#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <utility>

#include "mapper/index/index_kernels.h"
#include "mapper/index/voting_index.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

constexpr std::size_t kAhead = 4;  // groups, while one is worked on

constexpr std::size_t kLookUpsPerTask = 512;

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
          // Also where the frame was the first to look at covers that no list has room for.
          group.emptied = IsEmpty(lists);
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

}  // namespace tsdfpp
