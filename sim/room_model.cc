#include "sim/room_model.h"

#include "sim/textures.h"

namespace tsdfpp {
namespace {

constexpr double kWallThickness_m = 0.1;
// Cells of the meshes; the renderer lights vertices (mesh_shapes.h).
constexpr double kTableCell_m = 0.1;
constexpr double kRoomCell_m = 0.4;

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

void AddShell(std::vector<ModelPart>& parts) {
  const double t = kWallThickness_m;
  const Colour wall{214, 206, 190};
  // Walls stand on the inside edge of the floor slab and overlap at the corners.
  AddBox(parts, "floor", "floor", {-kRoomHalfX_m - t, -kRoomHalfY_m - t, -t},
         {kRoomHalfX_m + t, kRoomHalfY_m + t, 0}, {150, 150, 150}, kTileMaterial, kRoomCell_m);
  AddBox(parts, "ceiling", "wall", {-kRoomHalfX_m - t, -kRoomHalfY_m - t, kRoomHeight_m},
         {kRoomHalfX_m + t, kRoomHalfY_m + t, kRoomHeight_m + t}, {240, 238, 232}, "", kRoomCell_m);
  AddBox(parts, "wall_back", "wall", {-kRoomHalfX_m - t, kRoomHalfY_m, -t / 2},
         {kRoomHalfX_m + t, kRoomHalfY_m + t, kRoomHeight_m + t / 2}, wall, kPlasterMaterial,
         kRoomCell_m);
  AddBox(parts, "wall_front", "wall", {-kRoomHalfX_m - t, -kRoomHalfY_m - t, -t / 2},
         {kRoomHalfX_m + t, -kRoomHalfY_m, kRoomHeight_m + t / 2}, wall, kPlasterMaterial,
         kRoomCell_m);
  AddBox(parts, "wall_left", "wall", {-kRoomHalfX_m - t, -kRoomHalfY_m - t / 2, -t / 2},
         {-kRoomHalfX_m, kRoomHalfY_m + t / 2, kRoomHeight_m + t / 2}, wall, kPlasterMaterial,
         kRoomCell_m);
  AddBox(parts, "wall_right", "wall", {kRoomHalfX_m, -kRoomHalfY_m - t / 2, -t / 2},
         {kRoomHalfX_m + t, kRoomHalfY_m + t / 2, kRoomHeight_m + t / 2}, wall, kPlasterMaterial,
         kRoomCell_m);
}

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

}  // namespace

std::vector<ModelPart> MakeRoom() {
  std::vector<ModelPart> parts;
  AddTable(parts);
  AddShell(parts);
  AddFurniture(parts);
  return parts;
}

}  // namespace tsdfpp
