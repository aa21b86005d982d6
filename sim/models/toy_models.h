// The toys: each is composed of several closed meshes. No part is thinner than 2.5 cm, so that a
// map of 1 cm voxels can hold it.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"
#include "sim/models/mesh_shapes.h"
#include "sim/models/textures.h"

namespace tsdfpp {

// One coloured solid of a model. `material` is one of textures.h's, or empty for plain paint.
struct ModelPart {
  std::string name;
  Shape shape;  // in the model's frame: +x front, +z up, origin on the ground below the middle
  Colour colour{};
  std::string material;
  std::string region;
  // A picture of the part's own, whose name is `material`; null where `material` is one that all
  // scenes have (MakeTextures).
  std::shared_ptr<const TextureImage> picture = nullptr;
  // Where each triangle's three corners lie in the picture, its first row at v = 0; empty: laid on
  // by axis (part_geom.h).
  std::vector<Eigen::Vector2f> corner_uv{};
};

// How far the lowest point of every toy floats above the ground, so that no face lies in the
// table's.
inline constexpr double kToyClearance_m = 0.0007;

// The names that MakeToy knows, in a fixed order.
const std::vector<std::string>& ToyModelNames();

// The parts of a toy; `name` must be one of ToyModelNames(). Each part's region is the toy's name.
std::vector<ModelPart> MakeToy(std::string_view name);

}  // namespace tsdfpp
