// Rays through the maps of the bundled scene, against the frame that the camera saw and against the
// map's own mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "eval/picture/map_views.h"
#include "eval/run/open_source.h"
#include "eval/score/scene_sanity.h"
#include "eval/score/scene_seams.h"
#include "eval/tools/rasteriser.h"
#include "mapper/map_representation.h"
#include "tests/core/temp_folder.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

constexpr int kFrames = 12;
constexpr double kVoxel_m = 0.01;
// The project's criterion for the ray caster, and that of the visible scene's sanity.
constexpr double kMedianError_m = 0.35e-3;
// Triangles of marching cubes are chords of the trilinear surface, and the normals by which a
// surface is found to be hidden are the triangle's there and the gradient here.
constexpr double kMeshMedian_voxels = 0.005;
constexpr double kMeshNear_voxels = 0.25;
// Of the background's pixels beside objects; without rims a tenth of them sees nothing.
constexpr double kRingShare = 0.02;
constexpr double kMeshShare = 0.985;  // of the pixels that either sees; edges are among them

class ToyCarRays : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const std::filesystem::path scene =
        std::filesystem::path(TSDFPP_SOURCE_DIR) / "scenes" / "toycar3.toml";
    auto source = OpenSource(scene);
    if (!source) return;
    frames_ = new std::deque<Frame>;
    for (int i = 0; i < kFrames; ++i) {
      // Before and while the cars start to move.
      auto frame = (*source)->Read((*source)->info().first_index + 8 + 3 * i);
      if (frame) frames_->push_back(std::move(*frame));
    }
  }
  static void TearDownTestSuite() { delete frames_; }
  void SetUp() override {
    ASSERT_NE(frames_, nullptr);
    ASSERT_EQ(frames_->size(), static_cast<std::size_t>(kFrames));
  }

  static std::unique_ptr<MapRepresentation> Mapped(Method method, bool rims = true) {
    MapConfig config;
    config.rims = rims;
    config.voxel_m = kVoxel_m;
    EXPECT_TRUE(config.SetProfile("paper").has_value());
    auto map = MakeMap(method, config);
    for (const Frame& frame : *frames_) {
      for (const auto& [id, T_WO] : frame.T_WO) map->SetObjectPose(id, T_WO);
      map->Fuse(frame, frame.mask);
    }
    return map;
  }

  static inline std::deque<Frame>* frames_ = nullptr;
};

TEST_F(ToyCarRays, SeeWhatTheCameraSaw) {
  const Frame& last = frames_->back();
  const cv::Mat mapped =
      MappedPixels(std::deque<Frame>(frames_->end() - 3, frames_->end()), kVoxel_m);
  ASSERT_GT(cv::countNonZero(mapped), 100000);
  for (const Method method : {Method::kTsdfpp, Method::kTsdfppAnchored, Method::kVolumes}) {
    SCOPED_TRACE(MethodName(method));
    RayCastOptions options;
    options.colour = false;
    const RaySurface cast = Mapped(method)->CastRays(last.intrinsics, last.T_WC, options).front();
    std::vector<double> errors;
    std::map<InstanceId, std::pair<int, int>> right_of;  // right, all
    for (int v = 0; v < last.depth.rows; ++v) {
      for (int u = 0; u < last.depth.cols; ++u) {
        const float z = last.depth.at<float>(v, u);
        const float seen = cast.depth.at<float>(v, u);
        if (IsValidDepth(z) && seen > 0) errors.push_back(std::abs(double{seen} - z));
        if (mapped.at<std::uint8_t>(v, u) == 0) continue;
        const InstanceId id = last.mask.at<std::uint16_t>(v, u);
        auto& [right, all] = right_of[id];
        ++all;
        right += cast.id.at<std::uint16_t>(v, u) == id && std::abs(double{seen} - z) <= kVoxel_m;
      }
    }
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    std::cout << MethodName(method) << ": median " << 1e3 * errors[errors.size() / 2] << " mm";
    EXPECT_LE(errors[errors.size() / 2], kMedianError_m);
    int right = 0;
    int all = 0;
    for (const auto& [id, counts] : right_of) {
      right += counts.first;
      all += counts.second;
      if (counts.second < 100) continue;
      std::cout << ", " << id << ": " << counts.first << " of " << counts.second;
      EXPECT_GE(counts.first, kSaneShareObject * counts.second) << "object " << id;
    }
    std::cout << "\n";
    EXPECT_GE(right, kSaneShareAll * all);
  }
}

TEST_F(ToyCarRays, SeeTheScenesMesh) {
  const Frame& last = frames_->back();
  for (const Method method : {Method::kTsdf, Method::kTsdfpp, Method::kTsdfppLiteral,
                              Method::kTsdfppAnchored, Method::kVolumes}) {
    SCOPED_TRACE(MethodName(method));
    const auto map = Mapped(method);
    const TriangleMesh mesh = map->SceneMesh();
    const Raster raster = Rasterise(mesh, last.intrinsics, last.T_WC);
    RayCastOptions options;
    options.colour = false;
    const RaySurface cast = map->CastRays(last.intrinsics, last.T_WC, options).front();
    std::vector<double> errors;
    int seen = 0;
    int near = 0;
    for (int v = 0; v < last.depth.rows; ++v) {
      for (int u = 0; u < last.depth.cols; ++u) {
        const float a = raster.depth.at<float>(v, u);
        const float b = cast.depth.at<float>(v, u);
        if (a == 0 && b == 0) continue;
        ++seen;
        if (a == 0 || b == 0) continue;
        const int face = raster.face.at<int>(v, u);
        errors.push_back(std::abs(a - b) / kVoxel_m);
        near += errors.back() <= kMeshNear_voxels &&
                mesh.face_ids[static_cast<std::size_t>(face)] == cast.id.at<std::uint16_t>(v, u);
      }
    }
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    std::cout << MethodName(method) << ": median " << errors[errors.size() / 2] << " voxels, "
              << static_cast<double>(near) / seen << " near\n";
    EXPECT_LE(errors[errors.size() / 2], kMeshMedian_voxels);
    EXPECT_GE(near, kMeshShare * seen);
  }
}

// The ring of missing table around objects, which rims close: rays see it closed as the mesh does.
TEST_F(ToyCarRays, LeaveNoRingAroundObjects) {
  const Frame& last = frames_->back();
  const std::deque<Frame> recent(frames_->end() - 3, frames_->end());
  RayCastOptions options;
  options.colour = false;
  const auto ring = [&](const cv::Mat& depth) {
    return ScoreSeams(depth, recent, kVoxel_m).beside_objects.share.value.value();
  };
  const auto cast = [&](const MapRepresentation& map) {
    return ring(map.CastRays(last.intrinsics, last.T_WC, options).front().depth);
  };
  for (const Method method : {Method::kTsdfpp, Method::kTsdfppAnchored, Method::kVolumes}) {
    SCOPED_TRACE(MethodName(method));
    const auto map = Mapped(method);
    const double of_mesh = ring(Rasterise(map->SceneMesh(), last.intrinsics, last.T_WC).depth);
    const double of_rays = cast(*map);
    const double without_rims = cast(*Mapped(method, false));
    std::cout << MethodName(method) << ": " << of_rays << ", of its mesh " << of_mesh
              << ", without rims " << without_rims << "\n";
    EXPECT_NEAR(of_rays, of_mesh, kRingShare);
    EXPECT_LE(of_rays, kRingShare);
    EXPECT_GE(without_rims, of_rays + 2 * kRingShare);
  }
}

TEST(MapViews, AreTheCastsImages) {
  reference::Scene scene;
  scene.shapes.push_back(reference::Cuboid(
      kBackground, {150, 110, 70}, reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, -0.05}),
      {0.4, 0.35, 0.05}));
  scene.shapes.push_back(reference::Sphere(1, {200, 30, 30}, {0, 0, 0.08}, 0.1));
  const auto map = MakeMap(Method::kTsdfppAnchored, {});
  const Pose T_WC = reference::LookAt({0.5, 0.3, 0.5}, {0, 0, 0});
  scene.shapes.back().id = 1;
  reference::Scene table = scene;
  table.Erase(1);
  for (const Frame& frame : {reference::Render(table, T_WC), reference::Render(scene, T_WC, 2)}) {
    map->Fuse(frame, frame.mask);
  }
  const test::TempFolder folder;
  const Intrinsics camera = reference::SmallCamera();
  ASSERT_TRUE(WriteViews(*map, camera, T_WC, 2, folder.path()).has_value());
  RayCastOptions options;
  options.surfaces = 2;
  const auto cast = map->CastRays(camera, T_WC, options);
  for (int k = 1; k <= 2; ++k) {
    const auto file = [&](const char* what, const char* ending) {
      return (folder.path() / fmt::format("{}-{}.{}", what, k, ending)).string();
    };
    const RaySurface& surface = cast[static_cast<std::size_t>(k - 1)];
    const cv::Mat id = cv::imread(file("id", "png"), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(id.type(), CV_16UC1);
    EXPECT_EQ(cv::countNonZero(id != surface.id), 0);
    EXPECT_GT(cv::countNonZero(id == (k == 1 ? 1 : kBackground)), 100) << k;
    const cv::Mat bgr = cv::imread(file("colour", "png"));
    cv::Mat rgb;
    cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
    EXPECT_EQ(cv::norm(rgb, surface.colour, cv::NORM_INF), 0);
    EXPECT_TRUE(std::filesystem::exists(file("depth", "exr")));
    EXPECT_TRUE(std::filesystem::exists(file("normal", "png")));
  }
}

}  // namespace
}  // namespace tsdfpp
