// The rasteriser against rays cast through every pixel, one triangle after the other, in double.
#include "eval/tools/rasteriser.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "core/random.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

// Single precision carries 6e-8; a depth is some ten operations away from the vertices.
constexpr double kDepthTolerance = 1e-5;  // relative
// A ray this near to a triangle's border (in barycentric units) may be called either way.
constexpr double kBorder = 1e-4;
// As Rasterise promises: triangles that reach nearer than this are left out.
constexpr double kNearest_m = 0.05;

const Intrinsics kCamera{64, 48, 60.0, 55.0, 31.0, 24.5};

struct RayHit {
  double depth_m = std::numeric_limits<double>::infinity();
  int face = -1;
  bool doubtful = false;  // a border decides
};

// Cramer's rule for o + t d = a + beta (b - a) + gamma (c - a); o is the camera, t the depth.
RayHit CastRay(const TriangleMesh& mesh_W, const Pose& T_CW, double u, double v,
               const Intrinsics& k) {
  const Eigen::Vector3d d((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
  RayHit hit;
  std::vector<std::pair<double, double>> hits;  // depth and distance to the border
  for (std::size_t i = 0; i < mesh_W.triangles.size(); ++i) {
    std::array<Eigen::Vector3d, 3> p_C;
    for (std::size_t c = 0; c < 3; ++c) {
      p_C[c] = T_CW * mesh_W.vertices[mesh_W.triangles[i][c]].cast<double>();
    }
    if (p_C[0].z() < kNearest_m || p_C[1].z() < kNearest_m || p_C[2].z() < kNearest_m) continue;
    Eigen::Matrix3d A;
    A << p_C[1] - p_C[0], p_C[2] - p_C[0], -d;
    if (std::abs(A.determinant()) < 1e-12) continue;
    const Eigen::Vector3d x = A.inverse() * -p_C[0];
    const double inside = std::min({x[0], x[1], 1 - x[0] - x[1]});
    if (inside < -kBorder || x[2] <= 0) continue;
    hits.emplace_back(x[2], inside);
    if (inside >= 0 && x[2] < hit.depth_m) {
      hit.depth_m = x[2];
      hit.face = static_cast<int>(i);
    }
  }
  // A border in front of the surface that was hit, or its own.
  for (const auto& [depth_m, inside] : hits) {
    hit.doubtful |= std::abs(inside) <= kBorder && depth_m <= hit.depth_m;
  }
  return hit;
}

Pose SomeCamera(std::uint64_t seed) {
  const auto draw = UniformDraw(seed, 7, 0);
  const auto more = UniformDraw(seed, 7, 1);
  return reference::MakePose(3.0 * draw[0], {draw[1] - 0.5, draw[2] - 0.5, draw[3] - 0.5},
                             {more[0], more[1], more[2]});
}

// Triangles all over the view and somewhat beyond it, some of them behind the camera.
TriangleMesh RandomMesh(std::uint64_t seed, int triangles, const Pose& T_WC) {
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const auto centre = UniformDraw(seed, 1, static_cast<std::uint64_t>(i));
    const double z = 0.2 + 2.8 * centre[2] - (i % 7 == 0 ? 1.0 : 0.0);
    for (std::uint64_t c = 0; c < 3; ++c) {
      const auto d =
          UniformDraw(seed, 2 + static_cast<std::uint32_t>(c), static_cast<std::uint64_t>(i));
      const Eigen::Vector3d p_C(1.4 * (centre[0] - 0.5) * z + 0.5 * (d[0] - 0.5),
                                1.2 * (centre[1] - 0.5) * z + 0.5 * (d[1] - 0.5),
                                z + 0.5 * (d[2] - 0.5));
      mesh.vertices.push_back((T_WC * p_C).cast<float>());
    }
    const auto first = static_cast<std::uint32_t>(3 * i);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

TEST(Rasteriser, EqualsRaysOnRandomMeshes) {
  int compared = 0;
  int doubtful = 0;
  int hit = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Pose T_WC = SomeCamera(seed);
    const TriangleMesh mesh = RandomMesh(seed, 5 + 4 * static_cast<int>(seed), T_WC);
    const Raster raster = Rasterise(mesh, kCamera, T_WC);
    const Pose T_CW = T_WC.inverse();
    for (int v = 0; v < kCamera.height; ++v) {
      for (int u = 0; u < kCamera.width; ++u) {
        const RayHit expected = CastRay(mesh, T_CW, u, v, kCamera);
        if (expected.doubtful) {
          ++doubtful;
          continue;
        }
        ++compared;
        ASSERT_EQ(raster.face.at<int>(v, u), expected.face)
            << "pixel " << u << " " << v << ", seed " << seed;
        if (expected.face < 0) {
          ASSERT_EQ(raster.depth.at<float>(v, u), 0.0F);
          continue;
        }
        ++hit;
        ASSERT_NEAR(raster.depth.at<float>(v, u), expected.depth_m,
                    kDepthTolerance * expected.depth_m)
            << "pixel " << u << " " << v << ", seed " << seed;
      }
    }
  }
  EXPECT_GT(hit, compared / 4) << "the meshes are hardly in view";
  EXPECT_LT(doubtful, compared / 100) << "the borders hide the comparison";
}

// A plane cut into small triangles: its depth is known in closed form, and nowhere between two
// triangles may the background show through.
TEST(Rasteriser, PlaneIsExactAndWithoutGaps) {
  constexpr int kCells = 40;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto draw = UniformDraw(seed, 3, 0);
    const Pose T_WC = SomeCamera(seed + 100);
    // z = z0 + a x + b y in the camera's frame.
    const double z0 = 1.0 + draw[0];
    const double a = 1.2 * (draw[1] - 0.5);
    const double b = 1.2 * (draw[2] - 0.5);
    TriangleMesh mesh;
    for (int i = 0; i <= kCells; ++i) {
      for (int j = 0; j <= kCells; ++j) {
        const double x = 8.0 * (static_cast<double>(i) / kCells - 0.5);
        const double y = 8.0 * (static_cast<double>(j) / kCells - 0.5);
        const double z = z0 + a * x + b * y;
        mesh.vertices.push_back((T_WC * Eigen::Vector3d(x, y, z)).cast<float>());
      }
    }
    const auto at = [](int i, int j) { return static_cast<std::uint32_t>(i * (kCells + 1) + j); };
    for (int i = 0; i < kCells; ++i) {
      for (int j = 0; j < kCells; ++j) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
    const Raster raster = Rasterise(mesh, kCamera, T_WC);
    for (int v = 0; v < kCamera.height; ++v) {
      for (int u = 0; u < kCamera.width; ++u) {
        const double x = (u - kCamera.cx) / kCamera.fx;
        const double y = (v - kCamera.cy) / kCamera.fy;
        const double expected = z0 / (1 - a * x - b * y);
        ASSERT_GE(raster.face.at<int>(v, u), 0) << "a gap at " << u << " " << v;
        ASSERT_NEAR(raster.depth.at<float>(v, u), expected, kDepthTolerance * expected);
      }
    }
  }
}

// A square whose borders and diagonal run through pixel centres, so that rounding decides.
TEST(Rasteriser, SharedEdgesThroughPixelCentresLeaveNoGap) {
  TriangleMesh mesh;
  const auto corner = [&](double u, double v, double z) {
    mesh.vertices.emplace_back(static_cast<float>((u - kCamera.cx) / kCamera.fx * z),
                               static_cast<float>((v - kCamera.cy) / kCamera.fy * z),
                               static_cast<float>(z));
  };
  corner(3, 5, 1.1);
  corner(43, 5, 1.3);
  corner(43, 45, 1.7);
  corner(3, 45, 1.9);
  corner(23, 25, 1.37);
  for (std::uint32_t i = 0; i < 4; ++i) mesh.triangles.push_back({i, (i + 1) % 4, 4});
  const Raster raster = Rasterise(mesh, kCamera, Pose::Identity());
  for (int v = 6; v < 45; ++v) {
    for (int u = 4; u < 43; ++u) EXPECT_GE(raster.face.at<int>(v, u), 0) << u << " " << v;
  }
}

TEST(Rasteriser, BothSidesAreSeenAndNothingBehindTheCamera) {
  TriangleMesh mesh;
  const auto square = [&](float z) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{-9, -9, z}, {9, -9, z}, {0, 20, z}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  };
  square(-1);     // behind
  square(0.03F);  // nearer than 5 cm
  // Reaches from behind the camera to the front: left out, as documented.
  mesh.vertices.insert(mesh.vertices.end(), {{-9, 0, -1}, {9, 0, -1}, {0, 0, 3}});
  mesh.triangles.push_back({6, 7, 8});
  Raster raster = Rasterise(mesh, kCamera, Pose::Identity());
  EXPECT_EQ(cv::countNonZero(raster.depth), 0);
  EXPECT_EQ(cv::countNonZero(raster.face != -1), 0);
  square(2);
  raster = Rasterise(mesh, kCamera, Pose::Identity());
  EXPECT_EQ(cv::countNonZero(raster.face == 3), kCamera.width * kCamera.height);
  std::swap(mesh.triangles[3][0], mesh.triangles[3][1]);
  raster = Rasterise(mesh, kCamera, Pose::Identity());
  EXPECT_EQ(cv::countNonZero(raster.face == 3), kCamera.width * kCamera.height);
}

TEST(Rasteriser, LowerIndexWinsATie) {
  TriangleMesh mesh = RandomMesh(5, 1, Pose::Identity());
  mesh.vertices = {{-2, -2, 2}, {2, -2, 2}, {0, 3, 2}, {-2, -2, 1}, {2, -2, 1}, {0, 3, 1}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}, {0, 1, 2}, {3, 4, 5}};
  const Raster raster = Rasterise(mesh, kCamera, Pose::Identity());
  EXPECT_EQ(raster.face.at<int>(24, 31), 1);
  mesh.triangles = {{0, 1, 2}, {0, 1, 2}};
  EXPECT_EQ(Rasterise(mesh, kCamera, Pose::Identity()).face.at<int>(24, 31), 0);
}

TEST(Rasteriser, EmptyMeshGivesNothing) {
  const Raster raster = Rasterise({}, kCamera, Pose::Identity());
  EXPECT_EQ(cv::countNonZero(raster.depth), 0);
  EXPECT_EQ(cv::countNonZero(raster.face != -1), 0);
}

TEST(Rasteriser, ThreadsDoNotMatter) {
  const Intrinsics camera{320, 240, 300.0, 300.0, 159.5, 119.5};
  const Pose T_WC = SomeCamera(3);
  const TriangleMesh mesh = RandomMesh(3, 400, T_WC);
  const auto with = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return Rasterise(mesh, camera, T_WC);
  };
  const Raster one = with(1);
  for (const std::size_t threads : {2U, 4U}) {
    const Raster many = with(threads);
    EXPECT_EQ(std::memcmp(one.depth.data, many.depth.data, one.depth.total() * sizeof(float)), 0);
    EXPECT_EQ(std::memcmp(one.face.data, many.face.data, one.face.total() * sizeof(int)), 0);
  }
}

}  // namespace
}  // namespace tsdfpp
