// The kept meshes of object volumes and the visible scene that they make (docs/map.md, "Scene mesh
// of both").
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "mapper/mesh/scene_parts.h"
#include "mapper/mesh/surfaces_in_blocks.h"

namespace tsdfpp {

// Each function that takes surfaces brings what it needs in line with them first; they are always
// those of one map or of copies of it. `voxel_m` in metres, always the same.
class VolumeMeshes {
 public:
  // All objects' meshes, and which of their triangles are hidden.
  MeshWork Update(const VolumeSurfaces& surfaces, double voxel_m);

  // The visible scene as of the last update, with face ids.
  TriangleMesh Scene() const;

  // What changed of it since this was last asked, as of the last update: by id, then block.
  std::vector<ScenePiece> TakeChanges();

  // One object's whole surface; empty where there is no such volume.
  TriangleMesh Object(const VolumeSurfaces& surfaces, double voxel_m, InstanceId id);

  std::size_t Bytes() const;

 private:
  // Where triangles may have become hidden or visible since the last update, in global blocks.
  struct VisibilityChanges {
    BlockSet index;                 // other objects may be active
    BlockSet values;                // distances of some objects are others ...
    std::uint64_t whose = 0;        // ... of those with these bits
    InstanceId only = kNoInstance;  // if it is one alone, that one
    std::vector<BlockBox> all;
    BlockSet near;  // these and the blocks beside them
  };

  // Drops the meshes of objects that are no more; true where there were any.
  bool DropGone(const ObjectVolumes& volumes);
  // Nothing where that may be anywhere. `index_changes` are blocks of the index.
  std::optional<VisibilityChanges> WhereVisibilityChanged(const std::vector<Index3>& index_changes,
                                                          double voxel_m) const;
  // The parts of the object whose triangles are to be looked up again; all where `where` is
  // nothing.
  static std::vector<MeshPart*> PartsToLookUp(InstanceId id, PlacedMesh& object,
                                              const std::optional<VisibilityChanges>& where,
                                              double voxel_m);
  void FindHiddenTriangles(const VolumeSurfaces& surfaces, double voxel_m,
                           const std::optional<VisibilityChanges>& where);

  std::map<InstanceId, PlacedMesh> meshes_;
  std::vector<ScenePiece> gone_;  // shown parts of objects that are no more
  ChangeLog::Mark index_read_;
};

}  // namespace tsdfpp
