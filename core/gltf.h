// Binary glTF 2.0 (.glb), which every viewer opens (Khronos, "glTF 2.0 Specification").
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// An object of a glTF scene: a node with its mesh. Vertices in metres, in the world, z up; face ids
// are not written.
struct NamedMesh {
  std::string name;
  InstanceId id = kNoInstance;
  TriangleMesh mesh;
};

// One node and mesh an object, with its name and, in the node's `extras`, its `object_id`. glTF is
// y up, so the objects hang under a root node that turns z to y. Colours are kept in linear light,
// 16 bits a channel, as glTF has them. Errors: kData where a vertex is not finite, kEnvironment
// where the file cannot be written.
Expected<void> WriteGlb(const std::filesystem::path& path, const std::vector<NamedMesh>& objects);

// The triangles of the file's default scene, node by node, placed by the nodes' transformations
// and turned from glTF's y up to z up: what WriteGlb wrote comes back exactly. Ids are those in the
// `object_id` of a node's extras, kNoInstance where there is none. Positions must be floats, data
// inside the file, no extension required. Errors: kData, naming the file and what is wrong.
Expected<std::vector<NamedMesh>> ReadGlb(const std::filesystem::path& path);

// A mesh with face ids as one object an id, by increasing id, named as `name_of` says.
std::vector<NamedMesh> SplitByFaceIds(const TriangleMesh& mesh,
                                      const std::function<std::string(InstanceId)>& name_of);

}  // namespace tsdfpp
