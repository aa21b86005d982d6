// Meshes: PLY, OBJ with its materials and pictures, STL, glTF.
#include <algorithm>
#include <cmath>

#include "core/gltf.h"
#include "core/ply.h"
#include "eval/score/surface_file.h"
#include "sim/models/mesh_import.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/file_set.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

namespace fs = std::filesystem;

void CheckMesh(const TriangleMesh& mesh) {
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      Require(vertex < mesh.vertices.size(), "a triangle of a vertex that there is not");
    }
  }
  Require(mesh.colours.empty() || mesh.colours.size() == mesh.vertices.size(),
          "colours of some vertices");
  Require(mesh.face_ids.empty() || mesh.face_ids.size() == mesh.triangles.size(),
          "ids of some faces");
}

bool IsFinite(const TriangleMesh& mesh) {
  return std::all_of(mesh.vertices.begin(), mesh.vertices.end(),
                     [](const Eigen::Vector3f& vertex) { return vertex.allFinite(); });
}

bool IsSame(const TriangleMesh& a, const TriangleMesh& b) {
  return a.vertices == b.vertices && a.triangles == b.triangles && a.colours == b.colours &&
         a.face_ids == b.face_ids;
}

// As a surface that is scored, and as a model in a scene.
bool ReadAsSurface(const fs::path& path) {
  std::vector<std::string> remarks;
  const auto mesh = ReadSurfaceFile(path, 1.0, remarks);
  if (!Accepted(mesh, path.string())) return false;
  CheckMesh(*mesh);
  Require(IsFinite(*mesh), "a surface with a position that is not finite");
  return true;
}

bool ReadAsModel(const fs::path& path) {
  const auto model = ImportMesh(path);
  if (!Accepted(model, path.string())) return false;
  for (const ModelPart& part : model->parts) {
    for (const auto& triangle : part.shape.triangles) {
      for (const std::uint32_t vertex : triangle) {
        Require(vertex < part.shape.vertices.size(), "a part of a vertex that there is not");
      }
    }
    Require(part.corner_uv.empty() || part.corner_uv.size() == 3 * part.shape.triangles.size(),
            "texture coordinates of some corners");
  }
  return true;
}

bool ReadPlyInput(std::string_view input) {
  const fs::path path = WriteOne("mesh.ply", input);
  const auto truth = ReadTrueModel(path, {1, "thing", ""});
  if (Accepted(truth, path.string())) {
    Require(!truth->regions.empty(), "a model without a region");
    Require(truth->face_region.size() == truth->mesh_O.triangles.size(), "regions of some faces");
    for (const std::uint16_t region : truth->face_region) {
      Require(region < truth->regions.size(), "a face of a region that there is not");
    }
  }
  ReadAsModel(path);
  if (!ReadAsSurface(path)) return false;
  const auto mesh = ReadPly(path);
  Require(mesh.has_value(), "a surface that is no PLY");
  if (mesh->vertices.empty()) return true;
  const fs::path copy = path.parent_path() / "copy.ply";
  Require(WritePly(copy, *mesh).has_value(), "the disk refuses");
  const auto again = ReadPly(copy);
  Require(again && IsSame(*again, *mesh), "what was written is read as something else");
  return true;
}

bool ReadObjInput(std::string_view input) {
  const fs::path& folder = WriteSet(input);
  const fs::path path = folder / "meshes" / "mesh.obj";
  const bool is_surface = ReadAsSurface(path);
  const bool is_model = ReadAsModel(path);
  const auto painted = ImportMesh(path, 1, folder / "textures" / "picture.png");
  (void)Accepted(painted);
  return is_surface && is_model;
}

bool ReadStlInput(std::string_view input) {
  const fs::path path = WriteOne("mesh.stl", input);
  const bool is_surface = ReadAsSurface(path);
  return ReadAsModel(path) && is_surface;
}

bool ReadGltfInput(std::string_view input) {
  const fs::path path = WriteOne("scene.glb", input);
  ReadAsSurface(path);
  const auto scene = ReadGlb(path);
  if (!Accepted(scene, path.string())) return false;
  for (const NamedMesh& object : *scene) {
    CheckMesh(object.mesh);
    Require(IsFinite(object.mesh), "a vertex that is not finite");
  }
  const fs::path copy = path.parent_path() / "copy.glb";
  Require(WriteGlb(copy, *scene).has_value(), "the disk refuses");
  const auto again = ReadGlb(copy);
  Require(again.has_value(), again ? "" : "what was written is refused: " + again.error().message);
  return true;
}

}  // namespace

void AddMeshTargets(std::vector<Target>& targets) {
  targets.push_back({"ply", "mesh.ply", ReadPlyInput, {"core/ply.cc", "core/ply_header.cc"}});
  targets.push_back({"obj",
                     "",
                     ReadObjInput,
                     {"sim/models/obj_reader.cc", "sim/models/obj_materials.cc",
                      "sim/models/mesh_import.cc", "sim/models/mesh_repair.cc"}});
  targets.push_back({"stl", "mesh.stl", ReadStlInput, {"sim/models/stl_reader.cc"}});
  targets.push_back(
      {"gltf", "scene.glb", ReadGltfInput, {"core/gltf_document.cc", "core/gltf_reader.cc"}});
}

}  // namespace tsdfpp::fuzz
