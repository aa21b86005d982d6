#include "core/ply.h"

#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <sstream>
#include <string>

#include "core/farthest.h"
#include "core/files.h"
#include "core/limits.h"
#include "core/one_line.h"
#include "core/plain_name.h"

namespace tsdfpp {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY files are written little-endian");

template <typename T>
void AppendBinary(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string PlyBytes(const TriangleMesh& mesh, const std::vector<std::string>& regions,
                     const std::vector<std::uint16_t>& face_region) {
  const bool colours = !mesh.colours.empty();
  const bool ids = !mesh.face_ids.empty();
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment tsdfpp, metres\n";
  for (std::size_t i = 0; i < regions.size(); ++i) {
    bytes += fmt::format("comment region {} {}\n", i, regions[i]);
  }
  bytes += fmt::format("element vertex {}\nproperty float x\nproperty float y\nproperty float z\n",
                       mesh.vertices.size());
  if (colours) bytes += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  bytes += fmt::format("element face {}\nproperty list uchar int vertex_indices\n",
                       mesh.triangles.size());
  if (ids) bytes += "property ushort object_id\n";
  if (!regions.empty()) bytes += "property ushort region\n";
  bytes += "end_header\n";
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) AppendBinary(bytes, mesh.vertices[i][axis]);
    if (colours) {
      for (const std::uint8_t channel : mesh.colours[i]) AppendBinary(bytes, channel);
    }
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    AppendBinary(bytes, std::uint8_t{3});
    for (const std::uint32_t v : mesh.triangles[i])
      AppendBinary(bytes, static_cast<std::int32_t>(v));
    if (ids) AppendBinary(bytes, mesh.face_ids[i]);
    if (!regions.empty()) AppendBinary(bytes, face_region[i]);
  }
  return bytes;
}

enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble, kUnknown };

Scalar ScalarOf(const std::string& name) {
  if (name == "char" || name == "int8") return Scalar::kInt8;
  if (name == "uchar" || name == "uint8") return Scalar::kUint8;
  if (name == "short" || name == "int16") return Scalar::kInt16;
  if (name == "ushort" || name == "uint16") return Scalar::kUint16;
  if (name == "int" || name == "int32") return Scalar::kInt32;
  if (name == "uint" || name == "uint32") return Scalar::kUint32;
  if (name == "float" || name == "float32") return Scalar::kFloat;
  if (name == "double" || name == "float64") return Scalar::kDouble;
  return Scalar::kUnknown;
}

// Reads scalars from the body, one after the other; Ok() turns false past the end.
class Body {
 public:
  Body(std::string_view bytes, bool ascii) : bytes_(bytes), ascii_(ascii) {}

  bool Ok() const { return ok_; }

  double Read(Scalar type) {
    if (ascii_) return ReadAscii();
    switch (type) {
      case Scalar::kInt8:
        return ReadRaw<std::int8_t>();
      case Scalar::kUint8:
        return ReadRaw<std::uint8_t>();
      case Scalar::kInt16:
        return ReadRaw<std::int16_t>();
      case Scalar::kUint16:
        return ReadRaw<std::uint16_t>();
      case Scalar::kInt32:
        return ReadRaw<std::int32_t>();
      case Scalar::kUint32:
        return ReadRaw<std::uint32_t>();
      case Scalar::kFloat:
        return ReadRaw<float>();
      case Scalar::kDouble:
        return ReadRaw<double>();
      case Scalar::kUnknown:
        break;
    }
    ok_ = false;
    return 0;
  }

  // A count, index or id: Ok() turns false where it is not a whole number from 0 to `largest`.
  std::uint32_t ReadWhole(Scalar type, std::uint32_t largest) {
    const double value = Read(type);
    if (!(value >= 0 && value <= largest) || value != std::floor(value)) ok_ = false;
    return ok_ ? static_cast<std::uint32_t>(value) : 0;
  }

 private:
  template <typename T>
  double ReadRaw() {
    if (at_ + sizeof(T) > bytes_.size()) {
      ok_ = false;
      return 0;
    }
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return static_cast<double>(value);
  }

  double ReadAscii() {
    while (at_ < bytes_.size() && std::isspace(static_cast<unsigned char>(bytes_[at_])) != 0) ++at_;
    double value = 0;
    const auto [next, status] =
        std::from_chars(bytes_.data() + at_, bytes_.data() + bytes_.size(), value);
    if (status != std::errc()) ok_ = false;
    at_ = static_cast<std::size_t>(next - bytes_.data());
    return value;
  }

  std::string_view bytes_;
  bool ascii_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

struct Property {
  std::string name;
  Scalar type = Scalar::kUnknown;
  Scalar count_type = Scalar::kUnknown;  // of a list
  bool is_list = false;
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  std::vector<Element> elements;
  std::vector<std::string> regions;
  std::size_t body_at = 0;
};

Expected<Header> ParseHeader(const std::string& file, const std::string& bytes) {
  Header header;
  std::size_t at = 0;
  bool first = true;
  while (true) {
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string::npos) return DataError("{}: not a PLY file: no end_header", file);
    std::string line = bytes.substr(at, end - at);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    at = end + 1;
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (first) {
      if (word != "ply") return DataError("{}: not a PLY file: it does not begin with 'ply'", file);
      first = false;
    } else if (word == "format") {
      words >> word;
      if (word != "ascii" && word != "binary_little_endian") {
        return DataError("{}: PLY format '{}', expected ascii or binary_little_endian", file, word);
      }
      header.ascii = word == "ascii";
    } else if (word == "comment") {
      std::size_t index = 0;
      std::string name;
      if (words >> word && word == "region" && words >> index &&
          std::getline(words >> std::ws, name)) {
        if (index != header.regions.size()) {
          return DataError("{}: region comments are not numbered 0, 1, ...", file);
        }
        TSDFPP_RETURN_IF_ERROR(CheckLabel(name, fmt::format("{}: region {}", file, index)));
        header.regions.push_back(name);
      }
    } else if (word == "element") {
      Element element;
      if (!(words >> element.name >> element.count) || element.count > bytes.size()) {
        return DataError("{}: PLY element line '{}' cannot be read", file, line);
      }
      TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::mesh_elements,
                                        static_cast<std::int64_t>(element.count), file,
                                        "elements of one kind"));
      header.elements.push_back(element);
    } else if (word == "property") {
      Property property;
      words >> word;
      if (word == "list") {
        property.is_list = true;
        words >> word;
        property.count_type = ScalarOf(word);
        words >> word;
      }
      property.type = ScalarOf(word);
      if (header.elements.empty() || !(words >> property.name) ||
          property.type == Scalar::kUnknown ||
          (property.is_list && property.count_type == Scalar::kUnknown)) {
        return DataError("{}: PLY property line '{}' cannot be read", file, line);
      }
      header.elements.back().properties.push_back(property);
    } else if (word == "end_header") {
      header.body_at = at;
      return header;
    }
  }
}

constexpr std::uint32_t kMostOfAList = std::numeric_limits<std::int32_t>::max();

struct Parsed {
  TriangleMesh mesh;
  std::vector<std::string> regions;
  std::vector<std::uint16_t> face_region;
};

void ReadVertex(const Element& element, Body& body, TriangleMesh& mesh) {
  Eigen::Vector3f position = Eigen::Vector3f::Constant(NAN);
  Colour colour{};
  bool coloured = false;
  for (const Property& property : element.properties) {
    const std::uint32_t count =
        property.is_list ? body.ReadWhole(property.count_type, kMostOfAList) : 1;
    for (std::uint32_t i = 0; i < count && body.Ok(); ++i) {
      const double value = body.Read(property.type);
      if (property.name == "x") position.x() = static_cast<float>(value);
      if (property.name == "y") position.y() = static_cast<float>(value);
      if (property.name == "z") position.z() = static_cast<float>(value);
      const auto channel = property.name == "red"     ? 0
                           : property.name == "green" ? 1
                           : property.name == "blue"  ? 2
                                                      : -1;
      if (channel >= 0 && property.type == Scalar::kUint8) {
        // Text may have any number here.
        constexpr double kMostColour = 255;
        const bool fits = value >= 0 && value <= kMostColour;
        colour[static_cast<std::size_t>(channel)] = static_cast<std::uint8_t>(fits ? value : 0);
        coloured = true;
      }
    }
  }
  mesh.vertices.push_back(position);
  if (coloured) mesh.colours.push_back(colour);
}

void SkipElement(const Element& element, Body& body) {
  for (const Property& property : element.properties) {
    const std::uint32_t count =
        property.is_list ? body.ReadWhole(property.count_type, kMostOfAList) : 1;
    for (std::uint32_t i = 0; i < count && body.Ok(); ++i) body.Read(property.type);
  }
}

bool ReadFace(const Element& element, Body& body, Parsed& parsed) {
  constexpr std::uint32_t kMostOfAnId = std::numeric_limits<InstanceId>::max();
  std::vector<std::uint32_t> polygon;
  InstanceId id = 0;
  std::uint16_t region = 0;
  bool has_id = false;
  for (const Property& property : element.properties) {
    const std::uint32_t count =
        property.is_list ? body.ReadWhole(property.count_type, kMostOfAList) : 1;
    for (std::uint32_t i = 0; i < count && body.Ok(); ++i) {
      if (property.name == "vertex_indices" || property.name == "vertex_index") {
        const double value = body.Read(property.type);
        const bool whole = value == std::floor(value);
        if (!(whole && value >= 0 && value < static_cast<double>(parsed.mesh.vertices.size()))) {
          return false;
        }
        polygon.push_back(static_cast<std::uint32_t>(value));
      } else if (property.name == "object_id") {
        id = static_cast<InstanceId>(body.ReadWhole(property.type, kMostOfAnId));
        has_id = true;
      } else if (property.name == "region") {
        region = static_cast<std::uint16_t>(body.ReadWhole(property.type, kMostOfAnId));
      } else {
        body.Read(property.type);
      }
    }
  }
  if (!parsed.regions.empty() && region >= parsed.regions.size()) return false;
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    parsed.mesh.triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
    if (has_id) parsed.mesh.face_ids.push_back(id);
    if (!parsed.regions.empty()) parsed.face_region.push_back(region);
  }
  return true;
}

Expected<Parsed> Parse(const std::filesystem::path& path) {
  const std::string file = path.string();
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
  TSDFPP_ASSIGN(const Header header, ParseHeader(file, bytes));
  Parsed parsed;
  parsed.regions = header.regions;
  Body body(std::string_view(bytes).substr(header.body_at), header.ascii);
  for (const Element& element : header.elements) {
    // Without properties it takes no bytes, so its count is bounded by nothing.
    if (element.properties.empty() && element.count > 0) {
      return DataError("{}: {} elements {} have no property, expected one at least", file,
                       element.count, Quoted(element.name));
    }
    for (std::size_t i = 0; i < element.count && body.Ok(); ++i) {
      if (element.name == "vertex") {
        ReadVertex(element, body, parsed.mesh);
      } else if (element.name != "face") {
        SkipElement(element, body);
      } else if (!ReadFace(element, body, parsed) && body.Ok()) {
        return DataError("{}: face {} names a vertex or region that the file does not have", file,
                         i);
      }
    }
  }
  if (!body.Ok())
    return DataError(
        "{}: the file ends, or holds something unreadable, before its header's counts are "
        "reached",
        file);
  // Of several elements called so, some may lack what others have.
  if (parsed.mesh.colours.size() != parsed.mesh.vertices.size()) parsed.mesh.colours.clear();
  if (parsed.mesh.face_ids.size() != parsed.mesh.triangles.size()) parsed.mesh.face_ids.clear();
  for (const Eigen::Vector3f& vertex : parsed.mesh.vertices) {
    if (!vertex.allFinite()) return DataError("{}: a vertex has no finite x, y, z", file);
  }
  return parsed;
}

}  // namespace

Expected<void> WritePly(const std::filesystem::path& path, const TriangleMesh& mesh) {
  return WriteFile(path, PlyBytes(mesh, {}, {}));
}

Expected<TriangleMesh> ReadPly(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(Parsed parsed, Parse(path));
  return std::move(parsed.mesh);
}

Expected<void> WriteTrueModel(const std::filesystem::path& path, const TrueModel& model) {
  return WriteFile(path, PlyBytes(model.mesh_O, model.regions, model.face_region));
}

Expected<TrueModel> ReadTrueModel(const std::filesystem::path& path, const ObjectInfo& info) {
  TSDFPP_ASSIGN(Parsed parsed, Parse(path));
  for (const Eigen::Vector3f& vertex : parsed.mesh.vertices) {
    if (!(vertex.cwiseAbs().maxCoeff() <= static_cast<float>(kFarthest_m))) {
      return DataError("{}: a position is {:g} m from the origin, expected at most {:g}",
                       path.string(), vertex.cwiseAbs().maxCoeff(), kFarthest_m);
    }
  }
  if (parsed.regions.empty()) {
    parsed.regions = {info.name};
    parsed.face_region.assign(parsed.mesh.triangles.size(), 0);
  }
  return TrueModel{info, std::move(parsed.mesh), std::move(parsed.regions),
                   std::move(parsed.face_region)};
}

}  // namespace tsdfpp
