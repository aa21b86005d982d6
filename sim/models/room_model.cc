#include "sim/models/room_model.h"

#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>

namespace tsdfpp {
namespace {

constexpr double kWallThickness_m = 0.1;
// Cells of the meshes; the renderer lights vertices (mesh_shapes.h).
constexpr double kTableCell_m = 0.1;
constexpr double kRoomCell_m = 0.4;
// Of the default room's floor, what no furniture stands on: |x| and |y| up to these.
constexpr double kClearHalfX_m = 1.2;
constexpr double kClearHalfY_m = 1.05;

void AddBox(std::vector<ModelPart>& parts, const char* name, const char* region,
            const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Colour& colour,
            const char* material, double cell_m) {
  parts.push_back({name, MakeBox(low, high, cell_m), colour, material, region});
}

void AddTable(std::vector<ModelPart>& parts) {
  const Colour wood{176, 128, 84};
  AddBox(parts, "table_top", "table",
         {-kTableHalfX_m, -kTableHalfY_m, kTableTop_m - kTableThickness_m},
         {kTableHalfX_m, kTableHalfY_m, kTableTop_m}, wood, kWoodMaterial, kTableCell_m);
  constexpr double kLeg = 0.035;     // half of a leg's side
  constexpr double kInset = 0.07;    // of a leg's middle from the table's edge
  constexpr double kOverlap = 0.01;  // legs reach into the top, so no two faces share a plane
  for (const int sx : {-1, 1}) {
    for (const int sy : {-1, 1}) {
      const double x = sx * (kTableHalfX_m - kInset);
      const double y = sy * (kTableHalfY_m - kInset);
      const std::string name =
          std::string("table_leg_") + (sx < 0 ? "left" : "right") + (sy < 0 ? "_front" : "_back");
      AddBox(parts, name.c_str(), "table", {x - kLeg, y - kLeg, -kOverlap},
             {x + kLeg, y + kLeg, kTableTop_m - kTableThickness_m + kOverlap}, {110, 74, 46}, "",
             kRoomCell_m);
    }
  }
}

void AddShell(std::vector<ModelPart>& parts, const RoomSpec& spec) {
  const double t = kWallThickness_m;
  const double half_x = spec.half_x;
  const double half_y = spec.half_y;
  const double height = spec.height;
  const Colour wall{214, 206, 190};
  // Walls stand on the inside edge of the floor slab and overlap at the corners.
  AddBox(parts, "floor", "floor", {-half_x - t, -half_y - t, -t}, {half_x + t, half_y + t, 0},
         {150, 150, 150}, kTileMaterial, kRoomCell_m);
  AddBox(parts, "ceiling", "wall", {-half_x - t, -half_y - t, height},
         {half_x + t, half_y + t, height + t}, {240, 238, 232}, "", kRoomCell_m);
  AddBox(parts, "wall_back", "wall", {-half_x - t, half_y, -t / 2},
         {half_x + t, half_y + t, height + t / 2}, wall, kPlasterMaterial, kRoomCell_m);
  AddBox(parts, "wall_front", "wall", {-half_x - t, -half_y - t, -t / 2},
         {half_x + t, -half_y, height + t / 2}, wall, kPlasterMaterial, kRoomCell_m);
  AddBox(parts, "wall_left", "wall", {-half_x - t, -half_y - t / 2, -t / 2},
         {-half_x, half_y + t / 2, height + t / 2}, wall, kPlasterMaterial, kRoomCell_m);
  AddBox(parts, "wall_right", "wall", {half_x, -half_y - t / 2, -t / 2},
         {half_x + t, half_y + t / 2, height + t / 2}, wall, kPlasterMaterial, kRoomCell_m);
}

// Laid out for the default room.
void AddFurniture(std::vector<ModelPart>& parts) {
  const Colour oak{158, 112, 70};
  const Colour door{196, 150, 100};
  // A cupboard at the back wall: a body, two doors and a top board that stand out.
  AddBox(parts, "cupboard_body", "furniture", {-1.25, 1.72, -0.01}, {0.15, 2.21, 0.90}, oak, "",
         0.2);
  AddBox(parts, "cupboard_top", "furniture", {-1.29, 1.66, 0.88}, {0.19, 2.215, 0.92},
         {120, 82, 50}, "", 0.2);
  AddBox(parts, "cupboard_door_left", "furniture", {-1.21, 1.69, 0.10}, {-0.57, 1.75, 0.84}, door,
         "", 0.2);
  AddBox(parts, "cupboard_door_right", "furniture", {-0.53, 1.69, 0.10}, {0.11, 1.75, 0.84}, door,
         "", 0.2);
  // Books and a vase on it.
  AddBox(parts, "books_tall", "furniture", {-1.15, 1.80, 0.91}, {-1.02, 2.05, 1.18}, {120, 40, 46},
         "", 0.2);
  AddBox(parts, "books_low", "furniture", {-1.015, 1.80, 0.91}, {-0.86, 2.04, 1.13}, {44, 74, 104},
         "", 0.2);
  const std::vector<Eigen::Vector2d> vase{{0, 0.91},     {0.06, 0.91}, {0.075, 0.93}, {0.10, 1.00},
                                          {0.095, 1.07}, {0.06, 1.14}, {0.045, 1.19}, {0.055, 1.23},
                                          {0.05, 1.245}, {0, 1.245}};
  parts.push_back(
      {"vase", Translated(MakeLathe(vase, 48), -0.20, 1.93, 0), {70, 128, 128}, "", "furniture"});
  // A box and a stool on the floor, a low chest at the right wall.
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T.translation() = Eigen::Vector3d(1.05, 1.35, 0);
  parts.push_back({"box",
                   Transformed(MakeBox({-0.25, -0.2, -0.01}, {0.25, 0.2, 0.36}, 0.2), T),
                   {198, 160, 108},
                   "",
                   "furniture"});
  parts.push_back(
      {"stool",
       Translated(MakeLathe(CylinderProfile(0.20, -0.01, 0.44, 0.03), 64), -1.45, 0.75, 0),
       {72, 112, 96},
       "",
       "furniture"});
  AddBox(parts, "chest", "furniture", {1.90, -0.60, -0.01}, {2.41, 0.70, 0.55}, {128, 96, 110}, "",
         0.2);
}

// In a larger room the furniture keeps its distance from its wall.
void AddFurnitureAlongWalls(std::vector<ModelPart>& parts, const RoomSpec& spec) {
  const double dx = spec.half_x - kRoomHalfX_m;
  const double dy = spec.half_y - kRoomHalfY_m;
  std::vector<ModelPart> furniture;
  AddFurniture(furniture);
  for (ModelPart& part : furniture) {
    const bool right = part.name == "chest" || part.name == "box";
    const double x = right ? dx : part.name == "stool" ? -dx : 0;
    const double y = part.name == "chest" ? 0 : dy;
    if (x != 0 || y != 0) part.shape = Translated(std::move(part.shape), x, y, 0);
    parts.push_back(std::move(part));
  }
}

std::shared_ptr<const TextureImage> PictureOf(const TextureSpec& spec) {
  auto picture = MakeTexture(spec);
  // The caller validated it.
  if (!picture) std::abort();
  return std::make_shared<const TextureImage>(std::move(*picture));
}

void Cover(std::vector<ModelPart>& parts, const char* material,
           const std::optional<TextureSpec>& texture) {
  if (!texture) return;
  const auto picture = PictureOf(*texture);
  for (ModelPart& part : parts) {
    if (part.material != material) continue;
    part.material = picture->material;
    part.picture = picture;
  }
}

}  // namespace

Expected<void> RoomSpec::Validate() const {
  // The longest sight line, which has to stay within the renderer's depth range (kFar_m).
  constexpr double kLongest_m = 9.9;
  if (!(half_x >= kRoomHalfX_m) || !(half_y >= kRoomHalfY_m) || !(height >= kRoomHeight_m)) {
    return UsageError(
        "the room's half sides and height are {}, {} and {} m, expected {}, {} and {} at least",
        half_x, half_y, height, kRoomHalfX_m, kRoomHalfY_m, kRoomHeight_m);
  }
  const double diagonal = std::sqrt(4 * half_x * half_x + 4 * half_y * half_y + height * height);
  if (!(diagonal <= kLongest_m)) {
    return UsageError("the room's diagonal is {:.2f} m, expected {} m at most: depth ends there",
                      diagonal, kLongest_m);
  }
  for (const auto& [field, texture] :
       {std::pair{"table_texture", &table_texture}, std::pair{"floor_texture", &floor_texture},
        std::pair{"wall_texture", &wall_texture}}) {
    if (!*texture) continue;
    if (auto picture = MakeTexture(**texture); !picture) {
      return UsageError("{}: {}", field, picture.error().message);
    }
  }
  return {};
}

double RoomSpec::ground_half_x() const {
  if (table) return kTableHalfX_m;
  return furniture ? kClearHalfX_m + half_x - kRoomHalfX_m : half_x;
}

double RoomSpec::ground_half_y() const {
  if (table) return kTableHalfY_m;
  return furniture ? kClearHalfY_m + half_y - kRoomHalfY_m : half_y;
}

std::vector<ModelPart> MakeRoom(const RoomSpec& spec) {
  std::vector<ModelPart> parts;
  if (spec.table) AddTable(parts);
  AddShell(parts, spec);
  if (spec.furniture) AddFurnitureAlongWalls(parts, spec);
  Cover(parts, kWoodMaterial, spec.table_texture);
  Cover(parts, kTileMaterial, spec.floor_texture);
  Cover(parts, kPlasterMaterial, spec.wall_texture);
  return parts;
}

}  // namespace tsdfpp
