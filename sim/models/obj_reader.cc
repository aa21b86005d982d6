#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "core/polygon.h"
#include "sim/models/mesh_files.h"
#include "sim/models/obj_materials.h"
#include "sim/models/text_scanner.h"

namespace tsdfpp {
namespace {

// Pictures repeat, but not that often.
constexpr double kMostTexcoord = 1e4;

class ObjReader {
 public:
  ObjReader(const std::filesystem::path& path, Materials materials)
      : file_(path.string()), materials_(path, materials, mesh_) {}

  Expected<RawMesh> Read(std::string_view text);

 private:
  struct Corner {
    std::uint32_t vertex = 0;
    std::uint32_t texcoord = kNoTexcoord;
  };

  Expected<void> ReadLine(std::string_view line);
  Expected<void> ReadVertex(const std::vector<std::string_view>& words);
  Expected<void> ReadTexcoord(const std::vector<std::string_view>& words);
  Expected<void> ReadFace(const std::vector<std::string_view>& words);
  Expected<Corner> ReadCorner(std::string_view word);
  Expected<std::uint32_t> ReadIndex(std::string_view word, std::size_t count, const char* what);
  Expected<double> ReadNumber(std::string_view word);
  Expected<void> CutFace(const std::vector<Corner>& corners);
  Expected<void> AddTriangle(const Corner& a, const Corner& b, const Corner& c);
  void AddRemarks();

  std::string file_;
  int line_ = 0;
  RawMesh mesh_;
  std::vector<std::optional<Eigen::Vector3d>> colours_;  // as written, per vertex
  ObjMaterials materials_;
  int material_ = kNoMaterial;
  std::size_t not_faces_ = 0;
  FaceCutter cutter_;
};

Expected<double> ObjReader::ReadNumber(std::string_view word) {
  const auto value = NumberIn<double>(word);
  if (!value)
    return DataError("{}: line {}: '{}' is not a number", file_, line_, word.substr(0, 40));
  if (!std::isfinite(*value)) {
    return DataError("{}: line {}: '{}' is not a finite number", file_, line_, word);
  }
  return *value;
}

Expected<void> ObjReader::ReadVertex(const std::vector<std::string_view>& words) {
  if (words.size() < 4) {
    return DataError("{}: line {}: a vertex has {} numbers, expected 3", file_, line_,
                     words.size() - 1);
  }
  std::array<double, 6> numbers{};
  // x y z, or x y z and red green blue; a fourth number alone is a weight, which a mesh has no use
  // for.
  const std::size_t count = words.size() >= 7 ? 6 : 3;
  for (std::size_t i = 0; i < count; ++i) {
    TSDFPP_ASSIGN(numbers[i], ReadNumber(words[i + 1]));
  }
  mesh_.vertices.emplace_back(numbers[0], numbers[1], numbers[2]);
  colours_.emplace_back();
  if (count == 6) colours_.back() = Eigen::Vector3d(numbers[3], numbers[4], numbers[5]);
  return {};
}

Expected<void> ObjReader::ReadTexcoord(const std::vector<std::string_view>& words) {
  if (words.size() < 2) {
    return DataError("{}: line {}: a texture coordinate has no number", file_, line_);
  }
  TSDFPP_ASSIGN(const double u, ReadNumber(words[1]));
  double v = 0;
  if (words.size() > 2) {
    TSDFPP_ASSIGN(v, ReadNumber(words[2]));
  }
  if (std::max(std::abs(u), std::abs(v)) > kMostTexcoord) {
    return DataError("{}: line {}: texture coordinate {} {} is beyond {}", file_, line_, u, v,
                     kMostTexcoord);
  }
  mesh_.texcoords.emplace_back(u, v);
  return {};
}

// Numbered from 1, or from the end: -1 is the last so far.
Expected<std::uint32_t> ObjReader::ReadIndex(std::string_view word, std::size_t count,
                                             const char* what) {
  const auto value = NumberIn<std::int64_t>(word);
  if (!value) {
    return DataError("{}: line {}: '{}' is no index of a {}", file_, line_, word.substr(0, 40),
                     what);
  }
  const auto have = static_cast<std::int64_t>(count);
  if (*value == 0 || *value > have || *value < -have) {
    return DataError("{}: line {}: names {} {}, but there are {} so far", file_, line_, what,
                     *value, count);
  }
  return static_cast<std::uint32_t>(*value > 0 ? *value - 1 : have + *value);
}

// v, v/vt, v//vn or v/vt/vn; normals are made anew.
Expected<ObjReader::Corner> ObjReader::ReadCorner(std::string_view word) {
  Corner corner;
  const std::size_t slash = word.find('/');
  TSDFPP_ASSIGN(corner.vertex, ReadIndex(word.substr(0, slash), mesh_.vertices.size(), "vertex"));
  if (slash == std::string_view::npos) return corner;
  const std::string_view rest = word.substr(slash + 1);
  const std::string_view texcoord = rest.substr(0, rest.find('/'));
  if (!texcoord.empty()) {
    TSDFPP_ASSIGN(corner.texcoord,
                  ReadIndex(texcoord, mesh_.texcoords.size(), "texture coordinate"));
  }
  return corner;
}

Expected<void> ObjReader::AddTriangle(const Corner& a, const Corner& b, const Corner& c) {
  if (mesh_.triangles.size() == kMaxImportedTriangles) {
    return DataError("{}: has more than {} triangles, expected at most that: simplify it", file_,
                     kMaxImportedTriangles);
  }
  RawTriangle triangle;
  triangle.vertex = {a.vertex, b.vertex, c.vertex};
  triangle.texcoord = {a.texcoord, b.texcoord, c.texcoord};
  triangle.material = material_;
  mesh_.triangles.push_back(triangle);
  return {};
}

Expected<void> ObjReader::CutFace(const std::vector<Corner>& corners) {
  std::vector<Eigen::Vector3d> at;
  at.reserve(corners.size());
  for (const Corner& corner : corners) at.push_back(mesh_.vertices[corner.vertex]);
  const auto triangles = cutter_.Cut(at);
  if (!triangles) return DataError("{}: line {}: {}", file_, line_, triangles.error().message);
  for (const auto& [a, b, c] : *triangles) {
    TSDFPP_RETURN_IF_ERROR(AddTriangle(corners[a], corners[b], corners[c]));
  }
  return {};
}

Expected<void> ObjReader::ReadFace(const std::vector<std::string_view>& words) {
  if (words.size() < 4) {
    return DataError("{}: line {}: a face has {} corners, expected 3 at least", file_, line_,
                     words.size() - 1);
  }
  std::vector<Corner> corners;
  for (std::size_t i = 1; i < words.size(); ++i) {
    TSDFPP_ASSIGN(const Corner corner, ReadCorner(words[i]));
    corners.push_back(corner);
  }
  return CutFace(corners);
}

Expected<void> ObjReader::ReadLine(std::string_view line) {
  const auto words = WordsOf(line.substr(0, line.find('#')));
  if (words.empty()) return {};
  static const std::set<std::string_view> kKnown{"vn", "vp", "o", "g", "s"};
  if (words[0] == "v") return ReadVertex(words);
  if (words[0] == "vt") return ReadTexcoord(words);
  // Old files have "fo", which is the same.
  if (words[0] == "f" || words[0] == "fo") return ReadFace(words);
  if (words[0] == "usemtl") {
    material_ = materials_.Named(RestOf(line, words[0]));
  } else if (words[0] == "mtllib") {
    materials_.ReadLibrary(RestOf(line, words[0]));
  } else if (!kKnown.contains(words[0])) {
    ++not_faces_;
  }
  return {};
}

void ObjReader::AddRemarks() {
  if (not_faces_ > 0) {
    mesh_.remarks.push_back(fmt::format(
        "{}: {} lines are no vertices, faces or materials: left out", file_, not_faces_));
  }
}

Expected<RawMesh> ObjReader::Read(std::string_view text) {
  if (text.substr(0, 4096).find('\0') != std::string_view::npos) {
    return DataError("{}: not an OBJ file: it is not text", file_);
  }
  std::string joined;  // of lines that end in a backslash
  while (!text.empty()) {
    ++line_;
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.ends_with('\\')) {
      joined.append(line.substr(0, line.size() - 1)).append(" ");
      continue;
    }
    if (joined.empty()) {
      TSDFPP_RETURN_IF_ERROR(ReadLine(line));
    } else {
      joined.append(line);
      TSDFPP_RETURN_IF_ERROR(ReadLine(joined));
      joined.clear();
    }
  }
  if (!joined.empty()) return DataError("{}: the file is cut off within line {}", file_, line_);
  const bool coloured =
      !colours_.empty() &&
      std::all_of(colours_.begin(), colours_.end(), [](const auto& c) { return c.has_value(); });
  if (coloured) {
    // From 0 to 1 by custom, but some write bytes.
    double largest = 0;
    for (const auto& colour : colours_) largest = std::max(largest, colour->maxCoeff());
    for (const auto& colour : colours_) {
      mesh_.colours.push_back(ToColour(*colour, largest > 1 ? 255 : 1));
    }
  }
  AddRemarks();
  return std::move(mesh_);
}

}  // namespace

Expected<RawMesh> ReadObj(const std::filesystem::path& path, std::string_view bytes,
                          Materials materials) {
  return ObjReader(path, materials).Read(bytes);
}

}  // namespace tsdfpp
