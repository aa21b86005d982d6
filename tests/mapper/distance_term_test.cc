// The distances that a segment's points have, and what a motion of it does to them.
#include "mapper/track/distance_term.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "tests/mapper/known_shapes.h"

namespace tsdfpp {
namespace {

using reference::DistanceFunction;

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
  VoxelCube cube;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    const auto draw = UniformDraw(11, 0, i % 2000);
    const Eigen::Vector3d q = 12 * Eigen::Vector3d(draw[0], draw[1], draw[2]).array() - 6;
    const double trilinear = *DistanceAt(FindCorners(voxels, q));
    // Single precision, of values up to 0.5 and their differences.
    EXPECT_NEAR(reader.SagAt(q * kVoxel_m, cache, cube), trilinear - exact(q), 1e-6);
    EXPECT_EQ(cube.base, FloorOf(q));
    EXPECT_EQ(reader.At(q * kVoxel_m, 0, cube).value_m, reader.At(q * kVoxel_m).value_m);
  }
  EXPECT_EQ(reader.SagAt(Eigen::Vector3d(5, 5, 5), cache, cube), 0) << "nothing is there";
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

}  // namespace
}  // namespace tsdfpp
