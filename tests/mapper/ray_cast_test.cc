// Ray casting: against tiny steps, closed forms, copies of the map without what is in front.
// Longer than most files: each of these for the same camera and scenes.
#include <gtest/gtest.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "mapper/map_representation.h"
#include "mapper/methods/cast_by_removal.h"
#include "tests/mapper/map_snapshot.h"
#include "tests/mapper/methods_of_tests.h"
#include "tests/mapper/toy_scene.h"
#include "tests/reference/ray_reference.h"

namespace tsdfpp {
namespace {

using reference::LookAt;
using reference::MakePose;
using reference::Scene;

const Intrinsics kCamera{96, 72, 80.0, 80.0, 47.5, 35.5};

void SetPosesAndFuse(MapRepresentation& map, const Frame& frame) {
  for (const auto& [id, T_WO] : frame.T_WO) map.SetObjectPose(id, T_WO);
  map.Fuse(frame, frame.mask);
}

// A brick drives in a curve, the ball ends up in the tray, the camera follows.
std::unique_ptr<MapRepresentation> DrivenToys(Method method, const MapConfig& config,
                                              bool moving = true) {
  auto map = MakeMap(method, config);
  Scene scene = TableWithToys();
  for (int i = 0; i < 4; ++i) {
    if (moving)
      scene.T_WO[kBrick] = MakePose(0.3 + 0.2 * i, Eigen::Vector3d::UnitZ(),
                                    {-0.14 + 0.05 * i, 0.03 - 0.02 * i, kTableTop_m + 0.045});
    if (moving && i == 3) scene.T_WO[kBall].translation() = Eigen::Vector3d(0.07, 0.1, 0.07);
    SetPosesAndFuse(*map, RenderToys(scene, 0.2 + 0.15 * i, i));
  }
  return map;
}

float DepthAt(const RaySurface& surface, int v, int u) { return surface.depth.at<float>(v, u); }
InstanceId IdAt(const RaySurface& surface, int v, int u) {
  return surface.id.at<std::uint16_t>(v, u);
}
Eigen::Vector3d NormalAt(const RaySurface& surface, int v, int u) {
  const auto n = surface.normal.at<cv::Vec3f>(v, u);
  return {n[0], n[1], n[2]};
}

std::string BytesOf(const std::vector<RaySurface>& surfaces) {
  std::string bytes;
  for (const RaySurface& surface : surfaces) {
    for (const cv::Mat& image : {surface.depth, surface.normal, surface.colour, surface.id}) {
      bytes.append(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize());
    }
  }
  return bytes;
}

class RayCast : public ::testing::TestWithParam<Method> {};
TSDFPP_FOR_EVERY_METHOD(RayCast);
// Beside a reference that walks through voxels.
class RayCastInVoxels : public ::testing::TestWithParam<Method> {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(RayCastInVoxels);

bool KeepsOneSurface(Method method) {
  return IsOneField(method) || method == Method::kTsdfppLiteral;
}

// Whether the reference can say anything of what was hit.
bool IsKnown(const reference::RayReference& truth, const RaySurface& cast, const Intrinsics& k,
             const Pose& T_WC, int v, int u) {
  if (IdAt(cast, v, u) == kNoInstance) return true;
  const Eigen::Vector3d ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1);
  return truth.Knows(IdAt(cast, v, u), T_WC * (DepthAt(cast, v, u) * ray));
}

// Of the linear interpolation between the reference's steps and of single precision.
constexpr double kDepthTolerance_voxels = 0.01;
// Rays that graze a surface or an edge of what is observed, where a rounding decides.
constexpr double kGrazingShare = 0.005;
// `tsdf++/literal` mixes objects in one cube, and so does `tsdf/guarded`, whose guarded voxels lie
// beside others that took another object's distance: there the distance jumps and may change its
// sign twice within a third of a ray's way.
constexpr double kMixedShare = 0.015;
bool MixesObjects(Method method) {
  return method == Method::kTsdfppLiteral || method == Method::kTsdfGuarded;
}
constexpr double kNormalTolerance = 0.02;

TEST_P(RayCastInVoxels, AgreesWithTinySteps) {
  const MapConfig config = ToyConfig();
  // A move in one field leaves voxels without a label, of which the interface does not tell.
  const bool moving = !IsOneField(GetParam());
  const auto map = DrivenToys(GetParam(), config, moving);
  const reference::RayReference truth(*map, GetParam(), config, ToyBox(), ToyIds());
  const int surfaces = KeepsOneSurface(GetParam()) ? 1 : 2;
  RayCastOptions options;
  options.surfaces = surfaces;
  // Of the whole table, and with a long lens, whose tiles are smaller than blocks.
  Intrinsics tele = kCamera;
  tele.fx = tele.fy = 400;
  for (const Intrinsics& camera : {kCamera, tele}) {
    for (const double angle : {0.5, 2.6}) {
      const Pose T_WC = CircleCamera(angle, 0.3);
      const auto cast = map->CastRays(camera, T_WC, options);
      ASSERT_EQ(static_cast<int>(cast.size()), surfaces);
      std::vector<int> hits(2, 0);
      int different = 0;
      int pixels = 0;
      const auto agrees = [&](int v, int u) {
        std::vector<InstanceId> without;
        for (const RaySurface& surface : cast) {
          const auto expected = truth.Cast(camera, T_WC, u, v, 1.2, without);
          if (!IsKnown(truth, surface, camera, T_WC, v, u)) return true;
          ++pixels;
          if (!expected) return IdAt(surface, v, u) == kNoInstance;
          ++hits[without.size()];
          const bool same =
              IdAt(surface, v, u) == expected->id &&
              std::abs(DepthAt(surface, v, u) - expected->depth) <
                  kDepthTolerance_voxels * kToyVoxel_m &&
              (NormalAt(surface, v, u) - expected->normal_W).norm() < kNormalTolerance;
          if (!same) return false;
          without.push_back(expected->id);
        }
        return true;
      };
      for (int v = 0; v < camera.height; v += 2) {
        for (int u = 0; u < camera.width; u += 2) different += agrees(v, u) ? 0 : 1;
      }
      EXPECT_GT(hits[0], 500) << "the camera sees too little";
      if (surfaces > 1) {
        EXPECT_GT(hits[1], 20) << "too little behind the toys";
      }
      const double share = MixesObjects(GetParam()) ? kMixedShare : kGrazingShare;
      EXPECT_LE(different, share * pixels) << "of " << pixels << ", f " << camera.fx;
    }
  }
}

// What a map of several frames costs in depth, on scenes with a closed form.
struct Errors {
  double median_voxels = 0;
  double worst_voxels = 0;
  double normal_deg = 0;  // median
  int pixels = 0;
};

Errors ErrorsOf(const Scene& scene, Method method) {
  MapConfig config;  // 1 cm
  const auto map = MakeMap(method, config);
  const Intrinsics camera{192, 144, 160, 160, 95.5, 71.5};
  const auto eye = [](double angle) {
    return LookAt({0.6 * std::cos(angle), 0.6 * std::sin(angle), 0.55}, {0, 0, 0.03});
  };
  for (int i = 0; i < 8; ++i) {
    SetPosesAndFuse(*map, reference::Render(scene, eye(0.1 * i), i, camera));
  }
  const Frame truth = reference::Render(scene, eye(0.35), 9, camera);
  const RaySurface cast = map->CastRays(camera, truth.T_WC, {}).front();
  std::vector<double> errors;
  std::vector<double> turns;
  for (int v = 4; v < camera.height - 4; ++v) {
    for (int u = 4; u < camera.width - 4; ++u) {
      // Away from where another id, another face or nothing is near: a voxel is 2 to 3 pixels.
      bool edge = false;
      const float z = truth.depth.at<float>(v, u);
      for (const auto& [dv, du] :
           {std::pair(0, 1), std::pair(1, 0), std::pair(1, 1), std::pair(1, -1)}) {
        for (int k = 1; k <= 4; ++k) {
          const float a = truth.depth.at<float>(v + k * dv, u + k * du);
          const float b = truth.depth.at<float>(v - k * dv, u - k * du);
          edge = edge || a == 0 || b == 0 || std::abs(1 / a + 1 / b - 2 / z) > 0.01;
        }
      }
      if (edge || z == 0) continue;
      EXPECT_EQ(IdAt(cast, v, u), truth.mask.at<std::uint16_t>(v, u)) << u << " " << v;
      errors.push_back(std::abs(DepthAt(cast, v, u) - z) / config.voxel_m);
      const auto point = [&](int pv, int pu) -> Eigen::Vector3d {
        return truth.depth.at<float>(pv, pu) *
               Eigen::Vector3d((pu - camera.cx) / camera.fx, (pv - camera.cy) / camera.fy, 1);
      };
      const Eigen::Vector3d normal_C =
          (point(v + 1, u) - point(v - 1, u)).cross(point(v, u + 1) - point(v, u - 1)).normalized();
      const double cosine =
          std::clamp((truth.T_WC.linear() * normal_C).dot(NormalAt(cast, v, u)), -1.0, 1.0);
      turns.push_back(std::acos(cosine) * 180 / std::numbers::pi);
    }
  }
  std::sort(errors.begin(), errors.end());
  std::sort(turns.begin(), turns.end());
  if (errors.empty()) return {};
  return {errors[errors.size() / 2], errors.back(), turns[turns.size() / 2],
          static_cast<int>(errors.size())};
}

// Bounds for a map of 8 frames at 160 pixels of focal length: fusion along rays that differ by 40
// degrees bends a projective distance.
constexpr double kMedianError_voxels = 0.03;
constexpr double kWorstError_voxels = 0.4;
constexpr double kMedianNormal_deg = 3.0;

void ExpectNear(const Scene& scene, Method method, int least_pixels) {
  const Errors errors = ErrorsOf(scene, method);
  std::cout << MethodName(method) << ": median " << errors.median_voxels << ", worst "
            << errors.worst_voxels << " voxels, normals " << errors.normal_deg << " degrees, "
            << errors.pixels << " pixels\n";
  EXPECT_GT(errors.pixels, least_pixels);
  EXPECT_LE(errors.median_voxels, kMedianError_voxels);
  EXPECT_LE(errors.worst_voxels, kWorstError_voxels);
  EXPECT_LE(errors.normal_deg, kMedianNormal_deg);
}

TEST_P(RayCast, SeesATiltedPlane) {
  Scene scene;
  scene.shapes.push_back(reference::Cuboid(
      kBackground, {150, 110, 70}, MakePose(0.2, {1, 0.3, 0}, {0, 0, -0.1}), {0.4, 0.4, 0.1}));
  ExpectNear(scene, GetParam(), 10000);
}

TEST_P(RayCast, SeesASphere) {
  Scene scene;
  scene.shapes.push_back(reference::Sphere(kBall, {200, 60, 60}, Eigen::Vector3d::Zero(), 0.2));
  scene.T_WO[kBall] = MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, 0.02});
  ExpectNear(scene, GetParam(), 1200);
}

TEST_P(RayCast, SeesBoxesOnATable) {
  Scene scene = TableOnly();
  scene.shapes.push_back(
      reference::Cuboid(kBrick, {200, 30, 30}, Pose::Identity(), {0.075, 0.05, 0.045}));
  scene.T_WO[kBrick] = MakePose(0.3, Eigen::Vector3d::UnitZ(), {-0.05, 0.03, kTableTop_m + 0.045});
  ExpectNear(scene, GetParam(), 3000);
}

// The n-th surface is what its definition says, to the bit, by a map that was told to remove.
TEST_P(RayCast, WhatIsBehindIsWhatARemovalShows) {
  for (const bool relist : {false, true}) {
    MapConfig config = ToyConfig();
    config.relist_on_removal = relist;
    const auto map = DrivenToys(GetParam(), config);
    const Pose T_WC = CircleCamera(0.6, 0.25);
    RayCastOptions options;
    options.surfaces = 3;
    const auto cast = map->CastRays(kCamera, T_WC, options);
    ASSERT_EQ(cast.size(), 3U);
    int seconds = 0;
    int thirds = 0;
    for (int v = 0; v < kCamera.height; ++v) {
      for (int u = 0; u < kCamera.width; ++u) {
        const InstanceId second = IdAt(cast[1], v, u);
        if (IdAt(cast[0], v, u) == kNoInstance) {
          EXPECT_EQ(second, kNoInstance);
        }
        seconds += second != kNoInstance ? 1 : 0;
        thirds += IdAt(cast[2], v, u) != kNoInstance ? 1 : 0;
      }
    }
    const bool layered = !KeepsOneSurface(GetParam());
    EXPECT_GT(seconds, layered ? 200 : -1);
    // With K = 2 a third object is in no list, so that what is active there hides it.
    EXPECT_GT(thirds, layered && GetParam() != Method::kTsdfpp ? 20 : -1);
    for (const InstanceId first : ToyIds()) {
      const auto without = map->Clone();
      without->Remove(first);
      const RaySurface alone = without->CastRays(kCamera, T_WC, {}).front();
      int different = 0;
      for (int v = 0; v < kCamera.height; ++v) {
        for (int u = 0; u < kCamera.width; ++u) {
          if (IdAt(cast[0], v, u) != first) continue;
          const bool same = IdAt(cast[1], v, u) == IdAt(alone, v, u) &&
                            DepthAt(cast[1], v, u) == DepthAt(alone, v, u) &&
                            NormalAt(cast[1], v, u) == NormalAt(alone, v, u) &&
                            cast[1].colour.at<cv::Vec3b>(v, u) == alone.colour.at<cv::Vec3b>(v, u);
          different += same ? 0 : 1;
        }
      }
      EXPECT_EQ(different, 0) << "pixels of " << first;
    }
  }
}

TEST_P(RayCast, MoreSurfacesThanLayersAreThere) {
  MapConfig config = ToyConfig();
  if (GetParam() == Method::kTsdfppAnchored) config.layers = 1;
  const auto map = DrivenToys(GetParam(), config);
  const Pose T_WC = CircleCamera(0.6, 0.25);
  RayCastOptions two;
  two.surfaces = 2;
  RayCastOptions one;
  const auto cast = map->CastRays(kCamera, T_WC, two);
  const auto by_removal =
      CastByRemoval(*map, map->CastRays(kCamera, T_WC, one), kCamera, T_WC, two);
  EXPECT_TRUE(BytesOf(cast) == BytesOf(by_removal));
}

TEST_P(RayCast, ThreadsAndInstructionSetsDoNotChangeABit) {
  const auto map = DrivenToys(GetParam(), ToyConfig());
  const Intrinsics camera{157, 90, 130.0, 131.0, 77.5, 44.0};  // tiles that do not fill the image
  RayCastOptions options;
  options.surfaces = 2;
  const auto cast = [&] { return BytesOf(map->CastRays(camera, CircleCamera(0.4), options)); };
  const std::string bytes = cast();
  for (const std::size_t threads : {1U, 2U, 4U}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_TRUE(cast() == bytes) << threads << " threads";
  }
  for (std::int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    const std::int64_t target = left & -left;
    hwy::SetSupportedTargetsForTest(target);
    ASSERT_EQ(hwy::SupportedTargets(), target);
    const std::string now = cast();
    hwy::SetSupportedTargetsForTest(0);
    EXPECT_TRUE(now == bytes) << hwy::TargetName(target);
  }
}

TEST_P(RayCast, ColoursAreTheSurfaces) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  for (int i = 0; i < 4; ++i) {
    SetPosesAndFuse(*map, RenderToys(TableWithToys(), 0.1 + 0.1 * i, i));
  }
  const Frame frame = RenderToys(TableWithToys(), 0.25);
  const RaySurface cast = map->CastRays(frame.intrinsics, frame.T_WC, {}).front();
  // Shades vary by 30 levels within some 8 cm; near the toys' edges colours of two faces mix.
  constexpr double kLevels = 10;
  double sum = 0;
  int count = 0;
  for (int v = 0; v < frame.intrinsics.height; ++v) {
    for (int u = 0; u < frame.intrinsics.width; ++u) {
      const InstanceId id = IdAt(cast, v, u);
      if (id == kNoInstance) {
        EXPECT_EQ(cast.colour.at<cv::Vec3b>(v, u), cv::Vec3b(0, 0, 0));
        continue;
      }
      if (id != frame.mask.at<std::uint16_t>(v, u)) continue;
      for (int c = 0; c < 3; ++c) {
        sum += std::abs(cast.colour.at<cv::Vec3b>(v, u)[c] - frame.colour.at<cv::Vec3b>(v, u)[c]);
        ++count;
      }
    }
  }
  ASSERT_GT(count, 3000);
  EXPECT_LT(sum / count, kLevels);
  RayCastOptions without;
  without.colour = false;
  EXPECT_TRUE(map->CastRays(frame.intrinsics, frame.T_WC, without).front().colour.empty());
}

TEST_P(RayCast, AnEmptyMapShowsNothing) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  RayCastOptions options;
  options.surfaces = 2;
  for (const RaySurface& surface : map->CastRays(kCamera, CircleCamera(0), options)) {
    EXPECT_EQ(cv::countNonZero(surface.depth), 0);
    EXPECT_EQ(cv::countNonZero(surface.id != kNoInstance), 0);
  }
}

// The camera is amid the toys, and just below the table's surface, which is behind it.
TEST_P(RayCast, NothingIsSeenBehindTheCamera) {
  const auto map = DrivenToys(GetParam(), ToyConfig(), !IsOneField(GetParam()));
  for (const Pose& T_WC :
       {LookAt({0.10, -0.03, 0.09}, {-0.1, 0.05, 0.0}),
        LookAt({-0.2, -0.15, kTableTop_m - 1.5 * kToyVoxel_m}, {-0.1, -0.1, -1})}) {
    RayCastOptions options;
    options.surfaces = 2;
    const std::string expected = BytesOf(map->CastRays(kCamera, T_WC, options));
    for (const double near_m : {-1.0, -std::numeric_limits<double>::infinity(),
                                std::numeric_limits<double>::quiet_NaN()}) {
      SCOPED_TRACE(near_m);
      options.near_m = near_m;
      const std::vector<RaySurface> cast = map->CastRays(kCamera, T_WC, options);
      for (const RaySurface& surface : cast) EXPECT_EQ(cv::countNonZero(surface.depth < 0), 0);
      EXPECT_TRUE(BytesOf(cast) == expected);
    }
  }
}

// From amid the toys, with blocks before, beside and behind the camera.
TEST_P(RayCastInVoxels, NearSurfacesAreSeenFromCloseBy) {
  const MapConfig config = ToyConfig();
  const bool moving = !IsOneField(GetParam());
  const auto map = DrivenToys(GetParam(), config, moving);
  const Pose T_WC = LookAt({0.10, -0.03, 0.09}, {-0.1, 0.05, 0.0});
  const reference::RayReference truth(*map, GetParam(), config, ToyBox(), ToyIds());
  const RaySurface cast = map->CastRays(kCamera, T_WC, {}).front();
  int different = 0;
  int pixels = 0;
  for (int v = 0; v < kCamera.height; v += 3) {
    for (int u = 0; u < kCamera.width; u += 3) {
      const auto expected = truth.Cast(kCamera, T_WC, u, v, 0.8);
      if (!IsKnown(truth, cast, kCamera, T_WC, v, u)) continue;
      ++pixels;
      const double depth = expected ? expected->depth : 0;
      if (std::abs(DepthAt(cast, v, u) - depth) > kDepthTolerance_voxels * kToyVoxel_m) ++different;
    }
  }
  EXPECT_LE(different, kGrazingShare * pixels) << "of " << pixels;
  RayCastOptions beyond;
  beyond.near_m = 0.15;
  const RaySurface far = map->CastRays(kCamera, T_WC, beyond).front();
  int hits = 0;
  int other_roots = 0;
  for (int v = 0; v < kCamera.height; ++v) {
    for (int u = 0; u < kCamera.width; ++u) {
      if (DepthAt(far, v, u) != 0) {
        EXPECT_GE(DepthAt(far, v, u), 0.15F);
      }
      if (DepthAt(cast, v, u) > 0.15F) {
        ++hits;
        // Begun inside a cube, its root is found by other roundings.
        const float apart = DepthAt(far, v, u) - DepthAt(cast, v, u);
        if (std::abs(apart) > kDepthTolerance_voxels * kToyVoxel_m) ++other_roots;
      }
    }
  }
  EXPECT_LE(other_roots, MixesObjects(GetParam()) ? kMixedShare * hits : 0) << "of " << hits;
}

}  // namespace
}  // namespace tsdfpp
