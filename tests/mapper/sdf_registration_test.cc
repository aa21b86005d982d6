// Registration of points to signed distances, against shapes whose distances are known exactly.
#include "mapper/track/sdf_registration.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "core/random.h"
#include "tests/mapper/known_shapes.h"

namespace tsdfpp {
namespace {

using reference::DistanceFunction;
using reference::MakePose;

TEST(SdfRegistration, FindsWhereABoxIs) {
  const DistanceFunction box = reference::BoxDistance({0.08, 0.05, 0.06});
  const TsdfGrid grid = GridOf(box);
  const SurfaceReader model(grid, kVoxel_m);
  const auto points = InCamera(reference::VisiblePoints(box, kEye, 120));
  const auto found = RegisterToDistances(TaskFrom(model, points, kMotion), {});
  ASSERT_TRUE(found.converged);
  const Pose off = found.T_LC * TrueLC().inverse();
  EXPECT_LT(off.translation().norm(), kEdges_voxels * kVoxel_m);
  EXPECT_LT(Turn(off), kEdges_rad);
  EXPECT_GT(found.known.LeastShare(), SdfTrackConfig().weak_share) << "three faces hold a box";
  EXPECT_EQ(found.counts.inliers, found.counts.points);
}

// A search that is asked for more than it can settle to is a search all the same.
TEST(SdfRegistration, IsSettledWhereItCreeps) {
  const DistanceFunction box = reference::BoxDistance({0.08, 0.05, 0.06});
  const TsdfGrid grid = GridOf(box);
  const SurfaceReader model(grid, kVoxel_m);
  const auto points = InCamera(reference::VisiblePoints(box, kEye, 120));
  SdfTrackConfig config;
  config.settled_voxels = 1e-6;
  config.max_iterations = 2;
  const auto found = RegisterToDistances(TaskFrom(model, points, kMotion), config);
  EXPECT_TRUE(found.converged);
  const Pose off = found.T_LC * TrueLC().inverse();
  EXPECT_LT(off.translation().norm(), kEdges_voxels * kVoxel_m);
  // One step a pass is too few from further off: the last still moves points.
  config.max_iterations = 1;
  const Pose far = MakePose(50 * kDegree, {0.3, -1, 0.5}, {0.02, -0.02, 0.01});
  EXPECT_FALSE(RegisterToDistances(TaskFrom(model, points, far), config).converged);
}

// All but the turn about its axis, along which it stays where it was expected.
TEST(SdfRegistration, FindsWhereATorusIsAsBruteForceDoes) {
  const DistanceFunction torus = reference::TorusDistance(0.06, 0.04);
  const TsdfGrid grid = GridOf(torus);
  const SurfaceReader model(grid, kVoxel_m);
  const Points points_L = reference::VisiblePoints(torus, kEye, 100);
  const auto points = InCamera(points_L);
  const auto found = RegisterToDistances(TaskFrom(model, points, kMotion), {});
  ASSERT_TRUE(found.converged);
  const Pose brute = reference::BruteForcePose(torus, points_L, kMotion);
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Pose off = found.T_LC * TrueLC().inverse();
  for (const Pose& other : {Pose::Identity(), brute}) {
    EXPECT_LT((off.translation() - other.translation()).norm(), kSmooth_voxels * kVoxel_m);
    EXPECT_LT((off.linear() * z - other.linear() * z).norm(), kSmooth_rad);
  }
  EXPECT_LT(found.known.turn_shares[0], 1e-3);
  EXPECT_GT(std::abs(found.known.turns.col(0).z()), 0.99);
  EXPECT_GT(found.known.shift_shares[0], SdfTrackConfig().weak_share);
}

TEST(SdfRegistration, FindsABallAndDoesNotMakeUpItsTurn) {
  const DistanceFunction ball = reference::SphereDistance(0.06);
  const TsdfGrid grid = GridOf(ball);
  const SurfaceReader model(grid, kVoxel_m);
  const auto points = InCamera(reference::VisiblePoints(ball, kEye, 120));
  const auto found = RegisterToDistances(
      TaskFrom(model, points, Pose(Eigen::Translation3d(0.008, -0.009, 0.006))), {});
  ASSERT_TRUE(found.converged);
  const Pose off = found.T_LC * TrueLC().inverse();
  EXPECT_LT(off.translation().norm(), kSmooth_voxels * kVoxel_m);
  // A turn by a thousandth of a voxel at its surface for each of some ten steps.
  EXPECT_LT(Turn(off), 0.01 * kVoxel_m / 0.06);
}

// A house of walls a voxel thick, whose distances have ridges between them.
double DistanceToWalls(const Eigen::Vector3d& p) {
  double least = reference::BoxDistance({0.09, 0.07, 0.02})(p);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d q = p - Eigen::Vector3d(0.023 * i - 0.08, 0, 0.05);
    least = std::min(least, reference::BoxDistance({0.005, 0.06, 0.04})(q));
  }
  return least;
}

// Across the ridges the interpolated gradients jump. The search must not end at the first jump, but
// where the noise allows no more.
TEST(SdfRegistration, IsAsGoodAsTheNoiseBetweenRidges) {
  // The mean of the squared error in units of its covariance is 6; some of the covariance is lost
  // where Huber's function cuts, and voxels of a wall's thickness bend the distances.
  constexpr double kMostSquares = 3 * 6;
  constexpr double kNoise_m = 0.003;
  constexpr int kRuns = 12;
  const TsdfGrid grid = GridOf(DistanceToWalls);
  const SurfaceReader model(grid, kVoxel_m);
  const auto exact = InCamera(reference::VisiblePoints(DistanceToWalls, kEye, 60));
  std::vector<double> squares;
  for (std::uint32_t run = 0; run < kRuns; ++run) {
    std::vector<SegmentPoint> points = exact;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto draw = static_cast<float>(GaussianDraw(1, run, static_cast<std::uint32_t>(i))[0]);
      points[i].p_C += kNoise_m * draw * points[i].p_C.normalized();
    }
    const auto found = RegisterToDistances(TaskFrom(model, points, kMotion), {});
    ASSERT_TRUE(found.converged) << run;
    const Vector6 off = found.frame.LengthsOf(found.T_LC * TrueLC().inverse());
    squares.push_back(off.dot(found.information * off) /
                      (found.counts.deviation_m * found.counts.deviation_m));
  }
  std::ranges::sort(squares);
  EXPECT_LT(squares[kRuns / 2], kMostSquares);
}

TEST(SdfRegistration, DoesNotDependOnThreads) {
  const DistanceFunction box = reference::BoxDistance({0.08, 0.05, 0.06});
  const TsdfGrid grid = GridOf(box);
  const SurfaceReader model(grid, kVoxel_m);
  const auto points = InCamera(reference::VisiblePoints(box, kEye, 220));
  ASSERT_GT(points.size(), 1024U) << "more than two chunks";
  const auto with = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return RegisterToDistances(TaskFrom(model, points, kMotion), {});
  };
  const auto one = with(1);
  const auto four = with(4);
  EXPECT_EQ(one.T_LC.matrix(), four.T_LC.matrix());
  EXPECT_EQ(one.information, four.information);
}

TEST(SdfRegistration, SurvivesWhatIsNoSegment) {
  const DistanceFunction box = reference::BoxDistance({0.08, 0.05, 0.06});
  const TsdfGrid grid = GridOf(box);
  const TsdfGrid nothing;
  const auto whole = InCamera(reference::VisiblePoints(box, kEye, 80));
  auto broken = whole;
  broken[3].p_C.y() = std::numeric_limits<float>::quiet_NaN();
  const std::vector<SegmentPoint> three(whole.begin(), whole.begin() + 3);
  const std::vector<SegmentPoint> same(100, whole.front());
  struct Case {
    std::string name;
    const TsdfGrid* grid;
    std::vector<SegmentPoint> points;
  };
  for (const Case& trouble : {Case{"no points", &grid, {}}, Case{"three points", &grid, three},
                              Case{"one place", &grid, same}, Case{"not finite", &grid, broken},
                              Case{"no model", &nothing, whole}}) {
    SCOPED_TRACE(trouble.name);
    const SurfaceReader model(*trouble.grid, kVoxel_m);
    const auto found = RegisterToDistances(TaskFrom(model, trouble.points, kMotion), {});
    EXPECT_TRUE(found.T_LC.matrix().allFinite());
    const bool is_usable = trouble.name == "three points" || trouble.name == "one place";
    if (!is_usable) {
      EXPECT_FALSE(found.converged);
    }
  }
}

}  // namespace
}  // namespace tsdfpp
