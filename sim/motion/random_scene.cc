#include "sim/motion/random_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "core/random.h"
#include "sim/motion/scene_motion.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {
namespace {

constexpr int kTriesPerObject = 150;
// TOML has no larger whole number, and a drawn scene is written as TOML.
constexpr std::uint64_t kLargestOfToml = std::numeric_limits<std::int64_t>::max();
constexpr std::uint32_t kStream = 0x52440000;  // one stream a draw of the whole scene

double Within(const Eigen::Vector2d& range, double share) {
  return range[0] + (range[1] - range[0]) * share;
}

// Uniform numbers, one after the other.
class Draws {
 public:
  Draws(std::uint64_t seed, std::uint32_t stream) : seed_(seed), stream_(stream) {}
  double Next() {
    if (used_ % 4 == 0) numbers_ = UniformDraw(seed_, stream_, used_ / 4);
    return numbers_[used_++ % 4];
  }
  double In(const Eigen::Vector2d& range) { return Within(range, Next()); }
  double In(double low, double high) { return low + (high - low) * Next(); }
  bool Chance(double share) { return Next() < share; }
  template <typename T>
  const T& Of(const std::vector<T>& choices) {
    return choices[static_cast<std::size_t>(Next() * static_cast<double>(choices.size()))];
  }

 private:
  std::uint64_t seed_;
  std::uint32_t stream_;
  std::uint64_t used_ = 0;
  std::array<double, 4> numbers_{};
};

// An object and what is asked of its place.
struct Candidate {
  SceneObject object;
  double radius_m =
      0;  // of a circle around its footprint, about its origin; of a sphere where it falls
  Eigen::AlignedBox3d box_O;
  std::vector<Eigen::Vector2d> way;  // its origin seen from above, at every frame
};

bool IsInView(const Eigen::AlignedBox3d& box_O, const Pose& T_CO, const Intrinsics& k) {
  const auto inside = [&](const Eigen::Vector3d& p_O) {
    const Eigen::Vector3d p = T_CO * p_O;
    if (p.z() < kNear_m) return false;
    const double u = k.fx * p.x() / p.z() + k.cx;
    const double v = k.fy * p.y() / p.z() + k.cy;
    return u >= 0 && v >= 0 && u <= k.width - 1 && v <= k.height - 1;
  };
  constexpr int kLeastCorners = 4;
  int corners = 0;
  for (int i = 0; i < 8; ++i) {
    corners += inside(box_O.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i))) ? 1 : 0;
  }
  return corners >= kLeastCorners && inside(box_O.center());
}

template <typename PoseOf>
bool IsInViewLongEnough(const RandomSceneConfig& config, const Eigen::AlignedBox3d& box_O,
                        const CameraMotion& camera, const PoseOf& T_WO) {
  int seen = 0;
  for (int frame = kFirstFrame; frame < kFirstFrame + config.frames; ++frame) {
    seen += IsInView(box_O, camera.T_WC(frame).inverse() * T_WO(frame), config.intrinsics) ? 1 : 0;
  }
  return seen >= config.in_view * config.frames;
}

Eigen::Vector2d PlaceOnTable(Draws& draws, double radius_m) {
  const double x = kTableHalfX_m - radius_m;
  const double y = kTableHalfY_m - radius_m;
  return {draws.In(-x, x), draws.In(-y, y)};
}

// A drive at a speed in the range from the object's place on, or nothing where it does not fit.
bool DrawDrive(Draws& draws, const RandomSceneConfig& config, Candidate& candidate) {
  constexpr double kLeastStep_m = 0.12;
  SceneObject& object = candidate.object;
  DrivePath drive;
  const int waypoints = 1 + static_cast<int>(draws.Next() * 3);
  Eigen::Vector2d last(object.x, object.y);
  for (int i = 0; i < waypoints; ++i) {
    const Eigen::Vector2d next = PlaceOnTable(draws, candidate.radius_m);
    if ((next - last).norm() < kLeastStep_m) return false;
    drive.x.push_back(next.x());
    drive.y.push_back(next.y());
    last = next;
  }
  object.yaw_deg =
      std::atan2(drive.y[0] - object.y, drive.x[0] - object.x) * 180 / std::numbers::pi;
  drive.start_frame = kFirstFrame + static_cast<int>(draws.Next() * config.frames / 4);
  drive.end_frame = config.frames;
  object.drive = drive;
  const double length_m = ObjectMotion(object, config.rate_hz).length_m();
  const double duration_s = length_m / draws.In(config.speed);
  const int frames = static_cast<int>(std::lround(duration_s * config.rate_hz));
  if (frames < 2 || drive.start_frame + frames > config.frames) return false;
  object.drive->end_frame = drive.start_frame + frames;
  object.drive->ramp_s = std::min(0.5, duration_s / 4);
  return true;
}

void DrawCarry(Draws& draws, const RandomSceneConfig& config, Candidate& candidate) {
  SceneObject& object = candidate.object;
  const Pose T_WO = object.T_WO();
  const Eigen::Vector2d end = PlaceOnTable(draws, candidate.radius_m);
  const double lift_m = draws.In(0.06, 0.2);
  const double turn_deg = draws.In(-150, 150);
  const double tilt_deg = draws.In(-40, 40);
  const int start = kFirstFrame + static_cast<int>(draws.Next() * config.frames / 4);
  const int quarter = std::max(1, (config.frames - start) / 4);
  const Eigen::Vector3d from = T_WO.translation();
  const Eigen::Vector3d to(end.x(), end.y(), from.z());
  const Eigen::Vector3d up(0, 0, lift_m);
  const auto turned = [&](double share, double tilt) {
    return FromRollPitchYaw({0, tilt, object.yaw_deg + turn_deg * share});
  };
  object.keyframes = {{start, from, turned(0, 0)},
                      {start + quarter, from + up, turned(0.2, tilt_deg)},
                      {start + 2 * quarter, to + up, turned(0.8, tilt_deg)},
                      {start + 3 * quarter, to, turned(1, 0)}};
}

void DrawDrop(Draws& draws, const RandomSceneConfig& config, Candidate& candidate) {
  SceneObject& object = candidate.object;
  object.z = kTableTop_m + candidate.radius_m + draws.In(0.03, 0.15);
  object.pitch_deg = draws.In(-30, 30);
  object.roll_deg = draws.In(-30, 30);
  ObjectPhysics physics;
  physics.mass_kg = draws.In(0.05, 0.4);
  physics.friction = draws.In(0.3, 0.8);
  physics.start_frame = kFirstFrame + static_cast<int>(draws.Next() * config.frames / 3);
  // Braces: drawn in this order by every compiler.
  physics.velocity_W = Eigen::Vector3d{draws.In(-0.2, 0.2), draws.In(-0.2, 0.2), 0};
  object.physics = physics;
}

Expected<Candidate> DrawModel(Draws& draws, const RandomSceneConfig& config, std::uint64_t seed,
                              int id) {
  Candidate candidate;
  SceneObject& object = candidate.object;
  object.id = static_cast<InstanceId>(id);
  object.model.name = draws.Of(config.models);
  object.semantic_class = object.model.name;
  object.name = fmt::format("{}_{}", object.model.name, id);
  const ModelInfo* info = FindModel(object.model.name);
  object.model.scale = draws.In(config.scale);
  if (info->solid) {
    object.model.scale = 1;
    object.model.size_m =
        Eigen::Vector3d{draws.In(config.size_m), draws.In(config.size_m), draws.In(config.size_m)};
  }
  const auto index = static_cast<std::uint64_t>(id);
  object.model.seed = (seed + index) & kLargestOfToml;
  object.model.paint = DrawPaint(seed, index);
  if (draws.Chance(config.texture_share)) object.model.material = draws.Of(TexturePatternNames());
  TSDFPP_ASSIGN(const std::vector<ModelPart> parts, MakeModel(object.model));
  candidate.box_O = BoundsOf(parts);
  return candidate;
}

// Draws a place and a motion, and says whether they fit.
bool DrawPlace(Draws& draws, const RandomSceneConfig& config, const CameraMotion& camera,
               const std::vector<Candidate>& others, Candidate& candidate) {
  SceneObject& object = candidate.object;
  object.drive.reset();
  object.keyframes.clear();
  object.physics.reset();
  object.pitch_deg = object.roll_deg = 0;
  object.z = kTableTop_m;
  const RandomMotion motion = draws.Of(config.motions);
  const Eigen::Vector3d reach =
      candidate.box_O.min().cwiseAbs().cwiseMax(candidate.box_O.max().cwiseAbs());
  // What tilts may reach as far sideways as it is tall.
  const bool tilts = motion == RandomMotion::kCarry || motion == RandomMotion::kDrop;
  candidate.radius_m = tilts ? reach.norm() : reach.head<2>().norm();
  if (candidate.radius_m > kTableHalfY_m) return false;
  const Eigen::Vector2d place = PlaceOnTable(draws, candidate.radius_m);
  object.x = place.x();
  object.y = place.y();
  object.yaw_deg = draws.In(-180, 180);
  if (motion == RandomMotion::kDrive && !DrawDrive(draws, config, candidate)) return false;
  if (motion == RandomMotion::kCarry) DrawCarry(draws, config, candidate);
  if (motion == RandomMotion::kDrop) DrawDrop(draws, config, candidate);

  const ObjectMotion path(object, config.rate_hz);
  candidate.way.clear();
  for (int frame = kFirstFrame; frame < kFirstFrame + config.frames; ++frame) {
    const Eigen::Vector2d at = path.T_WO(frame).translation().head<2>();
    if (std::abs(at.x()) > kTableHalfX_m - candidate.radius_m ||
        std::abs(at.y()) > kTableHalfY_m - candidate.radius_m) {
      return false;
    }
    candidate.way.push_back(at);
  }
  for (const Candidate& other : others) {
    const double apart = candidate.radius_m + other.radius_m + config.gap_m;
    for (std::size_t i = 0; i < candidate.way.size(); ++i) {
      if ((candidate.way[i] - other.way[i]).norm() < apart) return false;
    }
  }
  return motion == RandomMotion::kDrop ||  // asked once it has fallen
         IsInViewLongEnough(config, candidate.box_O, camera,
                            [&](int frame) { return path.T_WO(frame); });
}

CameraConfig DrawCamera(Draws& draws, const RandomSceneConfig& config) {
  CameraConfig camera;
  const std::string path = draws.Of(config.camera_paths);
  const Eigen::Vector3d target{draws.In(-0.05, 0.05), draws.In(-0.05, 0.05), kTableTop_m};
  const double azimuth_deg = draws.In(config.camera_azimuth_deg);
  const double sweep = draws.In(config.camera_sweep_deg);
  const double sweep_deg = draws.Chance(0.5) ? sweep : -sweep;
  const std::array<double, 3> radius{draws.In(config.camera_radius_m),
                                     draws.In(config.camera_radius_m),
                                     draws.In(config.camera_radius_m)};
  const std::array<double, 3> height{draws.In(config.camera_height_m),
                                     draws.In(config.camera_height_m),
                                     draws.In(config.camera_height_m)};
  if (path == "orbit") {
    camera.path = OrbitPath{target, azimuth_deg, sweep_deg / 360, radius[0], height[0]};
  } else if (path == "arc") {
    camera.path = ArcPath{target,
                          {azimuth_deg, azimuth_deg + sweep_deg / 2, azimuth_deg + sweep_deg},
                          {radius[0], radius[1], radius[2]},
                          {height[0], height[1], height[2]}};
  } else {
    SplinePath spline;
    for (int i = 0; i < 3; ++i) {
      const double angle = (azimuth_deg + sweep_deg * i / 2) * std::numbers::pi / 180;
      const auto k = static_cast<std::size_t>(i);
      CameraKey key;
      key.frame = kFirstFrame + (config.frames - 1) * i / 2;
      key.target_W = target + Eigen::Vector3d{draws.In(-0.06, 0.06), draws.In(-0.06, 0.06), 0};
      key.position_W = target + Eigen::Vector3d(radius[k] * std::cos(angle),
                                                radius[k] * std::sin(angle), height[k]);
      spline.keys.push_back(key);
    }
    camera.path = std::move(spline);
  }
  if (draws.Chance(config.handheld_share)) {
    camera.jitter.emplace();
    camera.jitter->position_mm = draws.In(config.jitter_mm);
    camera.jitter->rotation_deg = draws.In(config.jitter_deg);
  }
  return camera;
}

void DrawRoom(Draws& draws, const RandomSceneConfig& config, std::uint64_t seed, RoomSpec& room) {
  constexpr std::uint64_t kRoomTextures = 1000;  // beyond the objects' indices
  std::uint64_t index = kRoomTextures;
  for (auto* texture : {&room.table_texture, &room.floor_texture, &room.wall_texture}) {
    if (draws.Chance(config.room_texture_share)) *texture = DrawTexture(seed, index);
    ++index;
  }
}

// One draw of everything; nothing where an object found no place, whose name is then in `failed`.
Expected<std::optional<SceneConfig>> DrawOnce(const RandomSceneConfig& config, std::uint64_t seed,
                                              std::uint32_t attempt, std::string& failed) {
  Draws draws(seed, kStream + attempt);
  SceneConfig scene;
  scene.name = config.name;
  scene.purpose = config.purpose;
  scene.frames = config.frames;
  scene.rate_hz = config.rate_hz;
  scene.seed = seed;
  scene.intrinsics = config.intrinsics;
  scene.sensor = config.sensor;
  scene.camera = DrawCamera(draws, config);
  scene.lights = DrawLightRig(config.lights, seed);
  DrawRoom(draws, config, seed, scene.room);
  TSDFPP_ASSIGN(const CameraMotion camera,
                CameraMotion::Make(scene.camera, config.frames, config.rate_hz, seed));
  const int count =
      static_cast<int>(std::floor(draws.In(config.objects[0], config.objects[1] + 1)));
  std::vector<Candidate> placed;
  for (int id = 1; id <= std::min(count, static_cast<int>(config.objects[1])); ++id) {
    TSDFPP_ASSIGN(Candidate candidate, DrawModel(draws, config, seed, id));
    int tries = 0;
    while (!DrawPlace(draws, config, camera, placed, candidate)) {
      if (++tries == kTriesPerObject) {
        failed = candidate.object.name;
        return std::optional<SceneConfig>();
      }
    }
    scene.objects.push_back(candidate.object);
    placed.push_back(std::move(candidate));
  }
  TSDFPP_ASSIGN(const SceneMotion motion, SceneMotion::Make(scene));
  const PoseTable poses = motion.Table();
  for (const Candidate& candidate : placed) {
    const std::vector<Pose>& T_WO = poses.T_WO.at(candidate.object.id);
    const auto at = [&](int frame) { return T_WO[static_cast<std::size_t>(frame - kFirstFrame)]; };
    if (candidate.object.physics && !IsInViewLongEnough(config, candidate.box_O, camera, at)) {
      failed = candidate.object.name;
      return std::optional<SceneConfig>();
    }
  }
  return std::optional<SceneConfig>(std::move(scene));
}

}  // namespace

Expected<SceneConfig> DrawRandomScene(const RandomSceneConfig& config, std::uint64_t seed) {
  if (config.models.empty() || config.motions.empty() || config.camera_paths.empty()) {
    return UsageError("scene '{}': there is no model, motion or camera path to draw from",
                      config.name);
  }
  std::string failed;
  for (std::uint32_t attempt = 0; attempt < kMaxDraws; ++attempt) {
    TSDFPP_ASSIGN(std::optional<SceneConfig> scene, DrawOnce(config, seed, attempt, failed));
    if (scene) return std::move(*scene);
  }
  return UsageError(
      "scene '{}', seed {}: '{}' found no place apart from the others and in view of the camera in "
      "{} draws: ask for fewer or smaller objects, a smaller gap_m or a lower in_view",
      config.name, seed, failed, kMaxDraws);
}

}  // namespace tsdfpp
