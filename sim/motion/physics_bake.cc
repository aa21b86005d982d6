#include "sim/motion/physics_bake.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "sim/scene/mujoco_guard.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// Contacts are stiff: what is at rest sinks in by some micrometres, a shove of some newtons pushes
// surfaces together by a tenth of a millimetre.
constexpr double kContactSteps = 4;  // time constant in steps; MuJoCo asks for two at least
constexpr double kRoomThickness_m = 0.2;
constexpr double kScriptedMass_kg = 1e4;
// A sphere's sides, as meshes have them, differ by the facets.
constexpr double kBallTolerance = 0.01;
// What physics moves meets everything; what it does not move meets only that.
constexpr int kMovedGroup = 1;
constexpr int kFixedGroup = 2;

bool IsScripted(const SceneObject& object) {
  return object.drive.has_value() || !object.keyframes.empty();
}

struct World {
  std::unique_ptr<mjModel, MujocoDeleter> model;
  std::unique_ptr<mjData, MujocoDeleter> data;
};

struct Moved {  // by physics
  const SceneObject* object = nullptr;
  Eigen::Vector3d centre_O = Eigen::Vector3d::Zero();  // of mass
  int qpos = 0;
  int dof = 0;
  std::vector<Pose> poses;
};

// A scripted object is a free body of great mass whose place and velocity are set before each step:
// a mocap body would push with a velocity of zero, so what it pushes would sink into it and not be
// dragged along.
struct Scripted {
  ObjectMotion motion;
  int qpos = 0;
  int dof = 0;
};

void SetContact(mjsGeom* geom, double timestep_s, double friction) {
  geom->solref[0] = kContactSteps * timestep_s;
  geom->solref[1] = 1;
  std::copy_n(std::array<double, 5>{0.98, 0.999, 0.0005, 0.5, 2}.data(), 5, geom->solimp);
  geom->margin = kToyClearance_m / 2;  // of each of the two that meet
  geom->friction[0] = friction;
  geom->condim = 3;
  geom->contype = kFixedGroup;
  geom->conaffinity = kMovedGroup;
}

void AddRoomBox(mjsBody* world, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                double timestep_s, double friction) {
  mjsGeom* geom = mjs_addGeom(world, nullptr);
  geom->type = mjGEOM_BOX;
  const Eigen::Vector3d middle = (low + high) / 2;
  const Eigen::Vector3d half = (high - low) / 2;
  std::copy_n(middle.data(), 3, geom->pos);
  std::copy_n(half.data(), 3, geom->size);
  SetContact(geom, timestep_s, friction);
}

void AddRoom(mjsBody* world, const SceneConfig& config, double timestep_s) {
  const RoomSpec& room = config.room;
  const double friction = config.physics.friction;
  const double x = room.half_x;
  const double y = room.half_y;
  const double t = kRoomThickness_m;
  const auto add = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    AddRoomBox(world, low, high, timestep_s, friction);
  };
  add({-x, -y, -t}, {x, y, 0});
  add({-x - t, -y, 0}, {-x, y, room.height});
  add({x, -y, 0}, {x + t, y, room.height});
  add({-x, -y - t, 0}, {x, -y, room.height});
  add({-x, y, 0}, {x, y + t, room.height});
  if (room.table) {
    add({-kTableHalfX_m, -kTableHalfY_m, kTableTop_m - kTableThickness_m},
        {kTableHalfX_m, kTableHalfY_m, kTableTop_m});
  }
}

// How an object's geoms touch others.
void SetObjectContact(mjsGeom* geom, const SceneObject& object, const SceneConfig& config,
                      double timestep_s) {
  SetContact(geom, timestep_s, object.physics ? object.physics->friction : config.physics.friction);
  if (!object.physics) return;
  geom->contype = kMovedGroup;
  geom->conaffinity = kMovedGroup | kFixedGroup;
  // Its own friction holds against the room and scripted objects, also where it is lower.
  geom->priority = 1;
  geom->condim = 6;
  geom->friction[1] = object.physics->rolling_friction_m;
  geom->friction[2] = object.physics->rolling_friction_m;
}

// A ball rolls on no facets.
mjsGeom* AddBall(mjsBody* body, const Eigen::AlignedBox3d& box) {
  mjsGeom* geom = mjs_addGeom(body, nullptr);
  geom->type = mjGEOM_SPHERE;
  const Eigen::Vector3d middle = box.center();
  std::copy_n(middle.data(), 3, geom->pos);
  geom->size[0] = box.sizes().z() / 2;
  return geom;
}

void AddHulls(mjSpec* spec, mjsBody* body, const SceneObject& object,
              const std::vector<ModelPart>& parts, const SceneConfig& config, double timestep_s) {
  const Eigen::AlignedBox3d box = BoundsOf(parts);
  if (object.model.name == "sphere" &&
      box.sizes().maxCoeff() - box.sizes().minCoeff() < kBallTolerance * box.sizes().maxCoeff()) {
    SetObjectContact(AddBall(body, box), object, config, timestep_s);
    return;
  }
  const std::vector<Points> hulls = CollisionHulls(parts);
  for (std::size_t i = 0; i < hulls.size(); ++i) {
    const std::string name = fmt::format("{}/{}", object.name, i);
    mjsMesh* mesh = mjs_addMesh(spec, nullptr);
    mjs_setName(mesh->element, name.c_str());
    mesh->inertia = mjMESH_INERTIA_CONVEX;
    std::vector<float> vertices;
    for (const Eigen::Vector3d& p : hulls[i]) {
      for (int k = 0; k < 3; ++k) vertices.push_back(static_cast<float>(p[k]));
    }
    mjs_setFloat(mesh->uservert, vertices.data(), static_cast<int>(vertices.size()));
    mjsGeom* geom = mjs_addGeom(body, nullptr);
    geom->type = mjGEOM_MESH;
    mjs_setString(geom->meshname, name.c_str());
    SetObjectContact(geom, object, config, timestep_s);
  }
}

Expected<World> Compile(const SceneConfig& config, double timestep_s) {
  InstallMujocoHandlers();
  const std::unique_ptr<mjSpec, MujocoDeleter> spec(mj_makeSpec());
  spec->option.timestep = timestep_s;
  spec->option.cone = mjCONE_ELLIPTIC;
  spec->option.impratio = 10;
  spec->option.noslip_iterations = 4;
  mjsBody* world_body = mjs_findBody(spec.get(), "world");
  AddRoom(world_body, config, timestep_s);
  for (const SceneObject& object : config.objects) {
    TSDFPP_ASSIGN(const std::vector<ModelPart> parts, MakeModel(object.model));
    mjsBody* body = mjs_addBody(world_body, nullptr);
    mjs_setName(body->element, object.name.c_str());
    const Pose T_WO = object.T_WO();
    const Eigen::Quaterniond q(T_WO.linear());
    std::copy_n(T_WO.translation().data(), 3, body->pos);
    std::copy_n(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()}.data(), 4, body->quat);
    if (object.physics || IsScripted(object)) mjs_addFreeJoint(body);
    AddHulls(spec.get(), body, object, parts, config, timestep_s);
  }
  World world;
  world.model.reset(mj_compile(spec.get(), nullptr));
  if (world.model == nullptr) {
    return EnvironmentError("MuJoCo {} cannot compile the physics of scene '{}': {}",
                            mj_versionString(), config.name, mjs_getError(spec.get()));
  }
  // A stated mass, spread as if the hulls were solid.
  for (const SceneObject& object : config.objects) {
    if (!object.physics && !IsScripted(object)) continue;
    const int body = mj_name2id(world.model.get(), mjOBJ_BODY, object.name.c_str());
    const double mass_kg = object.physics ? object.physics->mass_kg : kScriptedMass_kg;
    const double factor = mass_kg / world.model->body_mass[body];
    world.model->body_mass[body] *= factor;
    for (int k = 0; k < 3; ++k) world.model->body_inertia[3 * body + k] *= factor;
  }
  world.data.reset(mj_makeData(world.model.get()));
  mj_setConst(world.model.get(), world.data.get());
  return world;
}

void WritePose(const Pose& pose, mjtNum* qpos) {
  const Eigen::Quaterniond q(pose.linear());
  std::copy_n(pose.translation().data(), 3, qpos);
  std::copy_n(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()}.data(), 4, qpos + 3);
}

// A free joint's velocity is the world's, its angular velocity the body's own.
void WriteVelocity(const Eigen::Vector3d& velocity_W, const Eigen::Vector3d& spin_O, mjtNum* qvel) {
  std::copy_n(velocity_W.data(), 3, qvel);
  std::copy_n(spin_O.data(), 3, qvel + 3);
}

// Holds an object where it starts, moving as it will be when it is let go.
void Hold(const Moved& moved, mjData* data) {
  const Pose T_WO = moved.object->T_WO();
  const ObjectPhysics& physics = *moved.object->physics;
  WritePose(T_WO, data->qpos + moved.qpos);
  const Eigen::Vector3d spin_O =
      T_WO.linear().transpose() * (physics.angular_velocity_W * (std::numbers::pi / 180));
  const Eigen::Vector3d origin_velocity_W =
      physics.velocity_W - T_WO.linear() * spin_O.cross(moved.centre_O);
  WriteVelocity(origin_velocity_W, spin_O, data->qvel + moved.dof);
}

// Puts a scripted object where it is at `frame`, moving to where it is a step later.
void Follow(const Scripted& scripted, double frame, double step_frames, double step_s,
            mjData* data) {
  const Pose here = scripted.motion.T_WO(frame);
  const Pose next = scripted.motion.T_WO(frame + step_frames);
  const Eigen::Vector3d turn_O =
      ToRotationVector(Eigen::Quaterniond(here.linear().transpose() * next.linear()));
  WritePose(here, data->qpos + scripted.qpos);
  WriteVelocity((next.translation() - here.translation()) / step_s, turn_O / step_s,
                data->qvel + scripted.dof);
}

Pose ReadPose(const mjtNum* qpos) {
  Pose pose = Pose::Identity();
  pose.linear() =
      Eigen::Quaterniond(qpos[3], qpos[4], qpos[5], qpos[6]).normalized().toRotationMatrix();
  pose.translation() = Eigen::Vector3d(qpos[0], qpos[1], qpos[2]);
  return pose;
}

}  // namespace

Expected<std::map<InstanceId, std::vector<Pose>>> BakePhysics(const SceneConfig& config) {
  std::map<InstanceId, std::vector<Pose>> baked;
  if (std::none_of(config.objects.begin(), config.objects.end(),
                   [](const SceneObject& object) { return object.physics.has_value(); })) {
    return baked;
  }
  const double frame_s = 1 / config.rate_hz;
  const int steps = std::max(1, static_cast<int>(std::ceil(frame_s / config.physics.timestep_s)));
  TSDFPP_ASSIGN(World world, Compile(config, frame_s / steps));
  mjModel* model = world.model.get();
  mjData* data = world.data.get();
  std::vector<Moved> moved;
  std::vector<Scripted> scripted;
  for (const SceneObject& object : config.objects) {
    const int body = mj_name2id(model, mjOBJ_BODY, object.name.c_str());
    const int joint = model->body_jntadr[body];
    if (object.physics) {
      moved.push_back({&object,
                       Eigen::Vector3d(model->body_ipos + 3 * body),
                       model->jnt_qposadr[joint],
                       model->jnt_dofadr[joint],
                       {}});
    } else if (IsScripted(object)) {
      scripted.push_back({ObjectMotion(object, config.rate_hz), model->jnt_qposadr[joint],
                          model->jnt_dofadr[joint]});
    }
  }
  const int last = kFirstFrame + config.frames - 1;
  for (int frame = kFirstFrame; frame <= last; ++frame) {
    for (Moved& one : moved) {
      if (frame <= one.object->physics->start_frame) {
        one.poses.push_back(one.object->T_WO());
      } else {
        one.poses.push_back(ReadPose(data->qpos + one.qpos));
      }
    }
    if (frame == last) break;
    for (int step = 0; step < steps; ++step) {
      const double at = frame + static_cast<double>(step) / steps;
      for (const Scripted& one : scripted) Follow(one, at, 1.0 / steps, frame_s / steps, data);
      for (const Moved& one : moved) {
        const int start = one.object->physics->start_frame;
        if (frame < start || (frame == start && step == 0)) Hold(one, data);
      }
      TSDFPP_RETURN_IF_ERROR(RunGuarded([&] { mj_step(model, data); }));
    }
    for (const mjtWarning warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
      if (data->warning[warning].number > 0) {
        return UsageError(
            "scene '{}': the physics diverges in frame {}: a shorter "
            "physics.timestep_s or slower objects may help",
            config.name, frame);
      }
    }
  }
  for (Moved& one : moved) baked.emplace(one.object->id, std::move(one.poses));
  return baked;
}

}  // namespace tsdfpp
