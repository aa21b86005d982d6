// The room that scenes share: floor, walls, ceiling, a table and furniture, all of id 0.
#pragma once

#include <optional>
#include <vector>

#include "core/error.h"
#include "sim/models/textures.h"
#include "sim/models/toy_models.h"

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

// What a scene may vary of the room; the default is the room of toycar3.
struct RoomSpec {
  bool table = true;             // without it, things stand on the floor
  bool furniture = true;         // along the walls
  double half_x = kRoomHalfX_m;  // metres, no smaller than the default
  double half_y = kRoomHalfY_m;
  double height = kRoomHeight_m;
  std::optional<TextureSpec> table_texture;  // of the table's top
  std::optional<TextureSpec> floor_texture;
  std::optional<TextureSpec> wall_texture;

  // Errors: kUsage, with the field: out of range (a far corner would leave the depth range), or a
  // texture's own error.
  Expected<void> Validate() const;
  // Where things stand: the table's top or the floor, metres.
  double ground_m() const { return table ? kTableTop_m : 0; }
  // Half the sides of the rectangle around the origin on which nothing of the room stands.
  double ground_half_x() const;
  double ground_half_y() const;
};

// The parts of the room, in the world's frame. Regions: "table", "floor", "wall", "furniture".
// `spec` must be valid.
std::vector<ModelPart> MakeRoom(const RoomSpec& spec = {});

}  // namespace tsdfpp
