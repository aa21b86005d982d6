#include "eval/score/surface_file.h"

#include <algorithm>
#include <cctype>

#include "core/farthest.h"
#include "core/files.h"
#include "core/ply.h"
#include "sim/models/mesh_files.h"

namespace tsdfpp {
namespace {

std::string EndingOf(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

TriangleMesh MeshOf(const RawMesh& raw) {
  TriangleMesh mesh;
  for (const Eigen::Vector3d& vertex : raw.vertices) {
    mesh.vertices.emplace_back(vertex.cast<float>());
  }
  for (const RawTriangle& triangle : raw.triangles) mesh.triangles.push_back(triangle.vertex);
  return mesh;
}

}  // namespace

bool IsSurfaceFile(const std::filesystem::path& path) {
  const std::string ending = EndingOf(path);
  return ending == ".ply" || ending == ".obj" || ending == ".stl" || ending == ".glb";
}

Expected<std::vector<NamedMesh>> ReadSurfaceParts(const std::filesystem::path& path, double scale,
                                                  std::vector<std::string>& remarks) {
  const std::string ending = EndingOf(path);
  std::vector<NamedMesh> parts;
  if (ending == ".ply") {
    parts.emplace_back();
    TSDFPP_ASSIGN(parts.front().mesh, ReadPly(path));
  } else if (ending == ".glb") {
    TSDFPP_ASSIGN(parts, ReadGlb(path));
  } else if (ending == ".obj" || ending == ".stl") {
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
    TSDFPP_ASSIGN(const RawMesh raw,
                  ending == ".obj" ? ReadObj(path, bytes, Materials::kSkip) : ReadStl(path, bytes));
    remarks.insert(remarks.end(), raw.remarks.begin(), raw.remarks.end());
    parts.emplace_back();
    parts.front().mesh = MeshOf(raw);
  } else {
    return UsageError("{}: a surface is expected to be a .ply, .obj, .stl or .glb file",
                      path.string());
  }
  for (NamedMesh& part : parts) {
    for (Eigen::Vector3f& vertex : part.mesh.vertices) {
      vertex = (scale * vertex.cast<double>()).cast<float>();
      if (!(vertex.cwiseAbs().maxCoeff() <= static_cast<float>(kFarthest_m))) {
        return DataError(
            "{}: at scale {} a position is {:g} from the origin, expected at most {:g}",
            path.string(), scale, vertex.cwiseAbs().maxCoeff(), kFarthest_m);
      }
    }
  }
  return parts;
}

Expected<TriangleMesh> ReadSurfaceFile(const std::filesystem::path& path, double scale,
                                       std::vector<std::string>& remarks) {
  TSDFPP_ASSIGN(std::vector<NamedMesh> parts, ReadSurfaceParts(path, scale, remarks));
  TriangleMesh mesh;
  for (NamedMesh& part : parts) {
    if (parts.size() == 1) return std::move(part.mesh);
    AppendMesh(part.mesh, mesh);
  }
  return mesh;
}

void AppendMesh(const TriangleMesh& more, TriangleMesh& mesh) {
  const bool first = mesh.vertices.empty();
  const bool ids = first || mesh.face_ids.size() == mesh.triangles.size();
  const bool colours = first || mesh.colours.size() == mesh.vertices.size();
  const auto offset = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const auto& t : more.triangles) {
    mesh.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  }
  mesh.face_ids.insert(mesh.face_ids.end(), more.face_ids.begin(), more.face_ids.end());
  mesh.colours.insert(mesh.colours.end(), more.colours.begin(), more.colours.end());
  if (!ids || mesh.face_ids.size() != mesh.triangles.size()) mesh.face_ids.clear();
  if (!colours || mesh.colours.size() != mesh.vertices.size()) mesh.colours.clear();
}

}  // namespace tsdfpp
