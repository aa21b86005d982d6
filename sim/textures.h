// Pictures for the room's surfaces, made from keyed random numbers: the same bytes everywhere.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

inline constexpr const char* kWoodMaterial = "wood";
inline constexpr const char* kTileMaterial = "tile";
inline constexpr const char* kPlasterMaterial = "plaster";

struct TextureImage {
  std::string material;
  int width = 0;
  int height = 0;
  double size_m = 1;                 // side of the square of surface that one picture covers
  std::vector<std::uint8_t> pixels;  // RGB, row by row
  Colour mean{};                     // of all pixels
};

// All the pictures, one a material.
std::vector<TextureImage> MakeTextures();

}  // namespace tsdfpp
