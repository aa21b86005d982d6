#include "sim/scene/scene_builder.h"

#include <algorithm>

#include "sim/scene/mujoco_guard.h"
#include "sim/scene/part_geom.h"

namespace tsdfpp {
namespace {

constexpr const char* kPaintMaterial = "paint";

struct Composer {
  mjSpec* spec = nullptr;
  std::map<std::string, TextureImage> textures;  // by material
  std::map<std::string, GeomInfo> geoms;         // by geom name

  void AddMaterials();
  void AddPart(mjsBody* body, const ModelPart& part, InstanceId id, const std::string& prefix);
};

void SetLook(mjSpec* spec, const Intrinsics& intrinsics) {
  spec->stat.extent = 1.0;
  std::fill_n(spec->stat.center, 3, 0.0);
  spec->visual.map.znear = static_cast<float>(kNear_m);
  spec->visual.map.zfar = static_cast<float>(kFar_m);
  spec->visual.global.offwidth = intrinsics.width;
  spec->visual.global.offheight = intrinsics.height;
  spec->visual.quality.shadowsize = 1024;
  spec->visual.map.shadowscale = 1.0F;
}

void Composer::AddMaterials() {
  for (TextureImage& image : MakeTextures()) {
    AddTexture(spec, image);
    std::string material = image.material;
    textures.emplace(std::move(material), std::move(image));
  }
  mjsMaterial* paint = mjs_addMaterial(spec, nullptr);
  mjs_setName(paint->element, kPaintMaterial);
  paint->specular = 0.35F;
  paint->shininess = 0.6F;
}

void Composer::AddPart(mjsBody* body, const ModelPart& part, InstanceId id,
                       const std::string& prefix) {
  if (part.picture != nullptr && !textures.contains(part.material)) {
    AddTexture(spec, *part.picture);
    textures.emplace(part.material, *part.picture);
  }
  const std::string name = prefix + "/" + part.name;
  AddMesh(spec, name, part, part.material.empty() ? 1.0 : textures.at(part.material).size_m);
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
  AddLights(spec.get(), config.lights);
  mjsBody* world = mjs_findBody(spec.get(), "world");
  for (const ModelPart& part : MakeRoom(config.room)) {
    composer.AddPart(world, part, kBackground, "room");
  }
  for (const SceneObject& object : config.objects) {
    mjsBody* body = mjs_addBody(world, nullptr);
    mjs_setName(body->element, object.name.c_str());
    body->mocap = 1;
    TSDFPP_ASSIGN(const std::vector<ModelPart> parts, MakeModel(object.model));
    for (const ModelPart& part : parts) {
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
