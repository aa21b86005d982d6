#include "mapper/methods/map_objects.h"

#include <algorithm>

#include "mapper/map_reach.h"
#include "mapper/methods/anchored_map.h"
#include "mapper/methods/literal_map.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/single_field_map.h"
#include "mapper/methods/tsdfpp_map.h"
#include "mapper/volume/pull_back.h"

namespace tsdfpp {
namespace {

Expected<void> CheckIsObject(InstanceId id) {
  if (id != kBackground && id != kNoInstance) return {};
  return UsageError("id {} is {}, expected an object's", id,
                    id == kBackground ? "the background" : "kept for 'no object'");
}

void RenameKey(InstanceId from, InstanceId to, ObjectVolumes& volumes) {
  auto volume = volumes.extract(from);
  volume.key() = to;
  volumes.insert(std::move(volume));
}

}  // namespace

Expected<void> CheckNewId(InstanceId id, bool is_known) {
  TSDFPP_RETURN_IF_ERROR(CheckIsObject(id));
  if (is_known) return UsageError("object {} is in the map already, expected a new id", id);
  return {};
}

Expected<void> CheckRename(InstanceId from, bool from_is_known, InstanceId to, bool to_is_known) {
  TSDFPP_RETURN_IF_ERROR(CheckIsObject(from));
  if (!from_is_known) return UsageError("object {} is not in the map", from);
  return CheckNewId(to, to_is_known);
}

TsdfGrid InWorldLattice(const TsdfGrid& volume, const Pose& T_WL, const MapConfig& config) {
  if (!SameNumbers(T_WL, Pose::Identity())) {
    return ResampleGrid(volume, T_WL, config.voxel_m, config.back(), config.resampling);
  }
  TsdfGrid copy = volume;
  for (const auto& entry : copy.entries()) entry.block->UpdateMasks(config.back());
  return copy;
}

TsdfGrid CopyVolume(const MapRepresentation& map, InstanceId id) {
  const VoxelInspection& voxels = VoxelsOf(map);
  const TsdfGrid* grid = voxels.GridOf(id);
  if (grid == nullptr) return {};
  if (!IsOneField(map.method())) return *grid;
  TsdfGrid volume;
  for (const auto* entry : grid->Sorted()) {
    auto block = std::make_unique<TsdfBlock>(*entry->block);
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 v = VoxelAt(entry->index, place);
      if (!voxels.ValueAt(id, {v.x, v.y, v.z})) block->Clear(place);
    }
    block->UpdateMasks(map.config().back());
    if (block->AnyObserved()) volume.Add(entry->index, std::move(block));
  }
  return volume;
}

Expected<void> LayeredMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(CheckRename(from, volumes_.contains(from), to, volumes_.contains(to)));
  RenameKey(from, to, volumes_);
  anything_may_be_hidden_ = true;
  return {};
}

Expected<void> LayeredMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                               const Pose& T_WO) {
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, volumes_.contains(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  ObjectVolume& added = volumes_[id];
  added.T_WO = T_WO;
  // T_WL = T_WO * T_WO(birth)^-1
  added.T_WO_birth = SameNumbers(T_WL, Pose::Identity()) ? T_WO : T_WL.inverse() * T_WO;
  PlaceLattice(added);
  added.grid = InWorldLattice(volume, Pose::Identity(), config_);
  return {};
}

Expected<void> TsdfppMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(LayeredMap::Rename(from, to));
  for (const auto& entry : volumes_.at(to).grid.entries()) {
    ListBlock* lists = Any(entry.block->cover) ? index_.Find(entry.index) : nullptr;
    if (lists == nullptr) continue;
    std::replace(lists->ids.begin(), lists->ids.end(), from, to);
    if (lists->settled_id == from) lists->settled_id = to;
  }
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> TsdfppMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                              const Pose& T_WO) {
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, volumes_.contains(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  ObjectVolume& added = volumes_[id];
  added.T_WO = T_WO;
  added.grid = InWorldLattice(volume, T_WL, config_);
  Activate(id);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> AnchoredMap::Rename(InstanceId from, InstanceId to) {
  RefreshIndex();
  AddReach(from);  // made anew in vain where the renaming is refused
  TSDFPP_RETURN_IF_ERROR(LayeredMap::Rename(from, to));
  reach_.erase(from);
  moved_.push_back(to);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> AnchoredMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                                const Pose& T_WO) {
  TSDFPP_RETURN_IF_ERROR(LayeredMap::Add(id, volume, T_WL, T_WO));
  moved_.push_back(id);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> LiteralMap::Rename(InstanceId from, InstanceId to) {
  active_.all_are_stale = true;
  TSDFPP_RETURN_IF_ERROR(CheckRename(from, volumes_.contains(from), to, volumes_.contains(to)));
  for (const auto& entry : lists_.entries()) {
    for (auto* entries : {&entry.block->active, &entry.block->inactive}) {
      for (Entry& listing : *entries) {
        if (listing.id == from) listing.id = to;
      }
    }
  }
  RenameKey(from, to, volumes_);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> LiteralMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                               const Pose& T_WO) {
  active_.all_are_stale = true;
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, volumes_.contains(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  ObjectVolume& added = volumes_[id];
  added.T_WO = T_WO;
  added.grid = InWorldLattice(volume, T_WL, config_);
  Activate(id);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> SingleFieldMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(CheckRename(from, IsKnown(from), to, IsKnown(to)));
  for (const auto& entry : labels_.entries()) {
    if ((entry.block->ever & EverBit(from)) == 0) continue;
    entry.block->ever |= EverBit(to);
    for (InstanceId& label : entry.block->id) {
      if (label == from) label = to;
    }
  }
  if (const auto pose = T_WO_.find(from); pose != T_WO_.end()) {
    T_WO_.insert_or_assign(to, pose->second);
    T_WO_.erase(from);
  }
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> SingleFieldMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                                   const Pose& T_WO) {
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, IsKnown(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  T_WO_.insert_or_assign(id, T_WO);
  const TsdfGrid arrivals = InWorldLattice(volume, T_WL, config_);
  for (const auto* entry : arrivals.Sorted()) {
    Arrive(id, entry->index, *entry->block,
           [this](std::size_t) { return static_cast<std::uint16_t>(config_.moved_confidence); });
  }
  CheckInDebugBuilds(*this);
  return {};
}

bool SingleFieldMap::IsKnown(InstanceId id) const {
  if (T_WO_.contains(id)) return true;
  for (const auto& entry : labels_.entries()) {
    const auto& labels = entry.block->id;
    if ((entry.block->ever & EverBit(id)) != 0 &&
        std::find(labels.begin(), labels.end(), id) != labels.end()) {
      return true;
    }
  }
  return false;
}

}  // namespace tsdfpp
