// Each scene isolates one difficulty, and here are the numbers that it does.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scene_list.h"
#include "tests/sim/footprint.h"
#include "tests/sim/scene_files.h"
#include "tests/sim/scene_geometry.h"

namespace tsdfpp {
namespace {

// Every this many frames a check that is slow looks at one.
constexpr int kEveryNth = 6;

using Poses = std::map<InstanceId, Pose>;

double Speed(const SceneMotion& motion, InstanceId id, int frame, double rate_hz) {
  return (motion.T_WO(frame + 1).at(id).translation() - motion.T_WO(frame).at(id).translation())
             .norm() *
         rate_hz;
}

double TurnBetween_deg(const Pose& a, const Pose& b) {
  return Eigen::Quaterniond(a.linear()).angularDistance(Eigen::Quaterniond(b.linear())) * 180 /
         M_PI;
}

// The visible pixels of each object in each frame, at a quarter of the resolution.
std::vector<std::map<InstanceId, int>> VisiblePixels(SceneConfig config, int every = 1) {
  Intrinsics& k = config.intrinsics;
  k = {k.width / 4, k.height / 4,           k.fx / 4,
       k.fy / 4,    (k.cx + 0.5) / 4 - 0.5, (k.cy + 0.5) / 4 - 0.5};
  const auto source = OpenConfig(config);
  std::vector<std::map<InstanceId, int>> pixels;
  for (int frame = 1; frame <= config.frames; frame += every) {
    const auto read = source->Read(frame);
    EXPECT_TRUE(read.has_value()) << read.error().message;
    std::map<InstanceId, int> count;
    for (const SceneObject& object : config.objects) {
      count[object.id] = cv::countNonZero(read->mask == object.id);
    }
    pixels.push_back(std::move(count));
  }
  return pixels;
}

// The longest run of entries without a pixel of the object: its first index and its length.
std::pair<std::size_t, std::size_t> LongestAbsence(
    const std::vector<std::map<InstanceId, int>>& pixels, InstanceId id) {
  std::pair<std::size_t, std::size_t> longest{0, 0};
  std::size_t run = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    run = pixels[i].at(id) == 0 ? run + 1 : 0;
    if (run > longest.second) longest = {i + 1 - run, run};
  }
  return longest;
}

// The checks below can fail: an object that is 5 mm too low, and one that is put into another.
TEST(SceneGeometry, SeesWhatOverlaps) {
  const SceneConfig config = LoadScene("parked");
  const std::vector<Solid> solids = SolidsOf(config);
  Poses T_WO = MotionOf(config).T_WO(1);
  EXPECT_EQ(DeepestInGround(solids, T_WO, config.room), 0);
  EXPECT_EQ(DeepestOverlap(solids, T_WO), 0);
  T_WO.at(1).translation().z() -= 0.005;
  EXPECT_NEAR(DeepestInGround(solids, T_WO, config.room), 0.005 - kToyClearance_m, 1e-6);
  T_WO.at(1).translation() = T_WO.at(2).translation() + Eigen::Vector3d(0.12, 0, 0);
  EXPECT_GT(DeepestOverlap(solids, T_WO), 0.01);
}

class EveryScene : public testing::TestWithParam<std::string> {};

// Nothing is in the table, in the floor, or in another object, by more than physics' own softness.
TEST_P(EveryScene, ObjectsKeepOutOfOneAnother) {
  constexpr double kMostDepth_m = 3e-4;
  const SceneConfig config = LoadScene(GetParam());
  const SceneMotion motion = MotionOf(config);
  const std::vector<Solid> solids = SolidsOf(config);
  double in_ground = 0;
  double in_another = 0;
  for (int frame = 1; frame <= config.frames; frame += kEveryNth) {
    const Poses T_WO = motion.T_WO(frame);
    const double ground = DeepestInGround(solids, T_WO, config.room);
    const double another = DeepestOverlap(solids, T_WO);
    EXPECT_LE(ground, kMostDepth_m) << "frame " << frame;
    EXPECT_LE(another, kMostDepth_m) << "frame " << frame;
    in_ground = std::max(in_ground, ground);
    in_another = std::max(in_another, another);
  }
  std::printf("  %s: at most %.3f mm in the ground, %.3f mm in one another\n", GetParam().c_str(),
              1e3 * in_ground, 1e3 * in_another);
}

// A viewer of the first frame sees every object, and later each is seen most of the time.
TEST_P(EveryScene, ObjectsAreInView) {
  const SceneConfig config = LoadScene(GetParam());
  const auto pixels = VisiblePixels(config, 2 * kEveryNth);
  for (const SceneObject& object : config.objects) {
    EXPECT_GT(pixels.front().at(object.id), 0) << object.name;
    const auto seen = std::count_if(pixels.begin(), pixels.end(),
                                    [&](const auto& count) { return count.at(object.id) > 0; });
    // The car of `reentry` is away for half of the time, on purpose.
    EXPECT_GT(static_cast<double>(seen), 0.4 * static_cast<double>(pixels.size())) << object.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene,
                         testing::ValuesIn(std::vector<std::string>(kScenes.begin(),
                                                                    kScenes.end())),
                         [](const auto& scene) { return scene.param; });

TEST(SceneParked, TheCarStandsForEightSecondsThenClearsItsPlace) {
  const SceneConfig config = LoadScene("parked");
  const SceneMotion motion = MotionOf(config);
  const int still = static_cast<int>(8 * config.rate_hz) + 1;
  for (int frame = 2; frame <= still; ++frame) {
    EXPECT_EQ(motion.T_WO(frame).at(1).matrix(), motion.T_WO(1).at(1).matrix()) << frame;
  }
  const ModelSpec& car = config.objects[0].model;
  EXPECT_GT(Gap(FootprintOf(car, motion.T_WO(1).at(1)),
                FootprintOf(car, motion.T_WO(config.frames).at(1))),
            0.05);
}

TEST(SceneStack, FourSurfacesLieAtOnePlace) {
  const SceneConfig config = LoadScene("stack");
  const SceneMotion motion = MotionOf(config);
  const std::vector<Solid> solids = SolidsOf(config);
  // Piled up, and while the pile is pushed: tray, ball and cover, and the table below them.
  for (const int frame : {175, 200, 230, 260}) {
    const Poses T_WO = motion.T_WO(frame);
    const Eigen::Vector3d at = T_WO.at(2).translation();
    const std::set<InstanceId> crossed =
        ObjectsOnVertical(solids, T_WO, at.x() + 0.003, at.y() + 0.002);
    EXPECT_EQ(crossed, (std::set<InstanceId>{1, 2, 3})) << frame;
    EXPECT_LT(std::abs(at.x()), kTableHalfX_m);
    // It is a pile: rigid, and on the tray's floor.
    EXPECT_LT((T_WO.at(2).translation() - T_WO.at(3).translation()).norm(), 1e-9);
    EXPECT_NEAR(at.z() - T_WO.at(1).translation().z(), 0.0067, 1e-9);
  }
  const Poses first = motion.T_WO(1);
  EXPECT_EQ(ObjectsOnVertical(solids, first, first.at(2).translation().x() + 0.003,
                              first.at(2).translation().y() + 0.002),
            std::set<InstanceId>{2});
  EXPECT_GT((motion.T_WO(255).at(1).translation() - motion.T_WO(205).at(1).translation()).norm(),
            0.2);
}

TEST(SceneContact, BlocksArePushedAlongOneAnother) {
  const SceneConfig config = LoadScene("contact");
  const SceneMotion motion = MotionOf(config);
  constexpr double kTouching_m = 1.5e-3;  // the clearance, and a millimetre's half of give
  std::map<std::pair<InstanceId, InstanceId>, int> touching;  // frames
  for (int frame = 1; frame <= config.frames; frame += 2) {
    const Poses T_WO = motion.T_WO(frame);
    for (std::size_t i = 0; i < config.objects.size(); ++i) {
      for (std::size_t j = i + 1; j < config.objects.size(); ++j) {
        const SceneObject& a = config.objects[i];
        const SceneObject& b = config.objects[j];
        if (Gap(FootprintOf(a.model, T_WO.at(a.id)), FootprintOf(b.model, T_WO.at(b.id))) <
            kTouching_m) {
          ++touching[{a.id, b.id}];
        }
      }
    }
  }
  EXPECT_GE(touching.size(), 5U) << "pairs that touch at some time";
  EXPECT_GE((touching[{3, 4}]), 15) << "the cube pushes the brick, half a second at least";
  constexpr double kLeastWay_m = 0.05;
  for (const SceneObject& object : config.objects) {
    if (!object.physics) continue;
    const Pose before = motion.T_WO(1).at(object.id);
    const Pose after = motion.T_WO(config.frames).at(object.id);
    EXPECT_GT((after.translation() - before.translation()).norm(), kLeastWay_m) << object.name;
    EXPECT_GT(after.linear()(2, 2), 0.999) << object.name << " fell over";
  }
}

TEST(SceneTumble, ThingsTurnOverAndComeToRest) {
  const SceneConfig config = LoadScene("tumble");
  const SceneMotion motion = MotionOf(config);
  const PoseTable table = motion.Table();
  int turned_over = 0;
  for (const auto& [id, poses] : table.T_WO) {
    double turn = 0;
    for (const Pose& pose : poses) turn = std::max(turn, TurnBetween_deg(poses.front(), pose));
    turned_over += turn > 60 ? 1 : 0;
    constexpr double kCreep_m = 5e-5;  // a frame, in the last second
    for (std::size_t i = poses.size() - 30; i + 1 < poses.size(); ++i) {
      EXPECT_LT((poses[i + 1].translation() - poses[i].translation()).norm(), kCreep_m)
          << id << " in frame " << i + 1;
    }
    EXPECT_GT(poses.back().translation().z(), kTableTop_m - 1e-4) << id << " fell off the table";
  }
  EXPECT_GE(turned_over, 4);
}

TEST(SceneContainer, TheCarIsInsideForASecondAndComesOut) {
  const SceneConfig config = LoadScene("container");
  const SceneMotion motion = MotionOf(config);
  const ModelSpec& garage = config.objects[0].model;
  const ModelSpec& car = config.objects[1].model;
  const Outline house = FootprintOf(garage, motion.T_WO(1).at(1));
  int inside = 0;
  for (int frame = 1; frame <= config.frames; ++frame) {
    const Outline outline = FootprintOf(car, motion.T_WO(frame).at(2));
    inside += std::all_of(outline.begin(), outline.end(),
                          [&](const Eigen::Vector2d& p) { return Contains(house, p); })
                  ? 1
                  : 0;
  }
  EXPECT_GT(inside, config.rate_hz);
  for (const int frame : {1, config.frames}) {
    EXPECT_GT(Gap(FootprintOf(car, motion.T_WO(frame).at(2)), house), 0.05) << frame;
  }
}

TEST(SceneReentry, TheCarIsAwayForSecondsAndReturnsElsewhere) {
  const SceneConfig config = LoadScene("reentry");
  const SceneMotion motion = MotionOf(config);
  const auto pixels = VisiblePixels(config, 2);
  const auto [first, length] = LongestAbsence(pixels, 1);
  EXPECT_GT(static_cast<double>(2 * length) / config.rate_hz, 2.0);
  ASSERT_GT(first, 0U);
  ASSERT_LT(first + length, pixels.size());
  constexpr int kMany = 150;  // pixels at a quarter of the resolution
  EXPECT_GT(pixels.front().at(1), kMany);
  EXPECT_GT(pixels.back().at(1), kMany);
  EXPECT_GT(
      (motion.T_WO(config.frames).at(1).translation() - motion.T_WO(1).at(1).translation()).norm(),
      0.3);
}

TEST(SceneOcclusion, TheDuckMovesOnUnseen) {
  const SceneConfig config = LoadScene("occlusion");
  const SceneMotion motion = MotionOf(config);
  const auto pixels = VisiblePixels(config);
  const auto [first, length] = LongestAbsence(pixels, 2);
  EXPECT_GE(static_cast<double>(length) / config.rate_hz, 2.0);
  ASSERT_GT(first, 0U);
  ASSERT_LT(first + length, pixels.size());
  const auto at = [&](std::size_t i) -> Eigen::Vector3d {
    return motion.T_WO(static_cast<int>(i) + 1).at(2).translation();
  };
  EXPECT_GT((at(first + length) - at(first)).norm(), 0.1);
  EXPECT_GT(pixels.front().at(2), 30);
  EXPECT_GT(pixels.back().at(2), 30);
  EXPECT_EQ(motion.T_WO(1).at(1).matrix(), motion.T_WO(config.frames).at(1).matrix());
}

TEST(SceneThin, ThinThingsLieOnOneAnother) {
  const SceneConfig config = LoadScene("thin");
  const SceneMotion motion = MotionOf(config);
  const std::vector<Solid> solids = SolidsOf(config);
  for (const SceneObject& object : config.objects) {
    EXPECT_TRUE(FindModel(object.model.name)->thin) << object.name;
  }
  const Poses T_WO = motion.T_WO(212);
  const Eigen::Vector3d card = T_WO.at(1).translation();
  EXPECT_EQ(ObjectsOnVertical(solids, T_WO, card.x() + 0.002, card.y() + 0.001),
            (std::set<InstanceId>{1, 2, 3}));
  // From the table to the cup's floor, four objects' surfaces lie within ten voxels of a
  // millimetre.
  EXPECT_LT(T_WO.at(3).translation().z() - kTableTop_m, 0.011);
  const Eigen::Vector3d above = T_WO.at(4).translation();
  EXPECT_EQ(ObjectsOnVertical(solids, T_WO, above.x(), above.y() + 0.01),
            (std::set<InstanceId>{4, 5}));
}

TEST(SceneFast, SpeedsAreTheStatedOnes) {
  const SceneConfig config = LoadScene("fast");
  const SceneMotion motion = MotionOf(config);
  double top_speed = 0;
  std::map<InstanceId, double> top_turn;
  for (int frame = 1; frame < config.frames; ++frame) {
    top_speed = std::max(top_speed, Speed(motion, 1, frame, config.rate_hz));
    for (const InstanceId id : {1, 2}) {
      const double turn =
          TurnBetween_deg(motion.T_WO(frame).at(id), motion.T_WO(frame + 1).at(id)) *
          config.rate_hz;
      top_turn[id] = std::max(top_turn[id], turn);
    }
  }
  EXPECT_GE(top_speed, 0.8);
  EXPECT_LE(top_speed, 1.0);
  for (const InstanceId id : {1, 2}) {
    EXPECT_GE(top_turn[id], 160) << id;
    EXPECT_LE(top_turn[id], 183) << id;  // 180, and what the spline adds between two waypoints
  }
}

TEST(SceneMany, ThirtyTwoMoveAtOnce) {
  const SceneConfig config = LoadScene("many");
  const SceneMotion motion = MotionOf(config);
  ASSERT_EQ(config.objects.size(), 32U);
  const Poses before = motion.T_WO(150);
  const Poses after = motion.T_WO(151);
  for (const auto& [id, pose] : before) {
    const bool moves = (after.at(id).translation() - pose.translation()).norm() > 2e-4 ||
                       TurnBetween_deg(pose, after.at(id)) > 0.2;
    EXPECT_TRUE(moves) << id;
  }
}

TEST(SceneRoom, IsLikeRoom4) {
  const SceneConfig config = LoadScene("room");
  EXPECT_EQ(config.intrinsics, (Intrinsics{640, 480, 360, 360, 320, 240}));
  ASSERT_EQ(config.objects.size(), 3U);
  const std::vector<std::string> names{"ship", "car", "horse"};
  const SceneMotion motion = MotionOf(config);
  for (std::size_t i = 0; i < 3; ++i) {
    const SceneObject& object = config.objects[i];
    EXPECT_EQ(object.name, names[i]);
    EXPECT_EQ(object.id, i + 1);
    EXPECT_GT(BoundsOf(MakeModel(object.model).value()).sizes().x(), 0.8) << object.name;
    double turn = 0;
    double way = 0;
    for (int frame = 2; frame <= config.frames; ++frame) {
      turn = std::max(
          turn, TurnBetween_deg(motion.T_WO(1).at(object.id), motion.T_WO(frame).at(object.id)));
      way = std::max(way, (motion.T_WO(1).at(object.id).translation() -
                           motion.T_WO(frame).at(object.id).translation())
                              .norm());
    }
    EXPECT_GT(turn, 8) << object.name;
    EXPECT_GT(way, 0.1) << object.name;
  }
}

TEST(SceneHandheld, TheCameraShakesByTheStatedSize) {
  SceneConfig config = LoadScene("handheld");
  ASSERT_TRUE(config.camera.jitter.has_value());
  EXPECT_EQ(config.camera.jitter->position_mm, 3);
  EXPECT_EQ(config.camera.jitter->rotation_deg, 0.4);
  const SceneMotion shaken = MotionOf(config);
  config.camera.jitter.reset();
  const SceneMotion still = MotionOf(config);
  double power_m2 = 0;
  double power_deg2 = 0;
  for (int frame = 1; frame <= config.frames; ++frame) {
    const Pose off = still.T_WC(frame).inverse() * shaken.T_WC(frame);
    power_m2 += off.translation().squaredNorm() / config.frames;
    power_deg2 += std::pow(TurnBetween_deg(Pose::Identity(), off), 2) / config.frames;
  }
  // Three axes; ten seconds hold few periods of the slowest waves, hence 20 %.
  EXPECT_NEAR(std::sqrt(power_m2 / 3) * 1e3, 3, 0.6);
  EXPECT_NEAR(std::sqrt(power_deg2 / 3), 0.4, 0.08);
}

TEST(SceneFiles, ListsEveryScene) {
  const auto files = SceneFiles(std::string(TSDFPP_SOURCE_DIR) + "/scenes");
  ASSERT_TRUE(files.has_value()) << files.error().message;
  std::map<std::string, const SceneFile*> by_name;
  const std::set<std::string_view> tested(kScenes.begin(), kScenes.end());
  for (const SceneFile& file : *files) {
    EXPECT_TRUE(file.random || tested.contains(file.name))
        << "name it in kScenes (tests/sim/scene_files.h): no test looks at " << file.path;
    EXPECT_EQ(file.name, file.path.stem().string());
    EXPECT_FALSE(file.purpose.empty()) << file.name;
    EXPECT_GT(file.frames, 0);
    EXPECT_EQ(file.random, file.name == "random");
    by_name.emplace(file.name, &file);
  }
  for (const char* name : kScenes) EXPECT_TRUE(by_name.contains(name)) << name;
  EXPECT_TRUE(by_name.contains("random"));
  EXPECT_EQ(by_name.at("room")->width, 640);
  const auto none = SceneFiles("/nowhere");
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().kind, ErrorKind::kUsage);
}

}  // namespace
}  // namespace tsdfpp
