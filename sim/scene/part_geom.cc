#include "sim/scene/part_geom.h"

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace tsdfpp {
namespace {

// Faces that meet at less than this share a smooth normal; at more, the edge is drawn sharp.
constexpr double kCreaseAngle_deg = 40;

}  // namespace

UserMesh MakeUserMesh(const ModelPart& part, double texture_size_m) {
  const Shape& shape = part.shape;
  std::vector<Eigen::Vector3d> face_normal(shape.triangles.size());  // length: twice the area
  std::vector<std::vector<std::size_t>> faces_at(shape.vertices.size());
  for (std::size_t f = 0; f < shape.triangles.size(); ++f) {
    const auto& [a, b, c] = shape.triangles[f];
    face_normal[f] =
        (shape.vertices[b] - shape.vertices[a]).cross(shape.vertices[c] - shape.vertices[a]);
    for (const std::uint32_t v : {a, b, c}) faces_at[v].push_back(f);
  }
  std::vector<Eigen::Vector3d> face_direction(face_normal.size());
  std::transform(face_normal.begin(), face_normal.end(), face_direction.begin(),
                 [](const Eigen::Vector3d& normal) { return normal.normalized(); });
  const double least_cosine = std::cos(kCreaseAngle_deg * std::numbers::pi / 180);
  // Corners of one vertex whose faces are the same set have the same sum, bit for bit.
  std::map<std::pair<std::uint32_t, std::array<double, 3>>, int> split;
  UserMesh mesh;
  for (std::size_t f = 0; f < shape.triangles.size(); ++f) {
    const Eigen::Vector3d& own = face_direction[f];
    int axis = 0;
    own.cwiseAbs().maxCoeff(&axis);
    for (const std::uint32_t v : shape.triangles[f]) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (const std::size_t other : faces_at[v]) {
        if (face_direction[other].dot(own) > least_cosine) normal += face_normal[other];
      }
      normal.normalize();
      const auto [entry, is_new] = split.try_emplace({v, {normal.x(), normal.y(), normal.z()}},
                                                     static_cast<int>(split.size()));
      if (is_new) {
        for (int k = 0; k < 3; ++k) {
          mesh.vertices.push_back(static_cast<float>(shape.vertices[v][k]));
          mesh.normals.push_back(static_cast<float>(normal[k]));
        }
      }
      mesh.texcoord_index.push_back(static_cast<int>(mesh.faces.size()));
      mesh.faces.push_back(entry->second);
      if (!part.corner_uv.empty()) {
        const Eigen::Vector2f& uv = part.corner_uv[mesh.faces.size() - 1];
        mesh.texcoords.insert(mesh.texcoords.end(), {uv.x(), uv.y()});
        continue;
      }
      const Eigen::Vector3d at = shape.vertices[v] / texture_size_m;
      mesh.texcoords.push_back(static_cast<float>(at[axis == 0 ? 1 : 0]));
      mesh.texcoords.push_back(static_cast<float>(at[axis == 2 ? 1 : 2]));
    }
  }
  return mesh;
}

void AddMesh(mjSpec* spec, const std::string& name, const ModelPart& part, double texture_size_m) {
  mjsMesh* mesh = mjs_addMesh(spec, nullptr);
  mjs_setName(mesh->element, name.c_str());
  // Mass plays no part; a shell's inertia asks nothing of the mesh.
  mesh->inertia = mjMESH_INERTIA_SHELL;
  const UserMesh user = MakeUserMesh(part, texture_size_m);
  const auto size = [](const auto& values) { return static_cast<int>(values.size()); };
  mjs_setFloat(mesh->uservert, user.vertices.data(), size(user.vertices));
  mjs_setFloat(mesh->usernormal, user.normals.data(), size(user.normals));
  mjs_setInt(mesh->userface, user.faces.data(), size(user.faces));
  mjs_setFloat(mesh->usertexcoord, user.texcoords.data(), size(user.texcoords));
  mjs_setInt(mesh->userfacetexcoord, user.texcoord_index.data(), size(user.texcoord_index));
}

void AddTexture(mjSpec* spec, const TextureImage& image) {
  mjsTexture* texture = mjs_addTexture(spec, nullptr);
  mjs_setName(texture->element, image.material.c_str());
  texture->type = mjTEXTURE_2D;
  texture->width = image.width;
  texture->height = image.height;
  texture->nchannel = 3;
  mjs_setBuffer(texture->data, image.pixels.data(), static_cast<int>(image.pixels.size()));
  mjsMaterial* material = mjs_addMaterial(spec, nullptr);
  mjs_setName(material->element, image.material.c_str());
  mjs_setInStringVec(material->textures, mjTEXROLE_RGB, image.material.c_str());
  material->specular = 0.1F;
  material->shininess = 0.3F;
}

}  // namespace tsdfpp
