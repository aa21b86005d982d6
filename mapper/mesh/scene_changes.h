// What changed of kept meshes, for somebody who follows them (mapper/scene_mesher.h).
#pragma once

#include <vector>

#include "core/types.h"
#include "mapper/volume/block_directory.h"

namespace tsdfpp {

// What an update of cached meshes had to do, in blocks.
struct MeshWork {
  std::size_t blocks = 0;   // that there are
  std::size_t changed = 0;  // whose values changed since the last update, new and erased ones too
  std::size_t remade = 0;   // whose vertices or triangles were made again

  MeshWork& operator+=(const MeshWork& other) {
    blocks += other.blocks;
    changed += other.changed;
    remade += other.remade;
    return *this;
  }
};

// What one block of one volume adds to the visible scene.
struct ScenePiece {
  InstanceId id = kNoInstance;  // of the volume; kNoInstance where the map has one field for all
  Index3 block;                 // of the volume's lattice
  // In the world, with face_ids, the triangles of the cubes that the block's voxels name and the
  // vertices that they use. Vertices at a border are in the parts on both sides.
  TriangleMesh mesh;
};

// What changed of the visible scene.
struct SceneChanges {
  std::vector<ScenePiece> parts;
  MeshWork work;  // of bringing the kept meshes up to date
};

}  // namespace tsdfpp
