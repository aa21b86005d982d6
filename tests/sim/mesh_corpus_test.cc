// A corpus of broken mesh files, each of which gets its sentence; none may crash.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "core/random.h"
#include "tests/sim/mesh_texts.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using MeshCorpus = MeshFolder;

struct Broken {
  const char* name;
  std::string bytes;
  ErrorKind kind;
  const char* sentence;  // a part of it
};

std::vector<Broken> Corpus() {
  const ErrorKind data = ErrorKind::kData;
  const ErrorKind usage = ErrorKind::kUsage;
  std::string infinite = BinaryStl("x", 12);
  const float inf = INFINITY;
  std::memcpy(infinite.data() + 84 + 12, &inf, sizeof(inf));
  std::string many_corners = "f";
  std::string concave;  // of as many as a face may have
  std::string zigzag;
  for (int i = 0; i < 500; ++i) {
    zigzag += fmt::format("v {} {} 0\n", i < 250 ? i : 500 - i, (i < 250 ? 0 : 1) + 0.5 * (i % 2));
    many_corners += fmt::format(" {}", i + 1);
    if (i == 399) concave = many_corners + "\n";
  }
  std::string many_concave;
  for (int k = 0; k < 25; ++k) many_concave += concave;
  return {
      {"empty.obj", "", data, "is empty: 0 vertices and no face"},
      {"points.obj", kCorners, data, "is empty: 8 vertices and no face"},
      {"word.obj", "v 0 0 zero\n", data, "line 1: 'zero' is not a number"},
      {"nan.obj", "v 0 0 nan\n", data, "line 1: 'nan' is not a finite number"},
      {"inf.obj", "v 0 -inf 0\n", data, "line 1: '-inf' is not a finite number"},
      {"huge.obj", "v 0 1e999 0\n", data, "line 1: '1e999' is not a number"},
      {"short.obj", "v 0 0\n", data, "line 1: a vertex has 2 numbers, expected 3"},
      {"far.obj", "vt 0 1e30\n", data, "line 1: texture coordinate 0 1e+30 is beyond 10000"},
      {"vt.obj", "vt\n", data, "line 1: a texture coordinate has no number"},
      {"range.obj", std::string(kCorners) + "f 1 2 9\n", data,
       "line 9: names vertex 9, but there are 8 so far"},
      {"zero.obj", std::string(kCorners) + "f 0 1 2\n", data,
       "line 9: names vertex 0, but there are 8 so far"},
      {"back.obj", std::string(kCorners) + "f -9 1 2\n", data, "names vertex -9"},
      {"ahead.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n", data,
       "line 1: names vertex 1, but there are 0 so far"},
      {"uv.obj", std::string(kCorners) + "f 1/1 2/2 3/3\n", data,
       "line 9: names texture coordinate 1, but there are 0 so far"},
      {"index.obj", std::string(kCorners) + "f 1 2 x\n", data, "'x' is no index of a vertex"},
      {"large.obj", std::string(kCorners) + "f 1 2 99999999999999999999\n", data,
       "'99999999999999999999' is no index of a vertex"},
      {"pair.obj", std::string(kCorners) + "f 1 2\n", data, "a face has 2 corners, expected 3"},
      {"line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\n", data,
       "none of its 2 triangles has an area"},
      {"cut.obj", std::string(kCorners) + "f 1 2 \\\n", data, "cut off within line 9"},
      {"binary.obj", std::string("v 0 0 0\n\0\1\2", 11), data, "not an OBJ file: it is not text"},
      {"concave.obj", zigzag + many_corners + "\n", data,
       "a face that is not convex has 500 corners, expected 400 at most"},
      {"concaves.obj", zigzag + many_concave, data,
       "its faces that are not convex take too long to cut, expected triangles"},
      {"millimetres.obj", "v 0 0 0\nv 130 0 0\nv 0 80 0\nf 1 2 3\n", usage,
       "is 130 x 80 x 0 m at scale 1, expected a longest side of 0.001 to 10 m: is the file in "
       "another unit? Set scale (0.001 for millimetres)"},
      {"tiny.obj", "v 0 0 0\nv 1e-5 0 0\nv 0 1e-5 0\nf 1 2 3\n", usage,
       "is 1e-05 x 1e-05 x 0 m at scale 1"},
      {"vast.obj", "v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nf 1 2 3\n", usage, "m at scale 1, expected"},
      {"empty.stl", "", data, "not an STL file: it has 0 bytes, a binary one has 84 at least"},
      {"text.stl", std::string(200, 'a'), data, "the binary STL file is cut off"},
      {"cut.stl", BinaryStl("x", 12).substr(0, 400), data,
       "is cut off: 12 triangles need 684 bytes, it has 400"},
      {"long.stl", BinaryStl("x", 12) + "\n", data,
       "the binary STL file holds more than it counts: 12 triangles need 684 bytes, it has 685"},
      {"fewer.stl", BinaryStl("x", 11), data, "11 triangles need 634 bytes, it has 684"},
      {"ascii_open.stl",
       "solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendfacet\nfacet\nvertex 0 0 0\n"
       "vertex 1 0 0\nvertex 1 1 0\nendsolid\n",
       data, "the last facet has no endfacet"},
      {"count.stl", BinaryStl("x", 4000000000U), data, "4000000000 triangles need 200000000084"},
      {"none.stl", BinaryStl("x", 0).substr(0, 84), data, "is empty: 0 vertices and no face"},
      {"inf.stl", infinite, data, "triangle 0 has a corner that is not finite"},
      {"ascii_cut.stl", AsciiStl().substr(0, 300), data, "cut off"},
      {"ascii_two.stl",
       "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid\n", data,
       "line 7: the facet has 2 vertices, expected 3"},
      {"ascii_four.stl",
       "solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendfacet\nendsolid\n",
       data, "line 6: a facet is expected to have three vertices of three numbers"},
      {"ascii_word.stl", "solid\nfacet\nvertex 0 0 o\nendfacet\nendsolid\n", data,
       "line 3: 'o' is not a number"},
      {"ascii_nan.stl",
       "solid\nfacet\nvertex 0 0 nan\nvertex 1 0 0\nvertex 1 1 0\nendfacet\nendsolid\n", data,
       "triangle 0 has a corner that is not finite"},
      {"ascii_else.stl", "solid\n<html>\nendsolid\n", data,
       "line 2: '<html>' is no word of an ASCII STL"},
      {"ascii_none.stl", "solid\nendsolid\n", data, "is empty"},
      {"empty.ply", "", data, "not a PLY file"},
      {"stl.ply", AsciiStl(), data, "not a PLY file: it does not begin with 'ply'"},
      {"cut.ply", kPlyHeader + kPlyVertices, data, "the file ends, or holds something unreadable"},
      {"range.ply", kPlyHeader + kPlyVertices + "3 0 2 1\n3 0 1 4\n3 0 3 2\n3 1 2 3\n", data,
       "face 1 names a vertex or region that the file does not have"},
      {"nan.ply", kPlyHeader + "nan 0 0 1 2 3\n" + kPlyVertices.substr(14) + kPlyFaces, data,
       "a vertex has no finite x, y, z"},
      {"points.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
       "property float z\nend_header\n0 0 0\n",
       data, "is empty: 1 vertices and no face"},
      {"model.fbx", kCube, usage, "a mesh is expected to be an .obj, .stl or .ply file"},
      {"noending", kCube, usage, "a mesh is expected to be an .obj, .stl or .ply file"},
  };
}

TEST_F(MeshCorpus, EveryBrokenFileGetsItsSentence) {
  const std::vector<Broken> corpus = Corpus();
  EXPECT_GE(corpus.size(), 40U);
  for (const Broken& broken : corpus) {
    SCOPED_TRACE(broken.name);
    const fs::path path = Write(broken.name, broken.bytes);
    const auto mesh = ImportMesh(path);
    ASSERT_FALSE(mesh.has_value());
    EXPECT_EQ(mesh.error().kind, broken.kind);
    EXPECT_NE(mesh.error().message.find(broken.sentence), std::string::npos)
        << mesh.error().message;
    EXPECT_EQ(mesh.error().message.rfind(path.string() + ": ", 0), 0U) << mesh.error().message;
  }
  const auto missing = ImportMesh(folder_ / "nowhere.obj");
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().kind, ErrorKind::kData);
  EXPECT_EQ(missing.error().message, (folder_ / "nowhere.obj").string() + ": no such file");
  fs::create_directory(folder_ / "folder.stl");
  const auto folder = ImportMesh(folder_ / "folder.stl");
  ASSERT_FALSE(folder.has_value());
  EXPECT_EQ(folder.error().kind, ErrorKind::kData);
}

TEST_F(MeshCorpus, AGivenPictureMustFit) {
  const fs::path cube = Write("cube.obj", kCube);
  auto mesh = ImportMesh(cube, 1, folder_ / "none.png");
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().kind, ErrorKind::kData);
  EXPECT_NE(mesh.error().message.find("none.png: no such image"), std::string::npos);
  const fs::path text = Write("text.png", "text");
  mesh = ImportMesh(cube, 1, text);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_NE(mesh.error().message.find("text.png: cannot be decoded as an image"),
            std::string::npos);
  ASSERT_TRUE(
      cv::imwrite((folder_ / "ok.png").string(), cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(9))));
  mesh = ImportMesh(cube, 1, folder_ / "ok.png");
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().kind, ErrorKind::kData);
  EXPECT_NE(mesh.error().message.find("12 of its faces have no texture coordinates"),
            std::string::npos)
      << mesh.error().message;
}

// Cut off anywhere, or with any byte changed: a value or an error, never a crash (run under ASan).
TEST_F(MeshCorpus, DamagedFilesNeverCrash) {
  const std::vector<std::pair<std::string, std::string>> whole{
      {"a.obj", kCube},
      {"b.stl", BinaryStl("x", 12)},
      {"c.stl", AsciiStl().substr(0, 600) + "\nendsolid\n"},
      {"d.ply", kPlyHeader + kPlyVertices + kPlyFaces}};
  int refused = 0;
  for (const auto& [name, bytes] : whole) {
    for (std::size_t length = 0; length < bytes.size(); length += 11) {
      const auto mesh = ImportMesh(Write(name, bytes.substr(0, length)));
      refused += mesh.has_value() ? 0 : 1;
    }
    for (std::uint64_t i = 0; i < 150; ++i) {
      std::string damaged = bytes;
      const auto draw = UniformDraw(1, 900, i);
      for (const std::size_t k : {0U, 2U}) {
        damaged[static_cast<std::size_t>(draw[k] * static_cast<double>(bytes.size()))] =
            static_cast<char>(draw[k + 1] * 256);
      }
      const auto mesh = ImportMesh(Write(name, damaged));
      refused += mesh.has_value() ? 0 : 1;
    }
  }
  EXPECT_GT(refused, 200);
}

}  // namespace
}  // namespace tsdfpp
