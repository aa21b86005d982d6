// Renaming objects of a map and adding others' (docs/map.md, "Renaming and adding an object"). A
// map may have none of it (MapRepresentation::editing).
#pragma once

#include <optional>

#include "core/error.h"
#include "core/types.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

class MapRepresentation;

class MapEditing {
 public:
  virtual ~MapEditing() = default;

  // Gives an object another id: its values, listings, votes and poses are then the new one's, and
  // the places in lists stay, but for an index that is a function of volumes and poses, where ties
  // go by id. Errors: kUsage where `from` is not in the map, `to` is (a pose given is enough), or
  // one of them is the background or no id; the map is then unchanged.
  virtual Expected<void> Rename(InstanceId from, InstanceId to) = 0;

  // Puts a volume into the map as a new object whose pose is T_WO, with the volume's lattice at
  // T_WL; it arrives as if it had moved there (docs/map.md, "Renaming and adding an object").
  // Without a pose it has none yet, and its lattice must be the world's. The voxel size must be the
  // map's, and every block must hold an observed voxel. Errors: kUsage where the id is in the map
  // (a pose given is enough), the background or no id, or the lattice is another than the world's
  // and there is no pose; kData where a part would lie beyond the map's range, a pose is not rigid,
  // or a voxel holds what the map's cannot (MapConfig::Stores()); the map is then unchanged.
  virtual Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                             const std::optional<Pose>& T_WO) = 0;
};

// The map's, for whoever knows that it has one: aborts where it has none.
MapEditing& EditingOf(MapRepresentation& map);

}  // namespace tsdfpp
