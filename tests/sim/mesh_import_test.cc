// Meshes that others made: against trimesh's figures of the same files, and hand-made small ones.
#include "sim/models/mesh_import.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "sim/models/model_catalogue.h"
#include "tests/needs.h"
#include "tests/sim/mesh_checks.h"
#include "tests/sim/mesh_texts.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using MeshImport = MeshFolder;

TEST_F(MeshImport, EqualsTrimeshOnRealFiles) {
  const auto json =
      nlohmann::json::parse(ReadFile(test::CopiedData("geometry/mesh_properties.json")).value());
  // Files hold single precision or six decimals.
  constexpr double kRelative = 1e-4;
  int compared = 0;
  for (const auto& [name, known] : json["meshes"].items()) {
    fs::path path = test::CopiedData("toy_blocks") / fs::path(name).filename();
    if (!fs::exists(path)) path = test::SharedData("meshes") / name;
    if (!fs::exists(path)) continue;
    SCOPED_TRACE(name);
    const ImportedMesh mesh = Import(path, 1);
    ASSERT_EQ(mesh.parts.size(), 1U);
    const Shape& shape = mesh.parts[0].shape;
    EXPECT_EQ(mesh.report.watertight, known["watertight"].get<bool>());
    EXPECT_EQ(mesh.report.triangles, known["faces"].get<std::size_t>());
    if (mesh.report.watertight) {
      EXPECT_EQ(shape.triangles.size(), known["faces"].get<std::size_t>());
      EXPECT_EQ(shape.vertices.size(), known["vertices"].get<std::size_t>());
      EXPECT_EQ(CountOpenEdges(shape), 0U);
      EXPECT_EQ(mesh.report.turned, 0U);
      const double volume = known["volume"].get<double>();
      EXPECT_NEAR(EnclosedVolume(shape), volume, kRelative * volume);
    }
    const Eigen::AlignedBox3d box = BoxAround(shape);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(box.min()[k], known["bounds"][0][static_cast<std::size_t>(k)].get<double>(),
                  1e-6);
      EXPECT_NEAR(box.max()[k], known["bounds"][1][static_cast<std::size_t>(k)].get<double>(),
                  1e-6);
    }
    ++compared;
  }
  EXPECT_GE(compared, 6) << "the toy blocks";
  TSDFPP_NEEDS_SHARED("meshes");
  EXPECT_GE(compared, 10);
}

TEST_F(MeshImport, EveryFormatGivesTheSameCube) {
  // Polygons, indices from the end, a comment, a continued line, a lonely carriage return.
  const std::string back =
      std::string(kCorners) +
      "f -5 -6 -7 -8 # the bottom\r\nf -4 -3 \\\n-2 -1\nf -8//1 -7//1 -3//1 -4//1\nf -7 -6 -2 -3\n"
      "f -6 -5 -1 -2\nf -5 -8 -4 -1\n";
  for (const auto& [name, bytes] : std::vector<std::pair<std::string, std::string>>{
           {"a.obj", kCube},
           {"b.obj", back},
           {"old.obj", std::string(kCorners) +
                           "fo 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nfo 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"},
           {"c.stl", BinaryStl("cube", 12)},
           {"d.stl", BinaryStl("solid in name only", 12)},
           {"e.STL", AsciiStl()}}) {
    SCOPED_TRACE(name);
    const ImportedMesh mesh = Import(Write(name, bytes), 0.5);
    ASSERT_EQ(mesh.parts.size(), 1U);
    const Shape& shape = mesh.parts[0].shape;
    EXPECT_EQ(shape.vertices.size(), 8U);
    EXPECT_EQ(shape.triangles.size(), 12U);
    EXPECT_EQ(CountOpenEdges(shape), 0U);
    EXPECT_NEAR(EnclosedVolume(shape), 0.125, 1e-12);
    EXPECT_TRUE(mesh.report.watertight);
    EXPECT_TRUE(mesh.report.remarks.empty());
  }
}

// A star whose corners lie in and out by turns: a fan would leave it.
TEST_F(MeshImport, CutsPolygonsThatAreNotConvex) {
  std::string text;
  std::string front = "f";
  double area = 0;
  constexpr int kCorners2 = 10;
  std::vector<Eigen::Vector2d> star;
  for (int i = 0; i < kCorners2; ++i) {
    const double radius = i % 2 == 0 ? 1 : 0.35;
    const double angle = 2 * M_PI * i / kCorners2;
    star.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  for (int i = 0; i < kCorners2; ++i) {
    const Eigen::Vector2d& a = star[static_cast<std::size_t>(i)];
    const Eigen::Vector2d& b = star[static_cast<std::size_t>((i + 1) % kCorners2)];
    area += (a.x() * b.y() - a.y() * b.x()) / 2;
    text += fmt::format("v {:.17g} {:.17g} 0\n", a.x(), a.y());
    // Starts at an inner corner.
    front += fmt::format(" {}", (i + 1) % kCorners2 + 1);
  }
  const ImportedMesh mesh = Import(Write("star.obj", text + front + "\n"));
  EXPECT_EQ(mesh.report.triangles, 8U);
  double sum = 0;
  double both = 0;
  for (const auto& [a, b, c] : mesh.parts[0].shape.triangles) {
    const auto& p = mesh.parts[0].shape.vertices;
    const double z = (p[b] - p[a]).cross(p[c] - p[a]).z() / 2;
    sum += std::max(z, 0.0);
    both += z;
  }
  EXPECT_NEAR(sum, area, 1e-12);
  EXPECT_NEAR(both, 0, 1e-12) << "an open mesh is there from both sides";
}

TEST_F(MeshImport, RepairsWhatItCan) {
  // A face turned over, one there twice, one without an area, a vertex named twice.
  std::string text = std::string(kCorners) +
                     "f 4 3 2 1\nf 8 7 6 5\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
                     "f 4 1 5 8\nf 1 1 2\n";
  ImportedMesh mesh = Import(Write("a.obj", text));
  EXPECT_TRUE(mesh.report.watertight);
  EXPECT_EQ(mesh.report.turned, 2U);
  EXPECT_EQ(mesh.report.duplicate, 2U);
  EXPECT_EQ(mesh.report.degenerate, 1U);
  EXPECT_EQ(mesh.parts[0].shape.triangles.size(), 12U);
  EXPECT_NEAR(EnclosedVolume(mesh.parts[0].shape), 1, 1e-12);
  EXPECT_TRUE(Remarks(mesh.report, "2 of 15 triangles are there twice: left out"));
  EXPECT_TRUE(Remarks(mesh.report, "1 of 15 triangles have no area: left out"));
  EXPECT_TRUE(Remarks(mesh.report, "2 of 15 triangles faced the other way"));

  // Inside out as a whole.
  text =
      std::string(kCorners) + "f 1 2 3 4\nf 8 7 6 5\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\n";
  mesh = Import(Write("b.obj", text));
  EXPECT_EQ(mesh.report.turned, 12U);
  EXPECT_NEAR(EnclosedVolume(mesh.parts[0].shape), 1, 1e-12);

  // A cavity keeps its orientation: its wall faces into it.
  text = kCube;
  for (const auto& [x, y, z] : std::vector<std::array<double, 3>>{{0, 0, 0},
                                                                  {1, 0, 0},
                                                                  {1, 1, 0},
                                                                  {0, 1, 0},
                                                                  {0, 0, 1},
                                                                  {1, 0, 1},
                                                                  {1, 1, 1},
                                                                  {0, 1, 1}}) {
    text += fmt::format("v {} {} {}\n", 0.25 + x / 2, 0.25 + y / 2, 0.25 + z / 2);
  }
  text += "f 9 10 11 12\nf 16 15 14 13\nf 13 14 10 9\nf 14 15 11 10\nf 15 16 12 11\nf 16 13 9 12\n";
  mesh = Import(Write("c.obj", text));
  EXPECT_TRUE(mesh.report.watertight);
  EXPECT_EQ(mesh.report.turned, 0U);
  EXPECT_NEAR(EnclosedVolume(mesh.parts[0].shape), 1 - 0.125, 1e-12);
  EXPECT_NEAR(WindingNumber(mesh.parts[0].shape, {0.5, 0.5, 0.5}), 0, 1e-12);
}

TEST_F(MeshImport, AnOpenMeshIsDrawnFromBothSidesAndSaysSo) {
  const std::string text =
      std::string(kCorners) + "f 4 3 2 1\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  const ImportedMesh mesh = Import(Write("open.obj", text));
  EXPECT_FALSE(mesh.report.watertight);
  EXPECT_EQ(mesh.report.open_edges, 4U);
  EXPECT_EQ(mesh.report.triangles, 10U);
  EXPECT_EQ(mesh.parts[0].shape.triangles.size(), 20U);
  EXPECT_TRUE(Remarks(mesh.report,
                      "is not watertight: 4 edges are not shared by exactly two triangles; it is "
                      "drawn from both sides"));
  // As many faces either way, at the same place.
  EXPECT_NEAR(EnclosedVolume(mesh.parts[0].shape), 0, 1e-12);

  // A band with one twist has no two sides at all.
  std::string band;
  std::string faces;
  constexpr int kPieces = 12;
  for (int i = 0; i < kPieces; ++i) {
    const double angle = 2 * M_PI * i / kPieces;
    for (const double side : {-0.2, 0.2}) {
      const double radius = 1 + side * std::cos(angle / 2);
      band += fmt::format("v {} {} {}\n", radius * std::cos(angle), radius * std::sin(angle),
                          side * std::sin(angle / 2));
    }
    const int a = 2 * i + 1;
    const bool last = i + 1 == kPieces;
    faces += fmt::format("f {} {} {} {}\n", a, a + 1, last ? 1 : a + 3, last ? 2 : a + 2);
  }
  const ImportedMesh twisted = Import(Write("band.obj", band + faces));
  EXPECT_FALSE(twisted.report.watertight);
  EXPECT_EQ(twisted.parts[0].shape.triangles.size(), 4U * kPieces);
}

TEST_F(MeshImport, ColoursOfVerticesAndMaterials) {
  // One colour for all is plain paint.
  const std::string library = "newmtl red ink\nKd 1 0.5 0\nnewmtl blue\nKd 0 0 1\n";
  Write("inks.mtl", library);
  ImportedMesh mesh = Import(Write("plain.obj", "mtllib inks.mtl\nusemtl red ink\n" + kCube));
  EXPECT_EQ(mesh.parts[0].colour, (Colour{255, 128, 0}));
  EXPECT_EQ(mesh.parts[0].picture, nullptr);
  EXPECT_TRUE(mesh.report.remarks.empty());

  // The corner's colour is what the picture shows there.
  const auto expect_corners = [](const ModelPart& part, const auto& colour_at) {
    ASSERT_NE(part.picture, nullptr);
    ASSERT_EQ(part.corner_uv.size(), 3 * part.shape.triangles.size());
    const TextureImage& image = *part.picture;
    EXPECT_EQ(image.pixels.size(), 3U * static_cast<std::size_t>(image.width * image.height));
    for (std::size_t i = 0; i < part.corner_uv.size(); ++i) {
      const int x = static_cast<int>(part.corner_uv[i].x() * static_cast<float>(image.width));
      const int y = static_cast<int>(part.corner_uv[i].y() * static_cast<float>(image.height));
      const std::uint8_t* rgb = &image.pixels[3 * static_cast<std::size_t>(y * image.width + x)];
      EXPECT_EQ((Colour{rgb[0], rgb[1], rgb[2]}), colour_at(i)) << i;
    }
  };
  mesh =
      Import(Write("two.obj", "mtllib inks.mtl\n" + std::string(kCorners) +
                                  "usemtl red ink\nf 4 3 2 1\nusemtl blue\nf 5 6 7 8\nf 1 2 6 5\n"
                                  "f 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"));
  EXPECT_TRUE(mesh.report.watertight);
  expect_corners(mesh.parts[0], [&](std::size_t i) {
    return i < 6 ? Colour{255, 128, 0} : Colour{0, 0, 255};
  });
  const Colour mean = mesh.parts[0].colour;
  EXPECT_NEAR(mean[0], 255 / 6.0, 1);
  EXPECT_NEAR(mean[2], 5 * 255 / 6.0, 1);

  // Colours of vertices: where a corner is says which it has.
  const std::map<std::array<double, 3>, Colour> known{{{0, 0, 0}, {255, 0, 0}},
                                                      {{1, 0, 0}, {0, 255, 0}},
                                                      {{0, 1, 0}, {0, 0, 255}},
                                                      {{0, 0, 1}, {255, 255, 0}}};
  const std::string obj =
      "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0 0 1 1 1 0\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 "
      "4 3\n";
  const std::string ply = fmt::format("{}{}{}", kPlyHeader, kPlyVertices, kPlyFaces);
  for (const auto& [name, bytes] :
       std::vector<std::pair<std::string, std::string>>{{"c.ply", ply}, {"c.obj", obj}}) {
    SCOPED_TRACE(name);
    mesh = Import(Write(name, bytes));
    EXPECT_EQ(mesh.report.turned, name == "c.obj" ? 1U : 0U);
    const ModelPart& part = mesh.parts[0];
    expect_corners(part, [&](std::size_t i) {
      const Eigen::Vector3d& p = part.shape.vertices[part.shape.triangles[i / 3][i % 3]];
      return known.at({p.x(), p.y(), p.z()});
    });
  }
}

TEST_F(MeshImport, PicturesAreLaidOnByTextureCoordinates) {
  // Four quarters: the picture's upper left is red, upper right green, lower left blue.
  cv::Mat picture(8, 8, CV_8UC3, cv::Scalar(255, 255, 255));
  picture(cv::Rect(0, 0, 4, 4)) = cv::Scalar(0, 0, 255);
  picture(cv::Rect(4, 0, 4, 4)) = cv::Scalar(0, 255, 0);
  picture(cv::Rect(0, 4, 4, 4)) = cv::Scalar(255, 0, 0);
  ASSERT_TRUE(cv::imwrite((folder_ / "quarters.png").string(), picture));
  Write("q.mtl", "newmtl q\nKd 0.5 0.5 0.5\nmap_Kd -s 1 1 1 quarters.png\n");
  // A square whose texture coordinates are its own.
  const std::string text =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
  for (const bool given : {false, true}) {
    const ImportedMesh mesh = given ? Import(Write("a.obj", text), 1, folder_ / "quarters.png")
                                    : Import(Write("b.obj", "mtllib q.mtl\nusemtl q\n" + text));
    const ModelPart& part = mesh.parts[0];
    ASSERT_NE(part.picture, nullptr);
    ASSERT_EQ(part.corner_uv.size(), 3 * part.shape.triangles.size());
    const std::uint8_t* first = part.picture->pixels.data();
    EXPECT_EQ((Colour{first[0], first[1], first[2]}), (Colour{255, 0, 0})) << "rows run downwards";
    for (std::size_t i = 0; i < part.corner_uv.size(); ++i) {
      const Eigen::Vector3d& p = part.shape.vertices[part.shape.triangles[i / 3][i % 3]];
      EXPECT_FLOAT_EQ(part.corner_uv[i].x(), static_cast<float>(p.x()));
      EXPECT_FLOAT_EQ(part.corner_uv[i].y(), static_cast<float>(1 - p.y()));
    }
  }
  // What cannot be had is said.
  Write("lost.mtl", "newmtl q\nKd 0.2 0.4 0.6\nmap_Kd lost.png\n");
  ImportedMesh mesh = Import(Write("c.obj", "mtllib lost.mtl\nusemtl q\n" + text));
  EXPECT_EQ(mesh.parts[0].colour, (Colour{51, 102, 153}));
  EXPECT_TRUE(Remarks(mesh.report, "drawn without the picture of material 'q'"));
  EXPECT_TRUE(Remarks(mesh.report, "lost.png: no such image"));
  Write("bad.png", "this is no picture");
  Write("bad.mtl", "newmtl q\nKd red\nmap_Kd bad.png\nKd 2 nan 1\n");
  mesh = Import(Write("d.obj", "mtllib bad.mtl\nusemtl q\n" + text));
  EXPECT_TRUE(Remarks(mesh.report, "bad.png: cannot be decoded as an image"));
  EXPECT_TRUE(Remarks(mesh.report, "Kd of material 'q' is not three numbers from 0 to 1"));
  mesh = Import(Write("e.obj", "mtllib none.mtl\nusemtl q\ncurv 1 2\n" + text));
  EXPECT_TRUE(Remarks(mesh.report, "none.mtl: no such file), so its colours are not known"));
  EXPECT_TRUE(Remarks(mesh.report, "1 lines are no vertices, faces or materials"));
  mesh = Import(Write("f.obj", "mtllib q.mtl\nusemtl q\n" + kCube));
  EXPECT_TRUE(Remarks(mesh.report, "12 faces have a picture but no texture coordinates"));
}

TEST_F(MeshImport, AModelStandsOnTheGround) {
  ModelSpec spec;
  spec.name = kMeshModel;
  spec.file =
      Write("slab.obj", "v 1 2 3\nv 3 2 3\nv 3 5 3\nv 1 5 3\nv 1 2 7\nv 3 2 7\nv 3 5 7\nv 1 5 7\n" +
                            std::string(kQuads));
  spec.scale = 0.1;
  const std::map<std::string, Eigen::Vector3d> sizes{
      {"z", {0.2, 0.3, 0.4}},  {"-z", {0.2, 0.3, 0.4}}, {"y", {0.2, 0.4, 0.3}},
      {"-y", {0.2, 0.4, 0.3}}, {"x", {0.4, 0.3, 0.2}},  {"-x", {0.4, 0.3, 0.2}}};
  for (const auto& [up, size] : sizes) {
    spec.up = up;
    const auto parts = MakeModel(spec);
    ASSERT_TRUE(parts.has_value()) << parts.error().message;
    const Eigen::AlignedBox3d box = BoundsOf(*parts);
    EXPECT_LT((box.sizes() - size).norm(), 1e-12) << up;
    EXPECT_LT(box.center().head<2>().norm(), 1e-12);
    EXPECT_NEAR(box.min().z(), kToyClearance_m, 1e-12);
    EXPECT_NEAR(EnclosedVolume((*parts)[0].shape), 0.024, 1e-12) << "turned, not mirrored";
    EXPECT_EQ((*parts)[0].region, "mesh");
  }
  spec.scale = 100;
  const auto large = MakeModel(spec);
  ASSERT_FALSE(large.has_value());
  EXPECT_NE(large.error().message.find("is 200 x 300 x 400 m at scale 100"), std::string::npos)
      << large.error().message;
}

}  // namespace
}  // namespace tsdfpp
