// Baked physics against the textbook's formulae.
#include "sim/motion/physics_bake.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "core/files.h"
#include "tests/core/temp_folder.h"
#include "tests/sim/footprint.h"
#include "tests/sim/scene_files.h"

namespace tsdfpp {
namespace {

constexpr double kGravity = 9.81;
constexpr double kRate_hz = 30;

SceneObject Free(InstanceId id, const std::string& model, const Eigen::Vector3d& place) {
  SceneObject object;
  object.id = id;
  object.name = fmt::format("{}_{}", model, id);
  object.semantic_class = model;
  object.model.name = model;
  object.x = place.x();
  object.y = place.y();
  object.z = kTableTop_m + place.z();
  object.physics.emplace();
  return object;
}

SceneConfig SceneOf(std::vector<SceneObject> objects, int frames) {
  SceneConfig config = LoadScene("mini");
  config.name = "physics";
  config.experiment.reset();
  config.frames = frames;
  config.rate_hz = kRate_hz;
  config.objects = std::move(objects);
  return config;
}

std::map<InstanceId, std::vector<Pose>> Bake(const SceneConfig& config) {
  auto baked = BakePhysics(config);
  EXPECT_TRUE(baked.has_value()) << baked.error().message;
  return std::move(baked.value());
}

double TurnBetween(const Pose& a, const Pose& b) {
  return Eigen::Quaterniond(a.linear()).angularDistance(Eigen::Quaterniond(b.linear()));
}

// The lowest point of an object at a pose, above the table's top.
double LowestPoint(const SceneObject& object, const Pose& T_WO) {
  double lowest = std::numeric_limits<double>::infinity();
  const auto parts = MakeModel(object.model).value();
  for (const ModelPart& part : parts) {
    for (const Eigen::Vector3d& p : part.shape.vertices) lowest = std::min(lowest, (T_WO * p).z());
  }
  return lowest - kTableTop_m;
}

TEST(PhysicsBake, AFreeFallIsAParabola) {
  SceneObject cube = Free(1, "cube", {0, 0, 1.0});
  cube.physics->velocity_W = Eigen::Vector3d(0.3, -0.1, 0.5);
  const auto poses = Bake(SceneOf({cube}, 14)).at(1);
  ASSERT_EQ(poses.size(), 14U);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double t = static_cast<double>(i) / kRate_hz;
    const Eigen::Vector3d expected = Eigen::Vector3d(0, 0, kTableTop_m + 1) +
                                     t * cube.physics->velocity_W -
                                     0.5 * kGravity * t * t * Eigen::Vector3d::UnitZ();
    // Steps of a millisecond: the error of the first-order integrator is g t dt / 2.
    const double tolerance_m = kGravity * t * 0.001 / 2 + 1e-6;
    EXPECT_LT((poses[i].translation() - expected).norm(), tolerance_m) << i;
    EXPECT_LT(TurnBetween(poses[i], poses[0]), 1e-6) << i;
  }
}

// The stated velocity is the middle's, whatever the spin: a spinning ball falls straight.
TEST(PhysicsBake, ASpinDoesNotMoveTheMiddle) {
  SceneObject ball = Free(1, "sphere", {0.1, 0, 0.8});
  ball.physics->angular_velocity_W = Eigen::Vector3d(0, 720, 0);
  const auto poses = Bake(SceneOf({ball}, 10)).at(1);
  const Eigen::Vector3d middle_O = BoundsOf(MakeModel(ball.model).value()).center();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d moved = poses[i] * middle_O - poses[0] * middle_O;
    EXPECT_LT(moved.head<2>().norm(), 1e-4) << i;
    EXPECT_NEAR(TurnBetween(poses[0], poses[i]),
                std::abs(std::remainder(static_cast<double>(i) / kRate_hz * 4 * M_PI, 2 * M_PI)),
                1e-3);
  }
}

TEST(PhysicsBake, FrictionStopsABlockAfterItsWay) {
  constexpr double kSpeed = 0.6;
  SceneObject brick = Free(1, "brick", {-0.5, 0, 0});
  brick.physics->friction = 0.4;
  brick.physics->velocity_W = Eigen::Vector3d(kSpeed, 0, 0);
  const auto poses = Bake(SceneOf({brick}, 40)).at(1);
  // v^2 / (2 mu g), whatever the mass. Contacts yield a little, hence 2 %.
  const double expected_m = kSpeed * kSpeed / (2 * 0.4 * kGravity);
  EXPECT_NEAR(poses.back().translation().x() + 0.5, expected_m, 0.02 * expected_m);
  constexpr double kCreep_m = 1e-6;  // a frame, of what is at rest
  EXPECT_LT((poses[39].translation() - poses[38].translation()).norm(), kCreep_m);
  // It never sinks in, and but for a hop when friction sets in, slides at the clearance.
  constexpr double kSink_m = 5e-5;
  constexpr double kHop_m = 1e-3;
  for (const Pose& pose : poses) {
    EXPECT_GT(LowestPoint(brick, pose), kToyClearance_m - kSink_m);
    EXPECT_LT(LowestPoint(brick, pose), kToyClearance_m + kHop_m);
  }
  EXPECT_NEAR(LowestPoint(brick, poses.back()), kToyClearance_m, kSink_m);
}

TEST(PhysicsBake, ARollingBallKeepsRolling) {
  constexpr double kSpeed = 0.3;
  SceneObject ball = Free(1, "sphere", {-0.5, 0, 0});
  ball.physics->rolling_friction_m = 0;
  ball.physics->velocity_W = Eigen::Vector3d(kSpeed, 0, 0);
  const Eigen::AlignedBox3d box = BoundsOf(MakeModel(ball.model).value());
  const double radius = box.sizes().z() / 2;
  ball.physics->angular_velocity_W = Eigen::Vector3d(0, kSpeed / radius * 180 / M_PI, 0);
  const auto poses = Bake(SceneOf({ball}, 46)).at(1);
  const double way_m = (poses.back() * box.center() - poses.front() * box.center()).x();
  // A polyhedron's facets cost it a little.
  EXPECT_NEAR(way_m, kSpeed * 45 / kRate_hz, 0.05 * kSpeed * 45 / kRate_hz);
}

TEST(PhysicsBake, APusherMovesWhatItMeetsAndDoesNotEnterIt) {
  SceneObject pusher = Free(1, "brick", {-0.4, 0, 0});
  pusher.physics.reset();
  pusher.keyframes = {{5, pusher.T_WO().translation(), Eigen::Quaterniond::Identity()},
                      {65, {0.1, 0, kTableTop_m}, Eigen::Quaterniond::Identity()}};
  const SceneObject cube = Free(2, "cube", {-0.2, 0.005, 0});
  const SceneConfig config = SceneOf({pusher, cube}, 80);
  const auto poses = Bake(config).at(2);
  ASSERT_EQ(Bake(config).count(1), 0U) << "a scripted object is not baked";
  EXPECT_GT(poses.back().translation().x(), 0.15);
  EXPECT_LT(TurnBetween(poses.front(), poses[9]), 1e-9) << "touched too early";
  constexpr double kSink_m = 2e-4;
  const ObjectMotion script(pusher, kRate_hz);
  const double reach = BoundsOf(MakeModel(pusher.model).value()).max().x();
  const auto parts = MakeModel(cube.model).value();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    double nearest = 1;
    for (const Eigen::Vector3d& p : parts[0].shape.vertices) {
      nearest = std::min(nearest, (poses[i] * p).x());
    }
    const double front = script.T_WO(static_cast<double>(i) + 1).translation().x() + reach;
    EXPECT_GT(nearest, front - kSink_m) << i;
  }
}

TEST(PhysicsBake, AnObjectIsHeldUntilItsFrame) {
  SceneObject cube = Free(1, "cube", {0, 0, 0.3});
  cube.pitch_deg = 20;
  cube.physics->start_frame = 12;
  const auto poses = Bake(SceneOf({cube}, 20)).at(1);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(poses[i].matrix(), cube.T_WO().matrix()) << i;
  EXPECT_LT(poses[12].translation().z(), cube.z - 0.004);
}

// What falls into a bowl comes to rest inside it: the bowl is no lump.
TEST(PhysicsBake, ABowlIsHollow) {
  SceneObject bowl = Free(1, "bowl", {0, 0, 0});
  bowl.physics.reset();
  SceneObject ball = Free(2, "sphere", {0.01, 0, 0.12});
  ball.model.size_m = Eigen::Vector3d(0.04, 0.04, 0.04);
  ball.physics->rolling_friction_m = 0.002;
  const auto poses = Bake(SceneOf({bowl, ball}, 60)).at(2);
  const double rim_m = BoundsOf(MakeModel(bowl.model).value()).max().z();
  EXPECT_LT(LowestPoint(ball, poses.back()), 0.6 * rim_m);
  EXPECT_GT(LowestPoint(ball, poses.back()), 0.001);
}

TEST(PhysicsBake, OnlyPartsThatAreNotConvexAreCut) {
  const auto hulls = [](const std::string& model) {
    ModelSpec spec;
    spec.name = model;
    const auto parts = MakeModel(spec).value();
    return std::pair{parts.size(), CollisionHulls(parts).size()};
  };
  for (const char* convex : {"cube", "cylinder", "blocks", "hexagon"}) {
    EXPECT_EQ(hulls(convex).first, hulls(convex).second) << convex;
  }
  for (const char* concave : {"bowl", "cup", "arch", "garage"}) {
    EXPECT_GT(hulls(concave).second, 2 * hulls(concave).first) << concave;
  }
}

// A scene's sensor is between the renderer and Read; the truth stays beside it.
TEST(SimulatedSource, ReadsThroughTheScenesSensor) {
  SceneConfig config = LoadScene("mini");
  const auto exact = OpenConfig(config)->Read(9);
  ASSERT_TRUE(exact.has_value());
  config.sensor.depth.unit_m = 0.005;
  config.sensor.camera_pose.jitter_m = 0.01;
  const auto source = OpenConfig(config);
  const auto sensed = source->ReadSensed(9);
  ASSERT_TRUE(sensed.has_value()) << sensed.error().message;
  EXPECT_EQ(cv::norm(sensed->truth.depth, exact->depth, cv::NORM_INF), 0);
  EXPECT_EQ(sensed->truth.T_WC.matrix(), exact->T_WC.matrix());
  EXPECT_FALSE(sensed->frame.T_WC.isApprox(exact->T_WC, 1e-5));
  const double off = cv::norm(sensed->frame.depth, exact->depth, cv::NORM_INF);
  EXPECT_GT(off, 0.001);
  EXPECT_LE(off, 0.0025 + 1e-6);
  const auto read = source->Read(9);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(cv::norm(read->depth, sensed->frame.depth, cv::NORM_INF), 0);
}

TEST(PhysicsBake, TwiceIsTheSameBytes) {
  const SceneConfig config = LoadScene("tumble");
  SceneConfig brief = config;
  brief.frames = 100;
  const auto once = Bake(brief);
  const auto again = Bake(brief);
  ASSERT_EQ(once.size(), 6U);
  for (const auto& [id, poses] : once) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_EQ(poses[i].matrix(), again.at(id)[i].matrix());
    }
  }
}

// Rendered again from files, a sequence is the same to the bit.
TEST(PhysicsBake, PosesFromAFolderGiveTheSameImages) {
  SceneConfig config = LoadScene("tumble");
  config.frames = 60;
  config.intrinsics = {160, 120, 131.25, 131.25, 79.5, 59.5};
  const test::TempFolder temp;
  const auto& folder = temp.path();
  const auto first = OpenConfig(config, true);
  ASSERT_TRUE(WritePoseFolder(first->motion().Table(), first->info().objects, folder).has_value());
  SimOptions options;
  options.poses = folder;
  // Nothing of the scene's own motion is asked: it may even be another.
  SceneConfig other = config;
  for (SceneObject& object : other.objects) object.physics.reset();
  other.camera.path = OrbitPath{{0, 0, 0.7}, 0, 1, 1, 0.5};
  auto second = SimulatedSource::Open(other, options);
  ASSERT_TRUE(second.has_value()) << second.error().message;
  for (const int index : {1, 35, 47, 60}) {
    const auto a = first->Read(index);
    const auto b = (*second)->Read(index);
    ASSERT_TRUE(a.has_value() && b.has_value());
    const auto same = [](const cv::Mat& x, const cv::Mat& y) {
      return x.size() == y.size() && x.type() == y.type() &&
             std::memcmp(x.data, y.data, x.total() * x.elemSize()) == 0;
    };
    EXPECT_TRUE(same(a->colour, b->colour)) << index;
    EXPECT_TRUE(same(a->depth, b->depth)) << index;
    EXPECT_TRUE(same(a->mask, b->mask)) << index;
    EXPECT_EQ(a->T_WC.matrix(), b->T_WC.matrix());
    for (const auto& [id, pose] : a->T_WO) EXPECT_EQ(pose.matrix(), b->T_WO.at(id).matrix());
  }
}

TEST(PoseFolder, SaysWhatIsMissing) {
  const std::vector<ObjectInfo> objects{{0, "background", ""}, {3, "car", "car"}};
  const test::TempFolder temp;
  const auto& folder = temp.path();
  const std::string line = " 0 0 0 0 0 0 1\n";
  const auto fault = [&] {
    const auto table = ReadPoseFolder(folder, objects, 2);
    EXPECT_FALSE(table.has_value());
    if (table) return std::string("no fault");
    EXPECT_EQ(table.error().kind, ErrorKind::kData);
    return table.error().message;
  };
  EXPECT_NE(fault().find("gt-cam-0.txt"), std::string::npos);
  ASSERT_TRUE(WriteFile(folder / "gt-cam-0.txt", "1" + line + "2" + line));
  EXPECT_NE(fault().find("gt-car-3.txt"), std::string::npos);
  ASSERT_TRUE(WriteFile(folder / "gt-car-3.txt", "1" + line));
  EXPECT_NE(fault().find("gt-car-3.txt: frame 2 of 2 is missing"), std::string::npos);
  ASSERT_TRUE(WriteFile(folder / "gt-car-3.txt", "1" + line + "1" + line));
  EXPECT_NE(fault().find("gt-car-3.txt:2: frame 1 is there twice"), std::string::npos);
  ASSERT_TRUE(WriteFile(folder / "gt-car-3.txt", "one" + line));
  EXPECT_NE(fault().find("gt-car-3.txt:1: 'one' is not the number of a frame"), std::string::npos);
  ASSERT_TRUE(WriteFile(folder / "gt-car-3.txt", "1 0 0 0\n"));
  EXPECT_NE(fault().find("gt-car-3.txt:1: "), std::string::npos);
  ASSERT_TRUE(WriteFile(folder / "gt-car-3.txt", "# comment\n2" + line + "1" + line + "3" + line));
  const auto table = ReadPoseFolder(folder, objects, 2);
  ASSERT_TRUE(table.has_value()) << table.error().message;
  EXPECT_EQ(table->T_WO.at(3).size(), 2U);
}

}  // namespace
}  // namespace tsdfpp
