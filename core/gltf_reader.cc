#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/files.h"
#include "core/gltf.h"
#include "core/gltf_format.h"

namespace tsdfpp {
namespace {

using nlohmann::json;

// Of one file, all nodes together: a small file can name one mesh many times.
constexpr std::size_t kMostVertices = 50'000'000;

// An sRGB level from linear light, 0 to 1.
std::uint8_t LevelOf(double linear) {
  const double c = std::clamp(linear, 0.0, 1.0);
  const double level = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * level));
}

// What an accessor points at: `count` elements of `components` numbers.
struct Elements {
  const char* data = nullptr;
  std::size_t count = 0;
  std::size_t components = 0;
  std::size_t stride = 0;
  int component_type = 0;
  bool normalized = false;

  // As stored; integers are not scaled.
  double At(std::size_t element, std::size_t component) const;
};

std::size_t BytesOf(int component_type) {
  switch (component_type) {
    case gltf::kInt8:
    case gltf::kUint8:
      return 1;
    case gltf::kInt16:
    case gltf::kUint16:
      return 2;
    case gltf::kUint32:
    case gltf::kFloat:
      return 4;
    default:
      return 0;
  }
}

template <typename T>
double Load(const char* from) {
  T value;
  std::memcpy(&value, from, sizeof(T));
  return static_cast<double>(value);
}

double Elements::At(std::size_t element, std::size_t component) const {
  const char* from = data + element * stride + component * BytesOf(component_type);
  switch (component_type) {
    case gltf::kInt8:
      return Load<std::int8_t>(from);
    case gltf::kUint8:
      return Load<std::uint8_t>(from);
    case gltf::kInt16:
      return Load<std::int16_t>(from);
    case gltf::kUint16:
      return Load<std::uint16_t>(from);
    case gltf::kUint32:
      return Load<std::uint32_t>(from);
    default:
      return Load<float>(from);
  }
}

std::size_t ComponentsOf(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  if (type == "VEC4") return 4;
  return 0;  // matrices hold nothing that is read here
}

class GlbReader {
 public:
  explicit GlbReader(std::string file) : file_(std::move(file)) {}

  Expected<std::vector<NamedMesh>> Read(std::string bytes);

 private:
  Expected<void> Split();
  // The number under a key: a whole one from 0 to `most`; nothing where the key is absent.
  Expected<std::optional<std::size_t>> Whole(const json& object, const char* key, std::size_t most,
                                             const std::string& where) const;
  // The same where it must be there.
  Expected<std::size_t> Needed(const json& object, const char* key, std::size_t most,
                               const std::string& where) const;
  // Numbers of an array of this length; nothing where the key is absent.
  Expected<std::optional<std::vector<double>>> Numbers(const json& object, const char* key,
                                                       std::size_t length,
                                                       const std::string& where) const;
  // Element `index` of a top-level array.
  Expected<const json*> Item(const char* array, std::size_t index, const std::string& where) const;

  Expected<Elements> Accessor(std::size_t index) const;
  Expected<Eigen::Affine3d> TransformOf(const json& node, const std::string& where) const;
  Expected<void> AddNode(std::size_t index);
  Expected<void> AddPrimitive(const json& primitive, const std::string& where, TriangleMesh& mesh);
  Expected<void> AddTriangles(const std::vector<std::uint32_t>& corners, std::size_t mode,
                              std::uint32_t first, const std::string& where, TriangleMesh& mesh);

  struct Waiting {
    std::size_t node;
    Eigen::Affine3d T_world_parent;
  };

  std::string file_;
  std::string bytes_;
  std::string_view body_;
  json document_;
  std::vector<Waiting> waiting_;  // the next one last
  std::vector<bool> visited_;
  std::vector<NamedMesh> objects_;
  std::size_t vertices_ = 0;
};

Expected<std::optional<std::size_t>> GlbReader::Whole(const json& object, const char* key,
                                                      std::size_t most,
                                                      const std::string& where) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  if (!found->is_number_unsigned() || found->get<std::uint64_t>() > most) {
    return DataError("{}: {}: '{}' is {}, expected a whole number from 0 to {}", file_, where, key,
                     found->dump(-1, ' ', false, json::error_handler_t::replace).substr(0, 40),
                     most);
  }
  return found->get<std::size_t>();
}

Expected<std::size_t> GlbReader::Needed(const json& object, const char* key, std::size_t most,
                                        const std::string& where) const {
  TSDFPP_ASSIGN(const auto number, Whole(object, key, most, where));
  if (!number) return DataError("{}: {} has no '{}'", file_, where, key);
  return *number;
}

Expected<std::optional<std::vector<double>>> GlbReader::Numbers(const json& object, const char* key,
                                                                std::size_t length,
                                                                const std::string& where) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  std::vector<double> numbers;
  if (found->is_array()) {
    for (const json& number : *found) {
      if (number.is_number()) numbers.push_back(number.get<double>());
    }
  }
  if (numbers.size() != length || found->size() != length ||
      !std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) {
    return DataError("{}: {}: '{}' is not a list of {} numbers", file_, where, key, length);
  }
  return numbers;
}

Expected<const json*> GlbReader::Item(const char* array, std::size_t index,
                                      const std::string& where) const {
  const auto list = document_.find(array);
  if (list == document_.end() || !list->is_array() || index >= list->size() ||
      !(*list)[index].is_object()) {
    return DataError("{}: {} names number {} of '{}', which is not there", file_, where, index,
                     array);
  }
  return &(*list)[index];
}

// The header and the chunks: the JSON, and the body where there is one.
Expected<void> GlbReader::Split() {
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes_.data() + at, sizeof(value));
    return value;
  };
  if (bytes_.size() < gltf::kHeaderBytes || word(0) != gltf::kMagic) {
    return DataError("{}: not a .glb file: it does not begin with 'glTF'", file_);
  }
  if (word(4) != gltf::kVersion) {
    return DataError("{}: glTF version {}, expected {}", file_, word(4), gltf::kVersion);
  }
  if (word(8) != bytes_.size()) {
    return DataError("{}: {} bytes long, but its header says {}", file_, bytes_.size(), word(8));
  }
  std::string_view text;
  std::size_t at = gltf::kHeaderBytes;
  for (std::size_t chunk = 0; at < bytes_.size(); ++chunk) {
    if (bytes_.size() - at < gltf::kChunkHeaderBytes ||
        bytes_.size() - at - gltf::kChunkHeaderBytes < word(at)) {
      return DataError("{}: chunk {} is cut off", file_, chunk);
    }
    const std::uint32_t type = word(at + 4);
    const std::string_view content(bytes_.data() + at + gltf::kChunkHeaderBytes, word(at));
    if (chunk == 0 && type == gltf::kJsonChunk) text = content;
    if (chunk == 1 && type == gltf::kBinaryChunk) body_ = content;
    at += gltf::kChunkHeaderBytes + content.size();
  }
  document_ = json::parse(text, nullptr, false);
  if (!document_.is_object()) {
    return DataError("{}: its first chunk is not a JSON object", file_);
  }
  return {};
}

Expected<Elements> GlbReader::Accessor(std::size_t index) const {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const std::string where = fmt::format("accessor {}", index);
  TSDFPP_ASSIGN(const json* accessor, Item("accessors", index, "a primitive"));
  Elements elements;
  TSDFPP_ASSIGN(elements.count, Needed(*accessor, "count", kMost, where));
  TSDFPP_ASSIGN(const std::size_t component_type, Needed(*accessor, "componentType", kMost, where));
  elements.component_type = static_cast<int>(std::min<std::size_t>(component_type, 1U << 20U));
  const std::size_t size = BytesOf(elements.component_type);
  if (size == 0) {
    return DataError("{}: {}: unknown componentType {}", file_, where, component_type);
  }
  const auto type = accessor->find("type");
  if (type != accessor->end() && type->is_string()) {
    elements.components = ComponentsOf(type->get<std::string>());
  }
  if (elements.components == 0) {
    return DataError("{}: {}: its 'type' is none of SCALAR, VEC2, VEC3, VEC4", file_, where);
  }
  if (accessor->contains("sparse") || !accessor->contains("bufferView")) {
    return DataError("{}: {} is sparse or has no bufferView, which is not understood", file_,
                     where);
  }
  const auto normalized = accessor->find("normalized");
  elements.normalized = normalized != accessor->end() && *normalized == json(true);

  TSDFPP_ASSIGN(const std::size_t view_index, Needed(*accessor, "bufferView", kMost, where));
  TSDFPP_ASSIGN(const json* view, Item("bufferViews", view_index, where));
  const std::string view_where = fmt::format("bufferView {}", view_index);
  TSDFPP_ASSIGN(const std::size_t buffer_index, Needed(*view, "buffer", kMost, view_where));
  TSDFPP_ASSIGN(const json* buffer, Item("buffers", buffer_index, view_where));
  if (buffer_index != 0 || buffer->contains("uri")) {
    return DataError("{}: {} is not in the file's own body", file_, view_where);
  }
  TSDFPP_ASSIGN(const auto view_offset, Whole(*view, "byteOffset", kMost, view_where));
  TSDFPP_ASSIGN(const std::size_t view_length, Needed(*view, "byteLength", kMost, view_where));
  TSDFPP_ASSIGN(const auto stride, Whole(*view, "byteStride", 252, view_where));
  TSDFPP_ASSIGN(const auto offset, Whole(*accessor, "byteOffset", kMost, where));
  if (view_offset.value_or(0) + view_length > body_.size()) {
    return DataError("{}: {} reaches beyond the file's body of {} bytes", file_, view_where,
                     body_.size());
  }
  const std::size_t element = elements.components * size;
  elements.stride = stride.value_or(element);
  const std::size_t needed =
      elements.count == 0 ? 0
                          : offset.value_or(0) + (elements.count - 1) * elements.stride + element;
  if (elements.stride < element || needed > view_length) {
    return DataError("{}: {} reaches beyond its bufferView of {} bytes", file_, where, view_length);
  }
  elements.data = body_.data() + view_offset.value_or(0) + offset.value_or(0);
  return elements;
}

Expected<Eigen::Affine3d> GlbReader::TransformOf(const json& node, const std::string& where) const {
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  TSDFPP_ASSIGN(const auto matrix, Numbers(node, "matrix", 16, where));
  TSDFPP_ASSIGN(const auto translation, Numbers(node, "translation", 3, where));
  TSDFPP_ASSIGN(const auto rotation, Numbers(node, "rotation", 4, where));
  TSDFPP_ASSIGN(const auto scale, Numbers(node, "scale", 3, where));
  if (matrix) {
    T.matrix() = Eigen::Map<const Eigen::Matrix4d>(matrix->data());  // by columns
    if (T.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      return DataError("{}: {}: the last row of its matrix is not 0 0 0 1", file_, where);
    }
    return T;
  }
  if (translation) T.translate(Eigen::Map<const Eigen::Vector3d>(translation->data()));
  if (rotation) {
    const Eigen::Quaterniond q((*rotation)[3], (*rotation)[0], (*rotation)[1], (*rotation)[2]);
    constexpr double kUnit = 1e-2;  // numbers written with few digits
    if (std::abs(q.norm() - 1) > kUnit) {
      return DataError("{}: {}: its rotation is not a unit quaternion", file_, where);
    }
    T.rotate(q.normalized());
  }
  if (scale) T.scale(Eigen::Map<const Eigen::Vector3d>(scale->data()));
  return T;
}

Expected<void> GlbReader::AddTriangles(const std::vector<std::uint32_t>& corners, std::size_t mode,
                                       std::uint32_t first, const std::string& where,
                                       TriangleMesh& mesh) {
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
    mesh.triangles.push_back({first + corners[a], first + corners[b], first + corners[c]});
  };
  constexpr std::size_t kTriangles = 4;
  constexpr std::size_t kStrip = 5;
  constexpr std::size_t kFan = 6;
  if (mode == kTriangles) {
    if (corners.size() % 3 != 0) {
      return DataError("{}: {}: {} corners are no whole number of triangles", file_, where,
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
    return DataError("{}: {}: its mode is {}, expected triangles (4, 5 or 6)", file_, where, mode);
  }
  return {};
}

Expected<void> GlbReader::AddPrimitive(const json& primitive, const std::string& where,
                                       TriangleMesh& mesh) {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end() || !attributes->is_object() ||
      !attributes->contains("POSITION")) {
    return DataError("{}: {} has no POSITION", file_, where);
  }
  TSDFPP_ASSIGN(const std::size_t position_index, Needed(*attributes, "POSITION", kMost, where));
  TSDFPP_ASSIGN(const Elements positions, Accessor(position_index));
  if (positions.component_type != gltf::kFloat || positions.components != 3) {
    return DataError("{}: {}: its positions are not three floats each", file_, where);
  }
  vertices_ += positions.count;
  if (vertices_ > kMostVertices) {
    return DataError("{}: more than {} vertices", file_, kMostVertices);
  }
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (std::size_t i = 0; i < positions.count; ++i) {
    Eigen::Vector3f p;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      p[static_cast<Eigen::Index>(axis)] = static_cast<float>(positions.At(i, axis));
    }
    if (!p.allFinite()) return DataError("{}: {}: a position is not finite", file_, where);
    mesh.vertices.push_back(p);
  }

  TSDFPP_ASSIGN(const auto colour_index, Whole(*attributes, "COLOR_0", kMost, where));
  if (colour_index) {
    TSDFPP_ASSIGN(const Elements colours, Accessor(*colour_index));
    const bool is_float = colours.component_type == gltf::kFloat;
    const bool is_integer =
        colours.component_type == gltf::kUint8 || colours.component_type == gltf::kUint16;
    if (colours.components < 3 || colours.count != positions.count ||
        !(is_float || (is_integer && colours.normalized))) {
      return DataError(
          "{}: {}: its colours are not one of three or four floats or normalized "
          "integers a vertex",
          file_, where);
    }
    const double one = is_float ? 1 : (colours.component_type == gltf::kUint8 ? 255 : 65535);
    mesh.colours.resize(first, Colour{255, 255, 255});  // primitives before it that had none
    for (std::size_t i = 0; i < colours.count; ++i) {
      Colour colour{};
      for (std::size_t c = 0; c < 3; ++c) colour[c] = LevelOf(colours.At(i, c) / one);
      mesh.colours.push_back(colour);
    }
  } else if (!mesh.colours.empty()) {
    mesh.colours.resize(mesh.vertices.size(), Colour{255, 255, 255});
  }

  TSDFPP_ASSIGN(const auto mode, Whole(primitive, "mode", 6, where));
  TSDFPP_ASSIGN(const auto index_accessor, Whole(primitive, "indices", kMost, where));
  std::vector<std::uint32_t> corners;
  if (index_accessor) {
    TSDFPP_ASSIGN(const Elements indices, Accessor(*index_accessor));
    const bool is_index = indices.component_type == gltf::kUint8 ||
                          indices.component_type == gltf::kUint16 ||
                          indices.component_type == gltf::kUint32;
    if (!is_index || indices.components != 1) {
      return DataError("{}: {}: its indices are not unsigned integers", file_, where);
    }
    corners.reserve(indices.count);
    for (std::size_t i = 0; i < indices.count; ++i) {
      const double corner = indices.At(i, 0);
      if (corner >= static_cast<double>(positions.count)) {
        return DataError("{}: {}: an index is {}, but there are {} vertices", file_, where, corner,
                         positions.count);
      }
      corners.push_back(static_cast<std::uint32_t>(corner));
    }
  } else {
    for (std::size_t i = 0; i < positions.count; ++i) {
      corners.push_back(static_cast<std::uint32_t>(i));
    }
  }
  return AddTriangles(corners, mode.value_or(4), first, where, mesh);
}

Expected<void> GlbReader::AddNode(std::size_t index) {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const std::string where = fmt::format("node {}", index);
  const Eigen::Affine3d T_world_parent = waiting_.back().T_world_parent;
  waiting_.pop_back();
  TSDFPP_ASSIGN(const json* node, Item("nodes", index, "the scene or a node"));
  if (visited_[index]) {
    return DataError("{}: {} has more than one parent", file_, where);
  }
  visited_[index] = true;
  TSDFPP_ASSIGN(const Eigen::Affine3d T_parent_node, TransformOf(*node, where));
  const Eigen::Affine3d T = T_world_parent * T_parent_node;

  TSDFPP_ASSIGN(const auto mesh_index, Whole(*node, "mesh", kMost, where));
  if (mesh_index) {
    TSDFPP_ASSIGN(const json* mesh, Item("meshes", *mesh_index, where));
    NamedMesh object;
    for (const json* named : {node, mesh}) {
      const auto name = named->find("name");
      if (object.name.empty() && name != named->end() && name->is_string()) {
        object.name = name->get<std::string>();
      }
    }
    if (object.name.empty()) object.name = where;
    if (const auto extras = node->find("extras"); extras != node->end() && extras->is_object()) {
      TSDFPP_ASSIGN(const auto id, Whole(*extras, "object_id", kNoInstance, where));
      object.id = static_cast<InstanceId>(id.value_or(kNoInstance));
    }
    const auto primitives = mesh->find("primitives");
    if (primitives == mesh->end() || !primitives->is_array()) {
      return DataError("{}: mesh {} has no primitives", file_, *mesh_index);
    }
    for (const json& primitive : *primitives) {
      if (!primitive.is_object()) {
        return DataError("{}: a primitive of mesh {} is not an object", file_, *mesh_index);
      }
      TSDFPP_RETURN_IF_ERROR(
          AddPrimitive(primitive, fmt::format("mesh {}", *mesh_index), object.mesh));
    }
    for (Eigen::Vector3f& vertex : object.mesh.vertices) {
      const Eigen::Vector3d p = T * vertex.cast<double>();
      vertex = Eigen::Vector3d(p.x(), -p.z(), p.y()).cast<float>();  // y up to z up
      if (!vertex.allFinite()) {
        return DataError("{}: {} places a vertex beyond what a float can hold", file_, where);
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
  if (!children->is_array()) return DataError("{}: {}: 'children' is not a list", file_, where);
  for (auto child = children->rbegin(); child != children->rend(); ++child) {
    if (!child->is_number_unsigned()) {
      return DataError("{}: {}: a child is not a node's number", file_, where);
    }
    waiting_.push_back({child->get<std::size_t>(), T});
  }
  return {};
}

Expected<std::vector<NamedMesh>> GlbReader::Read(std::string bytes) {
  bytes_ = std::move(bytes);
  TSDFPP_RETURN_IF_ERROR(Split());
  const auto required = document_.find("extensionsRequired");
  if (required != document_.end() && required->is_array() && !required->empty()) {
    const json& name = (*required)[0];
    return DataError("{}: it requires the extension {}, which is not understood", file_,
                     name.dump(-1, ' ', false, json::error_handler_t::replace));
  }
  const auto nodes = document_.find("nodes");
  const std::size_t node_count = nodes == document_.end() || !nodes->is_array() ? 0 : nodes->size();
  visited_.assign(node_count, false);
  TSDFPP_ASSIGN(const auto scene_number, Whole(document_, "scene", node_count + 1000, "the file"));
  TSDFPP_ASSIGN(const json* scene, Item("scenes", scene_number.value_or(0), "the file"));
  const auto roots = scene->find("nodes");
  if (roots == scene->end()) return std::vector<NamedMesh>{};
  if (!roots->is_array()) return DataError("{}: the scene's 'nodes' is not a list", file_);
  for (auto root = roots->rbegin(); root != roots->rend(); ++root) {
    if (!root->is_number_unsigned()) {
      return DataError("{}: the scene's nodes are not all numbers", file_);
    }
    waiting_.push_back({root->get<std::size_t>(), Eigen::Affine3d::Identity()});
  }
  while (!waiting_.empty()) TSDFPP_RETURN_IF_ERROR(AddNode(waiting_.back().node));
  return std::move(objects_);
}

}  // namespace

Expected<std::vector<NamedMesh>> ReadGlb(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(std::string bytes, ReadFile(path));
  return GlbReader(path.string()).Read(std::move(bytes));
}

}  // namespace tsdfpp
