#include "mapper/methods/map_objects.h"

#include "mapper/volume/pull_back.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

Expected<void> CheckIsObject(InstanceId id) {
  if (id != kBackground && id != kNoInstance) return {};
  return UsageError("id {} is {}, expected an object's", id,
                    id == kBackground ? "the background" : "kept for 'no object'");
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
  TsdfGrid copy = volume;
  for (const auto& entry : copy.entries()) entry.block->UpdateMasks(config.back());
  if (SameNumbers(T_WL, Pose::Identity())) return copy;
  return ResampleGrid(copy, T_WL, config.voxel_m, config.back(), config.resampling);
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

}  // namespace tsdfpp
