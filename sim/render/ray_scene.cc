#include "sim/render/ray_scene.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/pixel_ray.h"
#include "sim/scene/mujoco_guard.h"

namespace tsdfpp {
namespace {

struct SpecDeleter {
  void operator()(mjSpec* spec) const { mj_deleteSpec(spec); }
};

// Where an object waits that is not in the picture.
constexpr double kFarAway_m = 1e6;

void AddObject(mjSpec* spec, const TrueModel& model) {
  const std::string name = fmt::format("object{}", model.info.id);
  std::vector<float> vertices;
  std::vector<int> faces;
  for (const Eigen::Vector3f& v : model.mesh_O.vertices) {
    vertices.insert(vertices.end(), {v.x(), v.y(), v.z()});
  }
  for (const auto& triangle : model.mesh_O.triangles) {
    for (const std::uint32_t corner : triangle) faces.push_back(static_cast<int>(corner));
  }
  mjsMesh* mesh = mjs_addMesh(spec, nullptr);
  mjs_setName(mesh->element, name.c_str());
  // Mass plays no part; a shell's inertia asks nothing of the mesh.
  mesh->inertia = mjMESH_INERTIA_SHELL;
  mjs_setFloat(mesh->uservert, vertices.data(), static_cast<int>(vertices.size()));
  mjs_setInt(mesh->userface, faces.data(), static_cast<int>(faces.size()));
  mjsBody* body = mjs_findBody(spec, "world");
  if (model.info.id != kBackground) {
    body = mjs_addBody(body, nullptr);
    mjs_setName(body->element, name.c_str());
    body->mocap = 1;
  }
  mjsGeom* geom = mjs_addGeom(body, nullptr);
  mjs_setName(geom->element, name.c_str());
  geom->type = mjGEOM_MESH;
  mjs_setString(geom->meshname, name.c_str());
  geom->contype = 0;
  geom->conaffinity = 0;
}

}  // namespace

struct RayScene::Model {
  mjModel* model = nullptr;
  std::vector<InstanceId> id_of_geom;
  std::map<InstanceId, int> mocap;

  Model() = default;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;
  ~Model() { mj_deleteModel(model); }
};

struct RayScene::State {
  mjData* data = nullptr;

  explicit State(const mjModel* model) : data(mj_makeData(model)) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { mj_deleteData(data); }
};

RayScene::RayScene(std::shared_ptr<const Model> model, std::unique_ptr<State> state)
    : model_(std::move(model)), state_(std::move(state)) {}
RayScene::RayScene(const RayScene& other)
    : model_(other.model_), state_(std::make_unique<State>(other.model_->model)) {}
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene::~RayScene() = default;

Expected<RayScene> RayScene::Compose(const std::vector<TrueModel>& models) {
  InstallMujocoHandlers();
  const std::unique_ptr<mjSpec, SpecDeleter> spec(mj_makeSpec());
  for (const TrueModel& model : models) {
    if (!model.mesh_O.triangles.empty()) AddObject(spec.get(), model);
  }
  auto composed = std::make_shared<Model>();
  composed->model = mj_compile(spec.get(), nullptr);
  if (composed->model == nullptr) {
    return EnvironmentError("MuJoCo {} cannot compose the true models: {}", mj_versionString(),
                            mjs_getError(spec.get()));
  }
  composed->id_of_geom.resize(static_cast<std::size_t>(composed->model->ngeom));
  for (const TrueModel& model : models) {
    const std::string name = fmt::format("object{}", model.info.id);
    const int geom = mj_name2id(composed->model, mjOBJ_GEOM, name.c_str());
    if (geom < 0) continue;
    composed->id_of_geom[static_cast<std::size_t>(geom)] = model.info.id;
    if (model.info.id == kBackground) continue;
    const int body = mj_name2id(composed->model, mjOBJ_BODY, name.c_str());
    composed->mocap.emplace(model.info.id, composed->model->body_mocapid[body]);
  }
  auto state = std::make_unique<State>(composed->model);
  return RayScene(std::move(composed), std::move(state));
}

RayImage RayScene::Cast(const Intrinsics& k, const Pose& T_WC,
                        const std::map<InstanceId, Pose>& T_WO) {
  mjData* data = state_->data;
  for (const auto& [id, mocap] : model_->mocap) {
    const auto pose = T_WO.find(id);
    mjtNum* pos = data->mocap_pos + 3 * mocap;
    mjtNum* quat = data->mocap_quat + 4 * mocap;
    if (pose == T_WO.end()) {
      std::fill_n(pos, 3, kFarAway_m);
      continue;
    }
    const Eigen::Quaterniond q(pose->second.linear());
    std::copy_n(pose->second.translation().data(), 3, pos);
    const double wxyz[] = {q.w(), q.x(), q.y(), q.z()};
    std::copy_n(wxyz, 4, quat);
  }
  mj_kinematics(model_->model, data);

  const auto count = static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height);
  std::vector<mjtNum> directions;
  directions.reserve(3 * count);
  std::vector<double> length;
  length.reserve(count);
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const Eigen::Vector3d ray = PixelRay(k, u, v);
      const Eigen::Vector3d direction = T_WC.linear() * ray.normalized();
      directions.insert(directions.end(), {direction.x(), direction.y(), direction.z()});
      length.push_back(ray.norm());
    }
  }
  std::vector<int> geom(count);
  std::vector<mjtNum> distance(count);
  std::vector<mjtNum> normal(3 * count);
  const Eigen::Vector3d origin = T_WC.translation();
  mj_multiRay(model_->model, data, origin.data(), directions.data(), nullptr, 1, -1, geom.data(),
              distance.data(), normal.data(), static_cast<int>(count), kMaxValidDepth_m);
  RayImage image;
  image.intrinsics = k;
  image.depth.reserve(count);
  image.id.reserve(count);
  image.normal_C.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const bool hit = geom[i] >= 0;
    image.depth.push_back(hit ? distance[i] / length[i] : std::numeric_limits<double>::infinity());
    image.id.push_back(hit ? model_->id_of_geom[static_cast<std::size_t>(geom[i])] : kNoInstance);
    image.normal_C.emplace_back(T_WC.linear().transpose() *
                                Eigen::Map<const Eigen::Vector3d>(&normal[3 * i]));
  }
  return image;
}

bool IsOnEdge(const RayImage& rays, int u, int v, const RayCheckConfig& config) {
  const Intrinsics& k = rays.intrinsics;
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * k.width + x); };
  const std::size_t centre = at(u, v);
  const Eigen::Vector3d& normal = rays.normal_C[centre];
  const Eigen::Vector3d p_C = rays.depth[centre] * PixelRay(k, u, v);
  const double offset = normal.dot(p_C);
  for (int y = std::max(0, v - 1); y <= std::min(k.height - 1, v + 1); ++y) {
    for (int x = std::max(0, u - 1); x <= std::min(k.width - 1, u + 1); ++x) {
      const std::size_t other = at(x, y);
      if (rays.id[other] != rays.id[centre]) return true;
      const double on_plane = offset / normal.dot(PixelRay(k, x, y));
      if (!(std::abs(rays.depth[other] - on_plane) < config.edge_step_m)) return true;
      // A low step: farther from the plane than a bend between the two pixels explains.
      const Eigen::Vector3d to_other = rays.depth[other] * PixelRay(k, x, y) - p_C;
      const double bend = to_other.norm() * normal.cross(rays.normal_C[other]).norm();
      if (std::abs(normal.dot(to_other)) > bend + config.low_step_m) return true;
    }
  }
  return false;
}

PixelComparison ComparePixel(const RayImage& rays, const cv::Mat& depth, const cv::Mat& mask, int u,
                             int v, const RayCheckConfig& config) {
  const Intrinsics& k = rays.intrinsics;
  const auto i = static_cast<std::size_t>(v * k.width + u);
  const float z = depth.at<float>(v, u);
  const bool shown = IsValidDepth(z);
  if (rays.id[i] == kNoInstance) {
    // Beside an edge the two may differ; what is all around empty must be empty.
    bool empty_around = true;
    for (int y = std::max(0, v - 1); y <= std::min(k.height - 1, v + 1); ++y) {
      for (int x = std::max(0, u - 1); x <= std::min(k.width - 1, u + 1); ++x) {
        empty_around &= rays.id[static_cast<std::size_t>(y * k.width + x)] == kNoInstance;
      }
    }
    return {shown && empty_around ? RayVerdict::kMissed : RayVerdict::kExcluded, 0};
  }
  const double least_cosine = std::cos(config.max_incidence_deg * std::numbers::pi / 180);
  // Whichever way a face is wound: a renderer that shows nothing of its back is to be found out.
  const double cosine = std::abs(rays.normal_C[i].dot(PixelRay(k, u, v).normalized()));
  if (cosine < least_cosine || IsOnEdge(rays, u, v, config)) return {};
  if (!shown) return {RayVerdict::kMissed, 0};
  if (mask.at<InstanceId>(v, u) != rays.id[i]) return {RayVerdict::kWrongId, 0};
  return {RayVerdict::kCompared, std::abs(z - rays.depth[i])};
}

}  // namespace tsdfpp
