// Registration to models that lack a side, or have one wrong, known exactly.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "mapper/track/sdf_registration.h"
#include "tests/mapper/known_shapes.h"

namespace tsdfpp {
namespace {

using reference::DistanceFunction;
using reference::MakePose;

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
    const Pose off = found.T_LC * TrueLC().inverse();  // of the middle
    EXPECT_NEAR(off.translation().z(), mean_m, kSmooth_voxels * kVoxel_m) << certain_slope;
  }
}

}  // namespace
}  // namespace tsdfpp
