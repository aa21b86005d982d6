// Rims (docs/map.md): beside an object the table is whole, and nothing is made up for it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

constexpr double kRimVoxel_m = 0.01;
constexpr InstanceId kHides = 1;
constexpr double kTop_m = 0.003;
// Half the sides of the table, which ends under the object.
const Eigen::Vector3d kTableHalf_m{0.25, 0.25, 0.1};
// Surface may be this far from the true one,
constexpr double kOff_voxels = 1;
// and this far from what some pixel saw: it goes on through the cube that the pixel sees, whose
// diagonal is 1.7 voxels.
constexpr double kFromSeen_voxels = 1.5;

const Intrinsics kRimCamera{320, 240, 280.0, 280.0, 159.5, 119.5};

MapConfig RimConfig(const char* profile) {
  MapConfig config;
  config.voxel_m = kRimVoxel_m;
  EXPECT_TRUE(config.SetProfile(profile).has_value());
  return config;
}

// An object across the table's far side: beyond it there is no table, which no pixel sees.
reference::Scene TableThatEndsBehind() {
  reference::Scene scene;
  scene.shapes.push_back(reference::Cuboid(
      kBackground, {150, 110, 70},
      reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, kTop_m - kTableHalf_m.z()}),
      kTableHalf_m));
  scene.shapes.push_back(
      reference::Cuboid(kHides, {30, 30, 200}, Pose::Identity(), {0.06, 0.4, 0.12}));
  scene.T_WO[kHides] =
      reference::MakePose(0.05, Eigen::Vector3d::UnitZ(), {0.225, 0, kTop_m + 0.12});
  return scene;
}

Frame SeenFrom(const reference::Scene& scene, double sideways_m, int index) {
  return reference::Render(scene, reference::LookAt({-0.7, sideways_m, 0.6}, {0.05, 0, kTop_m}),
                           index, kRimCamera);
}

void Map(const Frame& frame, MapRepresentation& map) {
  for (const auto& [id, T_WO] : frame.T_WO) map.SetObjectPose(id, T_WO);
  map.Fuse(frame, frame.mask);
}

double DistanceToBox(const Eigen::Vector3d& p, const Eigen::Vector3d& centre,
                     const Eigen::Vector3d& half) {
  const Eigen::Vector3d from = (p - centre).cwiseAbs() - half;
  const double outside = from.cwiseMax(0).norm();
  return outside > 0 ? outside : -from.maxCoeff();
}

// The points of the background that the frame's pixels saw.
void AddSeen(const Frame& frame, std::vector<Eigen::Vector3d>& points_W) {
  const Intrinsics& k = frame.intrinsics;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const double z = frame.depth.at<float>(v, u);
      if (frame.mask.at<std::uint16_t>(v, u) != kBackground || z == 0) continue;
      points_W.push_back(frame.T_WC *
                         Eigen::Vector3d((u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z));
    }
  }
}

class Rims : public ::testing::TestWithParam<std::tuple<Method, const char*>> {
 protected:
  std::unique_ptr<MapRepresentation> NewMap() const {
    return MakeMap(std::get<0>(GetParam()), RimConfig(std::get<1>(GetParam())));
  }
};

const auto kProfiles = ::testing::Values("paper", "close");
INSTANTIATE_TEST_SUITE_P(
    All, Rims,
    ::testing::Combine(::testing::Values(Method::kTsdfpp, Method::kTsdfppAnchored, Method::kVolumes,
                                         Method::kTsdfGuarded),
                       kProfiles));
// One field has one value a voxel, which what comes later may change.
class LayeredRims : public Rims {};
INSTANTIATE_TEST_SUITE_P(Layered, LayeredRims,
                         ::testing::Combine(::testing::Values(Method::kTsdfpp,
                                                              Method::kTsdfppAnchored,
                                                              Method::kVolumes),
                                            kProfiles));

// A sensor's fault, or a hostile image: every pixel is an outline, and its reach is the whole
// image. Looking there for each would take hours.
TEST_P(Rims, AnImageAtTheCameraItselfEnds) {
  const auto map = NewMap();
  Frame frame;
  frame.intrinsics = {1000, 1000, 900.0, 900.0, 499.5, 499.5};
  frame.depth = cv::Mat(1000, 1000, CV_32FC1, cv::Scalar(0.02));
  frame.colour = cv::Mat(1000, 1000, CV_8UC3, cv::Scalar(9, 9, 9));
  frame.mask = cv::Mat(1000, 1000, CV_16UC1, cv::Scalar(kBackground));
  for (int v = 0; v < 1000; ++v) {
    for (int u = v % 2; u < 1000; u += 2) frame.mask.at<std::uint16_t>(v, u) = kHides;
  }
  frame.T_WC = Pose::Identity();
  frame.T_WO[kHides] = Pose::Identity();
  Map(frame, *map);
  Map(frame, *map);
  EXPECT_FALSE(VoxelsOf(*map).FindFault().has_value());
}

TEST_P(Rims, InventNoTable) {
  const auto map = NewMap();
  std::vector<Eigen::Vector3d> seen_W;
  for (int i = 0; i < 6; ++i) {
    const Frame frame = SeenFrom(TableThatEndsBehind(), -0.1 + 0.04 * i, i + 1);
    Map(frame, *map);
    AddSeen(frame, seen_W);
  }
  const TriangleMesh table = map->ObjectMesh(kBackground);
  ASSERT_GT(table.triangles.size(), 1000U);
  const Eigen::Vector3d centre{0, 0, kTop_m - kTableHalf_m.z()};
  double off = 0;
  double from_seen = 0;
  double farthest_x = -1;
  for (const Eigen::Vector3f& vertex : table.vertices) {
    const Eigen::Vector3d p_W = vertex.cast<double>();
    off = std::max(off, std::abs(DistanceToBox(p_W, centre, kTableHalf_m)));
    farthest_x = std::max(farthest_x, p_W.x());
    double nearest = 1;
    for (const Eigen::Vector3d& seen : seen_W) nearest = std::min(nearest, (seen - p_W).norm());
    from_seen = std::max(from_seen, nearest);
  }
  std::cout << off / kRimVoxel_m << " voxels off, " << from_seen / kRimVoxel_m
            << " from what was seen\n";
  EXPECT_LE(off, kOff_voxels * kRimVoxel_m);
  EXPECT_LE(from_seen, kFromSeen_voxels * kRimVoxel_m);
  // It ends under the object, a voxel behind its front at most.
  EXPECT_LT(farthest_x, 0.225 - 0.06 + 0.02 + 2 * kRimVoxel_m);
}

// What was wholly seen before an object came stays what it was, to the bit, where the object hides
// it.
TEST_P(LayeredRims, LeaveWhatWasSeenBefore) {
  const auto map = NewMap();
  reference::Scene bare = TableThatEndsBehind();
  bare.Erase(kHides);
  for (int i = 0; i < 6; ++i) Map(SeenFrom(bare, -0.1 + 0.04 * i, i + 1), *map);
  const auto before = VoxelsOf(*map).ObservedVoxels(kBackground);
  const auto value_at = [&](const Eigen::Vector3i& v) {
    return VoxelsOf(*map).ValueAt(kBackground, v);
  };
  std::vector<VoxelValue> values;
  const auto is_hidden = [](const Eigen::Vector3i& v) {
    const Eigen::Vector3d p = v.cast<double>() * kRimVoxel_m;
    return p.x() > 0.19 && p.x() < 0.25 && std::abs(p.y()) < 0.2 && std::abs(p.z()) < 0.02;
  };
  std::vector<Eigen::Vector3i> hidden;
  for (const Eigen::Vector3i& v : before) {
    if (!is_hidden(v)) continue;
    hidden.push_back(v);
    values.push_back(*value_at(v));
  }
  ASSERT_GT(hidden.size(), 100U);
  for (int i = 0; i < 4; ++i) Map(SeenFrom(TableThatEndsBehind(), -0.1 + 0.04 * i, i + 7), *map);
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    const auto now = value_at(hidden[i]);
    ASSERT_TRUE(now.has_value());
    EXPECT_EQ(now->distance_m, values[i].distance_m);
    EXPECT_EQ(now->weight, values[i].weight);
  }
}

// Seen from where the camera is, the table goes on up to the object: every pixel of it, but for
// those whose table is beyond the image's rim, hits it within a voxel.
TEST_P(Rims, LeaveNoGapBesideAnObject) {
  const auto map = NewMap();
  Frame last;
  for (int i = 0; i < 4; ++i) {
    last = SeenFrom(TableThatEndsBehind(), 0.01 * i, i + 1);
    Map(last, *map);
  }
  RayCastOptions options;
  options.colour = false;
  const RaySurface cast = map->CastRays(last.intrinsics, last.T_WC, options).front();
  int asked = 0;
  int gaps = 0;
  constexpr int kBeside_px = 8;
  for (int v = kBeside_px; v < kRimCamera.height - kBeside_px; ++v) {
    for (int u = kBeside_px; u < kRimCamera.width - kBeside_px; ++u) {
      const float z = last.depth.at<float>(v, u);
      if (last.mask.at<std::uint16_t>(v, u) != kBackground || z == 0) continue;
      const cv::Rect around(u - kBeside_px, v - kBeside_px, 2 * kBeside_px + 1, 2 * kBeside_px + 1);
      if (cv::countNonZero(last.mask(around)) == 0) continue;
      if (cv::countNonZero(last.depth(around)) < around.area()) continue;  // beyond the table
      const float hit = cast.depth.at<float>(v, u);
      ++asked;
      gaps += hit > 0 && hit <= z + kRimVoxel_m ? 0 : 1;
    }
  }
  ASSERT_GT(asked, 500);
  EXPECT_EQ(gaps, 0) << "of " << asked;
}

}  // namespace
}  // namespace tsdfpp
