#include "mapper/rays/tile_order.h"

namespace tsdfpp {

TileOrder::TileOrder() {
  for (unsigned i = 0; i < kTilePixels; ++i) {
    const unsigned square = i / 16;
    const unsigned column = 4 * ((square & 1U) | (square >> 1U & 2U)) + i % 4;
    const unsigned row = 4 * ((square >> 1U & 1U) | (square >> 2U & 2U)) + i / 4 % 4;
    x[i] = static_cast<std::uint8_t>(column);
    y[i] = static_cast<std::uint8_t>(row);
    place[kTileSide * row + column] = static_cast<std::uint8_t>(i);
  }
}

const TileOrder& OrderOfTile() {
  static const TileOrder order;
  return order;
}

}  // namespace tsdfpp
