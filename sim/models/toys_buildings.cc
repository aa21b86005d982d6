#include <cmath>
#include <cstdlib>
#include <numbers>
#include <utility>

#include "sim/models/profile_shapes.h"
#include "sim/models/toys.h"

namespace tsdfpp {
namespace {

// A prism's profile lies in x-z; turned, it lies in y-z and the prism runs along x.
Shape AlongX(Shape shape) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return Transformed(std::move(shape), T);
}

// The profile lies flat in x-y, and the prism rises along z.
Shape Flat(Shape shape) {
  Pose T = Pose::Identity();
  T.linear() =
      Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return Transformed(std::move(shape), T);
}

ModelPart Pictured(const char* name, Shape shape, const TextureSpec& spec) {
  auto image = MakeTexture(spec);
  if (!image) std::abort();  // the specs below are right
  ModelPart part{name, std::move(shape), image->mean, image->material, ""};
  part.picture = std::make_shared<const TextureImage>(std::move(*image));
  return part;
}

}  // namespace

// Open towards +x and without a floor, so that a car of the table's drives in.
std::vector<ModelPart> MakeGarage() {
  const double bevel = 0.003;
  // Two walls and a ceiling in one piece.
  const Shape walls = AlongX(MakePrism({{-0.130, 0},
                                        {-0.102, 0},
                                        {-0.102, 0.150},
                                        {0.102, 0.150},
                                        {0.102, 0},
                                        {0.130, 0},
                                        {0.130, 0.178},
                                        {-0.130, 0.178}},
                                       0.170, bevel));
  const Shape back = Translated(
      AlongX(MakePrism({{-0.116, 0}, {0.116, 0}, {0.116, 0.165}, {-0.116, 0.165}}, 0.014, bevel)),
      -0.155, 0, 0);
  const Shape roof = Translated(MakeSlab(0.182, 0.142, 0.010, 0.172, 0.200, 0.004), 0, 0, 0);
  const Shape sign = Translated(
      AlongX(MakePrism(RoundedRectangle({-0.060, 0.156}, {0.060, 0.194}, 0.006), 0.014, bevel)),
      0.172, 0, 0);
  std::vector<ModelPart> parts;
  parts.push_back(
      Pictured("walls", walls, {"bricks", 3, {178, 92, 72}, {206, 198, 186}, 0.12, 256}));
  parts.push_back({"back", back, {150, 84, 70}, "", ""});
  parts.push_back({"roof", roof, {84, 92, 104}, "", ""});
  parts.push_back({"sign", sign, {236, 204, 76}, "", ""});
  return parts;
}

std::vector<ModelPart> MakeCrate() {
  const TextureSpec wood{"planks", 11, {206, 164, 108}, {128, 88, 52}, 0.10, 256};
  std::vector<ModelPart> parts;
  parts.push_back(Pictured("crate", MakeVessel(0.190, 0.130, 0.026, 0.120, 0.012, 0.0), wood));
  return parts;
}

std::vector<ModelPart> MakeArch() {
  std::vector<Eigen::Vector2d> profile{{-0.100, 0}, {-0.060, 0}};
  constexpr int kSteps = 24;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = std::numbers::pi * (1 - static_cast<double>(i) / kSteps);
    profile.emplace_back(0.060 * std::cos(angle), 0.030 + 0.060 * std::sin(angle));
  }
  profile.insert(profile.end(), {{0.060, 0}, {0.100, 0}, {0.100, 0.130}, {-0.100, 0.130}});
  return {{"arch", MakePrism(profile, 0.030, 0.003), {226, 168, 62}, "", ""}};
}

// Lies closed; the spine is at -x.
std::vector<ModelPart> MakeBook() {
  const double board = 0.003;
  const double high = 0.032;
  const Shape cover = MakePrism({{-0.060, 0},
                                 {0.060, 0},
                                 {0.060, board},
                                 {-0.057, board},
                                 {-0.057, high - board},
                                 {0.060, high - board},
                                 {0.060, high},
                                 {-0.060, high}},
                                0.085, 0.0006);
  const Shape pages =
      Translated(MakeSlab(0.0565, 0.0815, 0.002, 0.0015, high - 0.0015, 0.0005), -0.0015, 0, 0);
  const Shape title =
      Translated(MakeSlab(0.034, 0.046, 0.004, high - 0.0016, high + 0.0003, 0.0003), 0, 0, 0);
  return {{"cover", cover, {132, 42, 58}, "", ""},
          {"pages", pages, {240, 234, 216}, "", ""},
          {"title", title, {226, 190, 104}, "", ""}};
}

std::vector<ModelPart> MakeCard() {
  std::vector<ModelPart> parts;
  const double thickness = 0.002;
  parts.push_back(
      {"card",
       Translated(Flat(MakePrism(RoundedRectangle({-0.044, -0.0315}, {0.044, 0.0315}, 0.005),
                                 thickness / 2, 0.0003)),
                  0, 0, thickness / 2),
       {244, 242, 236},
       "",
       ""});
  // A printed field, proud on both sides.
  parts.push_back(Pictured(
      "print",
      Translated(Flat(MakePrism(RoundedRectangle({-0.038, -0.0255}, {0.038, 0.0255}, 0.003),
                                thickness / 2 + 0.0001, 0)),
                 0, 0, thickness / 2),
      {"checker", 5, {40, 72, 150}, {226, 232, 244}, 0.025, 128}));
  return parts;
}

}  // namespace tsdfpp
