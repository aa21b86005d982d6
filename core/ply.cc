#include "core/ply.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>

#include "core/farthest.h"
#include "core/files.h"
#include "core/limits.h"
#include "core/one_line.h"
#include "core/plain_name.h"
#include "core/ply_header.h"
#include "core/polygon.h"

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

// Reads scalars from the body, one after the other; Ok() turns false past the end. Text has a line
// an element.
class Body {
 public:
  Body(std::string_view bytes, bool ascii) : bytes_(bytes), ascii_(ascii) {}

  bool Ok() const { return ok_; }
  // Is it not Ok() because a line has other numbers than the header says?
  bool IsBadLine() const { return bad_line_; }

  void BeginElement() {
    if (ascii_) Skip(kBlanksAndEnds);
  }
  void EndElement() {
    if (!ascii_ || !ok_) return;
    Skip(kBlanks);
    if (at_ < bytes_.size() && bytes_[at_] != '\n') bad_line_ = true;
    ok_ = !bad_line_;
  }
  // Behind the last element, where text may have blank lines.
  bool IsAtEnd() {
    if (ascii_) Skip(kBlanksAndEnds);
    return at_ == bytes_.size();
  }

  double Read(PlyScalar type) {
    if (ascii_) return ReadAscii();
    switch (type) {
      case PlyScalar::kInt8:
        return ReadRaw<std::int8_t>();
      case PlyScalar::kUint8:
        return ReadRaw<std::uint8_t>();
      case PlyScalar::kInt16:
        return ReadRaw<std::int16_t>();
      case PlyScalar::kUint16:
        return ReadRaw<std::uint16_t>();
      case PlyScalar::kInt32:
        return ReadRaw<std::int32_t>();
      case PlyScalar::kUint32:
        return ReadRaw<std::uint32_t>();
      case PlyScalar::kFloat:
        return ReadRaw<float>();
      case PlyScalar::kDouble:
        return ReadRaw<double>();
      case PlyScalar::kUnknown:
        break;
    }
    ok_ = false;
    return 0;
  }

  // A count, index or id: Ok() turns false where it is not a whole number from 0 to `largest`.
  std::uint32_t ReadWhole(PlyScalar type, std::uint32_t largest) {
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

  static constexpr std::string_view kBlanks = " \t\r\v\f";
  static constexpr std::string_view kBlanksAndEnds = " \t\r\v\f\n";

  void Skip(std::string_view what) {
    at_ = std::min(bytes_.find_first_not_of(what, at_), bytes_.size());
  }

  double ReadAscii() {
    if (!ok_) return 0;
    Skip(kBlanks);
    if (at_ < bytes_.size() && bytes_[at_] == '\n') {
      bad_line_ = true;
      ok_ = false;
      return 0;
    }
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
  bool bad_line_ = false;
};

constexpr std::uint32_t kMostOfAList = std::numeric_limits<std::int32_t>::max();

struct Parsed {
  TriangleMesh mesh;
  std::vector<std::string> regions;
  std::vector<std::uint16_t> face_region;
  FaceCutter cutter;
};

void ReadVertex(const PlyElement& element, Body& body, TriangleMesh& mesh) {
  Eigen::Vector3f position = Eigen::Vector3f::Constant(NAN);
  Colour colour{};
  bool coloured = false;
  for (const PlyProperty& property : element.properties) {
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
      if (channel >= 0 && property.type == PlyScalar::kUint8) {
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

void SkipElement(const PlyElement& element, Body& body) {
  for (const PlyProperty& property : element.properties) {
    const std::uint32_t count =
        property.is_list ? body.ReadWhole(property.count_type, kMostOfAList) : 1;
    for (std::uint32_t i = 0; i < count && body.Ok(); ++i) body.Read(property.type);
  }
}

Expected<void> AddFace(const std::vector<std::uint32_t>& polygon, std::optional<InstanceId> id,
                       std::uint16_t region, Parsed& parsed) {
  if (polygon.size() < 3) return DataError(" has {} corners, expected 3 at least", polygon.size());
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    parsed.mesh.triangles.push_back({a, b, c});
    if (id) parsed.mesh.face_ids.push_back(*id);
    if (!parsed.regions.empty()) parsed.face_region.push_back(region);
  };
  if (polygon.size() == 3) {
    add(polygon[0], polygon[1], polygon[2]);
    return {};
  }
  std::vector<Eigen::Vector3d> corners;
  corners.reserve(polygon.size());
  for (const std::uint32_t v : polygon) corners.push_back(parsed.mesh.vertices[v].cast<double>());
  const auto triangles = parsed.cutter.Cut(corners);
  if (!triangles) return DataError(": {}", triangles.error().message);
  for (const auto& [a, b, c] : *triangles) add(polygon[a], polygon[b], polygon[c]);
  return {};
}

// Errors stand behind the face's number. Where the body is not Ok() afterwards nothing is added.
Expected<void> ReadFace(const PlyElement& element, Body& body, Parsed& parsed) {
  constexpr const char* kNotThere = " names a vertex or region that the file does not have";
  constexpr std::uint32_t kMostOfAnId = std::numeric_limits<InstanceId>::max();
  std::vector<std::uint32_t> polygon;
  std::optional<InstanceId> id;
  std::uint16_t region = 0;
  for (const PlyProperty& property : element.properties) {
    const std::uint32_t count =
        property.is_list ? body.ReadWhole(property.count_type, kMostOfAList) : 1;
    for (std::uint32_t i = 0; i < count && body.Ok(); ++i) {
      if (property.name == "vertex_indices" || property.name == "vertex_index") {
        const double value = body.Read(property.type);
        const bool whole = value == std::floor(value);
        if (!body.Ok()) return {};
        if (!(whole && value >= 0 && value < static_cast<double>(parsed.mesh.vertices.size()))) {
          return DataError("{}", kNotThere);
        }
        polygon.push_back(static_cast<std::uint32_t>(value));
      } else if (property.name == "object_id") {
        id = static_cast<InstanceId>(body.ReadWhole(property.type, kMostOfAnId));
      } else if (property.name == "region") {
        region = static_cast<std::uint16_t>(body.ReadWhole(property.type, kMostOfAnId));
      } else {
        body.Read(property.type);
      }
    }
  }
  if (!body.Ok()) return {};
  if (!parsed.regions.empty() && region >= parsed.regions.size()) {
    return DataError("{}", kNotThere);
  }
  return AddFace(polygon, id, region, parsed);
}

Expected<Parsed> Parse(const std::filesystem::path& path) {
  const std::string file = path.string();
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
  TSDFPP_ASSIGN(const PlyHeader header, ParsePlyHeader(file, bytes));
  Parsed parsed;
  parsed.regions = header.regions;
  Body body(std::string_view(bytes).substr(header.body_at), header.ascii);
  for (const PlyElement& element : header.elements) {
    // Without properties it takes no bytes, so its count is bounded by nothing.
    if (element.properties.empty() && element.count > 0) {
      return DataError("{}: {} elements {} have no property, expected one at least", file,
                       element.count, Quoted(element.name));
    }
    if (element.name == "tristrips" && element.count > 0) {
      return DataError("{}: its triangles are strips (element 'tristrips'), expected faces", file);
    }
    for (std::size_t i = 0; i < element.count && body.Ok(); ++i) {
      body.BeginElement();
      if (element.name == "vertex") {
        ReadVertex(element, body, parsed.mesh);
      } else if (element.name != "face") {
        SkipElement(element, body);
      } else if (const auto face = ReadFace(element, body, parsed); !face) {
        return DataError("{}: face {}{}", file, i, face.error().message);
      }
      body.EndElement();
      if (body.IsBadLine()) {
        return DataError("{}: {} {}: its line has more or fewer numbers than the header says", file,
                         Quoted(element.name), i);
      }
    }
  }
  if (!body.Ok())
    return DataError(
        "{}: the file ends, or holds something unreadable, before its header's counts are "
        "reached",
        file);
  if (!body.IsAtEnd()) {
    return DataError("{}: the file holds more than its header counts", file);
  }
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
