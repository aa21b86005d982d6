#include "mapper/anchored_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <bit>
#include <set>

#include "mapper/freeing.h"
#include "mapper/map_invariants.h"
#include "mapper/pull_back.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 8;

// Keeps the K smallest (distance, id) of a voxel, in order.
struct Candidate {
  float distance;
  InstanceId id;
  bool operator<(const Candidate& other) const {
    return distance != other.distance ? distance < other.distance : id < other.id;
  }
};

void Sift(Candidate* list, int layers, Candidate candidate) {
  for (int i = 0; i < layers; ++i) {
    if (list[i].id == kNoInstance || candidate < list[i]) std::swap(list[i], candidate);
    if (candidate.id == kNoInstance) return;
  }
}

}  // namespace

// The objects, as the workers of one refresh read them.
struct AnchoredMap::Participants {
  struct InWorld {
    InstanceId id;
    const TsdfGrid* grid;
  };
  struct Moved {
    InstanceId id;
    std::array<double, 12> T_LW;  // rows
    VoxelReader reader;
    const std::vector<Index3>* reach;
  };
  std::vector<InWorld> in_world;
  std::vector<Moved> moved;
};

AnchoredMap::AnchoredMap(const MapConfig& config, int layers)
    : LayeredMap(config), layers_(layers) {}

std::unique_ptr<MapRepresentation> AnchoredMap::Clone() const {
  return std::make_unique<AnchoredMap>(*this);
}

// Marks all that the object can list now.
void AnchoredMap::AddReach(InstanceId id) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return;
  if (volume->second.lattice_is_world) {
    for (const auto& entry : volume->second.grid.entries()) dirty_.push_back(entry.index);
  } else if (const auto reach = reach_.find(id); reach != reach_.end()) {
    dirty_.insert(dirty_.end(), reach->second.begin(), reach->second.end());
  }
}

void AnchoredMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  ObjectVolume& volume = volumes_[id];
  const std::optional<Pose> T_WO_old = std::exchange(volume.T_WO, T_WO);
  if (!volume.T_WO_birth) volume.T_WO_birth = T_WO;
  if (!T_WO_old || SameNumbers(*T_WO_old, T_WO)) return;
  AddReach(id);
  PlaceLattice(volume);
  reach_.erase(id);
  moved_.push_back(id);
  CheckInDebugBuilds(*this);
}

void AnchoredMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  const FrameView view(frame, labels);
  const FrameFreeing freeing(volumes_);
  const std::vector<FusedBlock> fused = FuseIntoVolumes(view, config_, volumes_);
  std::set<InstanceId> changed_ids;
  for (const FusedBlock& block : fused) changed_ids.insert(block.id);
  for (const InstanceId id : changed_ids) {
    const ObjectVolume& volume = volumes_.at(id);
    if (!volume.lattice_is_world) {
      AddReach(id);
      moved_.push_back(id);
      continue;
    }
    const std::vector<Index3> changed = WithNeighbours(volume.grid, ChangedMasks(fused, id));
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, changed.size(), kBlocksPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) {
            volume.grid.Find(changed[i])->cover = FindCover(volume.grid, changed[i]);
          }
        },
        tbb::simple_partitioner());
    dirty_.insert(dirty_.end(), changed.begin(), changed.end());
  }
  // Where one object alone is listed, its distances do not matter; where several are, they order
  // the list.
  for (const FusedBlock& block : fused) {
    if (volumes_.at(block.id).lattice_is_world && IsShared(block.index, block.id)) {
      dirty_.push_back(block.index);
    }
  }
  freeing.FreeEmpty(fused, volumes_);
  RefreshIndex();
  CheckInDebugBuilds(*this);
}

// Whether another object may be listed in this block of the index.
bool AnchoredMap::IsShared(const Index3& index, InstanceId id) const {
  for (const auto& [other, volume] : volumes_) {
    if (other == id) continue;
    if (volume.lattice_is_world) {
      if (volume.grid.Find(index) != nullptr) return true;
    } else if (const auto reach = reach_.find(other); reach != reach_.end()) {
      if (std::binary_search(reach->second.begin(), reach->second.end(), index)) return true;
    }
  }
  return false;
}

void AnchoredMap::Remove(InstanceId id) {
  RefreshIndex();
  if (!volumes_.contains(id)) return;
  AddReach(id);
  volumes_.erase(id);
  reach_.erase(id);
  RefreshIndex();
  CheckInDebugBuilds(*this);
}

void AnchoredMap::RefreshIndex() const {
  for (const InstanceId id : moved_) {
    const ObjectVolume& volume = volumes_.at(id);
    if (volume.lattice_is_world) {
      // Back at its birth: its cover masks have not been kept.
      for (const auto& entry : volume.grid.entries()) {
        entry.block->cover = FindCover(volume.grid, entry.index);
      }
    } else {
      reach_[id] = BlocksTouchedBy(VoxelReader(volume.grid), volume.T_WL, config_.voxel_m, true);
    }
    AddReach(id);
  }
  moved_.clear();
  if (dirty_.empty()) return;
  std::sort(dirty_.begin(), dirty_.end());
  dirty_.erase(std::unique(dirty_.begin(), dirty_.end()), dirty_.end());

  Participants participants;
  for (const auto& [id, volume] : volumes_) {
    if (volume.grid.empty()) continue;
    if (volume.lattice_is_world) {
      participants.in_world.push_back({id, &volume.grid});
    } else {
      participants.moved.push_back(
          {id, RowsOf(volume.T_WL.inverse()), VoxelReader(volume.grid), &reach_[id]});
    }
  }
  std::vector<IndexBlock> computed(dirty_.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, dirty_.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          computed[i] = ComputeBlock(dirty_[i], participants);
        }
      },
      tbb::simple_partitioner());
  std::vector<Index3> emptied;
  for (std::size_t i = 0; i < dirty_.size(); ++i) {
    IndexBlock* block = index_.Find(dirty_[i]);
    if (block != nullptr && computed[i].empty()) {
      emptied.push_back(dirty_[i]);
    } else if (block != nullptr) {
      *block = std::move(computed[i]);
    } else if (!computed[i].empty()) {
      index_.FindOrAdd(dirty_[i]) = std::move(computed[i]);
    }
  }
  index_.Erase(emptied);
  dirty_.clear();
}

AnchoredMap::IndexBlock AnchoredMap::ComputeBlock(const Index3& index,
                                                  const Participants& participants) const {
  const auto layers = static_cast<std::size_t>(layers_);
  std::vector<Candidate> lists;
  const auto list_of = [&](int place) {
    if (lists.empty()) lists.assign(kBlockVoxels * layers, {0, kNoInstance});
    return &lists[static_cast<std::size_t>(place) * layers];
  };
  for (const auto& [id, grid] : participants.in_world) {
    const TsdfBlock* block = grid->Find(index);
    if (block == nullptr) continue;
    for (int z = 0; z < kBlockSide; ++z) {
      for (std::uint64_t bits = block->cover[static_cast<std::size_t>(z)]; bits != 0;
           bits &= bits - 1) {
        const int place = 64 * z + std::countr_zero(bits);
        Sift(list_of(place), layers_, {block->distance[static_cast<std::size_t>(place)], id});
      }
    }
  }
  for (const Participants::Moved& object : participants.moved) {
    if (!std::binary_search(object.reach->begin(), object.reach->end(), index)) continue;
    PulledCover cover;
    if (!CoverOfBlock(object.reader, object.T_LW, config_.voxel_m, config_.back(), index, cover)) {
      continue;
    }
    for (int place = 0; place < kBlockVoxels; ++place) {
      const auto i = static_cast<std::size_t>(place);
      if (cover.covered[i] != 0) Sift(list_of(place), layers_, {cover.distance[i], object.id});
    }
  }
  IndexBlock ids(lists.size());
  for (std::size_t i = 0; i < lists.size(); ++i) ids[i] = lists[i].id;
  return ids;
}

InstanceId AnchoredMap::ActiveAt(const Index3& voxel) const {
  const IndexBlock* ids = index_.Find(BlockOf(voxel));
  if (ids == nullptr || ids->empty()) return kNoInstance;
  return (*ids)[static_cast<std::size_t>(PlaceInBlock(voxel) * layers_)];
}

TriangleMesh AnchoredMap::SceneMesh() const {
  RefreshIndex();
  return LayeredMap::SceneMesh();
}

std::vector<Listing> AnchoredMap::ListAt(const Eigen::Vector3i& voxel) const {
  RefreshIndex();
  std::vector<Listing> listings;
  const IndexBlock* ids = index_.Find(BlockOf(ToIndex3(voxel)));
  if (ids == nullptr || ids->empty()) return listings;
  const int first = PlaceInBlock(ToIndex3(voxel)) * layers_;
  for (int i = 0; i < layers_; ++i) {
    const InstanceId id = (*ids)[static_cast<std::size_t>(first + i)];
    if (id == kNoInstance) break;
    listings.push_back({id, 0});
  }
  return listings;
}

std::vector<Eigen::Vector3i> AnchoredMap::ListedVoxels() const {
  RefreshIndex();
  std::vector<Index3> voxels;
  for (const auto& entry : index_.entries()) {
    for (int place = 0; place < kBlockVoxels && !entry.block->empty(); ++place) {
      if ((*entry.block)[static_cast<std::size_t>(place * layers_)] != kNoInstance) {
        voxels.push_back(VoxelAt(entry.index, place));
      }
    }
  }
  return SortedVoxels(std::move(voxels));
}

MapMemory AnchoredMap::Memory() const {
  MapMemory memory = VolumeMemory();
  for (const auto& entry : index_.entries()) {
    if (entry.block->empty()) continue;
    ++memory.blocks;
    memory.bytes += entry.block->size() * sizeof(InstanceId);
  }
  memory.bytes += index_.TableBytes();
  return memory;
}

}  // namespace tsdfpp
