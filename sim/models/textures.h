// Pictures for surfaces, made from keyed random numbers: the same bytes everywhere.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
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

// The pictures that every scene has, one a material: wood, tile, plaster.
std::vector<TextureImage> MakeTextures();

// A picture that a scene chooses. It repeats without a seam.
struct TextureSpec {
  std::string pattern;         // one of TexturePatternNames()
  std::uint64_t seed = 7;      // of its noise
  Colour first{190, 142, 96};  // the ground
  Colour second{96, 64, 40};   // veins, lines, the other squares
  double size_m = 0.2;         // side of the square of surface that one picture covers
  int side_px = 256;
};

inline constexpr int kLeastTextureSide_px = 16;
inline constexpr int kMostTextureSide_px = 2048;

// checker, stripes, dots, bricks, planks, marble, noise, speckle, weave.
const std::vector<std::string>& TexturePatternNames();

// The picture, its material named after all that it depends on, so that equal names are equal
// pictures. Errors: kUsage: no such pattern, size_m not positive, side_px out of 16 to 2048.
Expected<TextureImage> MakeTexture(const TextureSpec& spec);

// A pattern, two muted colours that differ visibly, and a size between 5 and 30 cm, drawn for
// (seed, index). The same for the same arguments on every machine.
TextureSpec DrawTexture(std::uint64_t seed, std::uint64_t index);

// A paint that is neither nearly black nor nearly white, drawn for (seed, index).
Colour DrawPaint(std::uint64_t seed, std::uint64_t index);

}  // namespace tsdfpp
