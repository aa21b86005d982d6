#include <cmath>
#include <cstring>
#include <string>

#include "sim/models/mesh_files.h"
#include "sim/models/text_scanner.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kHeader = 84;  // bytes, the count of triangles being the last four
constexpr std::size_t kRecord = 50;  // bytes a triangle

Expected<void> AddTriangle(const std::string& file, const std::array<Eigen::Vector3d, 3>& corners,
                           RawMesh& mesh) {
  if (mesh.triangles.size() == kMaxImportedTriangles) {
    return DataError("{}: has more than {} triangles, expected at most that: simplify it", file,
                     kMaxImportedTriangles);
  }
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3d& corner : corners) {
    if (!corner.allFinite()) {
      return DataError("{}: triangle {} has a corner that is not finite", file,
                       mesh.triangles.size());
    }
    mesh.vertices.push_back(corner);
  }
  RawTriangle triangle;
  triangle.vertex = {first, first + 1, first + 2};
  mesh.triangles.push_back(triangle);
  return {};
}

Expected<RawMesh> ReadBinary(const std::string& file, std::string_view bytes, std::size_t count) {
  RawMesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    // A normal, which the corners give anyway, the corners, two bytes without a meaning.
    std::array<float, 12> numbers{};
    std::memcpy(numbers.data(), bytes.data() + kHeader + i * kRecord, sizeof(numbers));
    std::array<Eigen::Vector3d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = {numbers[3 * k + 3], numbers[3 * k + 4], numbers[3 * k + 5]};
    }
    TSDFPP_RETURN_IF_ERROR(AddTriangle(file, corners, mesh));
  }
  return mesh;
}

Expected<RawMesh> ReadAscii(const std::string& file, std::string_view text) {
  RawMesh mesh;
  std::array<Eigen::Vector3d, 3> corners;
  std::size_t corner = 0;
  bool ended = false;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = text.find('\n');
    const auto words = WordsOf(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (words.empty() || words[0] == "facet" || words[0] == "outer") continue;
    if (words[0] == "solid") {
      ended = false;
    } else if (words[0] == "endsolid") {
      ended = true;
    } else if (words[0] == "vertex") {
      if (corner == 3 || words.size() != 4) {
        return DataError("{}: line {}: a facet is expected to have three vertices of three numbers",
                         file, number);
      }
      for (int k = 0; k < 3; ++k) {
        const auto value = NumberIn<double>(words[static_cast<std::size_t>(k) + 1]);
        if (!value) {
          return DataError("{}: line {}: '{}' is not a number", file, number,
                           words[static_cast<std::size_t>(k) + 1]);
        }
        corners[corner][k] = *value;
      }
      ++corner;
    } else if (words[0] == "endfacet") {
      if (corner != 3) {
        return DataError("{}: line {}: the facet has {} vertices, expected 3", file, number,
                         corner);
      }
      TSDFPP_RETURN_IF_ERROR(AddTriangle(file, corners, mesh));
      corner = 0;
    } else if (words[0] != "endloop") {
      return DataError("{}: line {}: '{}' is no word of an ASCII STL file", file, number,
                       words[0].substr(0, 40));
    }
  }
  if (!ended) return DataError("{}: the file is cut off: it has no endsolid", file);
  if (corner != 0) return DataError("{}: the last facet has no endfacet", file);
  return mesh;
}

}  // namespace

Expected<RawMesh> ReadStl(const std::filesystem::path& path, std::string_view bytes) {
  const std::string file = path.string();
  const bool says_ascii = bytes.starts_with("solid");
  std::uint32_t count = 0;
  if (bytes.size() >= kHeader) std::memcpy(&count, bytes.data() + kHeader - 4, 4);
  const std::size_t needed = kHeader + kRecord * static_cast<std::size_t>(count);
  // Some binary files begin with "solid" all the same; their length gives them away.
  const bool is_binary = bytes.size() >= kHeader && bytes.size() == needed;
  if (is_binary) return ReadBinary(file, bytes, count);
  if (says_ascii) return ReadAscii(file, bytes);
  if (bytes.size() < kHeader) {
    return DataError("{}: not an STL file: it has {} bytes, a binary one has {} at least", file,
                     bytes.size(), kHeader);
  }
  return DataError("{}: the binary STL file {}: {} triangles need {} bytes, it has {}", file,
                   bytes.size() < needed ? "is cut off" : "holds more than it counts", count,
                   needed, bytes.size());
}

}  // namespace tsdfpp
