// The order of the pixels of an image tile in which rays are cast.
#pragma once

#include <array>
#include <cstdint>

namespace tsdfpp {

inline constexpr int kTileSide = 16;
inline constexpr int kTilePixels = kTileSide * kTileSide;

// Column and row of a tile's i-th pixel: squares of 4x4 pixels, these in squares of squares, so
// that neighbours in the order are neighbours in the image, and pixels 4 k ... 4 k + 3 one after
// another in a row of it.
struct TileOrder {
  TileOrder();
  std::array<std::uint8_t, kTilePixels> x{};
  std::array<std::uint8_t, kTilePixels> y{};
  std::array<std::uint8_t, kTilePixels> place{};  // i of column x and row y, at 16 y + x
};
const TileOrder& OrderOfTile();

}  // namespace tsdfpp
