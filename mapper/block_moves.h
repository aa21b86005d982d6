// Where poses would take the blocks of a map, whose indices end (docs/map.md, "Range"). A map that
// is not made of blocks has none of it (MapRepresentation::block_moves).
#pragma once

#include <map>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {

class BlockMoves {
 public:
  virtual ~BlockMoves() = default;

  // What SetObjectPose(id, T_WO) would move, and where to.
  virtual ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const = 0;

  // T_WL of the objects whose lattice is not the world's now.
  virtual std::map<InstanceId, Pose> MovedLattices() const { return {}; }
};

}  // namespace tsdfpp
