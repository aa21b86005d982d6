// Surfaces that lie in blocks, so that meshes of them can be kept and followed block by block
// (mapper/scene_mesher.h). A map may have none of it (MapRepresentation::block_surfaces).
#pragma once

#include "mapper/mesh/surfaces_in_blocks.h"

namespace tsdfpp {

class BlockSurfaces {
 public:
  virtual ~BlockSurfaces() = default;

  virtual SurfacesInBlocks Surfaces() const = 0;
};

}  // namespace tsdfpp
