// The camera found by the background: poses that are off are put right, poses that are not there
// are found, and a frame whose camera is lost is not mapped.
#include "mapper/track/camera_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/units.h"
#include "mapper/map_file.h"
#include "mapper/pipeline.h"
#include "mapper/volume/lattice_range.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

constexpr int kFrames = 16;
// A pixel sees some 8 mm of these scenes, 0.4 voxel; distances are those of the nearest pixel, and
// thousands of them say where the camera is.
constexpr double kPixel_voxels = 0.2;
constexpr double kMost_m = kPixel_voxels * kToyVoxel_m;
// So much at the table's edge, 0.35 m from its middle.
constexpr double kMost_rad = kMost_m / 0.35;

// A table with two walls, so that nothing of the camera's motion is free, and a brick that slides.
Frame RoomFrom(double camera_angle_rad, int index) {
  reference::Scene scene = TableOnly();
  scene.shapes.push_back(reference::Cuboid(kBackground, {90, 90, 90},
                                           MakePose(0, Eigen::Vector3d::UnitZ(), {-0.27, 0, 0.06}),
                                           {0.02, 0.24, 0.10}));
  scene.shapes.push_back(reference::Cuboid(kBackground, {60, 90, 90},
                                           MakePose(0, Eigen::Vector3d::UnitZ(), {0, -0.23, 0.05}),
                                           {0.24, 0.02, 0.08}));
  AddBrick(scene, 0.3, {-0.12 + 0.006 * index, 0.06, kTableTop_m + 0.045});
  const Intrinsics camera{192, 144, 160.0, 160.0, 95.5, 71.5};
  return reference::Render(scene, CircleCamera(camera_angle_rad), index, camera);
}

Frame Room(int index) { return RoomFrom(0.5 + 0.02 * index, index); }

// A camera that creeps, by a fiftieth of a voxel a frame, and sees its depth through noise: that it
// stands still is hardly less likely than that it moves.
Frame CreepingRoom(int index) {
  Frame frame = RoomFrom(0.5 + 0.001 * index, index);
  Dice dice(static_cast<std::uint64_t>(index));
  for (float& z : cv::Mat_<float>(frame.depth)) {
    if (IsValidDepth(z)) z += static_cast<float>(dice.Uniform(-0.004, 0.004));
  }
  return frame;
}

PipelineConfig ConfigOf(CameraSource camera, Method method = Method::kTsdfppAnchored) {
  PipelineConfig config;
  config.method = method;
  config.map = ToyConfig();
  config.camera = camera;
  return config;
}

std::vector<ObjectInfo> Toys() {
  return {{kBackground, "background", ""}, {kBrick, "brick", "toy"}};
}

// Within kMost of the truth in each frame.
void ExpectFound(const Pipeline& pipeline, int frames) {
  const auto& found = pipeline.camera_log().T_WC;
  ASSERT_EQ(found.size(), static_cast<std::size_t>(frames));
  for (const auto& [index, T_WC] : found) {
    const Pose off = Room(index).T_WC.inverse() * T_WC;
    EXPECT_LT(off.translation().norm(), kMost_m) << index;
    EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle(), kMost_rad) << index;
  }
}

TEST(CameraTracker, TakesADriftAway) {
  for (const Method method : {Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored}) {
    SCOPED_TRACE(MethodName(method));
    Pipeline pipeline(ConfigOf(CameraSource::kRefine, method), Toys());
    Pose drift = Pose::Identity();
    for (int i = 1; i <= kFrames; ++i) {
      Frame frame = Room(i);
      frame.T_WC = drift * frame.T_WC;
      ASSERT_TRUE(pipeline.Process(frame));
      drift = drift * MakePose(0.1 * kDegree, {1, 2, -1}, {0.001, -0.001, 0.001});
    }
    EXPECT_GT(drift.translation().norm(), 4 * kMost_m);
    ExpectFound(pipeline, kFrames);
    EXPECT_EQ(pipeline.camera_log().located, kFrames - 1);
    EXPECT_TRUE(pipeline.Remarks().empty());
  }
}

TEST(CameraTracker, TakesAwayWhatIsAnewInEveryFrame) {
  Pipeline pipeline(ConfigOf(CameraSource::kRefine), Toys());
  Dice dice(7);
  const auto up_to = [&](double most) {
    return Eigen::Vector3d(dice.Uniform(-most, most), dice.Uniform(-most, most),
                           dice.Uniform(-most, most));
  };
  for (int i = 1; i <= kFrames; ++i) {
    Frame frame = Room(i);
    if (i > 1) {
      const Eigen::Vector3d turn = up_to(1 * kDegree);
      frame.T_WC = frame.T_WC * MakePose(turn.norm(), turn.normalized(), up_to(0.02));
    }
    ASSERT_TRUE(pipeline.Process(frame));
  }
  ExpectFound(pipeline, kFrames);
}

TEST(CameraTracker, FindsTheCameraFromItsFirstPoseAlone) {
  Pipeline pipeline(ConfigOf(CameraSource::kTrack), Toys());
  for (int i = 1; i <= kFrames; ++i) {
    Frame frame = Room(i);
    if (i > 1) frame.T_WC = MakePose(2, {1, 1, 0}, {10, 0, 0.1 * i});  // is not looked at
    ASSERT_TRUE(pipeline.Process(frame));
  }
  ExpectFound(pipeline, kFrames);
}

// In two goes, with the map and what its file has of the camera.
TEST(CameraTracker, GoesOnWhereTheCameraWasFound) {
  for (const CameraSource source : {CameraSource::kTrack, CameraSource::kRefine}) {
    SCOPED_TRACE(CameraSourceName(source));
    // Given poses that drift, or are none.
    const auto given = [&](int index) {
      Frame frame = Room(index);
      if (source == CameraSource::kTrack && index > 1) {
        frame.T_WC = MakePose(2, {1, 1, 0}, {10, 0, 0.1 * index});
      } else {
        frame.T_WC =
            MakePose(0.1 * kDegree * (index - 1), {1, 2, -1}, {0.002 * (index - 1), 0, 0}) *
            frame.T_WC;
      }
      return frame;
    };
    Pipeline first(ConfigOf(source), Toys());
    EXPECT_FALSE(first.camera_place().has_value());
    for (int i = 1; i <= kFrames / 2; ++i) ASSERT_TRUE(first.Process(given(i)));
    const auto place = first.camera_place();
    ASSERT_TRUE(place.has_value());
    EXPECT_EQ(place->T_WC.matrix(), first.camera_log().T_WC.at(kFrames / 2).matrix());
    auto file = MapFromBytes(MapToBytes(first.map()).value(), "map.tsdf");
    ASSERT_TRUE(file.has_value());
    Pipeline second(ConfigOf(source), Toys(), std::move(file->map), first.trajectories());
    second.GoOnFrom(*place);
    for (int i = kFrames / 2 + 1; i <= kFrames; ++i) ASSERT_TRUE(second.Process(given(i)));
    ExpectFound(second, kFrames / 2);
    EXPECT_EQ(second.camera_log().located, kFrames / 2);
  }
}

// Between the frames that a network looks at nobody knows what is of an object, and the room is
// most of what is seen.
TEST(CameraTracker, FindsTheCameraWhereMasksSayNothing) {
  Pipeline pipeline(ConfigOf(CameraSource::kTrack), Toys());
  for (int i = 1; i <= kFrames; ++i) {
    Frame frame = Room(i);
    if (i % 2 == 0) frame.mask.setTo(static_cast<double>(kNoInstance));
    ASSERT_TRUE(pipeline.Process(frame));
  }
  ExpectFound(pipeline, kFrames);
}

TEST(CameraTracker, LeavesAFrameOutWhereTheCameraIsLost) {
  Pipeline pipeline(ConfigOf(CameraSource::kTrack), Toys());
  for (int i = 1; i <= 6; ++i) ASSERT_TRUE(pipeline.Process(Room(i)));
  const auto before = VoxelsOf(pipeline.map()).ObservedVoxels(kBrick);
  const Pose brick = pipeline.trajectories().at(kBrick).rbegin()->second;
  Frame blind = Room(7);
  blind.depth.setTo(0, blind.mask == kBackground);
  ASSERT_TRUE(pipeline.Process(blind));
  EXPECT_EQ(VoxelsOf(pipeline.map()).ObservedVoxels(kBrick), before);
  EXPECT_EQ(pipeline.trajectories().at(kBrick).rbegin()->second.matrix(), brick.matrix());
  EXPECT_EQ(pipeline.camera_log().lost, 1);
  ASSERT_EQ(pipeline.Remarks().size(), 1U);
  EXPECT_NE(pipeline.Remarks()[0].find("the camera was not found in 1 of 6 frames"),
            std::string::npos)
      << pipeline.Remarks()[0];
  for (int i = 8; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(Room(i)));
  ExpectFound(pipeline, kFrames - 1);
}

// Refined, such a frame is mapped where the given motion since the last one puts it.
// The first pose alone is given: where there is no room, no other is taken.
TEST(CameraTracker, IsLostWhereNoFrameShowsTheRoom) {
  for (const CameraSource source : {CameraSource::kTrack, CameraSource::kRefine}) {
    Pipeline pipeline(ConfigOf(source), Toys());
    for (int i = 1; i <= 3; ++i) {
      Frame frame = Room(i);
      frame.mask.setTo(kBrick);
      ASSERT_TRUE(pipeline.Process(frame));
    }
    const CameraLog& log = pipeline.camera_log();
    EXPECT_EQ(log.located, 0);
    EXPECT_EQ(log.lost, source == CameraSource::kTrack ? 3 : 0);
    EXPECT_EQ(log.carried_on, source == CameraSource::kRefine ? 3 : 0);
    EXPECT_EQ(log.T_WC.size(), source == CameraSource::kTrack ? 0U : 3U);
    const std::vector<std::string> remarks = pipeline.Remarks();
    EXPECT_TRUE(std::ranges::any_of(remarks, [](const std::string& remark) {
      return remark.find("the camera was not found in 3 of 3 frames") != std::string::npos;
    }));
  }
}

// Their products with what was found are rigid, too.
TEST(CameraTracker, TakesPosesThatAreJustRigid) {
  const Eigen::Matrix3d slant =
      Eigen::Matrix3d::Identity() + 0.45 * kRigidTolerance * Eigen::Matrix3d::Ones();
  for (const CameraSource source : {CameraSource::kTrack, CameraSource::kRefine}) {
    Pipeline pipeline(ConfigOf(source), Toys());
    for (int i = 1; i <= kFrames; ++i) {
      Frame frame = Room(i);
      frame.T_WC.linear() = slant * frame.T_WC.linear();
      ASSERT_TRUE(pipeline.Process(frame));
    }
    ExpectFound(pipeline, kFrames);
  }
}

// Of what is refused nothing is mapped.
TEST(CameraTracker, DoesNotCountRefusedFrames) {
  Pipeline pipeline(ConfigOf(CameraSource::kRefine), Toys());
  for (int i = 1; i <= 3; ++i) ASSERT_TRUE(pipeline.Process(Room(i)));
  const CameraLog before = pipeline.camera_log();
  Frame far = Room(4);
  far.T_WO[kBrick] = Pose(Eigen::Translation3d(1e9, 0, 0));
  EXPECT_FALSE(pipeline.Process(far));
  EXPECT_EQ(pipeline.camera_log().located, before.located);
  EXPECT_FALSE(pipeline.camera_log().T_WC.contains(4));
}

TEST(CameraTracker, GoesOnByTheGivenMotionWhereTheBackgroundIsOutOfSight) {
  Pipeline pipeline(ConfigOf(CameraSource::kRefine), Toys());
  const Pose off = MakePose(0.5 * kDegree, {1, 0, 1}, {0.01, 0, -0.01});
  for (int i = 1; i <= 7; ++i) {
    Frame frame = Room(i);
    if (i > 1) frame.T_WC = off * frame.T_WC;
    if (i == 7) frame.depth.setTo(0, frame.mask == kBackground);
    ASSERT_TRUE(pipeline.Process(frame));
  }
  ExpectFound(pipeline, 7);
  EXPECT_EQ(pipeline.camera_log().carried_on, 1);
  EXPECT_EQ(pipeline.camera_log().located, 5);
}

TEST(CameraTracker, LooksAtNothingWherePosesAreGiven) {
  Pipeline pipeline(ConfigOf(CameraSource::kGiven), Toys());
  for (int i = 1; i <= 3; ++i) ASSERT_TRUE(pipeline.Process(Room(i)));
  EXPECT_TRUE(pipeline.camera_log().T_WC.empty());
  EXPECT_EQ(pipeline.camera_log().located, 0);
}

// Where a camera is said to be it is, until something speaks against that. Where it was a frame ago
// is no such word.
TEST(CameraTracker, KeepsGivenPosesAndNotThoseOfBefore) {
  Pipeline refined(ConfigOf(CameraSource::kRefine), Toys());
  Pipeline tracked(ConfigOf(CameraSource::kTrack), Toys());
  for (int i = 1; i <= 4; ++i) {
    const Frame frame = CreepingRoom(i);
    ASSERT_TRUE(refined.Process(frame));
    ASSERT_TRUE(tracked.Process(frame));
    const Pose& by_refine = refined.camera_log().T_WC.at(i);
    EXPECT_LT((by_refine.matrix() - frame.T_WC.matrix()).norm(), 1e-12) << i;
    if (i == 1) continue;
    const Pose& by_track = tracked.camera_log().T_WC.at(i);
    EXPECT_GT((by_track.matrix() - CreepingRoom(1).T_WC.matrix()).norm(), 1e-6) << i;
  }
}

TEST(CameraTracker, NeedsSignedDistances) {
  PipelineConfig config = ConfigOf(CameraSource::kRefine, Method::kSurfels);
  const auto valid = config.Validate();
  ASSERT_FALSE(valid);
  EXPECT_NE(valid.error().message.find("'surfels'"), std::string::npos) << valid.error().message;
  for (const CameraSource source :
       {CameraSource::kGiven, CameraSource::kRefine, CameraSource::kTrack}) {
    EXPECT_EQ(CameraSourceFromName(CameraSourceName(source)).value(), source);
  }
  EXPECT_FALSE(CameraSourceFromName("vicon"));
}

}  // namespace
}  // namespace tsdfpp
