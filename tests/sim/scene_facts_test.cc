// What issue 2 asks of the scenes: how the cars drive, what they cover and hide.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "sim/models/room_model.h"
#include "tests/sim/footprint.h"
#include "tests/sim/scene_files.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kTruck = 1;
constexpr InstanceId kCar = 2;
constexpr int kReveal = 256;

double YawOf(const Pose& pose) { return std::atan2(pose.linear()(1, 0), pose.linear()(0, 0)); }

// The sum of all changes of heading from one frame to another, degrees.
double TurnOf(const SceneMotion& motion, InstanceId id, int first, int last) {
  double turn = 0;
  for (int frame = first + 1; frame <= last; ++frame) {
    turn += std::abs(std::remainder(
        YawOf(motion.T_WO(frame).at(id)) - YawOf(motion.T_WO(frame - 1).at(id)), 2 * M_PI));
  }
  return turn * 180 / M_PI;
}

TEST(Toycar3, TheCarsTurn) {
  const SceneMotion motion = MotionOf(LoadScene("toycar3"));
  constexpr double kLeastTurn_deg = 120;
  EXPECT_GE(TurnOf(motion, kTruck, 1, kReveal), kLeastTurn_deg);
  EXPECT_GE(TurnOf(motion, kCar, 1, kReveal), kLeastTurn_deg);
}

TEST(Toycar3, TheCarsRestThenDriveSmoothly) {
  const SceneConfig config = LoadScene("toycar3");
  const SceneMotion motion = MotionOf(config);
  constexpr double kSlowest = 0.08;  // metres a second, once under way
  constexpr double kFastest = 0.15;
  constexpr double kSpeedStep = 0.01;   // most that the speed changes in a frame
  constexpr double kTightest_m = 0.09;  // the smallest radius of a curve
  for (const InstanceId id : {kTruck, kCar}) {
    const auto& object = config.objects[id - 1U];
    ASSERT_EQ(object.id, id);
    const int start = object.drive->start_frame;
    for (int frame = 2; frame <= start; ++frame) {
      EXPECT_EQ(motion.T_WO(frame).at(id).matrix(), motion.T_WO(1).at(id).matrix());
    }
    EXPECT_GE(start, 15);
    double last_speed = 0;
    for (int frame = start; frame < config.frames; ++frame) {
      const Pose here = motion.T_WO(frame).at(id);
      const Pose next = motion.T_WO(frame + 1).at(id);
      const double step = (next.translation() - here.translation()).norm();
      const double speed = step * config.rate_hz;
      EXPECT_LE(speed, kFastest) << frame;
      EXPECT_LE(std::abs(speed - last_speed), kSpeedStep) << frame;
      const int ramp = static_cast<int>(object.drive->ramp_s * config.rate_hz);
      if (frame > start + ramp && frame < object.drive->end_frame - ramp) {
        EXPECT_GE(speed, kSlowest) << frame;
      }
      last_speed = speed;
      // The front leads along the path.
      if (speed > 0.01) {
        const Eigen::Vector3d along = (next.translation() - here.translation()) / step;
        EXPECT_GT(along.dot(here.linear().col(0)), 0.999) << frame;
      }
      const double turn = std::abs(std::remainder(YawOf(next) - YawOf(here), 2 * M_PI));
      EXPECT_LE(turn * kTightest_m, step + 1e-9) << frame;
    }
  }
}

TEST(Toycar3, NothingTouchesAndAllStayOnTheTable) {
  const SceneConfig config = LoadScene("toycar3");
  const SceneMotion motion = MotionOf(config);
  constexpr double kLeastGap_m = 0.02;
  std::map<InstanceId, Outline> outlines;
  for (int frame = 1; frame <= config.frames; ++frame) {
    const auto poses = motion.T_WO(frame);
    for (const SceneObject& object : config.objects) {
      if (frame > 1 && !object.drive) continue;
      outlines[object.id] = FootprintOf(object.model, poses.at(object.id));
      for (const Eigen::Vector2d& p : outlines[object.id]) {
        ASSERT_LT(std::abs(p.x()), kTableHalfX_m) << object.name << " in frame " << frame;
        ASSERT_LT(std::abs(p.y()), kTableHalfY_m) << object.name << " in frame " << frame;
      }
    }
    for (const auto& [id, outline] : outlines) {
      for (const auto& [other_id, other] : outlines) {
        if (id >= other_id) continue;
        ASSERT_GE(Gap(outline, other), kLeastGap_m)
            << id << " and " << other_id << " in frame " << frame;
      }
    }
  }
}

// At the reveal each car has left its place and stands on table that the camera saw bare before.
TEST(Toycar3, TheCarsCoverTableSeenBareBefore) {
  const SceneConfig config = LoadScene("toycar3");
  const auto source = OpenConfig(config);
  const SceneMotion motion = MotionOf(config);
  constexpr double kCell_m = 0.01;
  constexpr double kDepthMargin_m = 0.002;
  constexpr double kLeastSeen = 0.95;  // of the ground below the car
  std::map<InstanceId, std::vector<Eigen::Vector3d>> ground;
  std::map<InstanceId, std::vector<bool>> seen;
  for (const auto& [id, length_m] : std::map<InstanceId, double>{{kTruck, 0.32}, {kCar, 0.27}}) {
    const Pose then = motion.T_WO(1).at(id);
    const Pose now = motion.T_WO(kReveal).at(id);
    EXPECT_GE((now.translation() - then.translation()).norm(), length_m);
    const Outline outline = FootprintOf(config.objects[id - 1U].model, now);
    for (double x = -kTableHalfX_m; x <= kTableHalfX_m; x += kCell_m) {
      for (double y = -kTableHalfY_m; y <= kTableHalfY_m; y += kCell_m) {
        if (Contains(outline, {x, y})) ground[id].emplace_back(x, y, kTableTop_m);
      }
    }
    seen[id].assign(ground[id].size(), false);
    EXPECT_GT(ground[id].size(), 300U);
  }
  constexpr int kEvery = 12;
  for (int index = 1; index <= kReveal; index += kEvery) {
    const auto frame = source->Read(index);
    ASSERT_TRUE(frame.has_value()) << frame.error().message;
    const Intrinsics& k = frame->intrinsics;
    for (auto& [id, points] : ground) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector3d p_C = frame->T_WC.inverse() * points[i];
        const int u = static_cast<int>(std::lround(k.fx * p_C.x() / p_C.z() + k.cx));
        const int v = static_cast<int>(std::lround(k.fy * p_C.y() / p_C.z() + k.cy));
        if (u < 0 || v < 0 || u >= k.width || v >= k.height) continue;
        // Rounding to a pixel moves the depth on the slanted table by up to some 2 mm more.
        if (frame->mask.at<InstanceId>(v, u) == kBackground &&
            std::abs(frame->depth.at<float>(v, u) - p_C.z()) < 2 * kDepthMargin_m) {
          seen[id][i] = true;
        }
      }
    }
  }
  for (const auto& [id, flags] : seen) {
    const auto count = std::count(flags.begin(), flags.end(), true);
    EXPECT_GE(static_cast<double>(count), kLeastSeen * static_cast<double>(flags.size())) << id;
  }
}

int PixelsOf(const cv::Mat& mask, InstanceId id) { return cv::countNonZero(mask == id); }

// One car hides part of the other in the image at some frame before the reveal.
TEST(Toycar3, OneCarPassesInFrontOfTheOther) {
  const SceneConfig config = LoadScene("toycar3");
  const SceneMotion motion = MotionOf(config);
  auto scene = CompiledScene::Compile(config);
  ASSERT_TRUE(scene.has_value()) << scene.error().message;
  auto renderer = Renderer::Create(*scene, config.intrinsics);
  ASSERT_TRUE(renderer.has_value()) << renderer.error().message;
  constexpr int kLeastHidden = 300;  // pixels of the car
  int most_hidden = 0;
  for (int frame = 1; frame < kReveal; frame += 5) {
    auto poses = motion.T_WO(frame);
    scene->SetPoses(poses);
    const auto both = (*renderer)->Render(motion.T_WC(frame), false);
    ASSERT_TRUE(both.has_value()) << both.error().message;
    poses.at(kTruck).translation().z() = -5;  // below the floor
    scene->SetPoses(poses);
    const auto alone = (*renderer)->Render(motion.T_WC(frame), false);
    ASSERT_TRUE(alone.has_value()) << alone.error().message;
    EXPECT_EQ(PixelsOf(alone->mask, kTruck), 0);
    most_hidden = std::max(most_hidden, PixelsOf(alone->mask, kCar) - PixelsOf(both->mask, kCar));
  }
  EXPECT_GE(most_hidden, kLeastHidden);
}

TEST(Toycar3, TheCameraMovesSmoothlyAndSeesTheTable) {
  const SceneConfig config = LoadScene("toycar3");
  const SceneMotion motion = MotionOf(config);
  constexpr double kLeastArc_deg = 40;
  constexpr double kLargestStep_m = 0.006;   // a frame
  constexpr double kLargestBend_m = 0.0002;  // change of the step from frame to frame
  const auto& arc = std::get<ArcPath>(config.camera.path);
  EXPECT_GE(std::abs(arc.azimuth_deg.back() - arc.azimuth_deg.front()), kLeastArc_deg);
  for (int frame = 2; frame < config.frames; ++frame) {
    const Eigen::Vector3d before = motion.T_WC(frame - 1).translation();
    const Eigen::Vector3d here = motion.T_WC(frame).translation();
    const Eigen::Vector3d after = motion.T_WC(frame + 1).translation();
    EXPECT_LT((here - before).norm(), kLargestStep_m);
    EXPECT_LT((after - 2 * here + before).norm(), kLargestBend_m);
    // The rotation is a rotation, the image's rows are level.
    const Eigen::Matrix3d R = motion.T_WC(frame).linear();
    EXPECT_NEAR(R.determinant(), 1, 1e-12);
    EXPECT_NEAR(R(2, 0), 0, 1e-12);
    // The table's middle is in the image's middle.
    const Eigen::Vector3d middle_C =
        motion.T_WC(frame).inverse() * Eigen::Vector3d(0, 0, kTableTop_m);
    EXPECT_GT(middle_C.z(), 1.0);
    EXPECT_LT(middle_C.head<2>().norm(), 0.01);
  }
}

TEST(Mini, TheCarMovesAndTurns) {
  const SceneConfig config = LoadScene("mini");
  const SceneMotion motion = MotionOf(config);
  const Eigen::Vector3d way = motion.T_WO(config.experiment->reveal_frame).at(1).translation() -
                              motion.T_WO(1).at(1).translation();
  EXPECT_GE(way.norm(), 0.25);
  EXPECT_GE(TurnOf(motion, 1, 1, config.frames), 45);
  constexpr double kLeastGap_m = 0.02;
  for (int frame = 1; frame <= config.frames; ++frame) {
    const auto poses = motion.T_WO(frame);
    EXPECT_GE(Gap(FootprintOf(config.objects[0].model, poses.at(1)),
                  FootprintOf(config.objects[1].model, poses.at(2))),
              kLeastGap_m);
  }
}

TEST(Static, NothingMovesButTheCamera) {
  const SceneConfig config = LoadScene("static");
  const SceneMotion motion = MotionOf(config);
  for (const auto& [id, pose] : motion.T_WO(config.frames)) {
    EXPECT_EQ(pose.matrix(), motion.T_WO(1).at(id).matrix());
  }
  EXPECT_GT((motion.T_WC(config.frames).translation() - motion.T_WC(1).translation()).norm(), 0.5);
}

}  // namespace
}  // namespace tsdfpp
