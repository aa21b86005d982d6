#include "core/ply.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <limits>

#include "core/files.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

using test::TempFolder;

TriangleMesh SomeMesh() {
  TriangleMesh mesh;
  mesh.vertices = {{0.1F, -2, 3e-30F},
                   {std::numeric_limits<float>::denorm_min(), -0.0F, 1},
                   {std::numeric_limits<float>::max(), 5, 6},
                   {1.0F / 3, 7, 8}};
  mesh.triangles = {{0, 1, 2}, {3, 2, 1}};
  mesh.colours = {{0, 1, 2}, {255, 254, 253}, {10, 20, 30}, {128, 127, 126}};
  mesh.face_ids = {3, 65535};
  return mesh;
}

void ExpectSame(const TriangleMesh& a, const TriangleMesh& b) {
  ASSERT_EQ(a.vertices.size(), b.vertices.size());
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      // Bit for bit, the sign of a zero and numbers that are none, too.
      EXPECT_EQ(std::bit_cast<std::uint32_t>(a.vertices[i][axis]),
                std::bit_cast<std::uint32_t>(b.vertices[i][axis]))
          << i;
    }
  }
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.colours, b.colours);
  EXPECT_EQ(a.face_ids, b.face_ids);
}

TEST(Ply, RoundTripIsExact) {
  const TempFolder folder;
  ASSERT_TRUE(WritePly(folder / "m.ply", SomeMesh()).has_value());
  ExpectSame(ReadPly(folder / "m.ply").value(), SomeMesh());
}

TEST(Ply, RoundTripWithoutColoursAndIds) {
  const TempFolder folder;
  TriangleMesh mesh = SomeMesh();
  mesh.colours.clear();
  mesh.face_ids.clear();
  ASSERT_TRUE(WritePly(folder / "m.ply", mesh).has_value());
  ExpectSame(ReadPly(folder / "m.ply").value(), mesh);
  ASSERT_TRUE(WritePly(folder / "none.ply", {}).has_value());
  ExpectSame(ReadPly(folder / "none.ply").value(), {});
}

// Of what is somewhere in a world: SomeMesh() has a corner at the end of all numbers.
TriangleMesh SomeModel() {
  TriangleMesh mesh = SomeMesh();
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex = vertex.cwiseMin(1e7F).cwiseMax(-1e7F);
  return mesh;
}

TEST(Ply, AModelIsSomewhere) {
  const TempFolder folder;
  ASSERT_TRUE(WritePly(folder / "m.ply", SomeMesh()).has_value());
  const auto read = ReadTrueModel(folder / "m.ply", {2, "car", "car"});
  ASSERT_FALSE(read.has_value());
  EXPECT_NE(read.error().message.find("m.ply: a position is 3.40282e+38 m from the origin, "),
            std::string::npos)
      << read.error().message;
}

TEST(Ply, TrueModelRoundTripIsExact) {
  const TempFolder folder;
  const ObjectInfo info{0, "background", "background"};
  const TrueModel model{info, SomeModel(), {"table", "floor", "north wall"}, {2, 0}};
  ASSERT_TRUE(WriteTrueModel(folder / "m.ply", model).has_value());
  const auto read = ReadTrueModel(folder / "m.ply", info);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  ExpectSame(read->mesh_O, model.mesh_O);
  EXPECT_EQ(read->regions, model.regions);
  EXPECT_EQ(read->face_region, model.face_region);
  EXPECT_EQ(read->info, info);
}

TEST(Ply, MeshWithoutRegionsIsOneRegionNamedAfterTheObject) {
  const TempFolder folder;
  ASSERT_TRUE(WritePly(folder / "m.ply", SomeModel()).has_value());
  const TrueModel read = ReadTrueModel(folder / "m.ply", {2, "car", "car"}).value();
  EXPECT_EQ(read.regions, std::vector<std::string>{"car"});
  EXPECT_EQ(read.face_region, (std::vector<std::uint16_t>{0, 0}));
}

TEST(Ply, AsciiWithPolygonsForeignPropertiesAndElements) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "a.ply",
                        "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\n"
                        "element vertex 4\r\nproperty double x\r\nproperty double y\r\n"
                        "property double z\r\nproperty float nx\r\nproperty uchar red\r\n"
                        "property uchar green\r\nproperty uchar blue\r\n"
                        "element edge 1\r\nproperty int vertex1\r\nproperty list uchar int hops\r\n"
                        "element face 1\r\nproperty list uchar uint vertex_index\r\n"
                        "property ushort object_id\r\nend_header\r\n"
                        "0 0 0 0.5 1 2 3\r\n1 0 0 0.5 4 5 6\r\n1 1 0 0.5 7 8 9\r\n"
                        "0 1 -1.5e0 0.5 10 11 12\r\n"
                        "-1 2 7 8\r\n4 0 1 2 3 9\r\n")
                  .has_value());
  const auto mesh = ReadPly(folder / "a.ply");
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  TriangleMesh expected;
  expected.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, -1.5F}};
  expected.triangles = {{0, 1, 2}, {0, 2, 3}};
  expected.colours = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}};
  expected.face_ids = {9, 9};
  ExpectSame(*mesh, expected);
}

// Written by another program; count and bounds were read with Python's struct.
TEST(Ply, ReadsThirdPartyPoints) {
  const std::filesystem::path geometry = test::CopiedData("geometry");
  const struct {
    const char* file;
    std::size_t count;
    float smallest_x;
    float largest_x;
  } cases[] = {{"mustard_gt_points.ply", 6000, -0.0428810902F, 0.0535113141F},
               {"mustard_model_points.ply", 394, -0.04287F, 0.0533600003F},
               {"mustard_pred_points.ply", 3846, -0.0524094887F, 0.0628915504F}};
  for (const auto& [file, count, smallest_x, largest_x] : cases) {
    const auto mesh = ReadPly(geometry / file);
    ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
    EXPECT_EQ(mesh->vertices.size(), count);
    EXPECT_TRUE(mesh->triangles.empty());
    EXPECT_TRUE(mesh->colours.empty());
    float smallest = std::numeric_limits<float>::max();
    float largest = -smallest;
    for (const Eigen::Vector3f& v : mesh->vertices) {
      smallest = std::min(smallest, v.x());
      largest = std::max(largest, v.x());
    }
    EXPECT_EQ(smallest, smallest_x);
    EXPECT_EQ(largest, largest_x);
  }
}

TEST(Ply, MalformedFilesAreNamed) {
  const TempFolder folder;
  const std::string vertices =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
  const std::string short_file =
      "the file ends, or holds something unreadable, before its header's counts are reached";
  const std::string bad_line = ": its line has more or fewer numbers than the header says";
  const std::string too_long = "the file holds more than its header counts";
  const std::string bad_face = "face 0 names a vertex or region that the file does not have";
  const struct {
    std::string text;
    std::string sentence;
  } cases[] = {
      {"", "not a PLY file: no end_header"},
      {"solid x\n", "not a PLY file: it does not begin with 'ply'"},
      {"ply\nformat ascii 1.0\n", "not a PLY file: no end_header"},
      {"ply\nformat binary_big_endian 1.0\nend_header\n",
       "PLY format 'binary_big_endian', expected ascii or binary_little_endian"},
      {"ply\nformat ascii 1.0\nelement vertex -3\nend_header\n",
       "PLY element line 'element vertex -3' cannot be read"},
      {"ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n",
       "PLY element line 'element vertex 99999999999' cannot be read"},
      {"ply\nformat ascii 1.0\nproperty float x\nend_header\n",
       "PLY property line 'property float x' cannot be read"},
      {vertices + "property half w\nend_header\n",
       "PLY property line 'property half w' cannot be read"},
      {vertices + "property list half int w\nend_header\n",
       "PLY property line 'property list half int w' cannot be read"},
      {vertices + "element face 1\nproperty list uchar float vertex_indices\nend_header\n" +
           points + "3 0 1.5 2\n",
       bad_face},
      // Elements that take no bytes would be counted for ever.
      {"ply\nformat ascii 1.0\nelement junk 20\nend_header\n",
       "20 elements 'junk' have no property, expected one at least"},
      // Else the mesh would have no triangle.
      {vertices + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" +
           points + "4 0 1 2 -1\n",
       "its triangles are strips (element 'tristrips'), expected faces"},
      {"ply\nformat ascii 1.0\ncomment region 0 a\x1b[31m\nend_header\n",
       "region 0 'a\\x1b[31m' holds a control character"},
      {vertices + "end_header\n0 0 0\n1 0 0\n", short_file},
      {vertices + "end_header\n0 0 0\n1 zero 0\n0 1 0\n", short_file},
      {vertices + "end_header\n0 0 0\n1 0 nan\n0 1 0\n", "a vertex has no finite x, y, z"},
      {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n0 "
       "0\n",
       "a vertex has no finite x, y, z"},
      {vertices + faces + "end_header\n" + points + "3 0 1 3\n", bad_face},
      {vertices + faces + "end_header\n" + points + "3 0 -1 2\n", bad_face},
      {vertices + faces + "end_header\n" + points + "3 0 nan 2\n", bad_face},
      {vertices + faces + "end_header\n" + points + "-3 0 1 2\n", short_file},
      {vertices + faces + "end_header\n" + points + "nan 0 1 2\n", short_file},
      {vertices + faces + "end_header\n" + points + "3 0 1", short_file},
      // A line an element, with the numbers that the header says, and nothing after them.
      {vertices + faces + "end_header\n" + points + "3 0 1\n", "'face' 0" + bad_line},
      {vertices + faces + "end_header\n" + points + "3 0 1 2 1\n", "'face' 0" + bad_line},
      {vertices + "end_header\n0 0 0\n1 0 0 1\n0 1 0\n", "'vertex' 1" + bad_line},
      {vertices + "end_header\n0 0 0\n1 0\n0 1 0\n", "'vertex' 1" + bad_line},
      {vertices + faces + "end_header\n" + points + "3 0 1 2\n3 0 2 1\n", too_long},
      {vertices + "end_header\n" + points + "\n 1\n", too_long},
      {vertices + faces + "end_header\n" + points + "2 0 1\n",
       "face 0 has 2 corners, expected 3 at least"},
      {vertices + faces + "end_header\n" + points + "0\n",
       "face 0 has 0 corners, expected 3 at least"},
      {vertices + faces + "property int object_id\nend_header\n" + points + "3 0 1 2 70000\n",
       short_file},
      {"ply\ncomment region 1 floor\n" + vertices.substr(4) + "end_header\n" + points,
       "region comments are not numbered 0, 1, ..."},
      {"ply\ncomment region 0 floor\n" + vertices.substr(4) + faces +
           "property ushort region\nend_header\n" + points + "3 0 1 2 1\n",
       bad_face},
  };
  for (const auto& [text, sentence] : cases) {
    ASSERT_TRUE(WriteFile(folder / "bad.ply", text).has_value());
    const auto mesh = ReadPly(folder / "bad.ply");
    ASSERT_FALSE(mesh.has_value()) << text;
    EXPECT_EQ(mesh.error().kind, ErrorKind::kData);
    EXPECT_EQ(mesh.error().message, (folder / "bad.ply").string() + ": " + sentence) << text;
  }
}

// An arrowhead: a fan from its first corner would lie over the notch.
TEST(Ply, FacesThatAreNotConvexAreCut) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "a.ply",
                        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
                        "property float y\nproperty float z\nelement face 1\n"
                        "property list uchar int vertex_indices\nproperty ushort object_id\n"
                        "end_header\n0 0 1\n2 2 1\n0 1 1\n-2 2 1\n\n4 1 2 3 0 7\n\n \n")
                  .has_value());
  const auto mesh = ReadPly(folder / "a.ply");
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  ASSERT_EQ(mesh->triangles.size(), 2U);
  EXPECT_EQ(mesh->face_ids, (std::vector<InstanceId>{7, 7}));
  float area = 0;
  for (const auto& [a, b, c] : mesh->triangles) {
    const Eigen::Vector3f normal =
        (mesh->vertices[b] - mesh->vertices[a]).cross(mesh->vertices[c] - mesh->vertices[a]);
    EXPECT_GT(normal.z(), 0);
    area += normal.norm() / 2;
  }
  EXPECT_NEAR(area, 2, 1e-6);
}

// An id a face or none: whoever reads them looks at the id of every face.
TEST(Ply, IdsOfSomeFacesAreNone) {
  const TempFolder folder;
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\n" +
      faces + "property int object_id\n" + faces +
      "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 7\n3 0 2 1\n";
  ASSERT_TRUE(WriteFile(folder / "some.ply", text).has_value());
  const auto mesh = ReadPly(folder / "some.ply");
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_EQ(mesh->triangles.size(), 2U);
  EXPECT_TRUE(mesh->face_ids.empty());
}

// Every cut of a binary file is an error, never a crash or a shorter mesh.
TEST(Ply, CutBinaryFilesAreErrors) {
  const TempFolder folder;
  ASSERT_TRUE(WritePly(folder / "m.ply", SomeMesh()).has_value());
  const std::string bytes = ReadFile(folder / "m.ply").value();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ASSERT_TRUE(WriteFile(folder / "cut.ply", bytes.substr(0, size)).has_value());
    EXPECT_FALSE(ReadPly(folder / "cut.ply").has_value()) << size;
  }
}

TEST(Ply, BinaryFilesEndWhereTheirHeaderSays) {
  const TempFolder folder;
  ASSERT_TRUE(WritePly(folder / "m.ply", SomeMesh()).has_value());
  const std::string bytes = ReadFile(folder / "m.ply").value();
  ASSERT_TRUE(WriteFile(folder / "long.ply", bytes + bytes.back()).has_value());
  const auto mesh = ReadPly(folder / "long.ply");
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().message,
            (folder / "long.ply").string() + ": the file holds more than its header counts");
}

TEST(Ply, UnwritableFileIsTheEnvironmentsFault) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "file", "").has_value());
  const auto result = WritePly(folder / "file/m.ply", SomeMesh());
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kEnvironment);
}

}  // namespace
}  // namespace tsdfpp
