#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "core/files.h"
#include "core/gltf.h"
#include "core/gltf_format.h"
#include "core/json_text.h"

namespace tsdfpp {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF files are written little-endian");

using nlohmann::json;

template <typename T>
void Append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

// The body of the file and the JSON that describes it.
struct Content {
  std::string bytes;
  json views = json::array();
  json accessors = json::array();
  json meshes = json::array();
};

// Describes what was appended since `start`; returns the accessor's number.
std::size_t AddAccessor(Content& content, std::size_t start, int target, std::size_t count,
                        int component, const char* type) {
  content.accessors.push_back({{"bufferView", content.views.size()},
                               {"componentType", component},
                               {"count", count},
                               {"type", type}});
  content.views.push_back({{"buffer", 0},
                           {"byteOffset", start},
                           {"byteLength", content.bytes.size() - start},
                           {"target", target}});
  return content.accessors.size() - 1;
}

json AddPrimitive(Content& content, const TriangleMesh& mesh) {
  json attributes;
  std::size_t start = content.bytes.size();
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    box.extend(vertex);
    for (int axis = 0; axis < 3; ++axis) Append(content.bytes, vertex[axis]);
  }
  const std::size_t positions =
      AddAccessor(content, start, gltf::kVertexTarget, mesh.vertices.size(), gltf::kFloat, "VEC3");
  const Eigen::Vector3f low = box.min();
  const Eigen::Vector3f high = box.max();
  content.accessors[positions]["min"] = {low.x(), low.y(), low.z()};
  content.accessors[positions]["max"] = {high.x(), high.y(), high.z()};
  attributes["POSITION"] = positions;
  if (!mesh.colours.empty()) {
    start = content.bytes.size();
    for (const Colour& colour : mesh.colours) {
      for (const std::uint8_t level : colour) Append(content.bytes, gltf::LinearLight(level));
      Append(content.bytes, std::numeric_limits<std::uint16_t>::max());  // opaque
    }
    const std::size_t colours = AddAccessor(content, start, gltf::kVertexTarget,
                                            mesh.colours.size(), gltf::kUint16, "VEC4");
    content.accessors[colours]["normalized"] = true;
    attributes["COLOR_0"] = colours;
  }
  start = content.bytes.size();
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) Append(content.bytes, corner);
  }
  const std::size_t indices = AddAccessor(content, start, gltf::kIndexTarget,
                                          3 * mesh.triangles.size(), gltf::kUint32, "SCALAR");
  return {{"attributes", attributes}, {"indices", indices}, {"material", 0}, {"mode", 4}};
}

}  // namespace

std::uint16_t gltf::LinearLight(std::uint8_t level) {
  static const std::array<std::uint16_t, 256> table = [] {
    std::array<std::uint16_t, 256> made{};
    for (std::size_t i = 0; i < made.size(); ++i) {
      const double c = static_cast<double>(i) / 255;  // IEC 61966-2-1
      const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
      made[i] = static_cast<std::uint16_t>(std::lround(65535 * linear));
    }
    return made;
  }();
  return table[level];
}

Expected<void> WriteGlb(const std::filesystem::path& path, const std::vector<NamedMesh>& objects) {
  Content content;
  // The root turns z up to glTF's y up: x stays, y becomes -z, z becomes y; column by column.
  json nodes = json::array({json::object(
      {{"name", "z up"}, {"matrix", {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1}}})});
  for (const NamedMesh& object : objects) {
    for (const Eigen::Vector3f& vertex : object.mesh.vertices) {
      if (!vertex.allFinite()) {
        return DataError("{}: a vertex of '{}' is not finite", path.string(), object.name);
      }
    }
    json node{{"name", object.name}};
    if (object.id != kNoInstance) node["extras"] = {{"object_id", object.id}};
    if (!object.mesh.triangles.empty()) {
      node["mesh"] = content.meshes.size();
      json primitives = json::array({AddPrimitive(content, object.mesh)});
      content.meshes.push_back({{"name", object.name}, {"primitives", std::move(primitives)}});
    }
    nodes[0]["children"].push_back(nodes.size());
    nodes.push_back(std::move(node));
  }
  json document{{"asset", {{"version", "2.0"}, {"generator", "tsdfpp"}}},
                {"scene", 0},
                {"scenes", json::array({json::object({{"nodes", json::array({0})}})})},
                {"nodes", std::move(nodes)}};
  if (!content.meshes.empty()) {
    document["meshes"] = std::move(content.meshes);
    document["accessors"] = std::move(content.accessors);
    document["bufferViews"] = std::move(content.views);
    document["buffers"] = json::array({json::object({{"byteLength", content.bytes.size()}})});
    const json matt{{"metallicFactor", 0}, {"roughnessFactor", 1}};
    document["materials"] =
        json::array({json::object({{"doubleSided", true}, {"pbrMetallicRoughness", matt}})});
  }
  // Names come from files: what is not UTF-8 in them is replaced.
  std::string text = JsonText(document);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string& body = content.bytes;  // a multiple of 4 long, as all that it holds is

  const std::size_t size = gltf::kHeaderBytes + gltf::kChunkHeaderBytes + text.size() +
                           (body.empty() ? 0 : gltf::kChunkHeaderBytes + body.size());
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    return EnvironmentError("{}: {} bytes are more than a .glb file can hold", path.string(), size);
  }
  std::string bytes;
  bytes.reserve(size);
  Append(bytes, gltf::kMagic);
  Append(bytes, gltf::kVersion);
  Append(bytes, static_cast<std::uint32_t>(size));
  Append(bytes, static_cast<std::uint32_t>(text.size()));
  Append(bytes, gltf::kJsonChunk);
  bytes += text;
  if (!body.empty()) {
    Append(bytes, static_cast<std::uint32_t>(body.size()));
    Append(bytes, gltf::kBinaryChunk);
    bytes += body;
  }
  return WriteFile(path, bytes);
}

std::vector<NamedMesh> SplitByFaceIds(const TriangleMesh& mesh,
                                      const std::function<std::string(InstanceId)>& name_of) {
  std::map<InstanceId, std::vector<std::size_t>> faces_of;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) faces_of[mesh.face_ids[t]].push_back(t);
  constexpr std::uint32_t kUnused = ~0U;
  std::vector<NamedMesh> objects;
  for (const auto& [id, faces] : faces_of) {
    NamedMesh object{name_of(id), id, {}};
    std::vector<std::uint32_t> renamed(mesh.vertices.size(), kUnused);
    for (const std::size_t t : faces) {
      std::array<std::uint32_t, 3> corners = mesh.triangles[t];
      for (std::uint32_t& corner : corners) {
        std::uint32_t& name = renamed[corner];
        if (name == kUnused) {
          name = static_cast<std::uint32_t>(object.mesh.vertices.size());
          object.mesh.vertices.push_back(mesh.vertices[corner]);
          if (!mesh.colours.empty()) object.mesh.colours.push_back(mesh.colours[corner]);
        }
        corner = name;
      }
      object.mesh.triangles.push_back(corners);
    }
    objects.push_back(std::move(object));
  }
  return objects;
}

}  // namespace tsdfpp
