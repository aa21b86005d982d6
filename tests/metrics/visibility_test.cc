#include "metrics/visibility.h"

#include <gtest/gtest.h>

#include <numbers>

#include "metrics/preservation.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kTable = 1;
constexpr InstanceId kPlate = 2;

std::size_t Count(const SeenTracker& tracker, SampleStatus status) {
  return static_cast<std::size_t>(
      std::count(tracker.status().begin(), tracker.status().end(), status));
}

// A sheet at z = 2 that faces the camera (camera at the origin, looking along z).
TriangleMesh FacingSheet(float z, float half) {
  return testing::Sheet({-half, -half, z}, {0, 2 * half, 0}, {2 * half, 0, 0});
}

// Two parallel planes: the table at z = 2, and a plate of 40 cm x 40 cm at z = 1 in front of it.
std::optional<testing::Hit> TwoPlanes(double x, double y) {
  if (std::abs(x) < 0.2 && std::abs(y) < 0.2) return testing::Hit{1, kPlate};
  return testing::Hit{2, kTable};
}

TEST(Visibility, HiddenIsSplitByCause) {
  // The table's front at z = 2, a second layer of it at z = 2.5 (behind itself), and its back face.
  TriangleMesh mesh = FacingSheet(2, 1.5F);
  testing::Append(mesh, FacingSheet(2.5F, 0.3F));
  TriangleMesh back = FacingSheet(2.01F, 0.3F);
  testing::Flip(back);
  testing::Append(mesh, back);
  SeenTracker tracker(SampleMesh(mesh, 1, 1), kTable);
  const Frame frame = testing::CastFrame(TwoPlanes);
  ASSERT_TRUE(tracker.Observe(frame, Pose::Identity()));

  const Intrinsics& camera = frame.intrinsics;
  const SampleSet& samples = tracker.samples_O();
  std::size_t on_borders = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector3d p = samples.points[i].cast<double>();
    const double x = p.x() / p.z();
    const double y = p.y() / p.z();
    const double u = camera.fx * x + camera.cx;
    const double v = camera.fy * y + camera.cy;
    // The plate's outline falls between pixels: half a pixel either way is the image's to say.
    const double from_outline = std::abs(std::max(std::abs(x), std::abs(y)) - 0.2) * camera.fx;
    if (from_outline < 1) {
      ++on_borders;
      continue;
    }
    SampleStatus expected = SampleStatus::kVisible;
    if (u < -0.5 || v < -0.5 || u >= camera.width - 0.5 || v >= camera.height - 0.5) {
      expected = SampleStatus::kOutside;
    } else if (samples.normals[i].z() > 0) {
      expected = SampleStatus::kBehindItself;
    } else if (std::max(std::abs(x), std::abs(y)) < 0.2) {
      expected = SampleStatus::kBehindOther;
    } else if (p.z() > 2.2) {
      expected = SampleStatus::kBehindItself;
    }
    ASSERT_EQ(tracker.status()[i], expected) << p.transpose();
  }
  EXPECT_LT(on_borders, samples.size() / 50);
  // The plate hides 0.8 m x 0.8 m of the table's front, in 1 sample a cm^2, and 0.36 m^2 behind.
  EXPECT_NEAR(static_cast<double>(Count(tracker, SampleStatus::kBehindOther)), 6400 + 3600, 120);
}

TEST(Visibility, SeenAfterThreeFrames) {
  SeenTracker tracker(SampleMesh(FacingSheet(2, 0.1F), 1, 1), kTable);
  const Frame bare = testing::CastFrame([](double, double) { return testing::Hit{2, kTable}; });
  const Frame covered = testing::CastFrame(TwoPlanes);
  ASSERT_TRUE(tracker.Observe(bare, Pose::Identity()));
  ASSERT_TRUE(tracker.Observe(covered, Pose::Identity()));
  ASSERT_TRUE(tracker.Observe(bare, Pose::Identity()));
  EXPECT_FALSE(tracker.Seen(0));
  ASSERT_TRUE(tracker.Observe(bare, Pose::Identity()));
  EXPECT_TRUE(tracker.Seen(0));
  EXPECT_EQ(tracker.observations()[0], 3);
  const Selection all = SelectAll(tracker.samples_O());
  EXPECT_EQ(SelectSeenWith(tracker, SampleStatus::kVisible, all), all);
  ASSERT_TRUE(tracker.Observe(covered, Pose::Identity()));
  EXPECT_EQ(SelectHidden(tracker, all), all);
}

// A plane tilted about the x axis through (0, 0, 1.5), with its incidence at the optical axis.
Frame TiltedPlane(double tilt_deg, const Intrinsics& camera) {
  const double slope = std::tan(tilt_deg * std::numbers::pi / 180);
  // Plane: z = 1.5 + slope * Y, so a ray (x, y, 1) z meets it at z = 1.5 / (1 - slope y).
  return testing::CastFrame(
      [slope](double, double y) -> std::optional<testing::Hit> {
        if (1 - slope * y <= 0.05) return std::nullopt;
        return testing::Hit{1.5 / (1 - slope * y), kTable};
      },
      camera);
}
SampleSet TiltedSamples(double tilt_deg) {
  const auto slope = static_cast<float>(std::tan(tilt_deg * std::numbers::pi / 180));
  // A few centimetres around the axis, where the incidence is the tilt within a degree.
  constexpr float kHalf_m = 0.02F;
  return SampleMesh(
      testing::Sheet({-kHalf_m, -kHalf_m * 0.2F, 1.5F - slope * kHalf_m * 0.2F},
                     {0, 0.4F * kHalf_m, 0.4F * slope * kHalf_m}, {2 * kHalf_m, 0, 0}),
      50, 1);
}

// Half a pixel at 73 deg is 4.4 mm of depth here, more than the margin: no sample may be lost to
// it.
TEST(Visibility, GrazingPlanesAreSeenUpToTheLimit) {
  const Intrinsics camera{960, 540, 564.3, 564.3, 479.5, 269.5};
  for (const double tilt_deg : {0.0, 30.0, 60.0, 73.0}) {
    SeenTracker tracker(TiltedSamples(tilt_deg), kTable);
    ASSERT_GT(tracker.samples_O().size(), 100U);
    ASSERT_TRUE(tracker.Observe(TiltedPlane(tilt_deg, camera), Pose::Identity()));
    EXPECT_EQ(Count(tracker, SampleStatus::kVisible), tracker.samples_O().size()) << tilt_deg;
  }
  SeenTracker tracker(TiltedSamples(77), kTable);
  ASSERT_TRUE(tracker.Observe(TiltedPlane(77, camera), Pose::Identity()));
  EXPECT_EQ(Count(tracker, SampleStatus::kUnmeasured), tracker.samples_O().size())
      << "grazing, but nothing hides it";
}

TEST(Visibility, MarginIsTwoMillimetres) {
  for (const auto& [offset_m, visible] :
       {std::pair{-0.0015, true}, {0.0015, true}, {-0.0025, false}, {0.0025, false}}) {
    SeenTracker tracker(SampleMesh(FacingSheet(2, 0.1F), 1, 1), kTable);
    const double depth = 2 + offset_m;
    ASSERT_TRUE(tracker.Observe(testing::CastFrame([&](double, double) {
                                  return testing::Hit{depth, kTable};
                                }),
                                Pose::Identity()));
    EXPECT_EQ(Count(tracker, SampleStatus::kVisible) > 0, visible) << offset_m;
  }
}

// Another object's pixel: at the same depth it is in front, or it would not be drawn; where it is
// farther, the sample merely fell between pixels.
TEST(Visibility, ContactHidesAndSilhouettesDoNot) {
  const auto status_before = [](double depth_m) {
    SeenTracker tracker(SampleMesh(FacingSheet(2, 0.1F), 1, 1), kTable);
    EXPECT_TRUE(tracker.Observe(testing::CastFrame([&](double, double) {
                                  return testing::Hit{depth_m, kPlate};
                                }),
                                Pose::Identity()));
    return tracker.status()[0];
  };
  EXPECT_EQ(status_before(1.9), SampleStatus::kBehindOther);
  EXPECT_EQ(status_before(2.0), SampleStatus::kBehindOther);
  EXPECT_EQ(status_before(2.1), SampleStatus::kUnmeasured);
}

// A step of the same object: up to half a pixel before its edge the nearest pixel already shows
// the lower level, its neighbour the right one.
TEST(Visibility, EdgesAreJudgedByTheNeighbouringPixelToo) {
  const Frame frame = testing::CastFrame([](double x, double) {
    return x <= 0.0515 ? testing::Hit{2, kTable} : testing::Hit{2.3, kTable};
  });
  // Ends at x / z = 0.0515, 0.95 pixel beyond the centre of pixel 174.
  SeenTracker tracker(
      SampleMesh(testing::Sheet({0, -0.1F, 2}, {0, 0.2F, 0}, {0.103F, 0, 0}), 20, 1), kTable);
  ASSERT_TRUE(tracker.Observe(frame, Pose::Identity()));
  EXPECT_EQ(Count(tracker, SampleStatus::kVisible), tracker.samples_O().size());
}

TEST(Visibility, FollowsObjectAndCameraPoses) {
  const Pose T_WC(Eigen::Translation3d(1, 2, 3) *
                  Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  Pose T_CO = Pose::Identity();
  T_CO.translation().z() = 2;
  Frame frame = testing::CastFrame([](double, double) { return testing::Hit{2, kTable}; });
  frame.T_WC = T_WC;
  SeenTracker tracker(SampleMesh(FacingSheet(0, 0.1F), 1, 1), kTable);
  ASSERT_TRUE(tracker.Observe(frame, T_WC * T_CO));
  EXPECT_EQ(Count(tracker, SampleStatus::kVisible), tracker.samples_O().size());
}

TEST(Visibility, InvalidDepthHidesNothing) {
  SeenTracker tracker(SampleMesh(FacingSheet(2, 0.1F), 1, 1), kTable);
  ASSERT_TRUE(tracker.Observe(testing::CastFrame([](double, double) {
                                return testing::Hit{0, kTable};
                              }),
                              Pose::Identity()));
  EXPECT_EQ(Count(tracker, SampleStatus::kUnmeasured), tracker.samples_O().size());
}

TEST(Visibility, RefusesImagesOfTheWrongSizeOrType) {
  SeenTracker tracker(SampleMesh(FacingSheet(2, 0.1F), 1, 1), kTable);
  Frame frame = testing::CastFrame(TwoPlanes);
  frame.index = 12;
  frame.mask = cv::Mat();
  const auto no_mask = tracker.Observe(frame, Pose::Identity());
  ASSERT_FALSE(no_mask);
  EXPECT_EQ(no_mask.error().kind, ErrorKind::kData);
  EXPECT_NE(no_mask.error().message.find("frame 12: mask is 0x0"), std::string::npos);
  frame.depth = cv::Mat(240, 320, CV_16UC1);
  const auto bad_depth = tracker.Observe(frame, Pose::Identity());
  ASSERT_FALSE(bad_depth);
  EXPECT_NE(bad_depth.error().message.find("expected 320x240 floats"), std::string::npos);
}

}  // namespace
}  // namespace tsdfpp
