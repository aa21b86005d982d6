#include "metrics/surface_index.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "metrics/mesh_tools.h"
#include "metrics/normal_agreement.h"
#include "tests/metrics/test_scenes.h"
#include "tests/reference/brute_force_distance.h"

namespace tsdfpp {
namespace {

// Triangles of all shapes, slivers among them.
TriangleMesh Shards(std::size_t count) {
  TriangleMesh mesh;
  const auto corners = testing::RandomPoints(3 * count, {-1, -1, -1}, {1, 1, 1}, 11);
  for (std::uint32_t t = 0; t < count; ++t) {
    const Eigen::Vector3f& a = corners[3 * t];
    mesh.vertices.push_back(a);
    mesh.vertices.emplace_back(a + 0.2F * corners[3 * t + 1]);
    mesh.vertices.emplace_back(a + 0.2F * (t % 5 == 0 ? 0.01F : 1.0F) * corners[3 * t + 2]);
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  return mesh;
}

TEST(SurfaceIndex, EqualsBruteForce) {
  const SurfaceIndex index(Shards(300));
  const auto points = testing::RandomPoints(1000, {-1.5, -1.5, -1.5}, {1.5, 1.5, 1.5});
  const NearestSurface nearest = index.Nearest(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double expected =
        reference::DistanceToMesh(points[i], index.mesh(), [](std::size_t) { return true; });
    ASSERT_NEAR(nearest.distance_m[i], expected, testing::kFloat_m) << "point " << i;
    const double to_named = reference::DistanceToMesh(
        points[i], index.mesh(), [&](std::size_t t) { return t == nearest.triangle[i]; });
    ASSERT_NEAR(to_named, expected, testing::kFloat_m) << "the named triangle is not the nearest";
    const Eigen::Vector3d area = AreaVector(index.mesh(), nearest.triangle[i]);
    ASSERT_NEAR(nearest.normal[i].cast<double>().dot(area.normalized()), 1, 1e-5);
  }
}

TEST(SurfaceIndex, EmptyMeshIsInfinitelyFar) {
  const SurfaceIndex index(TriangleMesh{});
  const std::vector<Eigen::Vector3f> points(3, Eigen::Vector3f::Zero());
  const NearestSurface nearest = index.Nearest(points);
  EXPECT_EQ(nearest.distance_m[2], std::numeric_limits<float>::infinity());
  EXPECT_EQ(nearest.triangle[2], NearestSurface::kNone);
}

TEST(SurfaceIndex, ThreadsDoNotChangeTheAnswers) {
  const auto points = testing::RandomPoints(20000, {-1.5, -1.5, -1.5}, {1.5, 1.5, 1.5});
  auto normals = testing::RandomPoints(20000, {-1, -1, -1}, {1, 1, 1}, 8);
  for (auto& normal : normals) normal.normalize();
  const auto answers = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const SurfaceIndex index(Shards(2000));
    return std::pair(index.Nearest(points), MatchSurface(points, normals, index, 0.2));
  };
  const auto one = answers(1);
  for (const std::size_t threads : {2, 4}) {
    const auto more = answers(threads);
    EXPECT_EQ(one.first.distance_m, more.first.distance_m);
    EXPECT_EQ(one.first.triangle, more.first.triangle);
    EXPECT_EQ(one.second.agreeing_m, more.second.agreeing_m);
  }
}

TEST(MeshTools, PointTriangleDistanceEqualsReference) {
  const TriangleMesh mesh = Shards(200);
  const auto points = testing::RandomPoints(200, {-1, -1, -1}, {1, 1, 1}, 3);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const double expected =
        reference::DistanceToMesh(points[t], mesh, [&](std::size_t k) { return k == t; });
    EXPECT_NEAR(PointTriangleDistance(points[t], Corner(mesh, t, 0), Corner(mesh, t, 1),
                                      Corner(mesh, t, 2)),
                expected, testing::kFloat_m);
  }
}

TEST(MeshTools, DegenerateTriangleIsItsSegment) {
  const Eigen::Vector3f a(0, 0, 0);
  const Eigen::Vector3f b(1, 0, 0);
  EXPECT_FLOAT_EQ(PointTriangleDistance({0.5, 2, 0}, a, b, b), 2);
  EXPECT_FLOAT_EQ(PointTriangleDistance({4, 4, 0}, a, b, a), 5);
}

// Marching cubes makes triangles of no area where a distance is exactly 0; Open3D as Debian builds
// it aborts on them.
TEST(SurfaceIndex, DegenerateTrianglesChangeNothing) {
  const TriangleMesh shards = Shards(100);
  TriangleMesh with_degenerate = shards;
  for (std::uint32_t i = 0; i + 2 < shards.vertices.size(); i += 3) {
    with_degenerate.triangles.push_back({i, i, i});
    with_degenerate.triangles.push_back({i, i + 1, i});
  }
  const auto points = testing::RandomPoints(2000, {-1, -1, -1}, {1, 1, 1});
  const NearestSurface expected = SurfaceIndex(shards).Nearest(points);
  const NearestSurface found = SurfaceIndex(with_degenerate).Nearest(points);
  EXPECT_EQ(found.distance_m, expected.distance_m);
  EXPECT_EQ(found.triangle, expected.triangle);
}

// One triangle 50,000 times, once in each order of its corners: with all of them in the tree the
// queries would take an hour. What faces the other way stays, as its normal is another.
TEST(SurfaceIndex, ManyEqualTrianglesAreOne) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, -0.0F}, {0, 1, 0}};
  for (int i = 0; i < 50000; ++i) {
    mesh.triangles.push_back({0, 1, 2});
    mesh.triangles.push_back({1, 3, 0});
  }
  const SurfaceIndex front(mesh);
  EXPECT_EQ(front.indexed(), 1U);
  mesh.triangles.push_back({0, 2, 1});
  const SurfaceIndex index(mesh);
  EXPECT_EQ(index.indexed(), 2U);
  const NearestSurface nearest =
      index.Nearest(testing::RandomPoints(50000, {-1, -1, 0.1F}, {1, 1, 1}, 5));
  for (std::size_t i = 0; i < nearest.triangle.size(); ++i) {
    ASSERT_TRUE(nearest.triangle[i] == 0 || nearest.triangle[i] == 100000) << nearest.triangle[i];
  }
}

TEST(MeshTools, FacesOfAndFacesNear) {
  TriangleMesh mesh = testing::Box({0, 0, 0}, {1, 1, 1});
  testing::Label(mesh, 3);
  TriangleMesh other = testing::Box({5, 0, 0}, {6, 1, 1});
  testing::Label(other, 4);
  testing::Append(mesh, other);
  EXPECT_NEAR(SurfaceArea(mesh), 12, 1e-5);
  EXPECT_NEAR(SurfaceArea(FacesOf(mesh, 4)), 6, 1e-5);
  EXPECT_EQ(FacesOf(mesh, 4).vertices.size(), other.vertices.size());
  EXPECT_GE(BoundsOf(FacesOf(mesh, 4)).min().x(), 5);
  EXPECT_TRUE(FacesOf(mesh, 9).triangles.empty());
  const TriangleMesh near = FacesNear(mesh, {Eigen::Vector3f(4, -1, -1), Eigen::Vector3f(7, 2, 2)});
  EXPECT_EQ(near.face_ids, other.face_ids);
}

TEST(NormalAgreement, EqualsBruteForceOverAgreeingTriangles) {
  const SurfaceIndex index(Shards(300));
  const auto points = testing::RandomPoints(1000, {-1, -1, -1}, {1, 1, 1});
  auto normals = testing::RandomPoints(1000, {-1, -1, -1}, {1, 1, 1}, 8);
  for (auto& normal : normals) normal.normalize();
  constexpr double kLimit_m = 0.2;
  const SampleMatch match = MatchSurface(points, normals, index, kLimit_m);
  int second_looks = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double expected = reference::DistanceToMesh(points[i], index.mesh(), [&](std::size_t t) {
      return index.normals()[t].dot(normals[i]) >= 0.5F;
    });
    if (expected <= kLimit_m - testing::kFloat_m) {
      ASSERT_NEAR(match.agreeing_m[i], expected, testing::kFloat_m);
      if (match.agreeing_m[i] > match.nearest_m[i]) ++second_looks;
    } else if (expected > kLimit_m + testing::kFloat_m) {
      ASSERT_TRUE(std::isinf(match.agreeing_m[i]));
    }
  }
  EXPECT_GT(second_looks, 50) << "the scene does not try the second look";
}

}  // namespace
}  // namespace tsdfpp
