// Motion of an object's values through one field with labels (docs/map.md, "`tsdf`: one field").
#pragma once

#include "mapper/methods/labelled_field.h"

namespace tsdfpp {

// Moves the object's voxels by T_rel (world): vacates them, resamples them, and writes what arrives
// over what is there, or where `keep_nearer` only over what is farther from a surface.
void MoveInField(InstanceId id, const Pose& T_rel, const MapConfig& config, bool keep_nearer,
                 LabelledField& field);

}  // namespace tsdfpp
