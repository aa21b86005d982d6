#include "sim/models/model_catalogue.h"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <utility>

#include "sim/models/mesh_import.h"
#include "sim/models/toys.h"

namespace tsdfpp {
namespace {

// What a scene paints of the toys, whose first part is not always it.
struct PaintedPart {
  std::string_view model;
  std::string_view part;
};
constexpr std::array<PaintedPart, 3> kPainted{
    {{"truck", "cabin"}, {"ball", "ball"}, {"car", "body"}}};

// With MakeToy for those that have no generator here.
struct Generator {
  std::string_view name;
  std::vector<ModelPart> (*make)();
};
constexpr std::array<Generator, 16> kGenerators{{{"cup", MakeOpenCup},
                                                 {"cover", MakeCover},
                                                 {"bowl", MakeBowl},
                                                 {"plate", MakePlate},
                                                 {"tray", MakeTray},
                                                 {"bottle", MakeBottle},
                                                 {"torus", MakeTorus},
                                                 {"knot", MakeKnot},
                                                 {"garage", MakeGarage},
                                                 {"crate", MakeCrate},
                                                 {"arch", MakeArch},
                                                 {"book", MakeBook},
                                                 {"card", MakeCard},
                                                 {"duck", MakeDuck},
                                                 {"rocking_horse", MakeRockingHorse},
                                                 {"ship", MakeShip}}};

std::vector<ModelPart> Generate(const ModelSpec& spec, const ModelInfo& info) {
  std::vector<ModelPart> parts;
  if (info.solid) {
    parts = MakeSolid(spec.name, spec.size_m.value_or(info.size_m));
  } else {
    const auto* generator = std::find_if(kGenerators.begin(), kGenerators.end(),
                                         [&](const Generator& g) { return g.name == spec.name; });
    if (generator == kGenerators.end()) return MakeToy(spec.name);  // has its clearance
    parts = generator->make();
  }
  const double lift = kToyClearance_m - BoundsOf(parts).min().z();
  for (ModelPart& part : parts) part.shape = Translated(std::move(part.shape), 0, 0, lift);
  return parts;
}

// Lengths grow; the clearance under the model stays.
void Scale(std::vector<ModelPart>& parts, double scale) {
  if (scale == 1) return;
  for (ModelPart& part : parts) {
    for (Eigen::Vector3d& vertex : part.shape.vertices) {
      vertex.z() -= kToyClearance_m;
      vertex *= scale;
      vertex.z() += kToyClearance_m;
    }
  }
}

// The turn that brings the file's axis `up` to +z; 'z' is none.
Eigen::Matrix3d TurnUp(std::string_view up) {
  const bool down = up.starts_with('-');
  const int axis = up.back() - 'x';
  const Eigen::Vector3d from = (down ? -1 : 1) * Eigen::Vector3d::Unit(axis);
  return Eigen::Quaterniond::FromTwoVectors(from, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

Expected<std::vector<ModelPart>> Import(const ModelSpec& spec) {
  TSDFPP_ASSIGN(ImportedMesh mesh, ImportMesh(spec.file, spec.scale, spec.picture));
  for (const std::string& remark : mesh.report.remarks) spdlog::warn("{}", remark);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = TurnUp(spec.up);
  for (ModelPart& part : mesh.parts) part.shape = Transformed(std::move(part.shape), T);
  const Eigen::AlignedBox3d box = BoundsOf(mesh.parts);
  const Eigen::Vector3d middle = box.center();
  for (ModelPart& part : mesh.parts) {
    part.shape = Translated(std::move(part.shape), -middle.x(), -middle.y(),
                            kToyClearance_m - box.min().z());
  }
  return std::move(mesh.parts);
}

// The main part, and those that had its colour.
Expected<void> Paint(std::vector<ModelPart>& parts, const ModelSpec& spec) {
  if (!spec.paint && spec.material.empty()) return {};
  const auto* painted = std::find_if(kPainted.begin(), kPainted.end(),
                                     [&](const PaintedPart& p) { return p.model == spec.name; });
  const auto main = painted == kPainted.end()
                        ? parts.begin()
                        : std::find_if(parts.begin(), parts.end(),
                                       [&](const ModelPart& p) { return p.name == painted->part; });
  const Colour before = main->colour;
  const Colour paint = spec.paint.value_or(before);
  std::shared_ptr<const TextureImage> picture;
  if (!spec.material.empty()) {
    TextureSpec texture;
    texture.pattern = spec.material;
    texture.seed = spec.seed;
    texture.first = paint;
    // Lines and veins in a darker shade of the paint, or a lighter one where it is dark.
    const int sum = paint[0] + paint[1] + paint[2];
    for (std::size_t k = 0; k < 3; ++k) {
      texture.second[k] =
          static_cast<std::uint8_t>(sum > 300 ? 0.45 * paint[k] : 110 + 0.55 * paint[k]);
    }
    texture.size_m = 0.08;
    TSDFPP_ASSIGN(TextureImage image, MakeTexture(texture));
    picture = std::make_shared<const TextureImage>(std::move(image));
  }
  for (ModelPart& part : parts) {
    if (part.colour != before) continue;
    part.colour = picture ? picture->mean : paint;
    part.picture = picture;
    part.material = picture ? picture->material : "";
    part.corner_uv.clear();
  }
  return {};
}

}  // namespace

const std::vector<ModelInfo>& ModelCatalogue() {
  static const std::vector<ModelInfo> catalogue{
      {"truck", "a lorry of closed parts", {0.325, 0.156, 0.170}},
      {"car", "a small car", {0.271, 0.146, 0.120}},
      {"mug", "a thick mug with a handle", {0.156, 0.120, 0.121}, false, false, true},
      {"ball", "a ball on a wooden foot", {0.118, 0.118, 0.150}},
      {"house", "a house with a chimney", {0.150, 0.172, 0.165}},
      {"blocks", "three blocks stacked askew", {0.100, 0.100, 0.223}},
      {"cube", "a cube", {0.060, 0.060, 0.060}, false, true},
      {"brick", "a brick", {0.120, 0.060, 0.040}, false, true},
      {"domino", "a domino on its end", {0.012, 0.030, 0.060}, true, true},
      {"plank", "a plank", {0.200, 0.060, 0.012}, true, true},
      {"cylinder", "a cylinder", {0.070, 0.070, 0.100}, false, true},
      {"sphere", "a ball", {0.070, 0.070, 0.070}, false, true},
      {"cone", "a cone", {0.090, 0.090, 0.120}, false, true},
      {"capsule", "a standing capsule", {0.060, 0.060, 0.120}, false, true},
      {"pyramid", "a pyramid", {0.110, 0.110, 0.100}, false, true},
      {"wedge", "a ramp that rises forwards", {0.140, 0.080, 0.060}, false, true},
      {"hexagon", "a hexagonal column", {0.080, 0.0693, 0.100}, false, true},
      {"cup", "an open cup with thin walls", {0.104, 0.104, 0.105}, true, false, true},
      {"cover", "the cup upside down", {0.104, 0.104, 0.105}, true, false, true},
      {"bowl", "a bowl with thin walls", {0.170, 0.170, 0.069}, true, false, true},
      {"plate", "a thin plate", {0.220, 0.220, 0.020}, true, false, true},
      {"tray", "a flat tray", {0.320, 0.220, 0.026}, true, false, true},
      {"bottle", "a bottle", {0.0746, 0.0746, 0.206}},
      {"torus", "a ring lying flat", {0.164, 0.164, 0.044}, false, false, true},
      {"knot", "a trefoil knot", {0.193, 0.181, 0.097}, false, false, true},
      {"garage", "a garage open at the front", {0.370, 0.284, 0.200}, false, false, true},
      {"crate", "a wooden box open above", {0.380, 0.260, 0.120}, true, false, true},
      {"arch", "an arch to drive through", {0.200, 0.060, 0.130}, false, false, true},
      {"book", "a closed book, lying", {0.120, 0.170, 0.0323}, true},
      {"card", "a playing card, 2 mm thick", {0.088, 0.063, 0.0021}, true},
      {"duck", "a duck of smooth blends", {0.188, 0.120, 0.144}, false, false, true},
      {"rocking_horse", "a rocking horse", {0.340, 0.122, 0.300}, false, false, true},
      {"ship", "a ship with two funnels", {0.372, 0.126, 0.196}, false, false, true}};
  return catalogue;
}

const ModelInfo* FindModel(std::string_view name) {
  const std::vector<ModelInfo>& catalogue = ModelCatalogue();
  const auto found = std::find_if(catalogue.begin(), catalogue.end(),
                                  [&](const ModelInfo& info) { return info.name == name; });
  return found == catalogue.end() ? nullptr : &*found;
}

Expected<void> CheckModelSpec(const ModelSpec& spec) {
  const ModelInfo* info = FindModel(spec.name);
  const bool is_mesh = spec.name == kMeshModel;
  if (info == nullptr && !is_mesh) {
    std::vector<std::string_view> names;
    for (const ModelInfo& known : ModelCatalogue()) names.push_back(known.name);
    return UsageError("there is no model '{}', expected one of {} or {} (with its file)", spec.name,
                      fmt::join(names, ", "), kMeshModel);
  }
  if (!(spec.scale >= kLeastModelScale && spec.scale <= kMostModelScale)) {
    return UsageError("scale of model '{}' is {}, expected {} to {}", spec.name, spec.scale,
                      kLeastModelScale, kMostModelScale);
  }
  if (is_mesh && spec.file.empty()) return UsageError("model 'mesh' names no file");
  if (!is_mesh && !spec.file.empty()) {
    return UsageError("model '{}' has a file, {}, which only 'mesh' reads", spec.name,
                      spec.file.string());
  }
  if (!is_mesh && !spec.picture.empty()) {
    return UsageError("model '{}' has a picture, which only 'mesh' has", spec.name);
  }
  if (!is_mesh && spec.up != "z")
    return UsageError("model '{}' has up, which only 'mesh' has", spec.name);
  const std::string_view axis = std::string_view(spec.up).substr(spec.up.starts_with('-') ? 1 : 0);
  if (axis != "x" && axis != "y" && axis != "z") {
    return UsageError("up of model 'mesh' is '{}', expected x, y, z, -x, -y or -z", spec.up);
  }
  if (spec.size_m) {
    if (info == nullptr || !info->solid) {
      return UsageError("model '{}' has a size, which only solids have ({}): use scale", spec.name,
                        fmt::join(SolidNames(), ", "));
    }
    for (const double side : *spec.size_m) {
      if (!(side >= kLeastExtent_m && side <= kMostExtent_m)) {
        return UsageError("size of model '{}' has {} m, expected {} to {}", spec.name, side,
                          kLeastExtent_m, kMostExtent_m);
      }
    }
  }
  const std::vector<std::string>& patterns = TexturePatternNames();
  if (!spec.material.empty() &&
      std::find(patterns.begin(), patterns.end(), spec.material) == patterns.end()) {
    return UsageError("material of model '{}' is '{}', expected one of {}", spec.name,
                      spec.material, fmt::join(patterns, ", "));
  }
  if (info != nullptr) {
    const double longest = spec.scale * spec.size_m.value_or(info->size_m).maxCoeff();
    if (!(longest >= kLeastExtent_m && longest <= kMostExtent_m)) {
      return UsageError("model '{}' is {:.3g} m long at scale {:.3g}, expected {} to {} m",
                        spec.name, longest, spec.scale, kLeastExtent_m, kMostExtent_m);
    }
  }
  return {};
}

Expected<std::vector<ModelPart>> MakeModel(const ModelSpec& spec) {
  TSDFPP_RETURN_IF_ERROR(CheckModelSpec(spec));
  std::vector<ModelPart> parts;
  if (spec.name == kMeshModel) {
    TSDFPP_ASSIGN(parts, Import(spec));
  } else {
    parts = Generate(spec, *FindModel(spec.name));
    Scale(parts, spec.scale);
  }
  for (ModelPart& part : parts) part.region = spec.name;
  TSDFPP_RETURN_IF_ERROR(Paint(parts, spec));
  return parts;
}

Eigen::AlignedBox3d BoundsOf(const std::vector<ModelPart>& parts) {
  Eigen::AlignedBox3d box;
  for (const ModelPart& part : parts) {
    for (const Eigen::Vector3d& vertex : part.shape.vertices) box.extend(vertex);
  }
  return box;
}

}  // namespace tsdfpp
