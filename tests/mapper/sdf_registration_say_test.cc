// What a segment knows of its place, what is expected where it knows nothing, and what it says of
// other places.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/random.h"
#include "mapper/track/sdf_registration.h"
#include "tests/mapper/known_shapes.h"

namespace tsdfpp {
namespace {

using reference::DistanceFunction;

// A plane holds three of six lengths; the others are as expected, and seem to be as far beside that
// as the rest of the model does.
TEST(SdfRegistration, DoesNotSlideAlongAPlane) {
  const DistanceFunction plane = [](const Eigen::Vector3d& p) { return p.z() - 0.013; };
  const TsdfGrid grid = GridOf(plane);
  const SurfaceReader model(grid, kVoxel_m);
  Points points_L;
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) points_L.emplace_back(0.004 * x, 0.003 * y, 0.013);
  }
  const auto points = InCamera(points_L);
  const Eigen::Vector3d start(0.006, -0.004, 0.005);
  for (const Eigen::Vector3d& bias : {Eigen::Vector3d(0, 0, 0), {-0.002, 0.003, 0.004}}) {
    SdfRegistration task = TaskFrom(model, points, Pose(Eigen::Translation3d(start)));
    task.bias = Eigen::Translation3d(bias);
    const auto found = RegisterToDistances(task, {});
    ASSERT_TRUE(found.converged);
    const Pose off = found.T_LC * TrueLC().inverse();
    const Eigen::Vector3d at(0.058, 0.0435, 0.013);  // the segment's middle
    Eigen::Vector3d along = start + bias;
    along.z() = 0;
    EXPECT_LT((off * at - at - along).norm(), kSmooth_voxels * kVoxel_m);
    EXPECT_LT(Turn(off), kSmooth_rad);
    EXPECT_LT(found.known.shift_shares[1], 1e-6);
    EXPECT_LT(found.known.turn_shares[0], 1e-6);
    EXPECT_GT(found.known.turn_shares[1], SdfTrackConfig().weak_share);
  }
}

// What rests beside a model that is a bias off stays where it is, and so does what rests beside one
// that is not, whatever the bias.
TEST(SdfRegistration, ABiasIsNoReasonAgainstAPlace) {
  const DistanceFunction box = reference::BoxDistance({0.08, 0.05, 0.06});
  const TsdfGrid grid = GridOf(box);
  const SurfaceReader model(grid, kVoxel_m);
  const auto points = InCamera(reference::VisiblePoints(box, kEye, 220));
  SdfRegistration task = TaskFrom(model, points, Pose::Identity());
  const auto found = RegisterToDistances(task, {});
  ASSERT_TRUE(found.converged);
  const Pose bias(Eigen::Translation3d(0.3 * kVoxel_m * Eigen::Vector3d::UnitX()));
  const Pose beside = bias.inverse() * found.T_LC;
  constexpr double kMuchWorse = 2;    // a third of a voxel off on exact depth is more than that
  constexpr double kRounding = 1e-9;  // a bias taken off and put on again
  const auto ratio = [&](const Pose& T_LC, bool may_seem_biased) {
    return ComparePlace(task, T_LC, found, {}, may_seem_biased).cost_ratio;
  };
  EXPECT_GT(ratio(beside, true), kMuchWorse);
  task.bias = bias;
  EXPECT_NEAR(ratio(beside, true), 1, kRounding);
  EXPECT_NEAR(ratio(found.T_LC, true), 1, kRounding);
  EXPECT_GT(ratio(bias.inverse() * beside, true), kMuchWorse);
  EXPECT_GT(ratio(beside, false), kMuchWorse);
}

// Over many draws of a camera's noise the squared errors are as large as the covariance says, along
// the directions that the shape does not leave free; and it is said how many it does.
TEST(SdfRegistration, KnowsHowWellItKnows) {
  constexpr double kNoise_m = 0.002;
  constexpr std::uint32_t kRuns = 60;
  constexpr double kLeast =
      0.7;  // some three deviations of a mean of 60 with three directions each
  constexpr double kMost = 1.3;
  struct Shape {
    std::string name;
    DistanceFunction distance;
    int free_directions;
  };
  for (const Shape& shape : {Shape{"torus", reference::TorusDistance(0.06, 0.04), 1},
                             Shape{"ball", reference::SphereDistance(0.06), 3}}) {
    SCOPED_TRACE(shape.name);
    const TsdfGrid grid = GridOf(shape.distance);
    const SurfaceReader model(grid, kVoxel_m);
    const auto exact = InCamera(reference::VisiblePoints(shape.distance, kEye, 80));
    double sum = 0;
    for (std::uint32_t run = 0; run < kRuns; ++run) {
      std::vector<SegmentPoint> points = exact;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const auto at = static_cast<std::uint32_t>(i);
        const auto draw = static_cast<float>(GaussianDraw(2, run, at)[0]);
        points[i].p_C += kNoise_m * draw * points[i].p_C.normalized();
      }
      const auto found = RegisterToDistances(TaskFrom(model, points, Pose::Identity()), {});
      ASSERT_TRUE(found.converged);
      EXPECT_EQ(found.known.CountBelow(SdfTrackConfig().weak_share), shape.free_directions);
      const Vector6 off = found.frame.LengthsOf(found.T_LC * TrueLC().inverse());
      sum += off.dot(found.covariance.ldlt().solve(off)) / (6 - shape.free_directions);
    }
    EXPECT_GT(sum / kRuns, kLeast);
    EXPECT_LT(sum / kRuns, kMost);
  }
}

TEST(WeakShare, IsLessOfPointsThatDeviateLess) {
  SdfTrackConfig config;
  config.weak_share = 0.04;
  EXPECT_EQ(WeakShare(0.003, 0.01, config), 0.04);
  EXPECT_NEAR(WeakShare(0.0007, 0.01, config), 0.028, 1e-12);
  EXPECT_EQ(WeakShare(0.0001, 0.01, config), 0.02);
  config.weak_share = 0;
  EXPECT_EQ(WeakShare(0.003, 0.01, config), 0) << "switched off";
}

}  // namespace
}  // namespace tsdfpp
