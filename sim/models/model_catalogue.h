// Every model that a scene can name: the toys, solids of any size, thin things, and mesh files.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "sim/models/toy_models.h"

namespace tsdfpp {

// A model and what a scene may vary of it.
struct ModelSpec {
  std::string name;             // one of ModelCatalogue(), or "mesh" for `file`
  double scale = 1;             // of all lengths
  std::optional<Colour> paint;  // of the main part and those of its colour; default: its own
  std::string material;         // a pattern of textures.h for the main part; empty: plain paint
  std::uint64_t seed = 7;       // of that pattern
  std::filesystem::path file;   // of a "mesh": OBJ, STL or PLY
  std::optional<Eigen::Vector3d> size_m;  // of a solid: extents before scaling; default: its own
  std::string up = "z";           // of a "mesh": which of the file's axes points up, [-]x, y or z
  std::filesystem::path picture;  // of a "mesh": laid on by the file's texture coordinates
};

struct ModelInfo {
  std::string name;
  std::string what;        // a phrase for a list
  Eigen::Vector3d size_m;  // extents of its bounding box, to kModelSizeTolerance_m
  // Has walls or plates of less than 2.5 cm on purpose: a map of 1 cm voxels cannot hold both
  // sides.
  bool thin = false;
  bool solid = false;   // takes size_m
  bool hollow = false;  // its convex hull is not its shape: other things fit into it
};

inline constexpr double kModelSizeTolerance_m = 0.004;
// No model has more triangles; most have far fewer, so that thirty-two of them render quickly.
inline constexpr std::size_t kMaxModelTriangles = 14000;
// The name of a ModelSpec that reads `file`.
inline constexpr std::string_view kMeshModel = "mesh";
inline constexpr double kLeastModelScale = 1e-6;
inline constexpr double kMostModelScale = 1e6;

// In a fixed order, the toys of ToyModelNames() first.
const std::vector<ModelInfo>& ModelCatalogue();
// nullptr where there is no such model ("mesh" is none).
const ModelInfo* FindModel(std::string_view name);

// Checks the fields without reading any file. Errors: kUsage, naming the field.
Expected<void> CheckModelSpec(const ModelSpec& spec);

// The parts in the model's frame: +x front, +z up, the bounding box's middle above the origin, the
// lowest point at z = kToyClearance_m (times nothing: scale leaves the clearance). Each part's
// region is the model's name ("mesh" for a file). Remarks of a mesh's import are logged as
// warnings. Errors: those of CheckModelSpec and ImportMesh.
Expected<std::vector<ModelPart>> MakeModel(const ModelSpec& spec);

// The box around all parts, in the model's frame.
Eigen::AlignedBox3d BoundsOf(const std::vector<ModelPart>& parts);

}  // namespace tsdfpp
