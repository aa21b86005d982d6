#include "mapper/tsdfpp_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <bit>

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
  Deactivate(id);
  volume.grid = ResampleGrid(volume.grid, T_WO * T_WO_old->inverse(), config_.voxel_m,
                             config_.back(), config_.resampling);
  Activate(id);
}

void TsdfppMap::Deactivate(InstanceId id) {
  for (const auto& entry : volumes_.at(id).grid.entries()) {
    ListBlock* lists = index_.Find(entry.index);
    if (lists == nullptr) continue;
    for (int z = 0; z < kBlockSide; ++z) {
      // Overflow may have dropped the object from some of these; Remove() knows.
      ForEachBit(entry.block->cover[static_cast<std::size_t>(z)], z,
                 [&](int place) { ListOf(*lists, place).Remove(id); });
    }
  }
}

void TsdfppMap::Activate(InstanceId id) {
  const TsdfGrid& grid = volumes_.at(id).grid;
  for (const auto& entry : grid.entries()) {
    entry.block->cover = FindCover(grid, entry.index);
    ListBlock& lists = ListsOf(entry.index);
    for (int z = 0; z < kBlockSide; ++z) {
      ForEachBit(entry.block->cover[static_cast<std::size_t>(z)], z,
                 [&](int place) { ListOf(lists, place).PushFront(id, config_.moved_confidence); });
    }
  }
}

void TsdfppMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  const FrameView view(frame, labels);
  UpdateIndex(FuseIntoVolumes(view, config_, volumes_));
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
  for (std::size_t i = 0; i < changes.size(); ++i) group_at(changes[i].index).changes.push_back(i);
  for (std::size_t i = 0; i < fused.size(); ++i) group_at(fused[i].index).votes.push_back(i);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, groups.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          ApplyGroup(groups[i], fused, changes);
        }
      },
      tbb::simple_partitioner());
}

void TsdfppMap::ApplyGroup(const Group& group, const std::vector<FusedBlock>& fused,
                           const std::vector<CoverChange>& changes) {
  ListBlock& lists = *group.lists;
  for (int z = 0; z < kBlockSide; ++z) {
    const auto slice = static_cast<std::size_t>(z);
    for (const std::size_t i : group.changes) {
      const CoverChange& change = changes[i];
      const std::uint64_t lost = change.old_cover[slice] & ~change.block->cover[slice];
      ForEachBit(lost, z, [&](int place) { ListOf(lists, place).Remove(change.id); });
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
  if (!config_.relist_on_removal) return;
  for (const Vacated& voxel : vacated) {
    VoxelList list = ListOf(*index_.Find(voxel.block), voxel.place);
    for (const auto& [other, volume] : volumes_) {
      const TsdfBlock* block = volume.grid.Find(voxel.block);
      if (block == nullptr || !Bit(block->cover, voxel.place) || list.Lists(other)) continue;
      list.Append(other, 1);
    }
  }
}

InstanceId TsdfppMap::ActiveAt(const Index3& voxel) const {
  const ListBlock* lists = index_.Find(BlockOf(voxel));
  if (lists == nullptr || lists->empty()) return kNoInstance;
  return (*lists)[static_cast<std::size_t>(PlaceInBlock(voxel) * layers_)].id;
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
