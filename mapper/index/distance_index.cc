#include "mapper/index/distance_index.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <deque>
#include <limits>
#include <set>
#include <utility>

#include "mapper/index/grid_invariants.h"
#include "mapper/index/index_kernels.h"
#include "mapper/volume/block_set.h"
#include "mapper/volume/pull_back.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 32;

}  // namespace

// The objects, as the workers of one refresh read them.
struct DistanceIndex::Participants {
  struct Moved {
    std::array<double, 12> T_LW;  // rows
    VoxelReader reader;
    const std::vector<Index3>* reach;

    bool Reaches(const Index3& block) const {
      return std::binary_search(reach->begin(), reach->end(), block);
    }
  };
  struct Object {
    InstanceId id = kNoInstance;
    const TsdfGrid* grid = nullptr;
    std::optional<BlockBox> bounds;  // lists nothing outside, where it is known
    std::optional<Moved> moved;      // unless its lattice is the world's
  };
  std::vector<Object> objects;  // by increasing id
};

// What ComputeBlock finds of one block; kept from block to block for its memory alone.
struct DistanceIndex::Scratch {
  // An object's voxels in the block. The pointers are into its volume or into `pulled`.
  struct Listed {
    InstanceId id;
    const BlockMask* cover;
    const float* distance;
    TsdfBlock* block;  // which the distances are still to be taken from
  };
  std::vector<Listed> listed;
  std::deque<PulledCover> pulled;  // of moved objects; a deque, so that they stay where they are
};

// Marks all that the object can list now.
void DistanceIndex::AddReach(InstanceId id, const ObjectVolumes& volumes) const {
  const auto volume = volumes.find(id);
  if (volume == volumes.end()) return;
  if (volume->second.lattice_is_world) {
    for (const auto& entry : volume->second.grid.entries()) dirty_.push_back(entry.index);
  } else if (const auto reach = reach_.find(id); reach != reach_.end()) {
    dirty_.insert(dirty_.end(), reach->second.begin(), reach->second.end());
  }
}

void DistanceIndex::Deactivate(InstanceId id, const ObjectVolumes& volumes) {
  AddReach(id, volumes);
  reach_.erase(id);
  // Nothing is found anew for an object that is taken out.
  std::erase(moved_, id);
  once_.Outdate();
}

void DistanceIndex::Activate(InstanceId id) {
  moved_.push_back(id);
  once_.Outdate();
}

void DistanceIndex::NoteFusion(const std::vector<FusedBlock>& fused, const ObjectVolumes& volumes) {
  std::set<InstanceId> changed_ids;
  InstanceId last = kNoInstance;
  for (const FusedBlock& block : fused) {
    if (block.id != last) changed_ids.insert(block.id);
    last = block.id;
  }
  for (const InstanceId id : changed_ids) {
    if (volumes.at(id).lattice_is_world) continue;
    Deactivate(id, volumes);
    Activate(id);
  }
  for (const CoverChange& change : UpdateCovers(fused, volumes)) dirty_.push_back(change.index);
  // Where one object alone is listed, its distances do not matter; where several are, they order
  // the list.
  for (const FusedBlock& block : fused) {
    if (block.is_listed_with_others) dirty_.push_back(block.index);
  }
  once_.Outdate();
}

void DistanceIndex::Reset(const ObjectVolumes& volumes) {
  blocks_ = {};
  reach_.clear();
  dirty_.clear();
  moved_.clear();
  changes_.NoteAll();
  for (const auto& [id, volume] : volumes) moved_.push_back(id);
  once_.Outdate();
}

void DistanceIndex::MakeAgain(const ObjectVolumes& volumes) const {
  // Moved, then fused: in the list twice.
  std::sort(moved_.begin(), moved_.end());
  moved_.erase(std::unique(moved_.begin(), moved_.end()), moved_.end());
  for (const InstanceId id : moved_) {
    const auto found = volumes.find(id);
    if (found == volumes.end()) continue;  // nothing was left of it
    const ObjectVolume& volume = found->second;
    if (volume.lattice_is_world) {
      // Back at its birth: its cover masks have not been kept.
      RenewCovers(volume.grid);
    } else {
      reach_[id] = BlocksTouchedBy(VoxelReader(volume.grid), volume.T_WL, config_.voxel_m, true);
    }
    AddReach(id, volumes);
  }
  moved_.clear();
  if (dirty_.empty()) return;
  tbb::parallel_sort(dirty_.begin(), dirty_.end());
  dirty_.erase(std::unique(dirty_.begin(), dirty_.end()), dirty_.end());

  const Participants participants = ParticipantsOf(volumes);
  std::vector<IndexBlock> computed(dirty_.size());
  std::vector<IndexBlock*> existing(dirty_.size());
  std::vector<std::uint8_t> relisted(dirty_.size(), 1);  // other objects are active than were
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, dirty_.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        Scratch scratch;
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          existing[i] = blocks_.Find(dirty_[i]);
          IndexBlock& ids = existing[i] ? *existing[i] : computed[i];
          std::array<InstanceId, kBlockVoxels> before;
          const bool was_empty = ids.empty();
          if (!was_empty) std::copy_n(ids.begin(), kBlockVoxels, before.begin());
          ComputeBlock(dirty_[i], participants, scratch, ids);
          if (was_empty != ids.empty()) continue;
          relisted[i] = was_empty || std::equal(before.begin(), before.end(), ids.begin()) ? 0 : 1;
        }
      },
      tbb::simple_partitioner());
  std::vector<Index3> emptied;
  for (std::size_t i = 0; i < dirty_.size(); ++i) {
    if (existing[i] != nullptr && existing[i]->empty()) {
      emptied.push_back(dirty_[i]);
    } else if (existing[i] == nullptr && !computed[i].empty()) {
      blocks_.FindOrAdd(dirty_[i]) = std::move(computed[i]);
    }
  }
  blocks_.Erase(emptied);
  for (std::size_t i = 0; i < dirty_.size(); ++i) {
    if (relisted[i] != 0) changes_.Note(dirty_[i]);
  }
  dirty_.clear();
}

DistanceIndex::Participants DistanceIndex::ParticipantsOf(const ObjectVolumes& volumes) const {
  Participants participants;
  for (const auto& [id, volume] : volumes) {
    if (volume.grid.empty()) continue;
    Participants::Object& object = participants.objects.emplace_back();
    object.id = id;
    object.grid = &volume.grid;
    if (volume.lattice_is_world) {
      // To go through the blocks of a large one would take longer than to look blocks up in it.
      if (volume.grid.size() > dirty_.size()) continue;
      BlockBox& bounds = object.bounds.emplace();
      for (const auto& entry : volume.grid.entries()) bounds.Extend(entry.index);
      continue;
    }
    const std::vector<Index3>& reach = reach_[id];
    BlockBox& bounds = object.bounds.emplace();
    for (const Index3& block : reach) bounds.Extend(block);
    object.moved.emplace(
        Participants::Moved{RowsOf(volume.T_WL.inverse()), VoxelReader(volume.grid), &reach});
  }
  return participants;
}

void DistanceIndex::ComputeBlock(const Index3& index, const Participants& participants,
                                 Scratch& scratch, IndexBlock& ids) const {
  std::vector<Scratch::Listed>& listed = scratch.listed;
  listed.clear();
  std::size_t pulled = 0;
  for (const Participants::Object& object : participants.objects) {
    if (object.bounds && !object.bounds->Holds(index)) continue;
    if (!object.moved) {
      TsdfBlock* block = object.grid->Find(index);
      if (block == nullptr || !Any(block->cover)) continue;
      listed.push_back({object.id, &block->cover, nullptr, block});
      continue;
    }
    const Participants::Moved& moved = *object.moved;
    if (!moved.Reaches(index)) continue;
    if (pulled == scratch.pulled.size()) scratch.pulled.emplace_back();
    PulledCover& cover = scratch.pulled[pulled];
    if (CoverOfBlock(moved.reader, moved.T_LW, config_.voxel_m, config_.back(), index, cover)) {
      listed.push_back({object.id, &cover.covered, cover.distance.data(), nullptr});
      ++pulled;
    }
  }
  if (listed.empty()) {
    ids.clear();
    return;
  }
  // No voxel lists more objects than the block has.
  const int layers = std::min(layers_, static_cast<int>(listed.size()));
  for (const Scratch::Listed& of : listed) {
    if (of.block != nullptr) of.block->is_listed_with_others = listed.size() > 1;
  }
  const auto size = static_cast<std::size_t>(kBlockVoxels * layers);
  if (ids.size() != size) ids = IndexBlock(size);
  if (listed.size() == 1) {
    ListAlone(*listed[0].cover, listed[0].id, ids.data());
    return;
  }
  std::fill(ids.begin(), ids.end(), kNoInstance);
  std::array<float, kMaxLayers * kBlockVoxels> distance;
  std::fill_n(distance.begin(), size, std::numeric_limits<float>::infinity());
  std::array<float, kBlockVoxels> of_block;
  for (const Scratch::Listed& of : listed) {
    if (of.block != nullptr) ToFloats(of.block->distance.data(), kBlockVoxels, of_block.data());
    const float* its = of.block != nullptr ? of_block.data() : of.distance;
    InsertByDistance(*of.cover, its, of.id, {layers, distance.data(), ids.data()});
  }
}

const InstanceId* DistanceIndex::ActiveIn(const Index3& block) const {
  const IndexBlock* ids = blocks_.Find(block);
  return ids == nullptr || ids->empty() ? nullptr : ids->data();
}

std::vector<Listing> DistanceIndex::ListedAt(const Index3& voxel) const {
  std::vector<Listing> listings;
  const IndexBlock* ids = blocks_.Find(BlockOf(voxel));
  if (ids == nullptr || ids->empty()) return listings;
  const int place = PlaceInBlock(voxel);
  for (auto i = static_cast<std::size_t>(place); i < ids->size(); i += kBlockVoxels) {
    if ((*ids)[i] == kNoInstance) break;
    listings.push_back({(*ids)[i], 0});
  }
  return listings;
}

std::vector<Index3> DistanceIndex::ListedVoxels() const {
  std::vector<Index3> voxels;
  for (const auto& entry : blocks_.entries()) {
    for (int place = 0; place < kBlockVoxels && !entry.block->empty(); ++place) {
      if ((*entry.block)[static_cast<std::size_t>(place)] != kNoInstance) {
        voxels.push_back(VoxelAt(entry.index, place));
      }
    }
  }
  return voxels;
}

std::size_t DistanceIndex::blocks() const {
  return static_cast<std::size_t>(
      std::count_if(blocks_.entries().begin(), blocks_.entries().end(),
                    [](const auto& entry) { return !entry.block->empty(); }));
}

std::size_t DistanceIndex::Bytes() const {
  std::size_t bytes = blocks_.TableBytes();
  for (const auto& entry : blocks_.entries()) {
    if (entry.block->empty()) continue;
    bytes += sizeof(IndexBlock) + entry.block->size() * sizeof(InstanceId);
  }
  return bytes;
}

std::optional<std::string> DistanceIndex::FindFault(const ObjectVolumes& volumes) const {
  if (Fault fault = FindHashFault("the index", blocks_)) return fault;
  // Reset() makes the covers anew, in const grids as well: those of `volumes` stay as they are.
  const ObjectVolumes copies = volumes;  // NOLINT(performance-unnecessary-copy-initialization)
  DistanceIndex rebuilt(config_, layers_);
  rebuilt.Reset(copies);
  rebuilt.Refresh(copies);
  for (const auto& [index, ids] : rebuilt.blocks_.entries()) {
    const IndexBlock* of = blocks_.Find(index);
    if (of == nullptr || *of != *ids) {
      return fmt::format("block {} of the index is not what volumes and poses make it",
                         BlockText(index));
    }
  }
  if (rebuilt.blocks_.size() == blocks_.size()) return std::nullopt;
  return fmt::format("the index has {} blocks, volumes and poses make {}", blocks_.size(),
                     rebuilt.blocks_.size());
}

}  // namespace tsdfpp
