// Binary glTF: what is written is valid and comes back, what others write is read, and bad files
// are refused in one sentence.
#include "core/gltf.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/files.h"
#include "core/gltf_format.h"
#include "tests/core/glb_validator.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using nlohmann::json;
using test::GlbValidator;
using test::TempFolder;

std::vector<NamedMesh> SomeObjects() {
  NamedMesh car{"car", 2, {}};
  car.mesh.vertices = {{0.1F, -2, 3e-30F}, {1e20F, 0, 1}, {-7, 5, 6}, {1.0F / 3, 7, 8}};
  car.mesh.triangles = {{0, 1, 2}, {3, 2, 1}};
  car.mesh.colours = {{0, 1, 2}, {255, 254, 253}, {10, 20, 30}, {128, 127, 126}};
  NamedMesh plain{"no \"colour\"\n\xC3\xA9", kNoInstance, {}};
  plain.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  plain.mesh.triangles = {{0, 1, 2}};
  return {car, plain};
}

void ExpectSame(const std::vector<NamedMesh>& a, const std::vector<NamedMesh>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].name, b[i].name);
    EXPECT_EQ(a[i].id, b[i].id);
    EXPECT_EQ(a[i].mesh.vertices, b[i].mesh.vertices);
    EXPECT_EQ(a[i].mesh.triangles, b[i].mesh.triangles);
    EXPECT_EQ(a[i].mesh.colours, b[i].mesh.colours);
  }
}

std::string Written(const TempFolder& folder, const std::vector<NamedMesh>& objects) {
  const auto written = WriteGlb(folder / "m.glb", objects);
  EXPECT_TRUE(written.has_value()) << written.error().message;
  return ReadFile(folder / "m.glb").value();
}

TEST(Gltf, IsWhatTheSpecificationAsksFor) {
  const TempFolder folder;
  const GlbValidator file(Written(folder, SomeObjects()));
  EXPECT_EQ(file.faults(), std::vector<std::string>{});
  const json& nodes = file.document()["nodes"];
  ASSERT_EQ(nodes.size(), 3U);
  EXPECT_EQ(nodes[0]["children"], json({1, 2}));
  EXPECT_EQ(nodes[1]["name"], "car");
  EXPECT_EQ(nodes[1]["extras"]["object_id"], 2);
  EXPECT_FALSE(nodes[2].contains("extras"));
  // The root's matrix, by columns, takes our z to glTF's y, and our y to glTF's -z.
  EXPECT_EQ(nodes[0]["matrix"], json({1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1}));
  // Read with the numbers of the specification alone.
  const json& attributes = file.document()["meshes"][0]["primitives"][0]["attributes"];
  EXPECT_EQ(file.At<float>(attributes["POSITION"], 1, 0), 1e20F);
  EXPECT_EQ(file.At<float>(attributes["POSITION"], 3, 1), 7);
  const std::size_t colour = attributes["COLOR_0"];
  EXPECT_EQ(file.At<std::uint16_t>(colour, 0, 0), 0);
  EXPECT_EQ(file.At<std::uint16_t>(colour, 1, 0), 65535);
  // IEC 61966-2-1: sRGB 128 is 0.21586 of full light.
  EXPECT_NEAR(file.At<std::uint16_t>(colour, 3, 0) / 65535.0, 0.21586, 1e-5);
  EXPECT_EQ(file.At<std::uint16_t>(colour, 3, 3), 65535);
}

TEST(Gltf, TheValidatorNoticesFaults) {
  const TempFolder folder;
  const std::string bytes = Written(folder, SomeObjects());
  EXPECT_FALSE(GlbValidator(bytes.substr(0, bytes.size() - 1)).faults().empty());
  for (const std::string_view text : {"\"version\":\"2.0\"", "1.0000000200408773e+20", "5126"}) {
    std::string changed = bytes;
    const std::size_t at = changed.find(text);
    ASSERT_NE(at, std::string::npos) << text;
    char& last = changed[at + text.size() - (text.back() == '"' ? 2 : 1)];
    last = last == '0' ? '1' : '0';
    EXPECT_FALSE(GlbValidator(changed).faults().empty()) << text;
  }
  std::string changed = bytes;
  changed[changed.size() - 4] = 9;  // an index
  EXPECT_FALSE(GlbValidator(changed).faults().empty());
}

TEST(Gltf, RoundTripIsExact) {
  const TempFolder folder;
  Written(folder, SomeObjects());
  const auto read = ReadGlb(folder / "m.glb");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  ExpectSame(*read, SomeObjects());
}

TEST(Gltf, EveryColourComesBack) {
  const TempFolder folder;
  NamedMesh grey{"grey", 1, {}};
  for (int i = 0; i < 256; ++i) {
    grey.mesh.vertices.emplace_back(static_cast<float>(i), 0, 0);
    const auto level = static_cast<std::uint8_t>(i);
    grey.mesh.colours.push_back({level, level, level});
  }
  grey.mesh.triangles = {{0, 1, 255}};
  Written(folder, {grey});
  ExpectSame(ReadGlb(folder / "m.glb").value(), {grey});
}

TEST(Gltf, ObjectsWithoutTrianglesAreNodesAlone) {
  const TempFolder folder;
  for (const std::vector<NamedMesh>& objects :
       {std::vector<NamedMesh>{}, std::vector<NamedMesh>{{"nothing", 3, {}}}}) {
    const GlbValidator file(Written(folder, objects));
    EXPECT_EQ(file.faults(), std::vector<std::string>{});
    const auto read = ReadGlb(folder / "m.glb");
    ASSERT_TRUE(read.has_value()) << read.error().message;
    EXPECT_TRUE(read->empty());
  }
}

TEST(Gltf, WhatCannotBeWritten) {
  const TempFolder folder;
  std::vector<NamedMesh> objects = SomeObjects();
  objects[0].mesh.vertices[1].y() = std::numeric_limits<float>::infinity();
  const auto infinite = WriteGlb(folder / "m.glb", objects);
  ASSERT_FALSE(infinite.has_value());
  EXPECT_EQ(infinite.error().kind, ErrorKind::kData);
  EXPECT_EQ(folder.Entries(), 0);
  ASSERT_TRUE(WriteFile(folder / "file", "").has_value());
  const auto blocked = WriteGlb(folder / "file/m.glb", SomeObjects());
  ASSERT_FALSE(blocked.has_value());
  EXPECT_EQ(blocked.error().kind, ErrorKind::kEnvironment);
}

TEST(Gltf, AMeshIsSplitByItsFaceIds) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.colours = {{1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {4, 4, 4}};
  mesh.triangles = {{0, 1, 2}, {3, 1, 2}, {0, 2, 1}};
  mesh.face_ids = {5, 0, 5};
  const auto name_of = [](InstanceId id) { return "object " + std::to_string(id); };
  NamedMesh background{"object 0", 0, {}};
  background.mesh.vertices = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}};
  background.mesh.colours = {{4, 4, 4}, {2, 2, 2}, {3, 3, 3}};
  background.mesh.triangles = {{0, 1, 2}};
  NamedMesh five{"object 5", 5, {}};
  five.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  five.mesh.colours = {{1, 1, 1}, {2, 2, 2}, {3, 3, 3}};
  five.mesh.triangles = {{0, 1, 2}, {0, 2, 1}};
  ExpectSame(SplitByFaceIds(mesh, name_of), {background, five});
}

// A file as another program may write it.
std::string Glb(const json& document, std::string body) {
  std::string text = document.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  body.resize((body.size() + 3) / 4 * 4, '\0');
  const auto word = [](std::size_t value) {
    std::string bytes;
    for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFF);
    return bytes;
  };
  return "glTF" + word(2) + word(28 + text.size() + body.size()) + word(text.size()) + "JSON" +
         text + word(body.size()) + std::string("BIN\0", 4) + body;
}

template <typename T>
void Append(std::string& bytes, std::initializer_list<T> values) {
  for (const T value : values) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
}

// A square of four corners as strip, fan and triangles, colours interleaved with a stride.
struct Foreign {
  json document;
  std::string body;

  Foreign() {
    Append<float>(body, {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0});  // 48 bytes
    Append<std::uint8_t>(body, {255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 255, 9, 55, 188, 255, 9});
    Append<std::uint16_t>(body, {0, 1, 2, 3, 0, 1, 3, 2, 0, 1, 2, 2, 1, 3});
    document = json::parse(R"({
      "asset": {"version": "2.0"},
      "scenes": [{"nodes": [0]}],
      "nodes": [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"name": "half turn about y", "rotation": [0, 1, 0, 0], "scale": [2, 1, 1], "mesh": 0},
        {"mesh": 1, "scale": [1, 1, -1], "extras": {"object_id": 7}}],
      "meshes": [
        {"primitives": [
          {"attributes": {"POSITION": 0}, "mode": 5, "indices": 2},
          {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 6, "indices": 3}]},
        {"name": "named mesh", "primitives": [{"attributes": {"POSITION": 0}, "indices": 4}]}],
      "accessors": [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
        {"bufferView": 1, "componentType": 5121, "type": "VEC3", "count": 4, "normalized": true},
        {"bufferView": 2, "componentType": 5123, "type": "SCALAR", "count": 4},
        {"bufferView": 2, "byteOffset": 8, "componentType": 5123, "type": "SCALAR", "count": 4},
        {"bufferView": 2, "byteOffset": 16, "componentType": 5123, "type": "SCALAR", "count": 6}],
      "bufferViews": [
        {"buffer": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 16, "byteStride": 4},
        {"buffer": 0, "byteOffset": 64, "byteLength": 28}],
      "buffers": [{"byteLength": 92}]})");
  }
};

Expected<std::vector<NamedMesh>> ReadBytes(const TempFolder& folder, const std::string& bytes) {
  EXPECT_TRUE(WriteFile(folder / "f.glb", bytes).has_value());
  return ReadGlb(folder / "f.glb");
}

TEST(Gltf, ForeignFilesArePlacedAndTurnedToZUp) {
  const TempFolder folder;
  const Foreign file;
  const auto read = ReadBytes(folder, Glb(file.document, file.body));
  ASSERT_TRUE(read.has_value()) << read.error().message;
  ASSERT_EQ(read->size(), 2U);
  const NamedMesh& turned = (*read)[0];
  EXPECT_EQ(turned.name, "half turn about y");
  EXPECT_EQ(turned.id, kNoInstance);
  // (x, y, z) becomes (10 - 2x, y, -z) in glTF's world, then y becomes z.
  EXPECT_EQ(turned.mesh.vertices, (std::vector<Eigen::Vector3f>{{10, 0, 0},
                                                                {8, 0, 0},
                                                                {10, 0, 1},
                                                                {8, 0, 1},
                                                                {10, 0, 0},
                                                                {8, 0, 0},
                                                                {10, 0, 1},
                                                                {8, 0, 1}}));
  // The strip 0 1 2 3 is (0, 1, 2), (1, 3, 2); the fan 0 1 3 2 is (1, 3, 0), (3, 2, 0).
  EXPECT_EQ(turned.mesh.triangles, (std::vector<std::array<std::uint32_t, 3>>{
                                       {0, 1, 2}, {1, 3, 2}, {5, 7, 4}, {7, 6, 4}}));
  const Colour white{255, 255, 255};
  EXPECT_EQ(
      turned.mesh.colours,
      (std::vector<Colour>{
          white, white, white, white, {255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {128, 223, 255}}));
  // Mirrored: the corners are taken the other way round, so that the outside stays outside.
  const NamedMesh& mirrored = (*read)[1];
  EXPECT_EQ(mirrored.name, "named mesh");
  EXPECT_EQ(mirrored.id, 7);
  EXPECT_EQ(mirrored.mesh.triangles,
            (std::vector<std::array<std::uint32_t, 3>>{{0, 2, 1}, {2, 3, 1}}));
  EXPECT_EQ(mirrored.mesh.vertices[3], Eigen::Vector3f(11, 0, 1));
}

TEST(Gltf, MalformedFilesAreNamed) {
  const TempFolder folder;
  struct Case {
    std::string pointer;
    json value;  // null: taken out
    std::string sentence;
  };
  const Case cases[] = {
      {"/scenes", nullptr, "the file names number 0 of 'scenes', which is not there"},
      {"/scenes/0/nodes", "all", "the scene's 'nodes' is not a list"},
      {"/scenes/0/nodes/0", -1, "the scene's nodes are not all numbers"},
      {"/scenes/0/nodes/0", 9, "the scene or a node names number 9 of 'nodes', which is not there"},
      {"/nodes/2/children", json({0}), "node 0 has more than one parent"},
      {"/nodes/0/children/0", "x", "node 0: a child is not a node's number"},
      {"/nodes/0/translation", json({1, 2}), "node 0: 'translation' is not a list of 3 numbers"},
      {"/nodes/1/rotation", json({0, 0, 0, 2}), "node 1: its rotation is not a unit quaternion"},
      {"/nodes/1/matrix", json({1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}),
       "node 1: the last row of its matrix is not 0 0 0 1"},
      {"/nodes/1/mesh", 2, "node 1 names number 2 of 'meshes', which is not there"},
      {"/nodes/2/extras/object_id", 70000,
       "node 2: 'object_id' is 70000, expected a whole number from 0 to 65535"},
      {"/nodes/2/scale", json({1e300, 1, 1e300}),
       "node 2 places a vertex beyond what a float can hold"},
      {"/meshes/0/primitives", 3, "mesh 0 has no primitives"},
      {"/meshes/0/primitives/0", 3, "a primitive of mesh 0 is not an object"},
      {"/meshes/0/primitives/0/attributes", json::object(), "mesh 0 has no POSITION"},
      {"/meshes/0/primitives/0/mode", 1, "mesh 0: its mode is 1, expected triangles (4, 5 or 6)"},
      {"/meshes/1/primitives/0/indices", 2, "mesh 1: 4 corners are no whole number of triangles"},
      {"/meshes/1/primitives/0/indices", 0, "mesh 1: its indices are not unsigned integers"},
      {"/meshes/0/primitives/1/attributes/COLOR_0", 2,
       "mesh 0: its colours are not one of three or four floats or normalized integers a vertex"},
      {"/meshes/0/primitives/1/attributes/POSITION", 1,
       "mesh 0: its positions are not three floats each"},
      {"/accessors/0/count", 5, "accessor 0 reaches beyond its bufferView of 48 bytes"},
      {"/accessors/0/count", nullptr, "accessor 0 has no 'count'"},
      {"/accessors/0/count", 4294967295U, "accessor 0 reaches beyond its bufferView of 48 bytes"},
      {"/accessors/0/componentType", 5124, "accessor 0: unknown componentType 5124"},
      {"/accessors/0/type", "VEC5", "accessor 0: its 'type' is none of SCALAR, VEC2, VEC3, VEC4"},
      {"/accessors/0/sparse", json::object(),
       "accessor 0 is sparse or has no bufferView, which is not understood"},
      {"/bufferViews/0/buffer", 1, "bufferView 0 names number 1 of 'buffers', which is not there"},
      {"/bufferViews/0/byteLength", 1000,
       "bufferView 0 reaches beyond the file's body of 92 bytes"},
      {"/bufferViews/1/byteStride", 2, "accessor 1 reaches beyond its bufferView of 16 bytes"},
      {"/buffers/0/uri", "other.bin", "bufferView 0 is not in the file's own body"},
      {"/extensionsRequired", json({"KHR_draco_mesh_compression"}),
       "it requires the extension \"KHR_draco_mesh_compression\", which is not understood"},
  };
  for (const auto& [pointer, value, sentence] : cases) {
    Foreign file;
    const json::json_pointer place(pointer);
    if (value.is_null()) {
      file.document[place.parent_pointer()].erase(place.back());
    } else {
      file.document[place] = value;
    }
    const auto read = ReadBytes(folder, Glb(file.document, file.body));
    ASSERT_FALSE(read.has_value()) << pointer;
    EXPECT_EQ(read.error().kind, ErrorKind::kData);
    EXPECT_EQ(read.error().message, (folder / "f.glb").string() + ": " + sentence);
  }
  Foreign file;
  file.body[64] = 4;
  EXPECT_EQ(ReadBytes(folder, Glb(file.document, file.body)).error().message,
            (folder / "f.glb").string() + ": mesh 0: an index is 4, but there are 4 vertices");
  EXPECT_EQ(ReadBytes(folder, "solid x").error().message,
            (folder / "f.glb").string() + ": not a .glb file: it does not begin with 'glTF'");
  EXPECT_EQ(ReadBytes(folder, Glb(json::array(), "")).error().message,
            (folder / "f.glb").string() + ": its first chunk: not a JSON object");
  EXPECT_EQ(ReadGlb(folder / "absent.glb").error().kind, ErrorKind::kData);
}

// No cut and no changed byte may crash, nor give a mesh that names vertices it does not have.
TEST(Gltf, CutAndChangedFilesAreRefusedOrSound) {
  const TempFolder folder;
  const Foreign file;
  const std::string bytes = Glb(file.document, file.body);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(ReadBytes(folder, bytes.substr(0, size)).has_value()) << size;
  }
  std::size_t sound = 0;
  std::size_t refused = 0;
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (const unsigned flip : {0x01U, 0x10U, 0x80U, 0xFFU}) {
      std::string changed = bytes;
      changed[at] = static_cast<char>(static_cast<unsigned char>(changed[at]) ^ flip);
      const auto read = ReadBytes(folder, changed);
      if (!read) {
        ++refused;
        EXPECT_EQ(read.error().message.find('\n'), std::string::npos);
        continue;
      }
      ++sound;
      for (const NamedMesh& object : *read) {
        for (const auto& triangle : object.mesh.triangles) {
          for (const std::uint32_t corner : triangle) {
            ASSERT_LT(corner, object.mesh.vertices.size()) << at;
          }
        }
        for (const Eigen::Vector3f& vertex : object.mesh.vertices) {
          ASSERT_TRUE(vertex.allFinite()) << at;
        }
        ASSERT_TRUE(object.mesh.colours.empty() ||
                    object.mesh.colours.size() == object.mesh.vertices.size());
      }
    }
  }
  EXPECT_GT(sound, 100U);
  EXPECT_GT(refused, 100U);
}

}  // namespace
}  // namespace tsdfpp
