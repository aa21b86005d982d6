// The sanity of the visible scene on scenes whose true answer is known in closed form.
#include "eval/score/scene_sanity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

constexpr double kSanityVoxel_m = 0.01;
constexpr InstanceId kBrick = 1;
const Intrinsics kSanityCamera{160, 120, 140.0, 140.0, 79.5, 59.5};

// A brick on a slab; both boxes, so that twelve triangles each are exactly the true surface.
reference::Scene BrickOnSlab() {
  reference::Scene scene;
  scene.shapes.push_back(reference::Cuboid(
      kBackground, {150, 110, 70}, reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, -0.05}),
      {0.40, 0.35, 0.05}));
  scene.shapes.push_back(
      reference::Cuboid(kBrick, {200, 30, 30}, Pose::Identity(), {0.12, 0.08, 0.06}));
  scene.T_WO[kBrick] = reference::MakePose(0.4, Eigen::Vector3d::UnitZ(), {0.02, 0, 0.06});
  return scene;
}

Pose Camera(double angle_rad = -1.4) {
  return reference::LookAt({0.7 * std::cos(angle_rad), 0.7 * std::sin(angle_rad), 0.6},
                           {0, 0, 0.02});
}

// The boxes' surface in the world, with face ids.
TriangleMesh TrueMesh(const reference::Scene& scene) {
  TriangleMesh mesh;
  for (const reference::Shape& shape : scene.shapes) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    const Pose T_WS = scene.ObjectPose(shape.id) * shape.T_OS;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d sign((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                                 (corner & 4) != 0 ? 1 : -1);
      mesh.vertices.push_back((T_WS * sign.cwiseProduct(shape.half_m)).cast<float>());
    }
    constexpr std::array<std::array<std::uint32_t, 4>, 6> kFaces{
        {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
    for (const auto& f : kFaces) {
      mesh.triangles.push_back({first + f[0], first + f[1], first + f[2]});
      mesh.triangles.push_back({first + f[0], first + f[2], first + f[3]});
    }
    mesh.face_ids.resize(mesh.triangles.size(), shape.id);
  }
  return mesh;
}

TriangleMesh Shifted(TriangleMesh mesh, const Eigen::Vector3d& by_W) {
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex += by_W.cast<float>();
  return mesh;
}

std::deque<Frame> Views(const reference::Scene& scene, int count = 3) {
  std::deque<Frame> frames;
  for (int i = 0; i < count; ++i) {
    frames.push_back(reference::Render(scene, Camera(-1.4 + 0.01 * i), i + 1, kSanityCamera));
  }
  return frames;
}

SanityScores SanityOf(const TriangleMesh& mesh, const std::deque<Frame>& recent, double voxel_m) {
  const Raster raster = Rasterise(mesh, recent.back().intrinsics, recent.back().T_WC);
  return ScoreSanity(mesh, raster, recent, voxel_m);
}

int Count(const cv::Mat& pixels) { return cv::countNonZero(pixels); }

int MappedOf(const std::deque<Frame>& recent, InstanceId id) {
  return Count(MappedPixels(recent, kSanityVoxel_m) & (recent.back().mask == id));
}

TEST(SceneSanity, TrueMeshIsWhollySane) {
  const reference::Scene scene = BrickOnSlab();
  const std::deque<Frame> recent = Views(scene);
  ASSERT_GT(MappedOf(recent, kBackground), 500);
  ASSERT_GT(MappedOf(recent, kBrick), 50);
  const SanityScores scores = SanityOf(TrueMesh(scene), recent, kSanityVoxel_m);
  EXPECT_EQ(scores.all.value, 1.0);
  EXPECT_EQ(scores.by_object.at(kBackground).value, 1.0);
  EXPECT_EQ(scores.by_object.at(kBrick).value, 1.0);
}

TEST(SceneSanity, DepthMayBeOffByOneVoxelButNotByTwo) {
  const reference::Scene scene = BrickOnSlab();
  const std::deque<Frame> recent = Views(scene);
  const auto score = [&](double voxels) {
    const Eigen::Vector3d along_view = recent.back().T_WC.linear().col(2);
    // A plane shifted by s along the view is off by s n_z / (n . ray): at most some 1.6 s, and at
    // least 0.6 s, on the faces in this view.
    return SanityOf(Shifted(TrueMesh(scene), voxels * kSanityVoxel_m * along_view), recent,
                    kSanityVoxel_m);
  };
  for (const double little : {-0.5, 0.5}) {
    EXPECT_EQ(score(little).all.value, 1.0) << little;
  }
  for (const double much : {-2.0, 2.0}) {
    const SanityScores scores = score(much);
    EXPECT_EQ(scores.all.value, 0.0) << much;
    EXPECT_EQ(scores.by_object.at(kBrick).value, 0.0) << much;
    EXPECT_EQ(scores.by_object.at(kBackground).value, 0.0) << much;
  }
}

TEST(SceneSanity, WrongLabelsAreNotSane) {
  const reference::Scene scene = BrickOnSlab();
  const std::deque<Frame> recent = Views(scene);
  TriangleMesh mesh = TrueMesh(scene);
  for (InstanceId& id : mesh.face_ids) id = id == kBrick ? kBackground : kBrick;
  const SanityScores scores = SanityOf(mesh, recent, kSanityVoxel_m);
  EXPECT_EQ(scores.all.value, 0.0);
  EXPECT_EQ(scores.by_object.at(kBrick).value, 0.0);
}

TEST(SceneSanity, MissingObjectCostsItsOwnPixelsOnly) {
  reference::Scene scene = BrickOnSlab();
  const std::deque<Frame> recent = Views(scene);
  scene.Erase(kBrick);
  const SanityScores scores = SanityOf(TrueMesh(scene), recent, kSanityVoxel_m);
  EXPECT_EQ(scores.by_object.at(kBrick).value, 0.0);
  EXPECT_EQ(scores.by_object.at(kBackground).value, 1.0);
  const double background = MappedOf(recent, kBackground);
  const double brick = MappedOf(recent, kBrick);
  EXPECT_DOUBLE_EQ(scores.all.value.value(), background / (background + brick));
}

TEST(SceneSanity, EmptyMeshHasNothingRight) {
  const SanityScores scores = SanityOf({}, Views(BrickOnSlab()), kSanityVoxel_m);
  EXPECT_EQ(scores.all.value, 0.0);
}

TEST(SceneSanity, ObjectWithoutMappedPixelsIsUndefined) {
  std::deque<Frame> recent = Views(BrickOnSlab());
  // The brick appears in the last frame only.
  for (std::size_t i = 0; i + 1 < recent.size(); ++i) {
    recent[i].mask.setTo(cv::Scalar(kBackground));
  }
  const SanityScores scores = SanityOf(TrueMesh(BrickOnSlab()), recent, kSanityVoxel_m);
  EXPECT_FALSE(scores.by_object.at(kBrick).value.has_value());
  EXPECT_FALSE(scores.by_object.at(kBrick).why_not.empty());
  EXPECT_TRUE(scores.by_object.at(kBackground).value.has_value());
}

// A wall at `depth_m` seen straight on, from the column `first` on with another depth and id.
Frame Wall(float depth_m, int first, float other_depth_m, InstanceId other_id) {
  Frame frame;
  frame.intrinsics = kSanityCamera;
  frame.depth = cv::Mat(kSanityCamera.height, kSanityCamera.width, CV_32FC1, cv::Scalar(depth_m));
  frame.mask =
      cv::Mat(kSanityCamera.height, kSanityCamera.width, CV_16UC1, cv::Scalar(kBackground));
  const cv::Rect right(first, 0, kSanityCamera.width - first, kSanityCamera.height);
  frame.depth(right).setTo(other_depth_m);
  frame.mask(right).setTo(other_id);
  return frame;
}

// First and last column that is left out in a middle row; every other row must be the same.
std::pair<int, int> ColumnsLeftOut(const Frame& frame) {
  const cv::Mat mapped = MappedPixels({frame}, kSanityVoxel_m);
  int first = kSanityCamera.width;
  int last = -1;
  for (int u = 0; u < kSanityCamera.width; ++u) {
    const bool out = mapped.at<std::uint8_t>(kSanityCamera.height / 2, u) == 0;
    if (out) first = std::min(first, u);
    if (out) last = u;
    EXPECT_EQ(mapped.at<std::uint8_t>(5, u), mapped.at<std::uint8_t>(kSanityCamera.height / 2, u));
  }
  return {first, last};
}

// The edge lies between the columns kEdge and kEdge + 1.
constexpr int kEdge = 70;

TEST(SceneSanity, IdEdgesAreLeftOutByTheirRadius) {
  // 1.5 * 140 * 0.01 / 0.5 = 4.2; / 3 = 0.7, so the floor of two pixels; / 0.3 is 7 exactly.
  for (const auto& [depth_m, radius] : {std::pair{0.5F, 5}, {3.0F, 2}, {0.31F, 7}}) {
    const auto [first, last] = ColumnsLeftOut(Wall(depth_m, kEdge + 1, depth_m, kBrick));
    EXPECT_EQ(first, kEdge - radius) << depth_m;
    EXPECT_EQ(last, kEdge + 1 + radius) << depth_m;
  }
}

TEST(SceneSanity, DepthEdgesAreLeftOutByTheNearerSidesRadius) {
  // Nearer side 0.5 m: 5 pixels; the farther side alone would ask for 2.
  constexpr int kRadius = 5;
  // Within the radius of the nearer side's last pixel everything is left out; a pixel more at most.
  const auto [near_left, far_right] = ColumnsLeftOut(Wall(0.5F, kEdge + 1, 2.0F, kBackground));
  EXPECT_EQ(near_left, kEdge - kRadius);
  EXPECT_GE(far_right, kEdge + kRadius);
  EXPECT_LE(far_right, kEdge + 1 + kRadius);
  const auto [far_left, near_right] = ColumnsLeftOut(Wall(2.0F, kEdge + 1, 0.5F, kBackground));
  EXPECT_EQ(near_right, kEdge + 1 + kRadius);
  EXPECT_LE(far_left, kEdge + 1 - kRadius);
  EXPECT_GE(far_left, kEdge - kRadius);
}

TEST(SceneSanity, NoEdgeNothingLeftOut) {
  EXPECT_EQ(Count(MappedPixels({Wall(0.5F, kEdge, 0.5F, kBackground)}, kSanityVoxel_m)),
            kSanityCamera.width * kSanityCamera.height);
  // A plane so steep that neighbours differ by more than two voxels is no edge: 1/z is linear in
  // the image.
  Frame steep = Wall(1, kEdge, 1, kBackground);
  for (int u = 0; u < kSanityCamera.width; ++u) {
    steep.depth.col(u).setTo(cv::Scalar(1.0 / (0.5 - 0.0014 * u)));
  }
  const int last = kSanityCamera.width - 1;
  ASSERT_GT(steep.depth.at<float>(0, last) - steep.depth.at<float>(0, last - 1), 0.015F);
  EXPECT_EQ(Count(MappedPixels({steep}, kSanityVoxel_m)),
            kSanityCamera.width * kSanityCamera.height);
}

TEST(SceneSanity, InvalidDepthIsNotMapped) {
  Frame frame = Wall(0.5F, kEdge + 1, 0.0F, kBackground);
  const cv::Mat mapped = MappedPixels({frame}, kSanityVoxel_m);
  EXPECT_EQ(Count(mapped.colRange(kEdge + 1, kSanityCamera.width)), 0);
  EXPECT_GT(Count(mapped.colRange(0, kEdge)), 0);
}

// A plane that is turned away from the camera by 80 deg: seen at more than 75 deg it is not mapped.
TEST(SceneSanity, GrazingPixelsAreNotMapped) {
  const double turn = 80 * std::numbers::pi / 180;
  const double limit = std::cos(75 * std::numbers::pi / 180);
  // Where the plane is as steep as this a pixel more or less decides.
  constexpr double kDoubtful = 0.02;
  Frame frame = Wall(1, kEdge, 1, kBackground);
  const auto cosine = [&](int v, int u) {
    const double x = (u - kSanityCamera.cx) / kSanityCamera.fx;
    const double y = (v - kSanityCamera.cy) / kSanityCamera.fy;
    return (std::sin(turn) * x + std::cos(turn)) / std::sqrt(1 + x * x + y * y);
  };
  // To the left of this column the plane runs into the distance, and its depth jumps.
  const int first = static_cast<int>(kSanityCamera.cx);
  for (int u = 0; u < kSanityCamera.width; ++u) {
    const double x = (std::max(u, first - 5) - kSanityCamera.cx) / kSanityCamera.fx;
    frame.depth.col(u).setTo(cv::Scalar(0.3 / (std::sin(turn) * x + std::cos(turn))));
  }
  const cv::Mat mapped = MappedPixels({frame}, kSanityVoxel_m);
  int squarely = 0;
  int grazing = 0;
  for (int v = 0; v < kSanityCamera.height; ++v) {
    for (int u = first; u < kSanityCamera.width; ++u) {
      if (std::abs(cosine(v, u) - limit) < kDoubtful) continue;
      EXPECT_EQ(mapped.at<std::uint8_t>(v, u) != 0, cosine(v, u) > limit) << u << " " << v;
      ++(cosine(v, u) > limit ? squarely : grazing);
    }
  }
  EXPECT_GT(squarely, 1000);
  EXPECT_GT(grazing, 500);
}

// What an earlier frame did not see is not mapped yet.
TEST(SceneSanity, PixelsNotSeenBeforeAreNotCounted) {
  const Frame now = Wall(1, kEdge, 1, kBackground);
  Frame before = now;
  // A camera 30 cm further left sees the wall 42 pixels further right, so its left part never.
  constexpr int kShift = 42;  // 140 px * 0.3 m / 1 m
  before.T_WC.translation().x() = 0.3;
  cv::Mat expected(now.depth.size(), CV_8UC1, cv::Scalar(255));
  expected.colRange(0, kShift) = cv::Scalar(0);
  EXPECT_EQ(Count(MappedPixels({before, now}, kSanityVoxel_m) != expected), 0);
  // An occluder in an earlier frame hides; which of the earlier frames it was does not matter.
  Frame hidden = now;
  hidden.depth = now.depth.clone();  // a Frame's copy shares its images
  hidden.depth(cv::Rect(20, 30, 40, 50)).setTo(0.5F);
  expected.setTo(cv::Scalar(255));
  expected(cv::Rect(20, 30, 40, 50)) = cv::Scalar(0);
  EXPECT_EQ(Count(MappedPixels({hidden, now, now}, kSanityVoxel_m) != expected), 0);
  EXPECT_EQ(Count(MappedPixels({now, hidden, now}, kSanityVoxel_m) != expected), 0);
  // And so does another id.
  Frame other = now;
  other.mask = now.mask.clone();
  other.mask(cv::Rect(20, 30, 40, 50)).setTo(kBrick);
  EXPECT_EQ(Count(MappedPixels({other, now}, kSanityVoxel_m) != expected), 0);
}

// Pixels of a moving object are looked up where the object was.
TEST(SceneSanity, MovingObjectsPixelsFollowItsPose) {
  reference::Scene scene = BrickOnSlab();
  std::deque<Frame> recent;
  for (int i = 0; i < 3; ++i) {
    // Ten pixels and eight degrees a frame.
    scene.T_WO[kBrick] = reference::MakePose(0.4 + 0.14 * i, Eigen::Vector3d::UnitZ(),
                                             {-0.1 + 0.06 * i, 0.01 * i, 0.06});
    recent.push_back(reference::Render(scene, Camera(), i + 1, kSanityCamera));
  }
  const int still = MappedOf({recent.back()}, kBrick);
  ASSERT_GT(still, 50);
  const int followed = MappedOf(recent, kBrick);
  // Its sides come into view as it turns; the top was always seen.
  EXPECT_GT(followed, 0.8 * still);
  EXPECT_EQ(SanityOf(TrueMesh(scene), recent, kSanityVoxel_m).all.value, 1.0);

  // Without poses only what happens to lie in the old brick's surface counts.
  std::deque<Frame> blind = recent;
  for (Frame& frame : blind) frame.T_WO.clear();
  EXPECT_LT(MappedOf(blind, kBrick), 0.6 * still);
  // The table that the brick has just uncovered was not seen before.
  EXPECT_LT(MappedOf(recent, kBackground), MappedOf({recent.back()}, kBackground));
}

}  // namespace
}  // namespace tsdfpp
