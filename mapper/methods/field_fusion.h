// Fusion of a frame into one field with labels (docs/map.md, "`tsdf`: one field").
#pragma once

#include "mapper/methods/labelled_field.h"
#include "mapper/volume/observation.h"

namespace tsdfpp {

// Allocates the field's blocks along the rays, fuses values and lets labels vote, and frees what it
// allocated in vain. `guarded`: labels guard their surfaces from what is fused behind others, and
// rims are completed (`tsdf/guarded`).
void FuseIntoField(const FrameView& frame, const MapConfig& config, bool guarded,
                   LabelledField& field);

}  // namespace tsdfpp
