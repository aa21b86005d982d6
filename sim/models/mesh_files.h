// OBJ and STL files as they are: what mesh_import.h makes fit for rendering.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

inline constexpr std::uint32_t kNoTexcoord = 0xFFFFFFFF;
inline constexpr int kNoMaterial = -1;

struct RawTriangle {
  std::array<std::uint32_t, 3> vertex{};
  std::array<std::uint32_t, 3> texcoord{kNoTexcoord, kNoTexcoord, kNoTexcoord};
  int material = kNoMaterial;
};

struct RawMaterial {
  std::string name;
  std::optional<Colour> colour;   // Kd
  std::filesystem::path picture;  // map_Kd; empty: none
};

// A file that a mesh refers to, whether it is there or not.
struct Companion {
  std::string name;            // as it stands in the file that names it
  std::filesystem::path path;  // where that is
  // Relative, and inside the folder above the mesh's own (so that "../textures" is found), links
  // included. Others are not opened.
  bool inside = true;
};

struct RawMesh {
  std::vector<Eigen::Vector3d> vertices;   // finite, in the file's unit
  std::vector<Colour> colours;             // per vertex, or empty
  std::vector<Eigen::Vector2d> texcoords;  // finite, v upwards
  std::vector<RawTriangle> triangles;      // indices are in range
  std::vector<RawMaterial> materials;
  std::vector<Companion> companions;  // material libraries and their pictures
  std::vector<std::string> remarks;   // sentences on what was left out
};

// A file of more triangles is refused while it is read.
inline constexpr std::size_t kMaxImportedTriangles = 1000000;

// Whether an OBJ's material libraries are read.
enum class Materials { kRead, kSkip };

// `file` is the name for messages (of an OBJ, its folder is where material libraries are looked
// for). Errors: kData, naming file and line: see ImportMesh.
Expected<RawMesh> ReadObj(const std::filesystem::path& file, std::string_view bytes,
                          Materials materials = Materials::kRead);
Expected<RawMesh> ReadStl(const std::filesystem::path& file, std::string_view bytes);

}  // namespace tsdfpp
