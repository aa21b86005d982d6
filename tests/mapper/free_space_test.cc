// What a frame says of a model placed in it: where it looks through the model, and where the model
// sticks out of its segment. Against shapes that are cast exactly.
#include "mapper/track/free_space.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/units.h"
#include "mapper/pipeline.h"
#include "mapper/track/object_model.h"
#include "mapper/track/outline_term.h"
#include "mapper/track/segment_points.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

// Distances fused once, from one side, are along rays.
constexpr double kOnSurface_voxels = 0.3;
constexpr double kRadius_m = 0.055;  // of the ball of AddBall
constexpr int kAllPlaces = 100000;

reference::Scene OneBall(const Eigen::Vector3d& centre = {0.02, -0.02, kTableTop_m + 0.055}) {
  reference::Scene scene = TableOnly();
  AddBall(scene, centre);
  return scene;
}

// A map of one frame of one ball, and the ball's places.
class FreeSpace : public testing::Test {
 protected:
  FreeSpace()
      : frame_(RenderToys(OneBall(), 0.3)),
        pipeline_(Config(), {{kBackground, "background", ""}, {kBall, "ball", "toy"}}) {
    EXPECT_TRUE(pipeline_.Process(frame_));
    grid_ = ModelOf(pipeline_.map(), kBall)->grid;
    places_ = PlacesOf(*grid_, SurfaceReader(*grid_, kToyVoxel_m), kToyVoxel_m);
  }

  static PipelineConfig Config() {
    PipelineConfig config;
    config.method = Method::kTsdfppAnchored;
    config.map = ToyConfig();
    return config;
  }

  FreeSpaceCounts CountAt(const Pose& T_LC, const cv::Mat& depth) const {
    return CountInFront(places_, T_LC, depth, frame_.intrinsics, kToyVoxel_m, kToyVoxel_m,
                        kAllPlaces);
  }
  // The camera before the model, were the model moved in the world.
  Pose Moved(const Eigen::Vector3d& way_W) const {
    return Eigen::Translation3d(-way_W) * frame_.T_WC;
  }
  Eigen::Vector3d Sideways() const { return frame_.T_WC.linear().col(0); }
  Eigen::Vector3d Centre() const { return frame_.T_WO.at(kBall).translation(); }

  Frame frame_;
  Pipeline pipeline_;
  const TsdfGrid* grid_ = nullptr;
  std::vector<SurfacePlace> places_;
};

TEST_F(FreeSpace, PlacesLieOnTheSurfaceThatWasSeen) {
  ASSERT_GT(places_.size(), 30U);
  for (const SurfacePlace& place : places_) {
    const Eigen::Vector3d from_centre = place.p_L.cast<double>() - Centre();
    EXPECT_NEAR(from_centre.norm(), kRadius_m, kOnSurface_voxels * kToyVoxel_m);
    EXPECT_NEAR(place.normal_L.norm(), 1, 1e-4);
    EXPECT_GT(place.normal_L.cast<double>().dot(from_centre), 0) << "normals point out";
  }
}

TEST_F(FreeSpace, NothingIsSeenThroughWhereTheModelIsRight) {
  const FreeSpaceCounts counts = CountAt(frame_.T_WC, frame_.depth);
  EXPECT_GT(counts.on, 20);
  EXPECT_EQ(counts.in_front, 0);
}

TEST_F(FreeSpace, AModelBesideItsObjectIsSeenThrough) {
  const FreeSpaceCounts half = CountAt(Moved(kRadius_m * Sideways()), frame_.depth);
  EXPECT_GT(half.Share(), 0.2);
  EXPECT_LT(half.Share(), 0.8);
  const FreeSpaceCounts beside = CountAt(Moved(2.5 * kRadius_m * Sideways()), frame_.depth);
  EXPECT_GT(beside.Share(), 0.9);
  // Nearer to the camera it is seen through, farther away it is hidden.
  const Eigen::Vector3d back = frame_.T_WC.linear().col(2);
  EXPECT_GT(CountAt(Moved(-4 * kToyVoxel_m * back), frame_.depth).Share(), 0.9);
  const FreeSpaceCounts behind = CountAt(Moved(4 * kToyVoxel_m * back), frame_.depth);
  EXPECT_EQ(behind.in_front, 0);
}

TEST_F(FreeSpace, WhatHidesTheModelAndWhatHasNoDepthSaysNothing) {
  cv::Mat hidden = frame_.depth.clone();
  hidden.setTo(0.2F);
  const FreeSpaceCounts behind = CountAt(Moved(kRadius_m * Sideways()), hidden);
  EXPECT_EQ(behind.on + behind.in_front, 0);
  for (const float none : {0.0F, std::numeric_limits<float>::quiet_NaN()}) {
    const FreeSpaceCounts blind =
        CountAt(Moved(kRadius_m * Sideways()), cv::Mat(frame_.depth.size(), CV_32FC1, none));
    EXPECT_EQ(blind.on + blind.in_front, 0);
  }
  Pose lost = frame_.T_WC;
  lost.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(CountAt(lost, frame_.depth).on, 0);
  EXPECT_EQ(CountAt(lost, frame_.depth).in_front, 0);
}

class Outline : public FreeSpace {
 protected:
  Outline() {
    outline_ = OutlineOf(frame_.mask, kBall, Points(), frame_.depth, frame_.intrinsics, 40);
    motion_.centre = Centre();
    motion_.radius_m = kRadius_m;
    options_.max_places = kAllPlaces;
    options_.margin_m = kToyVoxel_m;
    options_.huber_m = kToyVoxel_m;
  }
  std::vector<SegmentPoint> Points() const {
    return SegmentPointsOf(frame_, PixelsByLabel(frame_.mask, 1).at(kBall), kToyVoxel_m, {});
  }
  OutlineTerm Term() const { return {places_, outline_, motion_, options_}; }

  SegmentOutline outline_;
  MotionFrame motion_;
  OutlineTerm::Options options_;
};

TEST_F(Outline, IsAsFarAsTheNearestPixelOfTheSegment) {
  for (int v = 0; v < outline_.box.height; v += 7) {
    for (int u = 0; u < outline_.box.width; u += 7) {
      double nearest = std::numeric_limits<double>::infinity();
      for (int y = 0; y < frame_.mask.rows; ++y) {
        for (int x = 0; x < frame_.mask.cols; ++x) {
          if (frame_.mask.at<InstanceId>(y, x) != kBall) continue;
          nearest = std::min(nearest, std::hypot(x - u - outline_.box.x, y - v - outline_.box.y));
        }
      }
      EXPECT_NEAR(outline_.pixels.at<float>(v, u), nearest, 0.01) << u << " " << v;
    }
  }
}

TEST_F(Outline, AModelInsideItsSegmentIsNotPulled) {
  options_.slack_m = 0.5 * kToyVoxel_m;
  const NormalEquations sums = Term().Sums(frame_.T_WC);
  EXPECT_EQ(sums.cost, 0);
  EXPECT_TRUE(sums.g.isZero());
}

TEST_F(Outline, AModelBesideItsSegmentIsPulledBack) {
  const Eigen::Vector3d way = 0.5 * kRadius_m * Sideways();
  const NormalEquations sums = Term().Sums(Moved(way));
  EXPECT_GT(sums.cost, 0);
  // The points move by -g, so the model by g: against the way that it was moved.
  EXPECT_LT(sums.g.head<3>().dot(way), -0.9 * sums.g.head<3>().norm() * way.norm());
}

TEST_F(Outline, TheGradientIsThatOfTheCost) {
  // Pixels of the image and the places' sides change which places count; each change is small.
  constexpr double kGradient = 0.1;
  const Pose at = Moved(0.5 * kRadius_m * Sideways());
  const NormalEquations sums = Term().Sums(at);
  constexpr double kStep_m = 2e-4;
  Vector6 numeric;
  for (int i = 0; i < 6; ++i) {
    const auto cost = [&](double step) {
      Vector6 x = Vector6::Zero();
      x[i] = step;
      return Term().Sums(motion_.MotionOf(x) * at).cost;
    };
    numeric[i] = (cost(kStep_m) - cost(-kStep_m)) / (2 * kStep_m);
  }
  EXPECT_LT((numeric - sums.g).norm(), kGradient * sums.g.norm());
}

TEST_F(Outline, WhatHidesTheModelAndWhatIsOfNoInstanceDoesNotPull) {
  const Pose beside = Moved(0.5 * kRadius_m * Sideways());
  Frame other = frame_;
  other.depth = cv::Mat(frame_.depth.size(), CV_32FC1, 0.2F);
  outline_ = OutlineOf(frame_.mask, kBall, Points(), other.depth, frame_.intrinsics, 40);
  EXPECT_EQ(Term().Sums(beside).cost, 0);
  cv::Mat unknown = frame_.mask.clone();
  unknown.setTo(static_cast<double>(kNoInstance), unknown != static_cast<double>(kBall));
  outline_ = OutlineOf(unknown, kBall, Points(), frame_.depth, frame_.intrinsics, 40);
  EXPECT_EQ(Term().Sums(beside).cost, 0);
}

}  // namespace
}  // namespace tsdfpp
