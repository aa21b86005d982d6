#include "mapper/tsdfpp_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <bit>

#include "mapper/freeing.h"
#include "mapper/map_invariants.h"
#include "mapper/pull_back.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

template <typename Function>
void ForEachBit(std::uint64_t bits, int slice, const Function& function) {
  for (; bits != 0; bits &= bits - 1) function(64 * slice + std::countr_zero(bits));
}

}  // namespace

// A block of one object whose cover may have changed in a frame.
struct TsdfppMap::CoverChange {
  Index3 index;
  InstanceId id = kNoInstance;
  TsdfBlock* block = nullptr;
  BlockMask old_cover{};
};

// All that a frame did at one block of the index, by increasing id.
struct TsdfppMap::Group {
  ListBlock* lists = nullptr;
  std::vector<std::size_t> changes;  // into the cover changes
  std::vector<std::size_t> votes;    // into the fused blocks
  bool emptied = false;
};

TsdfppMap::TsdfppMap(const MapConfig& config, int layers) : LayeredMap(config), layers_(layers) {}

std::unique_ptr<MapRepresentation> TsdfppMap::Clone() const {
  return std::make_unique<TsdfppMap>(*this);
}

TsdfppMap::ListBlock& TsdfppMap::ListsOf(const Index3& block) {
  ListBlock& lists = index_.FindOrAdd(block);
  if (lists.empty()) lists.resize(static_cast<std::size_t>(kBlockVoxels * layers_));
  return lists;
}

VoxelList TsdfppMap::ListOf(ListBlock& lists, int place) const {
  return {&lists[static_cast<std::size_t>(place * layers_)], layers_};
}

void TsdfppMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  ObjectVolume& volume = volumes_[id];
  const std::optional<Pose> T_WO_old = std::exchange(volume.T_WO, T_WO);
  if (!T_WO_old || SameNumbers(*T_WO_old, T_WO)) return;
  const std::vector<Index3> left = Deactivate(id);
  volume.grid = ResampleGrid(volume.grid, T_WO * T_WO_old->inverse(), config_.voxel_m,
                             config_.back(), config_.resampling);
  Activate(id);
  FreeEmptyLists(left);
  CheckInDebugBuilds(*this);
}

std::vector<Index3> TsdfppMap::Deactivate(InstanceId id) {
  std::vector<Index3> blocks;
  for (const auto& entry : volumes_.at(id).grid.entries()) {
    ListBlock* lists = index_.Find(entry.index);
    if (lists == nullptr) continue;
    for (int z = 0; z < kBlockSide; ++z) {
      // Overflow may have dropped the object from some of these; Remove() knows.
      ForEachBit(entry.block->cover[static_cast<std::size_t>(z)], z,
                 [&](int place) { ListOf(*lists, place).Remove(id); });
    }
    if (Any(entry.block->cover)) blocks.push_back(entry.index);
  }
  return blocks;
}

bool TsdfppMap::IsEmpty(const ListBlock& lists) const {
  for (std::size_t i = 0; i < lists.size(); i += static_cast<std::size_t>(layers_)) {
    if (lists[i].id != kNoInstance) return false;
  }
  return true;
}

void TsdfppMap::FreeEmptyLists(const std::vector<Index3>& blocks) {
  std::vector<Index3> empty;
  for (const Index3& index : blocks) {
    const ListBlock* lists = index_.Find(index);
    if (lists != nullptr && IsEmpty(*lists)) empty.push_back(index);
  }
  index_.Erase(empty);
}

void TsdfppMap::Activate(InstanceId id) {
  const TsdfGrid& grid = volumes_.at(id).grid;
  for (const auto& entry : grid.entries()) {
    entry.block->cover = FindCover(grid, entry.index);
    if (!Any(entry.block->cover)) continue;
    ListBlock& lists = ListsOf(entry.index);
    for (int z = 0; z < kBlockSide; ++z) {
      ForEachBit(entry.block->cover[static_cast<std::size_t>(z)], z,
                 [&](int place) { ListOf(lists, place).PushFront(id, config_.moved_confidence); });
    }
  }
}

void TsdfppMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  const FrameView view(frame, labels);
  const FrameFreeing freeing(volumes_);
  const std::vector<FusedBlock> fused = FuseIntoVolumes(view, config_, volumes_);
  UpdateIndex(fused);
  freeing.FreeEmpty(fused, volumes_);
  CheckInDebugBuilds(*this);
}

void TsdfppMap::UpdateIndex(const std::vector<FusedBlock>& fused) {
  std::vector<CoverChange> changes;
  for (auto& [id, volume] : volumes_) {
    for (const Index3& index : WithNeighbours(volume.grid, ChangedMasks(fused, id))) {
      TsdfBlock* block = volume.grid.Find(index);
      changes.push_back({index, id, block, block->cover});
    }
  }
  // Covers read the neighbours' values, which no longer change.
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, changes.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          changes[i].block->cover = FindCover(volumes_.at(changes[i].id).grid, changes[i].index);
        }
      },
      tbb::simple_partitioner());

  BlockGrid<std::size_t> group_of;
  std::vector<Group> groups;
  const auto group_at = [&](const Index3& index) -> Group& {
    std::size_t& number = group_of.FindOrAdd(index);
    if (number == 0) {
      groups.push_back({&ListsOf(index), {}, {}});
      number = groups.size();
    }
    return groups[number - 1];
  };
  // A block that nothing covers, or did, has no lists.
  for (std::size_t i = 0; i < changes.size(); ++i) {
    if (!Any(changes[i].block->cover) && !Any(changes[i].old_cover)) continue;
    group_at(changes[i].index).changes.push_back(i);
  }
  for (std::size_t i = 0; i < fused.size(); ++i) {
    if (Any(fused[i].block->cover)) group_at(fused[i].index).votes.push_back(i);
  }
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, groups.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          ApplyGroup(groups[i], fused, changes);
        }
      },
      tbb::simple_partitioner());
  std::vector<Index3> empty;
  for (const auto& entry : group_of.entries()) {
    if (groups[*entry.block - 1].emptied) empty.push_back(entry.index);
  }
  index_.Erase(empty);
}

void TsdfppMap::ApplyGroup(Group& group, const std::vector<FusedBlock>& fused,
                           const std::vector<CoverChange>& changes) {
  ListBlock& lists = *group.lists;
  std::uint64_t lost_any = 0;
  for (int z = 0; z < kBlockSide; ++z) {
    const auto slice = static_cast<std::size_t>(z);
    for (const std::size_t i : group.changes) {
      const CoverChange& change = changes[i];
      const std::uint64_t lost = change.old_cover[slice] & ~change.block->cover[slice];
      ForEachBit(lost, z, [&](int place) { ListOf(lists, place).Remove(change.id); });
      lost_any |= lost;
    }
    for (const std::size_t i : group.votes) {
      const FusedBlock& vote = fused[i];
      const std::uint64_t votes = vote.votes[slice] & vote.block->cover[slice];
      ForEachBit(votes, z, [&](int place) {
        // Nearly every vote is for the active object.
        ListEntry& active = lists[static_cast<std::size_t>(place * layers_)];
        if (active.id != vote.id) {
          ListOf(lists, place).Vote(vote.id, config_.confidence_cap);
        } else if (active.confidence < config_.confidence_cap) {
          ++active.confidence;
        }
      });
    }
    for (const std::size_t i : group.changes) {
      const CoverChange& change = changes[i];
      const std::uint64_t gained = change.block->cover[slice] & ~change.old_cover[slice];
      ForEachBit(gained, z, [&](int place) {
        VoxelList list = ListOf(lists, place);
        if (!list.Lists(change.id)) list.Append(change.id, 1);
      });
    }
  }
  group.emptied = lost_any != 0 && IsEmpty(lists);
}

void TsdfppMap::Remove(InstanceId id) {
  const auto removed = volumes_.find(id);
  if (removed == volumes_.end()) return;
  struct Vacated {
    Index3 block;
    int place;
  };
  std::vector<Vacated> vacated;
  for (const auto& entry : removed->second.grid.entries()) {
    ListBlock* lists = index_.Find(entry.index);
    if (lists == nullptr) continue;
    for (int z = 0; z < kBlockSide; ++z) {
      ForEachBit(entry.block->cover[static_cast<std::size_t>(z)], z, [&](int place) {
        VoxelList list = ListOf(*lists, place);
        if (!list.Lists(id)) return;
        list.Remove(id);
        vacated.push_back({entry.index, place});
      });
    }
  }
  volumes_.erase(removed);
  std::vector<Index3> blocks;
  for (const Vacated& voxel : vacated) {
    if (blocks.empty() || blocks.back() != voxel.block) blocks.push_back(voxel.block);
    if (!config_.relist_on_removal) continue;
    VoxelList list = ListOf(*index_.Find(voxel.block), voxel.place);
    for (const auto& [other, volume] : volumes_) {
      const TsdfBlock* block = volume.grid.Find(voxel.block);
      if (block == nullptr || !Bit(block->cover, voxel.place) || list.Lists(other)) continue;
      list.Append(other, 1);
    }
  }
  FreeEmptyLists(blocks);
  CheckInDebugBuilds(*this);
}

LayeredMap::ActiveIds TsdfppMap::ActiveIn(const Index3& block) const {
  const ListBlock* lists = index_.Find(block);
  if (lists == nullptr || lists->empty()) return {};
  static_assert(sizeof(ListEntry) == 2 * sizeof(InstanceId) && offsetof(ListEntry, id) == 0);
  return {&lists->data()->id, 2 * static_cast<std::size_t>(layers_)};
}

std::vector<RaySurface> TsdfppMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                            const RayCastOptions& options) const {
  if (!config_.relist_on_removal) return LayeredMap::CastRays(camera, T_WC, options);
  // A removal lists objects that the lists do not know of.
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(*this, LayeredMap::CastRays(camera, T_WC, first), camera, T_WC, options);
}

std::vector<Listing> TsdfppMap::ListAt(const Eigen::Vector3i& voxel) const {
  std::vector<Listing> listings;
  const ListBlock* lists = index_.Find(BlockOf(ToIndex3(voxel)));
  if (lists == nullptr || lists->empty()) return listings;
  const int first = PlaceInBlock(ToIndex3(voxel)) * layers_;
  for (int i = 0; i < layers_; ++i) {
    const ListEntry& entry = (*lists)[static_cast<std::size_t>(first + i)];
    if (entry.id == kNoInstance) break;
    listings.push_back({entry.id, entry.confidence});
  }
  return listings;
}

std::vector<Eigen::Vector3i> TsdfppMap::ListedVoxels() const {
  std::vector<Index3> voxels;
  for (const auto& entry : index_.entries()) {
    for (int place = 0; place < kBlockVoxels && !entry.block->empty(); ++place) {
      const ListEntry& active = (*entry.block)[static_cast<std::size_t>(place * layers_)];
      if (active.id != kNoInstance) voxels.push_back(VoxelAt(entry.index, place));
    }
  }
  return SortedVoxels(std::move(voxels));
}

MapMemory TsdfppMap::Memory() const {
  MapMemory memory = VolumeMemory();
  memory.blocks += index_.size();
  memory.bytes +=
      index_.size() * sizeof(ListEntry) * static_cast<std::size_t>(kBlockVoxels * layers_) +
      index_.TableBytes();
  return memory;
}

}  // namespace tsdfpp
