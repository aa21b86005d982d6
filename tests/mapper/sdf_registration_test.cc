// Registration of points to signed distances, against shapes whose distances are known exactly.
// Longer than most files: each of these on the same shapes.
#include "mapper/track/sdf_registration.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "core/random.h"
#include "core/units.h"
#include "tests/reference/analytic_scene.h"
#include "tests/reference/sdf_registration_reference.h"

namespace tsdfpp {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using reference::DistanceFunction;
using reference::MakePose;

constexpr double kVoxel_m = 0.01;
const Eigen::Vector3d kEye(0.5, -0.6, 0.7);  // of the camera, in the object's frame
// A torus is smooth: what is left is of the third order in a voxel over its tube's radius of four.
constexpr double kSmooth_voxels = 0.02;
// Beside an edge, points lie between voxels on both sides of it, whose distances bend.
constexpr double kEdges_voxels = 0.05;
// Over shapes of some 8 cm.
constexpr double kSmooth_rad = kSmooth_voxels * kVoxel_m / 0.08;
constexpr double kEdges_rad = kEdges_voxels * kVoxel_m / 0.08;

// Observed everywhere, without truncation.
TsdfGrid GridOf(const DistanceFunction& distance, int reach_voxels = 24) {
  TsdfGrid grid;
  const int blocks = reach_voxels / kBlockSide;
  for (int i = 0; i < 8 * blocks * blocks * blocks; ++i) {
    const Index3 index{i % (2 * blocks) - blocks, i / (2 * blocks) % (2 * blocks) - blocks,
                       i / (4 * blocks * blocks) - blocks};
    TsdfBlock& block = grid.FindOrAdd(index);
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 voxel = VoxelAt(index, place);
      const Eigen::Vector3d p = kVoxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
      block.distance[static_cast<std::size_t>(place)] = static_cast<float>(distance(p));
      block.weight[static_cast<std::size_t>(place)] = 50;
    }
  }
  return grid;
}

Pose TrueLC() { return reference::LookAt(kEye, Eigen::Vector3d::Zero()); }

std::vector<SegmentPoint> InCamera(const Points& points_L) {
  std::vector<SegmentPoint> points_C;
  for (const Eigen::Vector3d& p_L : points_L) {
    points_C.push_back({(TrueLC().inverse() * p_L).cast<float>(), {}});
  }
  return points_C;
}

SdfRegistration TaskFrom(const SurfaceReader& model, const std::vector<SegmentPoint>& points,
                         const Pose& motion) {
  SdfRegistration task{&model, points, kVoxel_m, reference::SmallCamera()};
  task.T_LC_expected = motion * TrueLC();
  return task;
}

double Turn(const Pose& T) { return Eigen::AngleAxisd(T.linear()).angle(); }

const Pose kMotion = MakePose(4 * kDegree, {0.3, -1, 0.5}, {0.008, -0.009, 0.006});

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

// As a map knows a box that it has seen from elsewhere: voxels in front of what was seen, and up to
// three behind it.
TsdfGrid GridSeenFrom(const DistanceFunction& distance, const Eigen::Vector3d& eye) {
  constexpr double kBehind_m = 3 * kVoxel_m;
  TsdfGrid grid = GridOf(distance);
  for (const auto& entry : grid.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 voxel = VoxelAt(entry.index, place);
      const Eigen::Vector3d p = kVoxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
      const Eigen::Vector3d ray = (p - eye).normalized();
      double along = 0;
      double step = distance(eye);
      while (step > 1e-4 && along < 2 * eye.norm()) {
        along += step;
        step = distance(eye + along * ray);
      }
      const bool is_seen = step <= 1e-4 && (p - eye).norm() < along + kBehind_m;
      if (!is_seen) entry.block->weight[static_cast<std::size_t>(place)] = 0;
    }
  }
  return grid;
}

// A side that the model lacks has no distances where it is, and its points come and go at the rim
// of what is known. That is no reason to end here from one place and there from another.
TEST(SdfRegistration, EndsAtOnePlaceWhereAModelLacksASide) {
  const DistanceFunction box = reference::BoxDistance({0.08, 0.05, 0.06});
  const auto points = InCamera(reference::VisiblePoints(box, kEye, 120));
  for (const double x : {0.0, -0.3, -0.6}) {
    SCOPED_TRACE(x);
    const TsdfGrid grid = GridSeenFrom(box, {x, -0.9, 0.5});
    const SurfaceReader model(grid, kVoxel_m);
    std::optional<Pose> first;
    for (const double turn_deg : {-16, -12, -8, 8, 12, 16}) {
      SdfRegistration task = TaskFrom(model, points, MakePose(2 * kDegree, {0, 0, 1}, {0, 0, 0}));
      task.T_LC_seeds = {MakePose(turn_deg * kDegree, {0, 0, 1}, {0.01, 0, 0}) * TrueLC()};
      const auto found = RegisterToDistances(task, {});
      ASSERT_TRUE(found.converged);
      EXPECT_LT(Turn(found.T_LC * TrueLC().inverse()), kEdges_rad);
      if (!first) first = found.T_LC;
      const Pose off = found.T_LC * first->inverse();
      EXPECT_LT(off.translation().norm(), kEdges_voxels * kVoxel_m) << turn_deg;
    }
  }
}

// The trilinear surface of a ball lies inside it where distances bend upwards; the sag says so.
TEST(SdfRegistration, IsBiasedWithoutSags) {
  const DistanceFunction bent = [](const Eigen::Vector3d& p) {
    const double d = p.norm() - 0.06;
    return d + 20 * d * d;  // as along grazing rays
  };
  const TsdfGrid grid = GridOf(bent);
  const SurfaceReader model(grid, kVoxel_m);
  Points points_L = reference::VisiblePoints(reference::SphereDistance(0.06), kEye, 120);
  const auto points = InCamera(points_L);
  SdfTrackConfig config;
  const auto off = [&] {
    const auto found = RegisterToDistances(TaskFrom(model, points, Pose::Identity()), config);
    EXPECT_TRUE(found.converged);
    return (found.T_LC * TrueLC().inverse()).translation().norm() / kVoxel_m;
  };
  const double with_sags = off();
  config.curved = false;
  EXPECT_LT(with_sags, kSmooth_voxels);
  EXPECT_GT(off(), 2 * kSmooth_voxels);
}

// A side that has been seen at a grazing angle alone: what is free before it was seen far along the
// rays, what is behind it from another side. Between both distances cross zero beside the surface.
TEST(SdfRegistration, IsNotDrawnToASideThatWasSeenGrazing) {
  constexpr double kSide_m = 0.084;  // between two voxels
  constexpr float kAlongTheRay_m = 10 * kVoxel_m;
  const DistanceFunction box = reference::BoxDistance({kSide_m, 0.05, 0.06});
  const TsdfGrid grid = GridOf([&](const Eigen::Vector3d& p) {
    const bool is_before = p.x() > kSide_m && std::abs(p.y()) < 0.055 && std::abs(p.z()) < 0.065;
    return is_before ? double{kAlongTheRay_m} : box(p);
  });
  const SurfaceReader model(grid, kVoxel_m);
  const auto points = InCamera(reference::VisiblePoints(box, kEye, 120));
  SdfTrackConfig config;
  config.certain_slope = 0;  // steep distances count less by it, too
  const auto off = [&] {
    const auto found = RegisterToDistances(TaskFrom(model, points, Pose::Identity()), config);
    EXPECT_TRUE(found.converged);
    return (found.T_LC * TrueLC().inverse()).translation().norm() / kVoxel_m;
  };
  // What is left is of points beside the side's rim, whose sag is of voxels before it. They are
  // few: where so few are expected to be wrong, they have no say.
  constexpr double kRim_voxels = 0.3;
  constexpr double kExpected_voxels = 0.05;
  EXPECT_LT(off(), kRim_voxels);
  config.weak_share = 0.04;
  EXPECT_LT(off(), kExpected_voxels);
  // The side's own points are more than that.
  config.max_slope = 0;
  EXPECT_GT(off(), kRim_voxels);
}

// Along the ray of a camera that sees a side at a grazing angle the distance falls by a metre a
// metre, as it should: it is steep across the side alone, and the side counts.
TEST(SdfRegistration, SidesThatAreSeenGrazingCount) {
  constexpr double kSide_m = 0.084;
  const Eigen::Vector3d eye(kSide_m + 0.1, -0.3, 0.9);
  const Eigen::Vector3d to_eye = eye.normalized();
  const TsdfGrid grid =
      GridOf([&](const Eigen::Vector3d& p) { return (p.x() - kSide_m) / to_eye.x(); });
  const SurfaceReader model(grid, kVoxel_m);
  Points side_L;
  for (int i = 0; i < 400; ++i) {
    const int row = i / 20;
    side_L.emplace_back(kSide_m, 0.0045 * (i % 20) - 0.043, 0.0045 * row - 0.043);
  }
  const Pose T_LC = reference::LookAt(eye, Eigen::Vector3d::Zero());
  std::vector<SegmentPoint> points;
  for (const Eigen::Vector3d& p_L : side_L) {
    points.push_back({(T_LC.inverse() * p_L).cast<float>(), {}});
  }
  SdfTrackConfig config;
  ASSERT_GT(1 / to_eye.x(), config.max_slope);
  SdfRegistration task = TaskFrom(model, points, Pose::Identity());
  task.T_LC_expected = Eigen::Translation3d(0.5 * kVoxel_m, 0, 0) * T_LC;
  const auto found = RegisterToDistances(task, config);
  EXPECT_TRUE(found.converged);
  EXPECT_LT(std::abs((found.T_LC * T_LC.inverse()).translation().x()), kEdges_voxels * kVoxel_m);
  config.max_fall = 0;
  EXPECT_FALSE(RegisterToDistances(task, config).converged) << "no point has a distance";
}

// Distances that are whole multiples of 2^-10 m, which halves hold exactly.
TEST(SurfaceReader, KnowsTheSagOfAQuadraticFunction) {
  const DistanceFunction quadratic = [](const Eigen::Vector3d& p) {
    const Eigen::Vector3d v = p / kVoxel_m;
    return std::round(2 * v.x() * v.x() - v.y() * v.y() + 3 * v.z() * v.z() + v.x() * v.y() -
                      2 * v.y() * v.z() + v.x()) /
           1024;
  };
  const auto exact = [](const Eigen::Vector3d& v) {
    return (2 * v.x() * v.x() - v.y() * v.y() + 3 * v.z() * v.z() + v.x() * v.y() -
            2 * v.y() * v.z() + v.x()) /
           1024;
  };
  const TsdfGrid grid = GridOf(quadratic, 16);
  const SurfaceReader reader(grid, kVoxel_m);
  const VoxelReader voxels(grid);
  SurfaceReader::SagCache cache;  // of fewer cubes than there are
  for (std::uint64_t i = 0; i < 400; ++i) {
    const auto draw = UniformDraw(11, 0, i % 200);
    const Eigen::Vector3d q = 12 * Eigen::Vector3d(draw[0], draw[1], draw[2]).array() - 6;
    const double trilinear = *DistanceAt(FindCorners(voxels, q));
    // Single precision, of values up to 0.5 and their differences.
    EXPECT_NEAR(reader.SagAt(q * kVoxel_m, cache), trilinear - exact(q), 1e-6);
  }
  EXPECT_EQ(reader.SagAt(Eigen::Vector3d(5, 5, 5), cache), 0) << "nothing is there";
}

// On a plane the distance is linear, so that Gauss and Newton's sums are the cost's derivatives.
TEST(DistanceTerm, HasTheDerivativesOfItsCost) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.5, 0.8).normalized();
  const DistanceFunction plane = [&](const Eigen::Vector3d& p) { return normal.dot(p) - 0.013; };
  const TsdfGrid grid = GridOf(plane);
  const SurfaceReader model(grid, kVoxel_m);
  Points points_L;
  for (std::uint64_t i = 0; i < 700; ++i) {
    const auto draw = UniformDraw(12, 0, i);
    Eigen::Vector3d p = 0.2 * (Eigen::Vector3d(draw[0], draw[1], draw[2]).array() - 0.5);
    p -= (normal.dot(p) - 0.013 - 0.006 * (draw[3] - 0.4)) * normal;
    points_L.push_back(p);
  }
  const auto points = InCamera(points_L);
  const MotionFrame frame{{0.01, 0.02, -0.01}, 0.07};
  SdfTrackConfig config;
  DistanceTerm term(model, points, frame, kVoxel_m, reference::SmallCamera(), config);
  term.KeepAt(TrueLC());
  for (const double huber_m : {1.0, 0.001}) {
    SCOPED_TRACE(huber_m);
    term.SetHuber(huber_m);
    const NormalEquations at = term.Sums(TrueLC());
    constexpr double kStep_m = 1e-4;  // halves round distances by up to 3e-5 m, the same at both
    for (int k = 0; k < 6; ++k) {
      Vector6 x = Vector6::Zero();
      x[k] = kStep_m;
      const double up = term.Sums(frame.MotionOf(x) * TrueLC()).cost;
      const double down = term.Sums(frame.MotionOf(-x) * TrueLC()).cost;
      EXPECT_NEAR(at.g[k], (up - down) / (2 * kStep_m), 0.01 * at.g.norm()) << k;
    }
  }
}

TEST(MotionFrame, TakesLengthsToMotionsAndBack) {
  const MotionFrame frame{{0.4, -0.2, 1.3}, 0.05};
  Vector6 x;
  x << 0.01, -0.02, 0.03, 0.02, 0.01, -0.04;
  EXPECT_LT((frame.LengthsOf(frame.MotionOf(x)) - x).norm(), 1e-12);
  const Pose motion = frame.MotionOf(x);
  EXPECT_LT((motion * frame.centre - frame.centre - x.head<3>()).norm(), 1e-12);
  EXPECT_NEAR(Turn(motion), x.tail<3>().norm() / 0.05, 1e-12);
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

// A plane holds three of six lengths; the others are as expected.
TEST(SdfRegistration, DoesNotSlideAlongAPlane) {
  const DistanceFunction plane = [](const Eigen::Vector3d& p) { return p.z() - 0.013; };
  const TsdfGrid grid = GridOf(plane);
  const SurfaceReader model(grid, kVoxel_m);
  Points points_L;
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) points_L.emplace_back(0.004 * x, 0.003 * y, 0.013);
  }
  const auto points = InCamera(points_L);
  const Pose start(Eigen::Translation3d(0.006, -0.004, 0.005));
  const auto found = RegisterToDistances(TaskFrom(model, points, start), {});
  ASSERT_TRUE(found.converged);
  const Pose off = found.T_LC * TrueLC().inverse();
  const Eigen::Vector3d at(0.058, 0.0435, 0.013);  // the segment's middle
  EXPECT_LT((off * at - at - Eigen::Vector3d(0.006, -0.004, 0)).norm(), kSmooth_voxels * kVoxel_m);
  EXPECT_LT(Turn(off), kSmooth_rad);
  EXPECT_LT(found.known.shift_shares[1], 1e-6);
  EXPECT_LT(found.known.turn_shares[0], 1e-6);
  EXPECT_GT(found.known.turn_shares[1], SdfTrackConfig().weak_share);
}

// What the plane leaves free is as expected, and seems to be as far beside it as the rest of the
// model does.
TEST(SdfRegistration, WhatIsExpectedIsAsFarBesideItsPlace) {
  const TsdfGrid grid = GridOf([](const Eigen::Vector3d& p) { return p.z() - 0.013; });
  const SurfaceReader model(grid, kVoxel_m);
  Points points_L;
  for (int i = 0; i < 900; ++i) {
    const int row = i / 30;
    points_L.emplace_back(0.004 * (i % 30), 0.003 * row, 0.013);
  }
  const auto points = InCamera(points_L);
  const Eigen::Vector3d shift(0.006, -0.004, 0.005);
  const Eigen::Vector3d bias(-0.002, 0.003, 0.004);
  SdfRegistration task = TaskFrom(model, points, Pose(Eigen::Translation3d(shift)));
  task.bias = Eigen::Translation3d(bias);
  const auto found = RegisterToDistances(task, {});
  ASSERT_TRUE(found.converged);
  const Pose off = found.T_LC * TrueLC().inverse();
  const Eigen::Vector3d at(0.058, 0.0435, 0.013);  // the segment's middle
  const Eigen::Vector3d free = (shift + bias).cwiseProduct(Eigen::Vector3d(1, 1, 0));
  EXPECT_LT((off * at - at - free).norm(), kSmooth_voxels * kVoxel_m);
}

// Of two levels, the one of which distances change three metres a metre, the place is their mean,
// with two thirds for its share.
TEST(SdfRegistration, SteepDistancesCountLess) {
  constexpr double kApart_m = 0.004;
  constexpr double kHalf_m = 0.06;
  const auto is_steep = [](const Eigen::Vector3d& p) { return std::abs(p.x()) < kHalf_m; };
  const TsdfGrid grid = GridOf(
      [&](const Eigen::Vector3d& p) { return is_steep(p) ? 3 * (p.z() - kApart_m) : p.z(); });
  const SurfaceReader model(grid, kVoxel_m);
  Points points_L;
  constexpr double kBetween_m = 0.015;  // no cube of voxels has both
  for (int i = 0; i < 2400; ++i) {
    const int row = i / 60;
    const Eigen::Vector3d p(0.004 * (i % 60) - 0.118, 0.004 * row - 0.078, 0);
    if (std::abs(std::abs(p.x()) - kHalf_m) > kBetween_m) points_L.push_back(p);
  }
  const auto steep = static_cast<double>(std::ranges::count_if(points_L, is_steep));
  const double other = static_cast<double>(points_L.size()) - steep;
  const auto points = InCamera(points_L);
  SdfTrackConfig config;
  for (const double certain_slope : {0., 2.}) {
    config.certain_slope = certain_slope;
    const auto found = RegisterToDistances(TaskFrom(model, points, Pose::Identity()), config);
    ASSERT_TRUE(found.converged);
    const double weight = certain_slope > 0 ? certain_slope / 3 : 1;
    const double mean_m = kApart_m * weight * steep / (weight * steep + other);
    const Eigen::Vector3d middle(0, 0, 0);
    const Eigen::Vector3d way = found.T_LC * TrueLC().inverse() * middle;
    EXPECT_NEAR(way.z(), mean_m, kSmooth_voxels * kVoxel_m) << certain_slope;
  }
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

TEST(WeakShare, IsLessOfPointsThatDeviateLess) {
  SdfTrackConfig config;
  config.weak_share = 0.04;
  EXPECT_EQ(WeakShare(0.003, 0.01, config), 0.04);
  EXPECT_NEAR(WeakShare(0.0007, 0.01, config), 0.028, 1e-12);
  EXPECT_EQ(WeakShare(0.0001, 0.01, config), 0.02);
  config.weak_share = 0;
  EXPECT_EQ(WeakShare(0.003, 0.01, config), 0) << "switched off";
}

TEST(SdfTrackConfig, RoundTripsThroughToml) {
  SdfTrackConfig config;
  config.curved = false;
  config.max_slope = 3;
  config.max_fall = 2;
  config.certain_slope = 1.5;
  config.anchor_turn_rad = 0.5;
  config.weak_share = 0.03;
  config.keyframe_points = 77;
  config.free_space_weight = 0.5;
  config.outline_weight = 0.25;
  config.colour_weight = 2;
  config.colour_points = 88;
  EXPECT_EQ(SdfTrackConfig::FromToml(config.ToToml(), "t").value(), config);
  EXPECT_TRUE(SdfTrackConfig().Validate());
  config.min_points = config.max_points + 1;
  const auto refused = config.Validate();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(refused.error().message,
            fmt::format("tracking setting 'min_points' is {}, expected at most 'max_points', which "
                        "is {}",
                        config.min_points, config.max_points));
}

}  // namespace
}  // namespace tsdfpp
