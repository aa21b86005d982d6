#include "sim/scene_builder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/mujoco_guard.h"
#include "sim/room_model.h"
#include "sim/textures.h"

namespace tsdfpp {
namespace {

constexpr const char* kPaintMaterial = "paint";
// Faces that meet at less than this share a smooth normal; at more, the edge is drawn sharp.
constexpr double kCreaseAngle_deg = 40;

struct Composer {
  mjSpec* spec = nullptr;
  std::map<std::string, TextureImage> textures;
  std::map<std::string, GeomInfo> geoms;  // by geom name

  void AddMaterials();
  void AddLights();
  void AddPart(mjsBody* body, const ModelPart& part, InstanceId id, const std::string& prefix);
  void AddMesh(const std::string& name, const ModelPart& part);
};

void SetLook(mjSpec* spec, const Intrinsics& intrinsics) {
  spec->stat.extent = 1.0;
  std::fill_n(spec->stat.center, 3, 0.0);
  spec->visual.map.znear = static_cast<float>(kNear_m);
  spec->visual.map.zfar = static_cast<float>(kFar_m);
  spec->visual.global.offwidth = intrinsics.width;
  spec->visual.global.offheight = intrinsics.height;
  spec->visual.quality.shadowsize = 1536;
  spec->visual.map.shadowscale = 1.0F;
  // Ambient light only: a head light would move with the camera and with it the colours.
  spec->visual.headlight.active = 1;
  std::fill_n(spec->visual.headlight.ambient, 3, 0.34F);
  std::fill_n(spec->visual.headlight.diffuse, 3, 0.0F);
  std::fill_n(spec->visual.headlight.specular, 3, 0.0F);
}

void Composer::AddMaterials() {
  for (const TextureImage& image : MakeTextures()) {
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
    textures.emplace(image.material, image);
  }
  mjsMaterial* paint = mjs_addMaterial(spec, nullptr);
  mjs_setName(paint->element, kPaintMaterial);
  paint->specular = 0.35F;
  paint->shininess = 0.6F;
}

// A lamp below the ceiling that casts shadows, and a soft fill from the other side.
void Composer::AddLights() {
  mjsBody* world = mjs_findBody(spec, "world");
  const auto add = [&](const Eigen::Vector3d& at, const Eigen::Vector3d& target, float strength,
                       bool shadow) {
    mjsLight* light = mjs_addLight(world, nullptr);
    const Eigen::Vector3d direction = (target - at).normalized();
    std::copy_n(at.data(), 3, light->pos);
    std::copy_n(direction.data(), 3, light->dir);
    light->type = shadow ? mjLIGHT_SPOT : mjLIGHT_DIRECTIONAL;
    light->cutoff = 55;
    light->exponent = 4.0F;
    light->castshadow = static_cast<mjtBool>(shadow);
    std::fill_n(light->ambient, 3, 0.0F);
    std::fill_n(light->diffuse, 3, strength);
    std::fill_n(light->specular, 3, shadow ? 0.4F : 0.0F);
  };
  add({-1.3, 0.5, 2.4}, {0.1, 0.0, 0.6}, 0.85F, true);
  add({2.0, -2.5, 2.4}, {0, 0, 0.9}, 0.42F, false);
}

// A shape as MuJoCo takes it: one normal a vertex, so vertices at sharp edges are there once for
// each side. (MuJoCo 3.17 accepts an index of normals beside the index of vertices and ignores it.)
struct UserMesh {
  std::vector<float> vertices;
  std::vector<float> normals;
  std::vector<int> faces;
  std::vector<float> texcoords;  // of each triangle's three corners
  std::vector<int> texcoord_index;
};

// Normals are smooth across edges below the crease angle. A texture is laid on each face along the
// axis that the face looks at most.
UserMesh SplitAtCreases(const Shape& shape, double texture_size_m) {
  std::vector<Eigen::Vector3d> face_normal(shape.triangles.size());  // length: twice the area
  std::vector<std::vector<std::size_t>> faces_at(shape.vertices.size());
  for (std::size_t f = 0; f < shape.triangles.size(); ++f) {
    const auto& [a, b, c] = shape.triangles[f];
    face_normal[f] =
        (shape.vertices[b] - shape.vertices[a]).cross(shape.vertices[c] - shape.vertices[a]);
    for (const std::uint32_t v : {a, b, c}) faces_at[v].push_back(f);
  }
  const double least_cosine = std::cos(kCreaseAngle_deg * std::numbers::pi / 180);
  // Corners of one vertex whose faces are the same set have the same sum, bit for bit.
  std::map<std::pair<std::uint32_t, std::array<double, 3>>, int> split;
  UserMesh mesh;
  for (std::size_t f = 0; f < shape.triangles.size(); ++f) {
    const Eigen::Vector3d own = face_normal[f].normalized();
    int axis = 0;
    own.cwiseAbs().maxCoeff(&axis);
    for (const std::uint32_t v : shape.triangles[f]) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (const std::size_t other : faces_at[v]) {
        if (face_normal[other].normalized().dot(own) > least_cosine) normal += face_normal[other];
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
      const Eigen::Vector3d at = shape.vertices[v] / texture_size_m;
      mesh.texcoords.push_back(static_cast<float>(at[axis == 0 ? 1 : 0]));
      mesh.texcoords.push_back(static_cast<float>(at[axis == 2 ? 1 : 2]));
    }
  }
  return mesh;
}

void Composer::AddMesh(const std::string& name, const ModelPart& part) {
  mjsMesh* mesh = mjs_addMesh(spec, nullptr);
  mjs_setName(mesh->element, name.c_str());
  // Mass plays no part; a shell's inertia asks nothing of the mesh.
  mesh->inertia = mjMESH_INERTIA_SHELL;
  const UserMesh user =
      SplitAtCreases(part.shape, part.material.empty() ? 1.0 : textures.at(part.material).size_m);
  const auto size = [](const auto& values) { return static_cast<int>(values.size()); };
  mjs_setFloat(mesh->uservert, user.vertices.data(), size(user.vertices));
  mjs_setFloat(mesh->usernormal, user.normals.data(), size(user.normals));
  mjs_setInt(mesh->userface, user.faces.data(), size(user.faces));
  mjs_setFloat(mesh->usertexcoord, user.texcoords.data(), size(user.texcoords));
  mjs_setInt(mesh->userfacetexcoord, user.texcoord_index.data(), size(user.texcoord_index));
}

void Composer::AddPart(mjsBody* body, const ModelPart& part, InstanceId id,
                       const std::string& prefix) {
  const std::string name = prefix + "/" + part.name;
  AddMesh(name, part);
  mjsGeom* geom = mjs_addGeom(body, nullptr);
  mjs_setName(geom->element, name.c_str());
  geom->type = mjGEOM_MESH;
  mjs_setString(geom->meshname, name.c_str());
  geom->contype = 0;
  geom->conaffinity = 0;
  GeomInfo info{id, part.region, part.colour};
  if (part.material.empty()) {
    mjs_setString(geom->material, kPaintMaterial);
    for (int k = 0; k < 3; ++k) geom->rgba[k] = static_cast<float>(part.colour[k]) / 255.0F;
    geom->rgba[3] = 1.0F;
  } else {
    mjs_setString(geom->material, part.material.c_str());
    info.colour = textures.at(part.material).mean;
  }
  geoms.emplace(name, std::move(info));
}

}  // namespace

Expected<CompiledScene> CompiledScene::Compile(const SceneConfig& config) {
  InstallMujocoHandlers();
  const std::unique_ptr<mjSpec, MujocoDeleter> spec(mj_makeSpec());
  Composer composer;
  composer.spec = spec.get();
  SetLook(spec.get(), config.intrinsics);
  composer.AddMaterials();
  composer.AddLights();
  mjsBody* world = mjs_findBody(spec.get(), "world");
  for (const ModelPart& part : MakeRoom()) composer.AddPart(world, part, kBackground, "room");
  for (const SceneObject& object : config.objects) {
    mjsBody* body = mjs_addBody(world, nullptr);
    mjs_setName(body->element, object.name.c_str());
    body->mocap = 1;
    for (const ModelPart& part : MakeToy(object.model)) {
      composer.AddPart(body, part, object.id, object.name);
    }
  }

  CompiledScene scene;
  scene.model_.reset(mj_compile(spec.get(), nullptr));
  if (scene.model_ == nullptr) {
    return EnvironmentError("MuJoCo {} cannot compile scene '{}': {}", mj_versionString(),
                            config.name, mjs_getError(spec.get()));
  }
  scene.data_.reset(mj_makeData(scene.model_.get()));
  scene.geoms_.resize(static_cast<std::size_t>(scene.model_->ngeom));
  for (auto& [name, info] : composer.geoms) {
    const int geom = mj_name2id(scene.model_.get(), mjOBJ_GEOM, name.c_str());
    scene.geoms_[static_cast<std::size_t>(geom)] = std::move(info);
  }
  scene.objects_.push_back({kBackground, "background", ""});
  for (const SceneObject& object : config.objects) {
    scene.objects_.push_back({object.id, object.name, object.semantic_class});
    const int body = mj_name2id(scene.model_.get(), mjOBJ_BODY, object.name.c_str());
    scene.mocap_.emplace(object.id, scene.model_->body_mocapid[body]);
  }
  return scene;
}

void CompiledScene::SetPoses(const std::map<InstanceId, Pose>& T_WO) {
  for (const auto& [id, pose] : T_WO) {
    const int mocap = mocap_.at(id);
    const Eigen::Quaterniond q(pose.linear());
    const Eigen::Vector3d t = pose.translation();
    std::copy_n(t.data(), 3, data_->mocap_pos + 3 * mocap);
    mjtNum* quat = data_->mocap_quat + 4 * mocap;
    quat[0] = q.w();
    quat[1] = q.x();
    quat[2] = q.y();
    quat[3] = q.z();
  }
  mj_kinematics(model_.get(), data_.get());
  mj_comPos(model_.get(), data_.get());
  mj_camlight(model_.get(), data_.get());
}

std::vector<TrueModel> CompiledScene::TrueModels() const {
  const mjModel& m = *model_;
  std::vector<TrueModel> models;
  for (const ObjectInfo& object : objects_) {
    TrueModel model;
    model.info = object;
    for (int g = 0; g < m.ngeom; ++g) {
      const GeomInfo& info = geoms_[static_cast<std::size_t>(g)];
      if (info.id != object.id) continue;
      auto region = std::find(model.regions.begin(), model.regions.end(), info.region);
      if (region == model.regions.end()) {
        model.regions.push_back(info.region);
        region = model.regions.end() - 1;
      }
      const auto region_index = static_cast<std::uint16_t>(region - model.regions.begin());
      const mjtNum* quat = m.geom_quat + 4 * g;
      const mjtNum* pos = m.geom_pos + 3 * g;
      // Of the geom in its body: the object's frame, or the world's for the background.
      Pose T_OG = Pose::Identity();
      T_OG.linear() =
          Eigen::Quaterniond(quat[0], quat[1], quat[2], quat[3]).normalized().toRotationMatrix();
      T_OG.translation() = Eigen::Vector3d(pos[0], pos[1], pos[2]);
      const int mesh = m.geom_dataid[g];
      const auto first = static_cast<std::uint32_t>(model.mesh_O.vertices.size());
      for (int v = 0; v < m.mesh_vertnum[mesh]; ++v) {
        const float* p = m.mesh_vert + 3 * (m.mesh_vertadr[mesh] + v);
        const Eigen::Vector3d p_O = T_OG * Eigen::Vector3d(p[0], p[1], p[2]);
        model.mesh_O.vertices.emplace_back(p_O.cast<float>());
        model.mesh_O.colours.push_back(info.colour);
      }
      for (int f = 0; f < m.mesh_facenum[mesh]; ++f) {
        const int* face = m.mesh_face + 3 * (m.mesh_faceadr[mesh] + f);
        model.mesh_O.triangles.push_back({first + static_cast<std::uint32_t>(face[0]),
                                          first + static_cast<std::uint32_t>(face[1]),
                                          first + static_cast<std::uint32_t>(face[2])});
        model.mesh_O.face_ids.push_back(object.id);
        model.face_region.push_back(region_index);
      }
    }
    models.push_back(std::move(model));
  }
  return models;
}

}  // namespace tsdfpp
