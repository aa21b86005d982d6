// The pipeline refuses what is no frame or lies too far out, and goes on as if it had not been
// given; it says what it could make nothing of. What it takes: frame numbers that go back.
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "mapper/map_file.h"
#include "mapper/map_reach.h"
#include "mapper/pipeline.h"
#include "mapper/volume/lattice_range.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/dyadic_scene.h"
#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

PipelineConfig ConfigOf(Method method, PoseSource poses = PoseSource::kGiven) {
  PipelineConfig config;
  config.method = method;
  config.map = DyadicConfig();
  config.poses = poses;
  return config;
}

std::vector<ObjectInfo> Toys() {
  return {{kBackground, "background", ""},
          {kBrick, "brick", "toy"},
          {kBall, "ball", "toy"},
          {kTray, "tray", "toy"}};
}

Pipeline NewPipeline(Method method, PoseSource poses = PoseSource::kGiven) {
  return {ConfigOf(method, poses), Toys()};
}

class PipelineRange : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(PipelineRange);

TEST_P(PipelineRange, ARefusedFrameLeavesNoTrace) {
  Pipeline undisturbed = NewPipeline(GetParam());
  Pipeline disturbed = NewPipeline(GetParam());
  const double beyond_m = 1.01 * LatticeRange(kDyadicVoxel_m).reach_m;
  const std::vector<std::function<void(Frame&)>> faults{
      [](Frame& f) { f.mask = cv::Mat(); },
      [](Frame& f) { f.intrinsics = {}; },
      [](Frame& f) { f.depth = f.depth.rowRange(0, 10); },
      [&](Frame& f) { f.T_WC.translation().z() = beyond_m; },
      [&](Frame& f) { f.T_WO.at(kTray).translation().x() = -beyond_m; },
      [](Frame& f) {
        f.T_WO.at(kTray).translation().x() = std::numeric_limits<double>::quiet_NaN();
      },
      [](Frame& f) { f.T_WC.linear() *= 2; },
      [](Frame& f) { f.intrinsics.fx = 1e-30; },
      [](Frame& f) { f.T_WO[kNoInstance] = Pose::Identity(); },
  };
  for (int i = 0; i < 3; ++i) {
    const Frame good = DyadicFrame(i);
    for (std::size_t k = 0; k < faults.size(); ++k) {
      Frame bad = DyadicFrame(i);
      faults[k](bad);
      const auto status = disturbed.Process(bad);
      ASSERT_FALSE(status.has_value()) << k;
      EXPECT_EQ(status.error().kind, ErrorKind::kData);
      EXPECT_TRUE(status.error().message.starts_with(fmt::format("frame {}: ", i)))
          << status.error().message;
    }
    ASSERT_TRUE(disturbed.Process(good).has_value());
    ASSERT_TRUE(undisturbed.Process(good).has_value());
    EXPECT_TRUE(MapToBytes(disturbed.map()).value() == MapToBytes(undisturbed.map()).value()) << i;
  }
  EXPECT_EQ(disturbed.trajectories().size(), undisturbed.trajectories().size());
  for (const auto& [id, poses] : undisturbed.trajectories()) {
    const auto& others = disturbed.trajectories().at(id);
    ASSERT_EQ(others.size(), poses.size());
    for (const auto& [frame, T_WO] : poses) EXPECT_EQ(others.at(frame).matrix(), T_WO.matrix());
  }
  EXPECT_TRUE(disturbed.Remarks().empty());
}

// The pose of the greatest number is an old one here.
TEST_P(PipelineRange, NumbersThatWentBackMoveNothingAfterLoading) {
  Pipeline saved = NewPipeline(GetParam());
  for (const int i : {0, 1, 2, 0}) ASSERT_TRUE(saved.Process(DyadicFrame(i)).has_value());
  auto file = MapFromBytes(MapToBytes(saved.map()).value(), "map.tsdf");
  ASSERT_TRUE(file.has_value());
  Pipeline loaded(ConfigOf(GetParam()), Toys(), std::move(file->map), saved.trajectories());
  Frame next = DyadicFrame(0);
  next.index = 3;
  next.T_WO.clear();  // all stay
  ASSERT_TRUE(saved.Process(next).has_value());
  ASSERT_TRUE(loaded.Process(next).has_value());
  EXPECT_EQ(loaded.trajectories().at(kBrick).at(3).matrix(),
            saved.trajectories().at(kBrick).at(3).matrix());
  EXPECT_TRUE(MapToBytes(loaded.map()).value() == MapToBytes(saved.map()).value());
}

// Poses that the frame brings along are not read.
TEST_P(PipelineRange, TrackedPosesAreTheOnesThatAreChecked) {
  Pipeline pipeline = NewPipeline(GetParam(), PoseSource::kIcp);
  Frame frame = DyadicFrame(0);
  frame.T_WO.at(kBrick).translation().x() = 1e30;
  const auto status = pipeline.Process(frame);
  ASSERT_TRUE(status.has_value()) << status.error().message;
  frame.T_WC.translation().x() = 1e30;
  EXPECT_FALSE(pipeline.Process(frame).has_value());
}

TEST_P(PipelineRange, AMapThatStaysEmptyIsSaidWithTheCounts) {
  const auto remark_after = [](const std::function<void(Frame&)>& change) {
    Pipeline pipeline = NewPipeline(GetParam());
    for (int i = 0; i < 2; ++i) {
      Frame frame = DyadicFrame(i);
      frame.depth.setTo(0.5);
      change(frame);
      EXPECT_TRUE(pipeline.Process(frame).has_value());
    }
    const std::vector<std::string> remarks = pipeline.Remarks();
    return remarks.empty() ? std::string() : remarks.front();
  };
  EXPECT_EQ(remark_after([](Frame&) {}), "");
  // Millimetres for metres, an empty sensor, a mask without objects.
  EXPECT_EQ(
      remark_after([](Frame& f) { f.depth.setTo(700); }),
      "the map is empty: of 13824 pixels in 2 frames 13824 have a depth, 0 of them within 100 "
      "m and 0 of those a label");
  EXPECT_EQ(remark_after([](Frame& f) { f.depth.setTo(0); }),
            "the map is empty: of 13824 pixels in 2 frames 0 have a depth, 0 of them within 100 m "
            "and 0 of those a label");
  EXPECT_EQ(remark_after([](Frame& f) {
              f.depth.at<float>(0, 0) = std::numeric_limits<float>::infinity();
              f.depth.at<float>(0, 1) = std::numeric_limits<float>::quiet_NaN();
              f.depth.at<float>(0, 2) = -1;
              f.depth.at<float>(0, 3) = 101;
              f.mask.setTo(kNoInstance);
            }),
            "the map is empty: of 13824 pixels in 2 frames 13818 have a depth, 13816 of them "
            "within 100 m and 0 of those a label");
  const std::vector<std::string> unused = NewPipeline(GetParam()).Remarks();
  ASSERT_EQ(unused.size(), 1U);
  EXPECT_EQ(unused[0], "the map is empty: no frame was mapped");
}

TEST(PipelineRemarks, RoundingIsSaidFarFromTheOrigin) {
  const auto remarks_at = [](int blocks) {
    Pipeline pipeline = NewPipeline(Method::kTsdfpp);
    EXPECT_TRUE(pipeline.Process(Shifted(DyadicFrame(0), {0, blocks, 0})).has_value());
    return pipeline.Remarks();
  };
  EXPECT_TRUE(remarks_at((1 << 17) - 8).empty());
  const std::vector<std::string> far = remarks_at(1 << 18);
  ASSERT_EQ(far.size(), 1U);
  EXPECT_NE(far[0].find("16384 m from the origin along an axis"), std::string::npos) << far[0];
  EXPECT_NE(far[0].find("0.12 voxels"), std::string::npos) << far[0];
}

// A map that was loaded is not empty.
TEST(PipelineRemarks, ALoadedMapCounts) {
  PipelineConfig config;
  config.map = DyadicConfig();
  config.method = Method::kTsdfppAnchored;
  const Pipeline loaded(config, {}, DyadicMap(config.method, 1), {});
  EXPECT_TRUE(loaded.Remarks().empty());
}

// Trackers see a frame before it is known whether the map can take it, and PCL's points have single
// precision; a map without blocks has no range of its own.
TEST(PipelineForm, WhatNoNumberCanHoldIsRefused) {
  const std::vector<std::function<void(Frame&)>> faults{
      [](Frame& f) { f.intrinsics.fx = 1e-300; }, [](Frame& f) { f.intrinsics.cx = 1e300; },
      [](Frame& f) { f.T_WC.translation().x() = 1e300; },
      [](Frame& f) { f.T_WC.translation().x() = 1e8; },
      [](Frame& f) {
        f.intrinsics.width = f.intrinsics.height = 1;
        for (cv::Mat* image : {&f.colour, &f.depth, &f.mask}) *image = (*image)({0, 0, 1, 1});
      }};
  for (const Method method : {Method::kTsdfppAnchored, Method::kSurfels}) {
    for (const PoseSource poses : {PoseSource::kGiven, PoseSource::kIcp}) {
      Pipeline pipeline = NewPipeline(method, poses);
      for (int i = 0; i < 2; ++i) ASSERT_TRUE(pipeline.Process(DyadicFrame(i)).has_value());
      for (std::size_t k = 0; k < faults.size(); ++k) {
        Frame bad = DyadicFrame(2);
        faults[k](bad);
        const auto status = pipeline.Process(bad);
        ASSERT_FALSE(status.has_value()) << k;
        EXPECT_EQ(status.error().kind, ErrorKind::kData);
      }
      EXPECT_TRUE(pipeline.Process(DyadicFrame(2)).has_value());
    }
  }
}

// Products of poses that a frame may just have are none that a map takes: here of an object's with
// that at its birth, when masks that merged two objects are repaired.
TEST(PipelineForm, PosesThatAreJustRigidCanBeMapped) {
  constexpr double kMerged_frames = 5;
  for (const Method method : {Method::kTsdfppAnchored, Method::kVolumes, Method::kTsdfpp}) {
    for (const double share : {0.22, 0.49}) {
      SCOPED_TRACE(fmt::format("{}, {}", MethodName(method), share));
      PipelineConfig config;
      config.map = ToyConfig();
      config.method = method;
      config.mask_repair = MaskRepairMode::kOn;
      config.repair.confirm_frames = 1;
      Pipeline pipeline(config, {});
      for (int i = 1; i <= 8; ++i) {
        reference::Scene scene = TableOnly();
        AddBrick(scene, 0.3, {-0.1 + 0.004 * i, 0.03, kTableTop_m + 0.045});
        AddBall(scene, {0.05 + 0.004 * i, 0.03, kTableTop_m + 0.055});
        Frame frame = reference::Render(scene, CircleCamera(0.02 * i), i,
                                        {192, 144, 160.0, 160.0, 95.5, 71.5});
        for (auto& [id, T_WO] : frame.T_WO) T_WO.linear() *= 1 + share * kRigidTolerance;
        if (i <= kMerged_frames) frame.mask.setTo(kBrick, frame.mask == static_cast<double>(kBall));
        const auto status = pipeline.Process(frame);
        ASSERT_TRUE(status.has_value()) << status.error().message;
        const auto bytes = MapToBytes(pipeline.map());
        ASSERT_TRUE(bytes.has_value());
        const auto again = MapFromBytes(*bytes, "the map");
        ASSERT_TRUE(again.has_value()) << again.error().message;
      }
    }
  }
}

// Nor is anything added that could not be read again.
TEST(PipelineForm, AnAdditionIsRigidInItsOwnLattice) {
  const auto from = MakeMap(Method::kTsdfppAnchored, DyadicConfig());
  const Frame frame = DyadicFrame(0);
  SetPosesThenFuse(*from, frame);
  Pose T = Pose::Identity();
  T.linear() *= 1 + 0.49 * kRigidTolerance;
  const TsdfGrid& grid = *VoxelsOf(*from).GridOf(kBrick);
  EXPECT_FALSE(CheckAddition(from->config(), 5, grid, T, T.inverse()));
  T.linear() = Eigen::Matrix3d::Identity();
  EXPECT_TRUE(CheckAddition(from->config(), 5, grid, T, T.inverse()));
}

// A pixel of the background that a repaired mask gives to an object may lie beyond the range of the
// object's lattice, which the check of the given masks could not know.
TEST(PipelineForm, RepairedMasksLeaveOutWhatLiesBeyond) {
  for (const Method method : {Method::kTsdfppAnchored, Method::kVolumes}) {
    PipelineConfig config;
    config.map = ToyConfig();
    config.method = method;
    config.mask_repair = MaskRepairMode::kOn;
    config.repair.confirm_frames = 1;
    config.repair.take_voxels = 1;
    Pipeline pipeline(config, {{kBackground, "background", ""}, {1, "plate", ""}});
    const double reach_m = LatticeRange(kToyVoxel_m).reach_m;
    const Eigen::Vector3d at(reach_m - 0.06 + 0.004, 0, 0);
    const Eigen::Vector3d inwards(-(reach_m - 1), 0, 0);
    const auto plate = [&](int i, const Eigen::Vector3d& moved, const Eigen::Vector3d& eye) {
      reference::Scene scene;
      scene.shapes.push_back(
          reference::Cuboid(1, {200, 30, 30}, Pose::Identity(), {0.004, 0.12, 0.12}));
      scene.T_WO[1] = reference::MakePose(0, Eigen::Vector3d::UnitZ(), at + moved);
      return reference::Render(scene, reference::LookAt(eye + moved, at + moved), i,
                               {128, 96, 260.0, 260.0, 63.5, 47.5});
    };
    for (int i = 1; i <= 6; ++i) {
      ASSERT_TRUE(pipeline.Process(
          plate(i, Eigen::Vector3d::Zero(), at + Eigen::Vector3d(-0.3, -0.95 - 0.02 * i, 0.02))));
    }
    // Moved inwards, seen head on and taken for the background.
    for (int i = 7; i <= 12; ++i) {
      Frame frame = plate(i, inwards, at + Eigen::Vector3d(-0.9, 0.01 * i, 0.02));
      frame.mask.setTo(i >= 8 ? kBackground : kNoInstance);
      EXPECT_TRUE(pipeline.Process(frame)) << i;
    }
  }
}

TEST(PipelineForm, NegativeNumbersAreRefused) {
  PipelineConfig config;
  config.map = DyadicConfig();
  Pipeline pipeline(config, {});
  Frame frame = DyadicFrame(0);
  frame.index = std::numeric_limits<int>::min();
  const auto status = pipeline.Process(frame);
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().message,
            "frame -2147483648: its number is negative, expected 0 or more");
}

// A camera's buffers are filled again.
TEST(PipelineForm, LabelsAreTheMapsOwn) {
  PipelineConfig config;
  config.map = DyadicConfig();
  Pipeline pipeline(config, {});
  Frame frame = DyadicFrame(0);
  ASSERT_TRUE(pipeline.Process(frame).has_value());
  const cv::Mat before = pipeline.labels().clone();
  frame.mask.setTo(9);
  EXPECT_EQ(cv::norm(before, pipeline.labels(), cv::NORM_INF), 0);
}

// Segments of depth and networks see a frame first of all.
TEST(PipelineForm, IsAskedForBeforeSegments) {
  class Nobody : public InstanceFinder {
   public:
    Expected<std::vector<Instance>> Find(const Frame&) override {
      ++asked;
      return std::vector<Instance>{};
    }
    int asked = 0;
  };
  const std::vector<std::function<void(Frame&)>> faults{
      [](Frame& f) { f.intrinsics.fx = std::numeric_limits<double>::quiet_NaN(); },
      [](Frame& f) { f.intrinsics.fy = -f.intrinsics.fy; },
      [](Frame& f) { f.depth.convertTo(f.depth, CV_16UC1, 1000); },
      [](Frame& f) { f.colour = cv::Mat(0, 5, CV_8UC3); }, [](Frame& f) { f.depth = cv::Mat(); }};
  for (const Segmentation segmentation : {Segmentation::kDepth, Segmentation::kFull}) {
    const auto finder = std::make_shared<Nobody>();
    PipelineConfig config;
    config.map = DyadicConfig();
    config.segmentation = segmentation;
    config.segmenter.finder = finder;
    config.associate = AssociationMode::kVotes;
    config.poses = PoseSource::kTrack;
    Pipeline pipeline(config, {});
    for (std::size_t k = 0; k < faults.size(); ++k) {
      Frame bad = DyadicFrame(0);
      faults[k](bad);
      const auto status = pipeline.Process(bad);
      ASSERT_FALSE(status.has_value()) << k;
      EXPECT_EQ(status.error().kind, ErrorKind::kData);
    }
    EXPECT_EQ(finder->asked, 0);
    const auto good = pipeline.Process(DyadicFrame(0));
    EXPECT_TRUE(good.has_value()) << good.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
