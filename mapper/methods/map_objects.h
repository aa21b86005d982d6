// Renaming and adding objects: what all maps share.
#pragma once

#include "mapper/map_representation.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// Whether `to` is free to become an object of a map in which `from`, where given, becomes it.
// Errors: kUsage; those of MapEditing::Rename and Add.
Expected<void> CheckNewId(InstanceId id, bool is_known);
Expected<void> CheckRename(InstanceId from, bool from_is_known, InstanceId to, bool to_is_known);

// The volume at T_WL in the world's lattice: a copy where T_WL is the identity, else resampled as
// by a move. Masks are up to date but for `crossed` and `cover`.
TsdfGrid InWorldLattice(const TsdfGrid& volume, const Pose& T_WL, const MapConfig& config);

// The volume of one object of a map, as Add() takes it: a copy; for one field the voxels labelled
// so. Masks are up to date but for `crossed` and `cover`. Aborts where the map has no voxels.
TsdfGrid CopyVolume(const MapRepresentation& map, InstanceId id);

}  // namespace tsdfpp
