// Every model and every imported mesh as the scene builder compiles it: what is rendered is what
// rays hit, and what is compiled is what was generated.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/files.h"
#include "sim/models/room_model.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"
#include "tests/sim/mesh_checks.h"
#include "tests/sim/model_stage.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// As in rendering_test.cc: depth equals the ray's to this, away from edges and grazing faces.
constexpr double kDepthTolerance_m = 1e-4;
constexpr double kMaxIncidence_deg = 80;
constexpr double kDepthStep_m = 1e-3;
constexpr int kLeastPixels = 200;  // compared of each model, or the test would prove little

struct Hit {
  double depth = 0;
  InstanceId id = kNoInstance;
  Eigen::Vector3d normal_C = Eigen::Vector3d::Zero();
};

class RayCaster {
 public:
  explicit RayCaster(ModelStage& stage) : stage_(stage) {}

  static Eigen::Vector3d Direction(const Intrinsics& k, int u, int v) {
    return {(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0};
  }

  Hit Cast(int u, int v) const {
    const Eigen::Vector3d ray = Direction(stage_.config.intrinsics, u, v);
    const Eigen::Vector3d direction = stage_.T_WC.linear() * ray.normalized();
    const Eigen::Vector3d origin = stage_.T_WC.translation();
    int geom = -1;
    Eigen::Vector3d normal;
    const double distance = mj_ray(stage_.scene->model(), stage_.scene->data(), origin.data(),
                                   direction.data(), nullptr, 1, -1, &geom, normal.data());
    Hit hit;
    if (geom < 0) return hit;
    hit.depth = distance / ray.norm();
    hit.id = stage_.scene->geoms()[static_cast<std::size_t>(geom)].id;
    hit.normal_C = stage_.T_WC.linear().transpose() * normal;
    return hit;
  }

 private:
  ModelStage& stage_;
};

struct Comparison {
  int compared = 0;  // pixels of objects, edges and grazing ones apart
  int wrong = 0;     // in depth or id
  double worst_m = 0;
  std::set<InstanceId> seen;
};

// Compares the pixels of objects with rays; the table's are rendering_test.cc's.
Comparison CompareWithRays(ModelStage& stage, const RenderedImages& images) {
  const RayCaster rays(stage);
  const Intrinsics& k = stage.config.intrinsics;
  const double least_cosine = std::cos(kMaxIncidence_deg * M_PI / 180);
  Comparison result;
  for (int v = 1; v + 1 < k.height; ++v) {
    for (int u = 1; u + 1 < k.width; ++u) {
      if (images.mask.at<InstanceId>(v, u) == kBackground) continue;
      const Hit hit = rays.Cast(u, v);
      const Eigen::Vector3d ray = RayCaster::Direction(k, u, v);
      if (std::abs(hit.normal_C.dot(ray.normalized())) < least_cosine) continue;
      const double offset = hit.normal_C.dot(hit.depth * ray);
      bool on_edge = false;
      for (const auto& [du, dv] :
           {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}) {
        const Hit other = rays.Cast(u + du, v + dv);
        const double on_plane = offset / hit.normal_C.dot(RayCaster::Direction(k, u + du, v + dv));
        on_edge =
            on_edge || other.id != hit.id || !(std::abs(other.depth - on_plane) < kDepthStep_m);
      }
      if (on_edge) continue;
      ++result.compared;
      result.seen.insert(hit.id);
      const double error = std::abs(images.depth.at<float>(v, u) - hit.depth);
      result.worst_m = std::max(result.worst_m, error);
      if (error > kDepthTolerance_m || images.mask.at<InstanceId>(v, u) != hit.id) ++result.wrong;
    }
  }
  return result;
}

// Several models on the table, from two sides.
void ExpectRenderedAsRaysHit(const std::vector<ModelSpec>& models, double gap_m) {
  ModelStage stage(models, gap_m, 288, 216);
  ASSERT_EQ(stage.error, "");
  std::set<InstanceId> seen;
  for (const double azimuth : {-60.0, 110.0}) {
    const RenderedImages images = stage.Render(azimuth, 0.75, 0.62, 0.02, false);
    const Comparison comparison = CompareWithRays(stage, images);
    EXPECT_EQ(comparison.wrong, 0) << comparison.worst_m * 1e3 << " mm at worst";
    EXPECT_GT(comparison.compared, kLeastPixels * static_cast<int>(models.size()));
    seen.insert(comparison.seen.begin(), comparison.seen.end());
  }
  for (std::size_t i = 0; i < models.size(); ++i) {
    EXPECT_TRUE(seen.contains(static_cast<InstanceId>(i + 1))) << models[i].name << " is not seen";
  }
}

TEST(RenderingModels, EveryModelIsRenderedAsRaysHitIt) {
  std::vector<ModelSpec> few;
  const auto& catalogue = ModelCatalogue();
  for (std::size_t i = 0; i < catalogue.size(); ++i) {
    ModelSpec spec;
    spec.name = catalogue[i].name;
    // So that four stand on the table without hiding one another.
    spec.scale = 0.2 / std::max(0.2, catalogue[i].size_m.maxCoeff());
    few.push_back(spec);
    if (few.size() == 4 || i + 1 == catalogue.size()) {
      SCOPED_TRACE(few.front().name + " and the next");
      ExpectRenderedAsRaysHit(few, 0.24);
      few.clear();
    }
  }
}

// The compiled meshes are closed, of the same volume, and of as many triangles as were generated.
TEST(RenderingModels, CompiledModelsAreWhatWasGenerated) {
  std::vector<ModelSpec> models;
  for (const ModelInfo& info : ModelCatalogue()) {
    models.emplace_back();
    models.back().name = info.name;
  }
  ModelStage stage(models, 0.1, 32, 24);
  ASSERT_EQ(stage.error, "");
  const std::vector<TrueModel> truth = stage.scene->TrueModels();
  ASSERT_EQ(truth.size(), models.size() + 1);
  for (std::size_t i = 0; i < models.size(); ++i) {
    SCOPED_TRACE(models[i].name);
    const auto parts = MakeModel(models[i]);
    ASSERT_TRUE(parts.has_value());
    double volume = 0;
    std::size_t triangles = 0;
    for (const ModelPart& part : *parts) {
      volume += EnclosedVolume(part.shape);
      triangles += part.shape.triangles.size();
    }
    Shape compiled;
    for (const Eigen::Vector3f& vertex : truth[i + 1].mesh_O.vertices) {
      compiled.vertices.emplace_back(vertex.cast<double>());
    }
    compiled.triangles = truth[i + 1].mesh_O.triangles;
    EXPECT_EQ(compiled.triangles.size(), triangles);
    constexpr double kRelative = 1e-5;  // single precision
    EXPECT_NEAR(EnclosedVolume(compiled), volume, kRelative * volume);
    const Eigen::AlignedBox3d box = BoundsOf(*parts);
    const Eigen::AlignedBox3d compiled_box = BoxAround(compiled);
    EXPECT_LT((box.min() - compiled_box.min()).norm(), 1e-6);
    EXPECT_LT((box.max() - compiled_box.max()).norm(), 1e-6);
  }
}

TEST(RenderingModels, RealMeshesAreRenderedAsRaysHitThem) {
  const bool all = fs::exists(test::SharedData("meshes"));
  const fs::path folder = all ? test::SharedData("meshes") : test::CopiedData("toy_blocks");
  std::vector<ModelSpec> models;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string ending = entry.path().extension().string();
    if (ending != ".obj" && ending != ".stl") continue;
    ModelSpec spec;
    spec.name = kMeshModel;
    spec.file = entry.path();
    if (entry.path().filename() == "spot.obj") {
      spec.scale = 0.08;
      spec.up = "y";
      spec.picture = entry.path().parent_path() / "spot.png";
    }
    models.push_back(spec);
  }
  std::sort(models.begin(), models.end(),
            [](const auto& a, const auto& b) { return a.file < b.file; });
  ASSERT_GE(models.size(), all ? 14U : 6U);
  for (std::size_t i = 0; i < models.size(); i += 4) {
    SCOPED_TRACE(models[i].file.filename().string() + " and the next");
    ExpectRenderedAsRaysHit(
        {models.begin() + static_cast<std::ptrdiff_t>(i),
         models.begin() + static_cast<std::ptrdiff_t>(std::min(i + 4, models.size()))},
        0.22);
  }
  TSDFPP_NEEDS_SHARED("meshes");
}

// Half a box, seen from inside and outside: a renderer leaves out faces seen from behind, rays hit
// them, so there are faces either way. And a sheet without any thickness.
TEST(RenderingModels, OpenMeshesAreRenderedAsRaysHitThem) {
  const test::TempFolder temp;
  const auto& folder = temp.path();
  const std::string half =
      "v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nv 0 0 .1\nv .1 0 .1\nv .1 .1 .1\nv 0 .1 .1\n"
      "f 4 3 2 1\nf 2 3 7 6\nf 3 4 8 7\n";
  const std::string sheet = "v 0 0 0\nv .12 0 0\nv .12 .12 .04\nv 0 .12 .04\nf 1 2 3 4\n";
  const std::string flat = "v 0 0 0\nv .12 0 0\nv .12 .12 0\nv 0 .12 0\nf 1 2 3 4\n";
  std::vector<ModelSpec> models;
  for (const auto& [name, text] :
       {std::pair{"half.obj", half}, std::pair{"sheet.obj", sheet}, std::pair{"flat.obj", flat}}) {
    ASSERT_TRUE(WriteFile(folder / name, text).has_value());
    models.emplace_back();
    models.back().name = kMeshModel;
    models.back().file = folder / name;
  }
  ExpectRenderedAsRaysHit(models, 0.2);
}

// A picture shows where its texture coordinates say: the sheet's red quarter is the nearest to -x,
// +y.
TEST(RenderingModels, ColoursOfAMeshAreRenderedWhereTheyBelong) {
  const test::TempFolder temp;
  const auto& folder = temp.path();
  // Four squares in the table's plane, each of its own material.
  std::string text = "mtllib c.mtl\n";
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) text += fmt::format("v {} {} 0\n", x * 0.2, y * 0.2);
  }
  text += "usemtl a\nf 1 2 5 4\nusemtl b\nf 2 3 6 5\nusemtl c\nf 4 5 8 7\nusemtl d\nf 5 6 9 8\n";
  ASSERT_TRUE(WriteFile(folder / "c.mtl",
                        "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\nnewmtl c\nKd 0 0 1\nnewmtl d\nKd "
                        "1 1 0\n")
                  .has_value());
  ASSERT_TRUE(WriteFile(folder / "sheet.obj", text).has_value());
  ModelSpec spec;
  spec.name = kMeshModel;
  spec.file = folder / "sheet.obj";
  ModelStage stage({spec}, 0, 200, 200);
  ASSERT_EQ(stage.error, "");
  // From above, nearly straight down: x to the right, y upwards in the picture.
  const RenderedImages images = stage.Render(-90, 0.05, 0.6, 0, true);
  const auto main_channels = [&](double x, double y) {
    const Eigen::Vector3d p_C = stage.T_WC.inverse() * Eigen::Vector3d(x, y, kTableTop_m);
    const Intrinsics& k = stage.config.intrinsics;
    const auto& rgb =
        images.colour.at<cv::Vec3b>(static_cast<int>(std::lround(k.fy * p_C.y() / p_C.z() + k.cy)),
                                    static_cast<int>(std::lround(k.fx * p_C.x() / p_C.z() + k.cx)));
    std::string channels;
    for (int c = 0; c < 3; ++c) {
      if (rgb[c] > 70) channels += "rgb"[c];
    }
    return channels;
  };
  EXPECT_EQ(main_channels(-0.1, -0.1), "r");
  EXPECT_EQ(main_channels(0.1, -0.1), "g");
  EXPECT_EQ(main_channels(-0.1, 0.1), "b");
  EXPECT_EQ(main_channels(0.1, 0.1), "rg");
}

}  // namespace
}  // namespace tsdfpp
