// Method `surfels` against its reference (tests/reference/surfel_reference.h), which is written
// from docs/map.md alone, and against surfaces in closed form. Longer than most files: one method.
#include <gtest/gtest.h>

#include <cmath>

#include "mapper/methods/surfel_map.h"
#include "tests/mapper/mesh_checks.h"
#include "tests/mapper/toy_scene.h"
#include "tests/reference/surfel_reference.h"

namespace tsdfpp {
namespace {

using reference::LookAt;
using reference::MakePose;
using reference::PlainSurfel;
using reference::Scene;

// Of stored values, which are in single precision, at some decimetres from the origin, after some
// ten means whose terms the reference adds in another order.
constexpr float kStored_m = 2e-6F;
constexpr float kStoredNormal = 1e-5F;
constexpr int kStoredColour = 1;  // of 256 a level

::testing::AssertionResult SameSurfels(const std::vector<Surfel>& actual,
                                       const std::vector<PlainSurfel>& expected) {
  if (actual.size() != expected.size()) {
    return ::testing::AssertionFailure()
           << actual.size() << " surfels, expected " << expected.size();
  }
  for (std::size_t i = 0; i < actual.size(); ++i) {
    const Surfel& a = actual[i];
    const PlainSurfel& e = expected[i];
    bool same = (a.centre - e.centre_L).norm() <= kStored_m &&
                (a.normal - e.normal_L).norm() <= kStoredNormal &&
                std::abs(a.radius_m - e.radius_m) <= kStored_m && a.confidence == e.confidence &&
                a.born == static_cast<std::uint32_t>(e.born);
    for (std::size_t c = 0; c < 3; ++c) {
      same = same && std::abs(a.colour[c] - e.colour[c]) <= kStoredColour;
    }
    if (!same) {
      return ::testing::AssertionFailure()
             << "surfel " << i << " of " << actual.size() << ": at " << a.centre.transpose()
             << ", expected " << e.centre_L.transpose() << "; normal " << a.normal.transpose()
             << ", expected " << e.normal_L.transpose() << "; radius " << a.radius_m
             << ", expected " << e.radius_m << "; confidence " << a.confidence << ", expected "
             << e.confidence;
    }
  }
  return ::testing::AssertionSuccess();
}

// The map and its reference told the same.
class Pair {
 public:
  explicit Pair(const MapConfig& config)
      : map_(config), plain_(config.voxel_m, config.weight_cap) {}

  void SetObjectPose(InstanceId id, const Pose& T_WO) {
    map_.SetObjectPose(id, T_WO);
    plain_.SetObjectPose(id, T_WO);
  }
  void Fuse(const Frame& frame, const cv::Mat& labels) {
    for (const auto& [id, T_WO] : frame.T_WO) SetObjectPose(id, T_WO);
    map_.Fuse(frame, labels);
    plain_.Fuse(frame, labels);
  }
  void Remove(InstanceId id) {
    map_.Remove(id);
    plain_.Remove(id);
  }
  std::size_t Compare(const std::string& after) const {
    std::size_t count = 0;
    for (const InstanceId id : ToyIds()) {
      const std::vector<Surfel>* surfels = map_.SurfelsOf(id);
      EXPECT_TRUE(
          SameSurfels(surfels == nullptr ? std::vector<Surfel>{} : *surfels, plain_.SurfelsOf(id)))
          << "object " << id << " after " << after;
      count += surfels == nullptr ? 0 : surfels->size();
    }
    EXPECT_EQ(map_.FindFault().value_or(""), "") << after;
    return count;
  }
  const SurfelMap& map() const { return map_; }
  const reference::SurfelReference& plain() const { return plain_; }

 private:
  SurfelMap map_;
  reference::SurfelReference plain_;
};

constexpr Intrinsics kTinyCamera{48, 36, 40.0, 41.0, 23.4, 17.7};

// A toy goes somewhere, is seen from somewhere, through holes and with wrong labels now and then.
TEST(Surfels, StoriesLeaveTheSameSurfelsAsTheReference) {
  constexpr std::array<InstanceId, 3> kToys{kBrick, kBall, kTray};
  std::size_t most = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Dice dice(seed);
    MapConfig config;
    config.voxel_m = seed % 2 == 0 ? 0.02 : 0.04;
    config.weight_cap = seed % 3 == 0 ? 2 : 50;
    Pair maps(config);
    Scene scene = TableWithToys();
    for (int i = 0; i < 16; ++i) {
      const InstanceId id = kToys[static_cast<std::size_t>(dice.Whole(3))];
      const int event = dice.Whole(8);
      if (event == 0) {
        maps.Remove(id);
      } else if (event <= 3) {
        Pose& T_WO = scene.T_WO[id];
        T_WO = MakePose(
            dice.Uniform(-2, 2), {0.1 * dice.Uniform(-1, 1), 0, 1},
            {dice.Uniform(-0.12, 0.12), dice.Uniform(-0.12, 0.12), T_WO.translation().z()});
        if (event == 1) maps.SetObjectPose(id, T_WO);
      }
      Frame frame = reference::Render(
          scene, CircleCamera(dice.Uniform(0, 6), dice.Uniform(0.2, 0.5)), i, kTinyCamera);
      cv::Mat labels = frame.mask.clone();
      if (event == 4) {
        frame.depth(cv::Rect(dice.Whole(30), dice.Whole(20), 12, 10)).setTo(0);
        labels(cv::Rect(dice.Whole(30), dice.Whole(20), 6, 4)).setTo(kNoInstance);
        frame.T_WO.erase(id);
      }
      if (event == 5) {
        cv::Mat half = labels(cv::Rect(0, 0, labels.cols, 18));
        half.setTo(kToys[static_cast<std::size_t>(dice.Whole(3))], half == id);
      }
      // Of a sensor, so that normals differ from those of the map.
      if (event == 6) {
        for (float& z : cv::Mat_<float>(frame.depth)) {
          if (z > 0) z += static_cast<float>(dice.Uniform(-0.01, 0.01));
        }
      }
      maps.Fuse(frame, labels);
      most = std::max(
          most, maps.Compare("event " + std::to_string(i) + " of story " + std::to_string(seed)));
      if (::testing::Test::HasFailure()) return;
    }
  }
  EXPECT_GT(most, 300U);
}

TEST(Surfels, RaysMeetWhatTheReferencesRaysMeet) {
  MapConfig config;
  config.voxel_m = 0.02;
  Pair maps(config);
  Scene scene = TableWithToys();
  for (int i = 0; i < 5; ++i) {
    scene.T_WO[kBrick] = MakePose(0.3 + 0.2 * i, Eigen::Vector3d::UnitZ(),
                                  {-0.14 + 0.05 * i, 0.03 - 0.02 * i, kTableTop_m + 0.045});
    const Frame frame = RenderToys(scene, 0.2 + 0.15 * i, i);
    maps.Fuse(frame, frame.mask);
  }
  const Intrinsics camera{61, 45, 55, 54, 30.2, 22.1};
  RayCastOptions options;
  options.surfaces = 4;
  // From above the table, and from amid the toys.
  for (const Pose& T_WC :
       {CircleCamera(0.6, 0.25), LookAt({0.10, -0.03, 0.09}, {-0.1, 0.05, 0.0})}) {
    const auto cast = maps.map().CastRays(camera, T_WC, options);
    std::array<int, 4> hits{};
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const auto expected = maps.plain().Cast(camera, T_WC, u, v);
        for (std::size_t n = 0; n < cast.size(); ++n) {
          const InstanceId id = cast[n].id.at<InstanceId>(v, u);
          ASSERT_EQ(id, n < expected.size() ? expected[n].id : kNoInstance)
              << u << ' ' << v << ", surface " << n;
          if (id == kNoInstance) continue;
          ++hits[n];
          ASSERT_NEAR(cast[n].depth.at<float>(v, u), expected[n].depth, 1e-5);
          const auto& normal = cast[n].normal.at<cv::Vec3f>(v, u);
          const Eigen::Vector3d normal_W(normal[0], normal[1], normal[2]);
          ASSERT_LT((normal_W - expected[n].normal_W).norm(), 1e-5);
        }
      }
    }
    EXPECT_GT(hits[0], 500);
    EXPECT_GT(hits[1], 50);
  }
}

// --- surfaces in closed form -----------------------------------------------------------------

// Depth is in single precision, which at most of a metre rounds by 3e-8 m, and so are centres; the
// ray multiplies it by up to 1.5.
constexpr double kQuantised_m = 2e-7;

Frame PlaneFrame(const Pose& T_WC, const Intrinsics& camera) {
  Scene scene;
  scene.shapes.push_back(reference::Plane(kBackground, {120, 120, 120}, kTableTop_m));
  return reference::Render(scene, T_WC, 1, camera);
}

TEST(Surfels, OfAPlaneLieOnItAndFaceUp) {
  SurfelMap map(MapConfig{});
  const Intrinsics camera{160, 120, 140, 140, 79.5, 59.5};
  for (int i = 0; i < 6; ++i) {
    const Frame frame = PlaneFrame(
        LookAt({0.3 * std::cos(1.0 * i), 0.3 * std::sin(1.0 * i), 0.5}, {0, 0, 0}), camera);
    map.Fuse(frame, frame.mask);
  }
  ASSERT_GT(map.SurfelsOf(kBackground)->size(), 3000U);
  for (const Surfel& surfel : *map.SurfelsOf(kBackground)) {
    ASSERT_NEAR(surfel.centre.z(), kTableTop_m, kQuantised_m);
    // Two ends of a difference of at least 4 mm, each off by the above.
    ASSERT_LT((surfel.normal - Eigen::Vector3f::UnitZ()).norm(), 2 * kQuantised_m / 4e-3);
  }
}

// Rays from elsewhere, closer together than the pixels that were fused, meet discs wherever the
// plane was seen; so does a point that is looked up in the hexagons of the mesh.
TEST(Surfels, CoverAPlaneWithoutHoles) {
  const Intrinsics camera{160, 120, 140, 140, 79.5, 59.5};
  for (const double voxel_m :
       {0.004, 0.01, 0.03}) {  // a pixel of some 4 mm is more, less, far less
    MapConfig config;
    config.voxel_m = voxel_m;
    SurfelMap map(config);
    const Frame frame = PlaneFrame(LookAt({0.2, 0.1, 0.5}, {0, 0, 0}), camera);
    for (int i = 0; i < kStableSightings; ++i) map.Fuse(frame, frame.mask);
    const Intrinsics fine{400, 400, 900, 900, 199.5, 199.5};
    const RaySurface cast = map.CastRays(fine, LookAt({0.01, 0, 0.5}, {0, 0, 0}), {}).front();
    EXPECT_EQ(cv::countNonZero(cast.depth == 0), 0) << voxel_m;

    const TriangleMesh mesh = map.SceneMesh();
    std::vector<std::uint8_t> is_covered(40UL * 40UL, 0);  // points 5 mm apart
    for (const auto& triangle : mesh.triangles) {
      Eigen::Matrix<double, 3, 2> p;
      for (int c = 0; c < 3; ++c) {
        p.row(c) = mesh.vertices[triangle[static_cast<std::size_t>(c)]].head<2>().cast<double>();
      }
      const auto side = [](const auto& a, const auto& b, const Eigen::RowVector2d& q) {
        return (b.x() - a.x()) * (q.y() - a.y()) - (b.y() - a.y()) * (q.x() - a.x());
      };
      for (std::size_t i = 0; i < is_covered.size(); ++i) {
        const Eigen::RowVector2d q(-0.1 + 0.005 * static_cast<double>(i % 40),
                                   -0.1 + 0.005 * static_cast<double>(i / 40));
        const bool is_in = side(p.row(0), p.row(1), q) >= 0 && side(p.row(1), p.row(2), q) >= 0 &&
                           side(p.row(2), p.row(0), q) >= 0;
        is_covered[i] |= is_in ? 1 : 0;
      }
    }
    EXPECT_EQ(std::count(is_covered.begin(), is_covered.end(), 0), 0) << voxel_m;
  }
}

TEST(Surfels, OfABallLieOnItAndFaceOut) {
  constexpr double kRadius_m = 0.15;
  const Eigen::Vector3d centre(0.01, 0.02, 0.2);
  Scene scene;
  scene.shapes.push_back(reference::Sphere(kBall, {30, 30, 200}, centre, kRadius_m));
  const Intrinsics camera{160, 120, 140, 140, 79.5, 59.5};
  SurfelMap map(MapConfig{});
  for (int i = 0; i < 24; ++i) {
    const double angle = 0.26 * i + 0.1;
    const Pose T_WC = LookAt(
        centre + Eigen::Vector3d(0.5 * std::cos(angle), 0.5 * std::sin(angle), 0.15), centre);
    const Frame frame = reference::Render(scene, T_WC, i, camera);
    map.Fuse(frame, frame.mask);
  }
  // A surfel is the mean over a disc of 5 mm: the ball falls off by 0.08 mm at its edge, and a
  // pixel at the rim stands for much more.
  constexpr double kMean_m = 2e-4;
  constexpr double kWorst_m = 4e-3;
  constexpr double kMeanTurn_rad = 0.05;
  double off = 0;
  double worst = 0;
  double turn = 0;
  int count = 0;
  for (const Surfel& surfel : *map.SurfelsOf(kBall)) {
    if (!surfel.is_stable()) continue;
    const Eigen::Vector3d out = surfel.centre.cast<double>() - centre;
    const double error = std::abs(out.norm() - kRadius_m);
    off += error;
    worst = std::max(worst, error);
    turn += std::acos(std::min(1.0, out.normalized().dot(surfel.normal.cast<double>())));
    ++count;
  }
  ASSERT_GT(count, 1000);
  EXPECT_LT(off / count, kMean_m);
  EXPECT_LT(worst, kWorst_m);
  EXPECT_LT(turn / count, kMeanTurn_rad);
}

TEST(Surfels, AStaticSceneSeenAHundredTimesDoesNotGrow) {
  SurfelMap map(ToyConfig());
  const Frame frame = RenderToys(TableWithToys(), 0.4);
  std::vector<std::size_t> first;
  for (int i = 0; i < 100; ++i) {
    map.Fuse(frame, frame.mask);
    for (std::size_t k = 0; k < ToyIds().size(); ++k) {
      const std::size_t size = map.SurfelsOf(ToyIds()[k])->size();
      if (i == 0) first.push_back(size);
      // A surfel that no pixel is nearest to, or whose normal is another, goes when its time is up,
      // and where it alone was, another one comes.
      ASSERT_LE(size, first[k]) << "frame " << i;
      ASSERT_GE(size, first[k] * 9 / 10) << "frame " << i;
    }
  }
  EXPECT_GT(first[0], 300U);
}

// --- what goes and what stays ----------------------------------------------------------------

std::size_t CountOf(const SurfelMap& map, InstanceId id) {
  const std::vector<Surfel>* surfels = map.SurfelsOf(id);
  return surfels == nullptr ? 0 : surfels->size();
}

TEST(Surfels, WhatIsSeenThroughGoesAndWhatIsHiddenStays) {
  SurfelMap map(ToyConfig());
  const Frame bare = RenderToys(TableOnly(), 0.4);
  for (int i = 0; i < 3; ++i) map.Fuse(bare, bare.mask);
  const std::vector<Surfel> table = *map.SurfelsOf(kBackground);
  // The brick stands on the table, which it hides, for long.
  Scene scene = TableOnly();
  AddBrick(scene, 0.3, {0, 0, kTableTop_m + 0.045});
  const Frame hidden = RenderToys(scene, 0.4);
  for (int i = 0; i < 30; ++i) map.Fuse(hidden, hidden.mask);
  // Lists keep their order, and what comes new stands at the end.
  const std::vector<Surfel>& now = *map.SurfelsOf(kBackground);
  ASSERT_GE(now.size(), table.size());
  for (std::size_t i = 0; i < table.size(); ++i) {
    ASSERT_LT((now[i].centre - table[i].centre).norm(), 0.1 * kToyVoxel_m) << i;
  }
  EXPECT_LT(now.size() - table.size(), table.size() / 50);
  EXPECT_GT(CountOf(map, kBrick), 20U);
  // It is gone, without a word.
  map.Fuse(bare, bare.mask);
  EXPECT_GE(CountOf(map, kBackground), table.size());
  const Eigen::Vector3d eye = bare.T_WC.translation();
  for (const Surfel& surfel : *map.SurfelsOf(kBrick)) {
    const Eigen::Vector3d p = surfel.centre.cast<double>();
    const double range_m = (p - eye).norm();
    const double cosine = (eye.z() - p.z()) / range_m;
    const double in_front_m = (p.z() - kTableTop_m) / cosine;
    // A pixel that is asked is up to 1.5 rows lower, where the table is nearer; a tenth for what
    // the row's own slope changes.
    const double row_m = range_m / bare.intrinsics.fy;
    const double nearer_m = 1.1 * 1.5 * row_m * std::sqrt(1 - cosine * cosine) / cosine;
    ASSERT_LT(in_front_m, kSurfelSlack_voxels * kToyVoxel_m + nearer_m) << p.transpose();
  }
}

TEST(Surfels, WhatIsSeenOnceIsNotShownAndGoesInTime) {
  SurfelMap map(ToyConfig());
  const Frame once = RenderToys(TableOnly(), 0.4);
  map.Fuse(once, once.mask);
  EXPECT_GT(CountOf(map, kBackground), 300U);
  EXPECT_TRUE(map.SceneMesh().triangles.empty());
  Frame nothing = once;
  nothing.depth = cv::Mat::zeros(once.depth.size(), CV_32FC1);
  for (std::uint32_t i = 1; i < kFramesToBeStable; ++i) map.Fuse(nothing, nothing.mask);
  EXPECT_GT(CountOf(map, kBackground), 300U);
  map.Fuse(nothing, nothing.mask);
  EXPECT_EQ(CountOf(map, kBackground), 0U);
  EXPECT_TRUE(map.Objects().empty());
}

TEST(Surfels, APoseMovesTheFrameAndNoValue) {
  SurfelMap map(ToyConfig());
  const Frame frame = RenderToys(TableWithToys(), 0.4);
  for (int i = 0; i < 2; ++i) {
    for (const auto& [id, T_WO] : frame.T_WO) map.SetObjectPose(id, T_WO);
    map.Fuse(frame, frame.mask);
  }
  const std::vector<Surfel> before = *map.SurfelsOf(kBrick);
  const TriangleMesh mesh = map.ObjectMesh(kBrick);
  Dice dice(3);
  Pose T_WO;
  for (int i = 0; i < 1000; ++i) {
    T_WO = MakePose(dice.Uniform(-3, 3), {0.3, dice.Uniform(-1, 1), 0.4},
                    {dice.Uniform(-1, 1), dice.Uniform(-1, 1), 0});
    map.SetObjectPose(kBrick, T_WO);
  }
  EXPECT_EQ(*map.SurfelsOf(kBrick), before);
  const Pose T_WL = T_WO * frame.T_WO.at(kBrick).inverse();
  const TriangleMesh moved = map.ObjectMesh(kBrick);
  ASSERT_EQ(moved.vertices.size(), mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d expected = T_WL * mesh.vertices[i].cast<double>();
    ASSERT_LT((moved.vertices[i].cast<double>() - expected).norm(), 1e-6);
  }
}

// The sides of a hexagon touch the disc from outside, and it faces where the normal does.
TEST(Surfels, AreHexagonsInTheMesh) {
  SurfelMap map(ToyConfig());
  const Frame frame = RenderToys(TableWithToys(), 0.4);
  for (int i = 0; i < 2; ++i) map.Fuse(frame, frame.mask);
  std::vector<Surfel> stable;
  for (const Surfel& surfel : *map.SurfelsOf(kBall)) {
    if (surfel.is_stable()) stable.push_back(surfel);
  }
  const TriangleMesh mesh = map.ObjectMesh(kBall);
  ASSERT_GT(stable.size(), 5U);
  ASSERT_EQ(mesh.triangles.size(), 4 * stable.size());
  ASSERT_EQ(mesh.vertices.size(), 6 * stable.size());
  for (std::size_t i = 0; i < stable.size(); ++i) {
    double area = 0;
    for (std::size_t t = 4 * i; t < 4 * i + 4; ++t) {
      const Eigen::Vector3d normal = NormalOf(mesh, t);
      area += normal.norm() / 2;
      ASSERT_GT(normal.normalized().dot(stable[i].normal.cast<double>()), 0.9999);
    }
    const double r = static_cast<double>(stable[i].radius_m);
    ASSERT_NEAR(area, 2 * std::sqrt(3.0) * r * r, 1e-3 * r * r);
    for (std::size_t k = 0; k < 6; ++k) {
      const Eigen::Vector3f middle =
          (mesh.vertices[6 * i + k] + mesh.vertices[6 * i + (k + 1) % 6]) / 2;
      ASSERT_NEAR((middle - stable[i].centre).norm(), stable[i].radius_m, 1e-5);
    }
  }
}

}  // namespace
}  // namespace tsdfpp
