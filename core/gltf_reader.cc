#include <algorithm>
#include <cmath>
#include <limits>

#include "core/files.h"
#include "core/gltf.h"
#include "core/gltf_document.h"
#include "core/gltf_format.h"
#include "core/json_text.h"
#include "core/limits.h"

namespace tsdfpp {
namespace {

using gltf::Elements;
using nlohmann::json;

constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
// primitive.mode
constexpr std::size_t kTriangles = 4;
constexpr std::size_t kStrip = 5;
constexpr std::size_t kFan = 6;

// An sRGB level from linear light, 0 to 1.
std::uint8_t LevelOf(double linear) {
  const double c = std::clamp(linear, 0.0, 1.0);
  const double level = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * level));
}

class GlbReader {
 public:
  explicit GlbReader(std::string file) : document_(std::move(file)) {}

  Expected<std::vector<NamedMesh>> Read(std::string bytes);

 private:
  struct Waiting {
    std::size_t node;
    Eigen::Affine3d T_world_parent;
  };

  Expected<Eigen::Affine3d> TransformOf(const json& node, const std::string& where) const;
  Expected<void> AddNode(const Waiting& waiting);
  Expected<NamedMesh> MeshOf(const json& node, std::size_t mesh_index, const std::string& where);
  Expected<void> AddPrimitive(const json& primitive, const std::string& where, TriangleMesh& mesh);
  Expected<void> AddPositions(const json& attributes, const std::string& where, TriangleMesh& mesh);
  Expected<void> AddColours(const json& attributes, std::size_t first, const std::string& where,
                            TriangleMesh& mesh) const;
  Expected<std::vector<std::uint32_t>> CornersOf(const json& primitive, std::size_t vertices,
                                                 const std::string& where);
  Expected<void> AddTriangles(const std::vector<std::uint32_t>& corners, std::size_t mode,
                              std::uint32_t first, const std::string& where,
                              TriangleMesh& mesh) const;
  // Counts numbers read; an error where there are too many.
  Expected<void> Count(std::size_t elements);

  const std::string& file() const { return document_.file(); }

  gltf::Document document_;
  std::vector<Waiting> waiting_;  // the next one last
  std::vector<bool> visited_;
  std::vector<NamedMesh> objects_;
  std::size_t elements_ = 0;
};

Expected<Eigen::Affine3d> GlbReader::TransformOf(const json& node, const std::string& where) const {
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  TSDFPP_ASSIGN(const auto matrix, document_.Numbers(node, "matrix", 16, where));
  TSDFPP_ASSIGN(const auto translation, document_.Numbers(node, "translation", 3, where));
  TSDFPP_ASSIGN(const auto rotation, document_.Numbers(node, "rotation", 4, where));
  TSDFPP_ASSIGN(const auto scale, document_.Numbers(node, "scale", 3, where));
  if (matrix) {
    T.matrix() = Eigen::Map<const Eigen::Matrix4d>(matrix->data());  // by columns
    if (T.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      return DataError("{}: {}: the last row of its matrix is not 0 0 0 1", file(), where);
    }
    return T;
  }
  if (translation) T.translate(Eigen::Map<const Eigen::Vector3d>(translation->data()));
  if (rotation) {
    const Eigen::Quaterniond q((*rotation)[3], (*rotation)[0], (*rotation)[1], (*rotation)[2]);
    constexpr double kUnit = 1e-2;  // numbers written with few digits
    if (std::abs(q.norm() - 1) > kUnit) {
      return DataError("{}: {}: its rotation is not a unit quaternion", file(), where);
    }
    T.rotate(q.normalized());
  }
  if (scale) T.scale(Eigen::Map<const Eigen::Vector3d>(scale->data()));
  return T;
}

Expected<void> GlbReader::AddTriangles(const std::vector<std::uint32_t>& corners, std::size_t mode,
                                       std::uint32_t first, const std::string& where,
                                       TriangleMesh& mesh) const {
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
    mesh.triangles.push_back({first + corners[a], first + corners[b], first + corners[c]});
  };
  if (mode == kTriangles) {
    if (corners.size() % 3 != 0) {
      return DataError("{}: {}: {} corners are no whole number of triangles", file(), where,
                       corners.size());
    }
    for (std::size_t i = 0; i < corners.size(); i += 3) add(i, i + 1, i + 2);
  } else if (mode == kStrip) {
    for (std::size_t i = 2; i < corners.size(); ++i) {
      add(i - 2, i % 2 == 0 ? i - 1 : i, i % 2 == 0 ? i : i - 1);
    }
  } else if (mode == kFan) {
    for (std::size_t i = 2; i < corners.size(); ++i) add(i - 1, i, 0);
  } else {
    return DataError("{}: {}: its mode is {}, expected triangles (4, 5 or 6)", file(), where, mode);
  }
  return {};
}

Expected<void> GlbReader::Count(std::size_t elements) {
  elements_ += elements;
  return CheckLimit(&Limits::mesh_elements, static_cast<std::int64_t>(elements_), file(),
                    "vertices and corners");
}

Expected<void> GlbReader::AddPositions(const json& attributes, const std::string& where,
                                       TriangleMesh& mesh) {
  TSDFPP_ASSIGN(const std::size_t index, document_.Needed(attributes, "POSITION", kMost, where));
  TSDFPP_ASSIGN(const Elements positions, document_.Accessor(index));
  if (positions.component_type != gltf::kFloat || positions.components != 3) {
    return DataError("{}: {}: its positions are not three floats each", file(), where);
  }
  TSDFPP_RETURN_IF_ERROR(Count(positions.count));
  for (std::size_t i = 0; i < positions.count; ++i) {
    const Eigen::Vector3d p(positions.At(i, 0), positions.At(i, 1), positions.At(i, 2));
    if (!p.allFinite()) return DataError("{}: {}: a position is not finite", file(), where);
    mesh.vertices.push_back(p.cast<float>());
  }
  return {};
}

// Vertices from `first` on; where some primitives of a mesh have colours, the others are white.
Expected<void> GlbReader::AddColours(const json& attributes, std::size_t first,
                                     const std::string& where, TriangleMesh& mesh) const {
  constexpr Colour kWhite{255, 255, 255};
  TSDFPP_ASSIGN(const auto index, document_.Whole(attributes, "COLOR_0", kMost, where));
  if (!index) {
    if (!mesh.colours.empty()) mesh.colours.resize(mesh.vertices.size(), kWhite);
    return {};
  }
  TSDFPP_ASSIGN(const Elements colours, document_.Accessor(*index));
  const bool is_float = colours.component_type == gltf::kFloat;
  const bool is_integer =
      colours.component_type == gltf::kUint8 || colours.component_type == gltf::kUint16;
  if (colours.components < 3 || colours.count != mesh.vertices.size() - first ||
      !(is_float || (is_integer && colours.normalized))) {
    return DataError(
        "{}: {}: its colours are not one of three or four floats or normalized integers a vertex",
        file(), where);
  }
  const double one = is_float ? 1 : (colours.component_type == gltf::kUint8 ? 255 : 65535);
  mesh.colours.resize(first, kWhite);
  for (std::size_t i = 0; i < colours.count; ++i) {
    Colour colour{};
    for (std::size_t c = 0; c < 3; ++c) colour[c] = LevelOf(colours.At(i, c) / one);
    mesh.colours.push_back(colour);
  }
  return {};
}

// The vertices that a primitive names one after the other: its indices, or all of them.
Expected<std::vector<std::uint32_t>> GlbReader::CornersOf(const json& primitive,
                                                          std::size_t vertices,
                                                          const std::string& where) {
  TSDFPP_ASSIGN(const auto index, document_.Whole(primitive, "indices", kMost, where));
  std::vector<std::uint32_t> corners;
  if (!index) {
    for (std::size_t i = 0; i < vertices; ++i) corners.push_back(static_cast<std::uint32_t>(i));
    return corners;
  }
  TSDFPP_ASSIGN(const Elements indices, document_.Accessor(*index));
  const bool is_index = indices.component_type == gltf::kUint8 ||
                        indices.component_type == gltf::kUint16 ||
                        indices.component_type == gltf::kUint32;
  if (!is_index || indices.components != 1) {
    return DataError("{}: {}: its indices are not unsigned integers", file(), where);
  }
  TSDFPP_RETURN_IF_ERROR(Count(indices.count));
  for (std::size_t i = 0; i < indices.count; ++i) {
    const double corner = indices.At(i, 0);
    if (corner >= static_cast<double>(vertices)) {
      return DataError("{}: {}: an index is {}, but there are {} vertices", file(), where, corner,
                       vertices);
    }
    corners.push_back(static_cast<std::uint32_t>(corner));
  }
  return corners;
}

Expected<void> GlbReader::AddPrimitive(const json& primitive, const std::string& where,
                                       TriangleMesh& mesh) {
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end() || !attributes->is_object() ||
      !attributes->contains("POSITION")) {
    return DataError("{}: {} has no POSITION", file(), where);
  }
  const std::size_t first = mesh.vertices.size();
  TSDFPP_RETURN_IF_ERROR(AddPositions(*attributes, where, mesh));
  TSDFPP_RETURN_IF_ERROR(AddColours(*attributes, first, where, mesh));
  TSDFPP_ASSIGN(const auto corners, CornersOf(primitive, mesh.vertices.size() - first, where));
  TSDFPP_ASSIGN(const auto mode, document_.Whole(primitive, "mode", 6, where));
  return AddTriangles(corners, mode.value_or(kTriangles), static_cast<std::uint32_t>(first), where,
                      mesh);
}

// The mesh of a node, in the node's own frame.
Expected<NamedMesh> GlbReader::MeshOf(const json& node, std::size_t mesh_index,
                                      const std::string& where) {
  TSDFPP_ASSIGN(const json* mesh, document_.Item("meshes", mesh_index, where));
  NamedMesh object;
  for (const json* named : {&node, mesh}) {
    const auto name = named->find("name");
    if (object.name.empty() && name != named->end() && name->is_string()) {
      object.name = name->get<std::string>();
    }
  }
  if (object.name.empty()) object.name = where;
  if (const auto extras = node.find("extras"); extras != node.end() && extras->is_object()) {
    TSDFPP_ASSIGN(const auto id, document_.Whole(*extras, "object_id", kNoInstance, where));
    object.id = static_cast<InstanceId>(id.value_or(kNoInstance));
  }
  const auto primitives = mesh->find("primitives");
  if (primitives == mesh->end() || !primitives->is_array()) {
    return DataError("{}: mesh {} has no primitives", file(), mesh_index);
  }
  for (const json& primitive : *primitives) {
    if (!primitive.is_object()) {
      return DataError("{}: a primitive of mesh {} is not an object", file(), mesh_index);
    }
    TSDFPP_RETURN_IF_ERROR(
        AddPrimitive(primitive, fmt::format("mesh {}", mesh_index), object.mesh));
  }
  return object;
}

Expected<void> GlbReader::AddNode(const Waiting& waiting) {
  const std::string where = fmt::format("node {}", waiting.node);
  TSDFPP_ASSIGN(const json* node, document_.Item("nodes", waiting.node, "the scene or a node"));
  if (visited_[waiting.node]) return DataError("{}: {} has more than one parent", file(), where);
  visited_[waiting.node] = true;
  TSDFPP_ASSIGN(const Eigen::Affine3d T_parent_node, TransformOf(*node, where));
  const Eigen::Affine3d T = waiting.T_world_parent * T_parent_node;

  TSDFPP_ASSIGN(const auto mesh_index, document_.Whole(*node, "mesh", kMost, where));
  if (mesh_index) {
    TSDFPP_ASSIGN(NamedMesh object, MeshOf(*node, *mesh_index, where));
    for (Eigen::Vector3f& vertex : object.mesh.vertices) {
      const Eigen::Vector3d p = T * vertex.cast<double>();
      vertex = Eigen::Vector3d(p.x(), -p.z(), p.y()).cast<float>();  // y up to z up
      if (!vertex.allFinite()) {
        return DataError("{}: {} places a vertex beyond what a float can hold", file(), where);
      }
    }
    // A mirrored mesh would be inside out.
    if (T.linear().determinant() < 0) {
      for (auto& triangle : object.mesh.triangles) std::swap(triangle[1], triangle[2]);
    }
    objects_.push_back(std::move(object));
  }

  const auto children = node->find("children");
  if (children == node->end()) return {};
  if (!children->is_array()) return DataError("{}: {}: 'children' is not a list", file(), where);
  for (auto child = children->rbegin(); child != children->rend(); ++child) {
    if (!child->is_number_unsigned()) {
      return DataError("{}: {}: a child is not a node's number", file(), where);
    }
    waiting_.push_back({child->get<std::size_t>(), T});
  }
  return {};
}

Expected<std::vector<NamedMesh>> GlbReader::Read(std::string bytes) {
  TSDFPP_RETURN_IF_ERROR(document_.Parse(std::move(bytes)));
  const auto required = document_.root().find("extensionsRequired");
  if (required != document_.root().end() && required->is_array() && !required->empty()) {
    const json& name = (*required)[0];
    return DataError("{}: it requires the extension {}, which is not understood", file(),
                     JsonShown(name));
  }
  const auto nodes = document_.root().find("nodes");
  const std::size_t node_count =
      nodes == document_.root().end() || !nodes->is_array() ? 0 : nodes->size();
  visited_.assign(node_count, false);
  TSDFPP_ASSIGN(const auto scene_number,
                document_.Whole(document_.root(), "scene", node_count + 1000, "the file"));
  TSDFPP_ASSIGN(const json* scene, document_.Item("scenes", scene_number.value_or(0), "the file"));
  const auto roots = scene->find("nodes");
  if (roots == scene->end()) return std::vector<NamedMesh>{};
  if (!roots->is_array()) return DataError("{}: the scene's 'nodes' is not a list", file());
  for (auto root = roots->rbegin(); root != roots->rend(); ++root) {
    if (!root->is_number_unsigned()) {
      return DataError("{}: the scene's nodes are not all numbers", file());
    }
    waiting_.push_back({root->get<std::size_t>(), Eigen::Affine3d::Identity()});
  }
  while (!waiting_.empty()) {
    const Waiting next = waiting_.back();
    waiting_.pop_back();
    TSDFPP_RETURN_IF_ERROR(AddNode(next));
  }
  return std::move(objects_);
}

}  // namespace

Expected<std::vector<NamedMesh>> ReadGlb(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(std::string bytes, ReadFile(path));
  return GlbReader(path.string()).Read(std::move(bytes));
}

}  // namespace tsdfpp
