// What a map of blocks lets be meshed: its volumes, who hides whom, or one field with labels.
#pragma once

#include <functional>
#include <optional>

#include "mapper/index/global_index.h"
#include "mapper/index/voxel_labels.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

// Object volumes, each meshed by itself. A triangle is hidden where another object is active at its
// look-up voxel, and its look-up point deep enough in that object (docs/map.md, "Scene mesh of
// both").
struct VolumeSurfaces {
  const ObjectVolumes* volumes = nullptr;
  const GlobalIndex* index = nullptr;  // nullptr where nobody is active, so that nothing is hidden
};

// One field for all, whose triangles are labelled by the voxels nearest to their centroids.
struct FieldSurface {
  const TsdfGrid* field = nullptr;
  std::function<VoxelLabels()> make_labels;  // for each thread that labels
};

// Valid until the map changes.
struct SurfacesInBlocks {
  double voxel_m = 0;
  // The objects. Without them an object's mesh is what the field labels so.
  std::optional<VolumeSurfaces> objects;
  // The visible scene; without it that of the objects.
  std::optional<FieldSurface> field;
};

}  // namespace tsdfpp
