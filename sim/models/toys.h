// The generators behind model_catalogue.h, one a model. Parts stand on z = 0, +x is front; the
// first part is the main one, which a scene may paint.
#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

#include "sim/models/toy_models.h"

namespace tsdfpp {

// toys_solids.cc: one part of any extents, all positive. `kind` is one of SolidNames().
const std::vector<std::string_view>& SolidNames();
std::vector<ModelPart> MakeSolid(std::string_view kind, const Eigen::Vector3d& size_m);

// toys_vessels.cc: bodies of revolution and trays.
std::vector<ModelPart> MakeOpenCup();
std::vector<ModelPart> MakeCover();  // the cup upside down
std::vector<ModelPart> MakeBowl();
std::vector<ModelPart> MakePlate();
std::vector<ModelPart> MakeTray();
std::vector<ModelPart> MakeBottle();
std::vector<ModelPart> MakeTorus();
std::vector<ModelPart> MakeKnot();

// toys_buildings.cc: things of boards.
std::vector<ModelPart> MakeGarage();
std::vector<ModelPart> MakeCrate();
std::vector<ModelPart> MakeArch();
std::vector<ModelPart> MakeBook();
std::vector<ModelPart> MakeCard();

// toys_figures.cc
std::vector<ModelPart> MakeDuck();
std::vector<ModelPart> MakeRockingHorse();
std::vector<ModelPart> MakeShip();

}  // namespace tsdfpp
