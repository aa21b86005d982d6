// Surfaces from files that any program wrote: PLY, OBJ, STL, binary glTF.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/gltf.h"
#include "core/types.h"

namespace tsdfpp {

// Does the name end in .ply, .obj, .stl or .glb, in small or capital letters?
bool IsSurfaceFile(const std::filesystem::path& path);

// The parts that the file tells apart by name: the nodes of a .glb, else the whole file under no
// name. Positions are multiplied by `scale`; face ids (PLY's object_id) are kept. Only a PLY may
// lack faces: then it is a set of points. `remarks` gets sentences on what was left out. Errors:
// kUsage where the name ends in none of the four, kData where the file cannot be read or has a
// position that is not finite, or farther than kFarthest_m (core/farthest.h).
Expected<std::vector<NamedMesh>> ReadSurfaceParts(const std::filesystem::path& path, double scale,
                                                  std::vector<std::string>& remarks);

// The parts as one mesh, without labels but a PLY's own. Errors: those of ReadSurfaceParts.
Expected<TriangleMesh> ReadSurfaceFile(const std::filesystem::path& path, double scale,
                                       std::vector<std::string>& remarks);

// Appends the vertices and triangles of `more`, and its face ids and colours where `mesh` is empty
// or has such, too; else those are dropped.
void AppendMesh(const TriangleMesh& more, TriangleMesh& mesh);

}  // namespace tsdfpp
