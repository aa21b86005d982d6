// Puts model parts, pictures and lamps into an mjSpec.
#pragma once

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "sim/models/textures.h"
#include "sim/models/toy_models.h"

namespace tsdfpp {

// A shape as MuJoCo takes it: one normal a vertex, so vertices at sharp edges are there once for
// each side. (MuJoCo 3.17 accepts an index of normals beside the index of vertices and ignores it.)
struct UserMesh {
  std::vector<float> vertices;
  std::vector<float> normals;
  std::vector<int> faces;
  std::vector<float> texcoords;  // of each triangle's three corners
  std::vector<int> texcoord_index;
};

// Normals are smooth across edges below 40 degrees; at more, the edge is drawn sharp. A texture is
// laid on by the part's own coordinates, or else on each face along the axis that the face looks at
// most, one picture on every `texture_size_m` metres.
UserMesh MakeUserMesh(const ModelPart& part, double texture_size_m);

// Adds the part's mesh, named `name`, for rendering and rays; its inertia asks nothing of it.
// `texture_size_m` is the material's TextureImage::size_m, anything where there is none.
void AddMesh(mjSpec* spec, const std::string& name, const ModelPart& part, double texture_size_m);

// Adds a texture and a material that shows it, both named image.material.
void AddTexture(mjSpec* spec, const TextureImage& image);

}  // namespace tsdfpp
