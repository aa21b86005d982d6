// Meshes that others made: OBJ, STL and PLY files as parts of a scene.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "sim/models/mesh_files.h"
#include "sim/models/toy_models.h"

namespace tsdfpp {

// What was found in the file and what was done about it.
struct MeshReport {
  std::size_t triangles = 0;   // of the file's faces once cut into triangles and cleaned
  std::size_t degenerate = 0;  // left out: no area, or a vertex named twice
  std::size_t duplicate = 0;   // left out: there before, facing the same way
  std::size_t turned = 0;      // turned over to agree with their neighbours, or to face outwards
  std::size_t open_edges = 0;  // not shared by exactly two triangles
  bool watertight = false;     // open_edges == 0, and orientable
  std::vector<std::string> remarks;  // sentences for the user, naming the file
};

struct ImportedMesh {
  // One part for each picture, and one for all that has none. Plain colours, colours of vertices
  // and of materials (Kd), and pictures (map_Kd) are kept.
  std::vector<ModelPart> parts;  // in the file's frame, times scale
  MeshReport report;
};

// The longest extent, once scaled, of what can be meant: beyond, the file is in another unit.
inline constexpr double kLeastExtent_m = 0.001;
inline constexpr double kMostExtent_m = 10;

// Reads a mesh and makes it fit to be rendered: vertices at one place are welded, faces are turned
// to agree (outwards where the mesh is closed). A mesh that is not watertight is drawn from both
// sides: every triangle is there twice, facing either way, because a renderer drops faces seen from
// behind while rays hit them. OBJ: polygons of any simple shape, indices from the end, `v x y z r g
// b`, mtllib with Kd and map_Kd. STL: binary and ASCII. PLY: what core/ply.h reads. `picture`,
// where not empty, is laid on by the file's texture coordinates in place of its own. Errors: kData,
// naming the file (and line): missing, not such a format, cut off, empty, a number that is not
// finite, an index that the file does not have, no face with an area, too many triangles, texture
// coordinates missing for `picture`; kUsage where the name ends in none of .obj, .stl, .ply, or the
// scaled size is implausible (the sentence names the size and `scale`).
Expected<ImportedMesh> ImportMesh(const std::filesystem::path& path, double scale = 1,
                                  const std::filesystem::path& picture = {});

}  // namespace tsdfpp
