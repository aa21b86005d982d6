// The room that every scene shares: floor, walls, ceiling, a table and furniture, all of id 0.
#pragma once

#include <vector>

#include "sim/toy_models.h"

namespace tsdfpp {

// World frame: +z up, the floor at z = 0, the origin below the table's middle.
// The table's top is at an odd height on purpose: it lies on no plane of a 1 cm or 5 mm lattice.
inline constexpr double kTableTop_m = 0.7437;
inline constexpr double kTableHalfX_m = 0.8;
inline constexpr double kTableHalfY_m = 0.5;
inline constexpr double kTableThickness_m = 0.05;
// The inside of the room: |x|, |y| and z up to these.
inline constexpr double kRoomHalfX_m = 2.4;
inline constexpr double kRoomHalfY_m = 2.2;
inline constexpr double kRoomHeight_m = 2.6;

// The parts of the room, in the world's frame. Regions: "table", "floor", "wall", "furniture".
std::vector<ModelPart> MakeRoom();

}  // namespace tsdfpp
