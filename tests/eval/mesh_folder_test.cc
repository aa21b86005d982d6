// Folders of meshes of any mapper: every file format and layout, and everything that can be wrong
// with a file.
#include "eval/score/mesh_folder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>

#include "core/files.h"
#include "core/gltf.h"
#include "metrics/mesh_tools.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/box_meshes.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::At;
using test::BoxSource;
using test::ErrorOf;
using test::Evaluated;
using test::kLeft;
using test::kRight;
using test::kRounding_m;
using test::Put;
using test::PutNamed;
using test::SceneOf;
using test::Scores;
using test::TempFolder;
using test::TruthMeshes;

// What a file has beside faces may be surface, too.
TEST(MeshFolder, SaysWhichLinesOfAnObjAreLeftOut) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "scene.obj",
                        "v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\nsurf 0 1 0 1 1 2 3\nend\n")
                  .has_value());
  const auto meshes = ReadMeshFolder(folder.path(), 0, true, 1);
  ASSERT_TRUE(meshes.has_value()) << meshes.error().message;
  ASSERT_EQ(meshes->remarks.size(), 1U);
  EXPECT_EQ(meshes->remarks[0], (folder / "scene.obj").string() +
                                    ": 2 lines are no vertices, faces or materials: left out");
}

TEST(MeshFolder, EveryFormatAndUnitGivesTheSameScores) {
  const TempFolder folder;
  BoxSource source;
  const auto meshes = TruthMeshes(source);
  PutNamed(folder / "ply", meshes);
  const nlohmann::json expected = Scores(Evaluated(At(folder / "ply")).frames[0]);
  fs::create_directories(folder / "obj");
  fs::create_directories(folder / "stl");
  const std::map<InstanceId, std::string> stems{
      {kBackground, "background-0"}, {kLeft, "left-3"}, {kRight, "right-8"}};
  std::vector<NamedMesh> nodes;
  for (const auto& [id, mesh] : meshes) {
    std::ofstream obj(folder / "obj" / (stems.at(id) + ".obj"));
    obj.precision(9);
    for (const Eigen::Vector3f& v : mesh.vertices) {
      obj << "v " << 1000.0 * static_cast<double>(v.x()) << " "
          << 1000.0 * static_cast<double>(v.y()) << " " << 1000.0 * static_cast<double>(v.z())
          << "\n";
    }
    for (const auto& t : mesh.triangles) {
      obj << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
    }
    std::ofstream stl(folder / "stl" / (stems.at(id) + ".stl"));
    stl.precision(9);
    stl << "solid s\n";
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      stl << "facet normal 0 0 0\nouter loop\n";
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3f& v = Corner(mesh, t, k);
        stl << "vertex " << v.x() << " " << v.y() << " " << v.z() << "\n";
      }
      stl << "endloop\nendfacet\n";
    }
    stl << "endsolid s\n";
    nodes.push_back({stems.at(id).substr(0, stems.at(id).rfind('-')), id, mesh});
  }
  ASSERT_TRUE(WriteGlb(folder / "glb/scene.glb", nodes).has_value());
  Put(folder / "labels/scene.ply", SceneOf(meshes, true));
  for (const char* form : {"obj", "stl", "glb", "labels"}) {
    EvaluateConfig config = At(folder / form);
    if (std::string(form) == "obj") {
      config.scale = 0.001;
      config.scale_is_given = true;
    }
    const EvaluateResult result = Evaluated(config);
    ASSERT_EQ(result.frames.size(), 1U) << form;
    const nlohmann::json scores = Scores(result.frames[0]);
    // Shares are the same; distances to the rounding of text and of millimetres.
    for (std::size_t i = 0; i < 3; ++i) {
      for (const char* share : {"completion", "visible_completion", "label_purity"}) {
        EXPECT_EQ(scores["objects"][i][share], expected["objects"][i][share]) << form;
      }
      EXPECT_NEAR(scores["objects"][i]["accuracy"]["mean_m"].get<double>(),
                  expected["objects"][i]["accuracy"]["mean_m"].get<double>(), kRounding_m)
          << form;
    }
  }
}

TEST(MeshFolder, SeveralFramesNeedAFolderEach) {
  const TempFolder folder;
  BoxSource source;
  PutNamed(folder / "m/000005", TruthMeshes(source));
  EXPECT_EQ(Evaluated(At(folder / "m")).frames.size(), 1U);
  const Error missing = ErrorOf(At(folder / "m", {4, 5}));
  EXPECT_EQ(missing.kind, ErrorKind::kData);
  EXPECT_NE(missing.message.find("holds nothing for frame 4, expected a subfolder 000004"),
            std::string::npos)
      << missing.message;
  PutNamed(folder / "m/frame-4", TruthMeshes(source));
  const EvaluateResult both = Evaluated(At(folder / "m", {5, 4}));
  ASSERT_EQ(both.frames.size(), 2U);
  EXPECT_EQ(both.frames[0].evaluation.frame, 4);
  EXPECT_EQ(both.frames[1].evaluation.frame, 5);
}

struct Bad {
  std::string name;
  std::function<void(TriangleMesh&)> spoil;
  std::string sentence;  // of the error
};

TEST(MeshFolder, WhatCannotBeScoredIsRefusedWithASentence) {
  BoxSource source;
  const TriangleMesh good = SceneOf(TruthMeshes(source), true);
  const std::vector<Bad> all{
      {"millimetres",
       [](TriangleMesh& mesh) {
         for (Eigen::Vector3f& vertex : mesh.vertices) vertex *= 1000;
       },
       "is it in another unit? Give its scale (--scale 0.001 would fit"},
      {"empty", [](TriangleMesh& mesh) { mesh = {}; }, "has no faces, expected a mesh"},
      {"points", [](TriangleMesh& mesh) { mesh.triangles.clear(), mesh.face_ids.clear(); },
       "has no faces, expected a mesh"},
      {"nan", [](TriangleMesh& mesh) { mesh.vertices[3].y() = NAN; },
       "a vertex has no finite x, y, z"},
      {"infinite", [](TriangleMesh& mesh) { mesh.vertices[0].x() = INFINITY; },
       "a vertex has no finite x, y, z"},
      {"flat",
       [](TriangleMesh& mesh) {
         for (auto& t : mesh.triangles) t[2] = t[1];
       },
       "none of them has an area"},
  };
  for (const Bad& bad : all) {
    const TempFolder folder;
    TriangleMesh mesh = good;
    bad.spoil(mesh);
    Put(folder / "m/scene.ply", mesh);
    const Error error = ErrorOf(At(folder / "m"));
    EXPECT_EQ(error.kind, ErrorKind::kData) << bad.name;
    EXPECT_NE(error.message.find(bad.sentence), std::string::npos) << error.message;
    EXPECT_NE(error.message.find("scene.ply"), std::string::npos) << error.message;
  }
}

TEST(MeshFolder, HalfAFileIsRefused) {
  const TempFolder folder;
  BoxSource source;
  Put(folder / "m/scene.ply", SceneOf(TruthMeshes(source), true));
  const auto bytes = ReadFile(folder / "m/scene.ply");
  ASSERT_TRUE(WriteFile(folder / "m/scene.ply", bytes->substr(0, bytes->size() / 2)).has_value());
  const Error error = ErrorOf(At(folder / "m"));
  EXPECT_EQ(error.kind, ErrorKind::kData);
  EXPECT_NE(error.message.find("the file ends"), std::string::npos) << error.message;
}

TEST(MeshFolder, WhatIsTypedWronglyIsSaid) {
  const TempFolder folder;
  BoxSource source;
  PutNamed(folder / "m", TruthMeshes(source));
  EvaluateConfig config = At(folder / "m", {6});
  EXPECT_EQ(ErrorOf(config).message, "--at 6 is out of range: boxes has frames 0 to 5");
  config.frames = {5, 5};
  EXPECT_EQ(ErrorOf(config).message, "--at names frame 5 twice");
  config.frames = {5};
  config.removed = {kBackground};
  EXPECT_NE(ErrorOf(config).message.find("cannot be removed"), std::string::npos);
  config.removed = {};
  config.meshes = folder / "nowhere";
  EXPECT_NE(ErrorOf(config).message.find("nowhere: no such folder"), std::string::npos);
  fs::create_directories(folder / "nothing");
  config.meshes = folder / "nothing";
  EXPECT_NE(ErrorOf(config).message.find("holds no mesh of frame 5"), std::string::npos);
  config.meshes = folder / "m";
  Put(folder / "m/scene-without-car.ply", SceneOf(TruthMeshes(source), true));
  EXPECT_NE(ErrorOf(config).message.find("expected ids between dashes"), std::string::npos);
}

}  // namespace
}  // namespace tsdfpp
