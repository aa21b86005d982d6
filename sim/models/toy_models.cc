#include "sim/models/toy_models.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <utility>

namespace tsdfpp {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

constexpr double kWheelRadius_m = 0.032;
constexpr double kWheelHalfWidth_m = 0.015;
constexpr int kSegments = 48;  // of a turned shape

constexpr Colour kRubber{38, 38, 42};
constexpr Colour kGlass{70, 110, 140};
constexpr Colour kMetal{176, 180, 186};

Pose Turned(double yaw_deg, double x, double y, double z) {
  Pose T = Pose::Identity();
  T.linear() =
      Eigen::AngleAxisd(yaw_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()).matrix();
  T.translation() = Eigen::Vector3d(x, y, z);
  return T;
}

// A wheel whose axle lies along y, and its hub cap, which stands out on the far side from the
// middle.
void AddWheel(std::vector<ModelPart>& parts, const std::string& name, double x, double y,
              const Colour& cap) {
  Pose T = Pose::Identity();
  // The z axis of the turned shape points away from the car's middle.
  T.linear() = Eigen::AngleAxisd(y > 0 ? -std::numbers::pi / 2 : std::numbers::pi / 2,
                                 Eigen::Vector3d::UnitX())
                   .toRotationMatrix();
  T.translation() = Eigen::Vector3d(x, y, kWheelRadius_m);
  parts.push_back({"wheel_" + name,
                   Transformed(MakeLathe(CylinderProfile(kWheelRadius_m, -kWheelHalfWidth_m,
                                                         kWheelHalfWidth_m, 0.005),
                                         kSegments),
                               T),
                   kRubber, "", ""});
  parts.push_back(
      {"cap_" + name,
       Transformed(
           MakeLathe(CylinderProfile(0.017, -0.008, kWheelHalfWidth_m + 0.003, 0.003), kSegments),
           T),
       cap, "", ""});
}

void AddWheels(std::vector<ModelPart>& parts, double front_x, double rear_x, double y,
               const Colour& cap) {
  AddWheel(parts, "front_left", front_x, y, cap);
  AddWheel(parts, "front_right", front_x, -y, cap);
  AddWheel(parts, "rear_left", rear_x, y, cap);
  AddWheel(parts, "rear_right", rear_x, -y, cap);
}

Shape Lamp(double x, double y, double z, double radius) {
  return Translated(MakeLathe(BallProfile(radius, 0), 24), x, y, z);
}

// 32 x 15 x 17 cm.
std::vector<ModelPart> Truck() {
  const Colour red{196, 44, 38};
  const Colour yellow{236, 186, 52};
  std::vector<ModelPart> parts;
  parts.push_back(
      {"chassis",
       MakeExtrusion(RoundedRectangle({-0.152, 0.022}, {0.156, 0.055}, 0.010), 0.047, 0.006),
       {70, 72, 80},
       "",
       ""});
  parts.push_back(
      {"bumper",
       MakeExtrusion(RoundedRectangle({0.128, 0.016}, {0.160, 0.046}, 0.008), 0.066, 0.008), kMetal,
       "", ""});
  parts.push_back(
      {"cargo",
       MakeExtrusion(RoundedRectangle({-0.160, 0.050}, {0.048, 0.170}, 0.016), 0.075, 0.014),
       yellow, "", ""});
  parts.push_back(
      {"stripe",
       // Proud by 0.3 mm alone: a wider ledge would be surface that no 1 cm voxel can hold.
       MakeExtrusion(RoundedRectangle({-0.1603, 0.088}, {0.0483, 0.116}, 0.004), 0.0753, 0.004),
       {36, 96, 150},
       "",
       ""});
  parts.push_back(
      {"cabin",
       // Joined to the cargo: a slot of less than a voxel between them could not be mapped.
       MakeExtrusion(Polygon{{0.046, 0.050},
                             {0.150, 0.050},
                             {0.157, 0.058},
                             {0.156, 0.088},
                             {0.148, 0.097},
                             {0.126, 0.140},
                             {0.118, 0.146},
                             {0.054, 0.146},
                             {0.046, 0.138}},
                     0.070, 0.012),
       red, "", ""});
  parts.push_back(
      {"windscreen",
       MakeExtrusion(Polygon{{0.100, 0.098}, {0.1492, 0.0985}, {0.1302, 0.1355}, {0.100, 0.136}},
                     0.056, 0.003),
       kGlass, "", ""});
  parts.push_back(
      {"side_windows",
       MakeExtrusion(RoundedRectangle({0.072, 0.096}, {0.112, 0.132}, 0.007), 0.0715, 0.001),
       kGlass, "", ""});
  parts.push_back({"lamp_left", Lamp(0.150, 0.046, 0.070, 0.013), {250, 244, 214}, "", ""});
  parts.push_back({"lamp_right", Lamp(0.150, -0.046, 0.070, 0.013), {250, 244, 214}, "", ""});
  AddWheels(parts, 0.100, -0.095, 0.060, kMetal);
  return parts;
}

// 27 x 14 x 12 cm.
std::vector<ModelPart> Car() {
  const Colour green{34, 132, 84};
  std::vector<ModelPart> parts;
  parts.push_back({"body",
                   MakeExtrusion(Polygon{{-0.124, 0.022},
                                         {0.126, 0.022},
                                         {0.134, 0.032},
                                         {0.135, 0.046},
                                         {0.130, 0.058},
                                         {0.112, 0.066},
                                         {0.050, 0.074},
                                         {-0.116, 0.076},
                                         {-0.130, 0.070},
                                         {-0.135, 0.056},
                                         {-0.134, 0.032}},
                                 0.066, 0.014),
                   green, "", ""});
  parts.push_back({"cabin",
                   MakeExtrusion(Polygon{{-0.104, 0.060},
                                         {0.064, 0.060},
                                         {0.060, 0.072},
                                         {0.026, 0.110},
                                         {0.014, 0.118},
                                         {-0.056, 0.120},
                                         {-0.072, 0.113},
                                         {-0.100, 0.076}},
                                 0.057, 0.012),
                   {232, 232, 224},
                   "",
                   ""});
  parts.push_back(
      {"windscreen",
       MakeExtrusion(Polygon{{-0.020, 0.076}, {0.0605, 0.0765}, {0.0335, 0.1065}, {-0.020, 0.107}},
                     0.046, 0.003),
       kGlass, "", ""});
  parts.push_back(
      {"rear_window",
       MakeExtrusion(
           Polygon{{-0.1003, 0.0785}, {-0.050, 0.078}, {-0.050, 0.108}, {-0.0788, 0.1075}}, 0.044,
           0.003),
       kGlass, "", ""});
  parts.push_back(
      {"side_windows",
       MakeExtrusion(Polygon{{-0.078, 0.079}, {0.034, 0.079}, {0.012, 0.104}, {-0.058, 0.106}},
                     0.0585, 0.001),
       kGlass, "", ""});
  parts.push_back({"lamp_left", Lamp(0.122, 0.042, 0.050, 0.014), {250, 244, 214}, "", ""});
  parts.push_back({"lamp_right", Lamp(0.122, -0.042, 0.050, 0.014), {250, 244, 214}, "", ""});
  AddWheels(parts, 0.078, -0.080, 0.055, {220, 200, 120});
  return parts;
}

std::vector<ModelPart> Mug() {
  // Up the outside, over the rim, down the inside.
  const Polygon profile{{0, 0},         {0.050, 0},     {0.056, 0.003}, {0.059, 0.010},
                        {0.060, 0.060}, {0.060, 0.112}, {0.058, 0.118}, {0.053, 0.121},
                        {0.041, 0.121}, {0.036, 0.118}, {0.034, 0.112}, {0.034, 0.045},
                        {0.031, 0.037}, {0.024, 0.034}, {0, 0.034}};
  return {
      {"bowl", MakeLathe(profile, 64), {52, 104, 176}, "", ""},
      {"handle", Translated(MakeHandle(0.032, 0.013), 0.051, 0, 0.062), {240, 238, 230}, "", ""}};
}

std::vector<ModelPart> Ball() {
  const Polygon foot{{0, 0},         {0.050, 0},     {0.054, 0.003}, {0.055, 0.010}, {0.053, 0.020},
                     {0.044, 0.028}, {0.036, 0.036}, {0.034, 0.046}, {0, 0.046}};
  return {{"foot", MakeLathe(foot, kSegments), {120, 82, 52}, "", ""},
          {"ball", MakeLathe(BallProfile(0.058, 0.092), 64), {226, 118, 40}, "", ""},
          {"band",
           MakeLathe(CylinderProfile(0.0592, 0.079, 0.105, 0.004), 64),
           {250, 240, 226},
           "",
           ""}};
}

std::vector<ModelPart> House() {
  std::vector<ModelPart> parts;
  parts.push_back(
      {"walls",
       MakeExtrusion(RoundedRectangle({-0.060, 0}, {0.060, 0.090}, 0.004), 0.075, 0.004),
       {236, 222, 190},
       "",
       ""});
  parts.push_back({"roof",
                   MakeExtrusion(Polygon{{-0.074, 0.086},
                                         {0.074, 0.086},
                                         {0.075, 0.090},
                                         {0.004, 0.148},
                                         {-0.004, 0.148},
                                         {-0.075, 0.090}},
                                 0.086, 0.003),
                   {170, 62, 48},
                   "",
                   ""});
  parts.push_back(
      {"chimney",
       Translated(
           MakeExtrusion(RoundedRectangle({-0.014, 0.100}, {0.014, 0.165}, 0.003), 0.014, 0.003),
           -0.036, 0.040, 0),
       {120, 70, 60},
       "",
       ""});
  parts.push_back(
      {"door",
       MakeExtrusion(RoundedRectangle({0.030, 0.001}, {0.0625, 0.060}, 0.002), 0.017, 0.002),
       {60, 90, 120},
       "",
       ""});
  for (const double y : {-0.045, 0.045}) {
    parts.push_back(
        {y < 0 ? "window_right" : "window_left",
         Translated(MakeExtrusion(RoundedRectangle({-0.0622, 0.036}, {0.0622, 0.066}, 0.003), 0.015,
                                  0.002),
                    0, y, 0),
         kGlass, "", ""});
  }
  return parts;
}

std::vector<ModelPart> Blocks() {
  const auto block = [](double half, double low, double yaw_deg, double x, double y) {
    return Transformed(
        MakeExtrusion(RoundedRectangle({-half, 0.0}, {half, 2 * half}, 0.006), half, 0.006),
        Turned(yaw_deg, x, y, low));
  };
  return {{"lower", block(0.050, 0, 0, 0, 0), {184, 52, 92}, "", ""},
          {"middle", block(0.036, 0.0995, 24, 0.006, -0.004), {64, 148, 172}, "", ""},
          {"upper", block(0.026, 0.171, -15, 0.002, 0.004), {244, 200, 66}, "", ""}};
}

struct Toy {
  std::string name;
  std::function<std::vector<ModelPart>()> make;
};

const std::vector<Toy>& Toys() {
  static const std::vector<Toy> toys{{"truck", Truck}, {"car", Car},     {"mug", Mug},
                                     {"ball", Ball},   {"house", House}, {"blocks", Blocks}};
  return toys;
}

}  // namespace

const std::vector<std::string>& ToyModelNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Toy& toy : Toys()) all.push_back(toy.name);
    return all;
  }();
  return names;
}

std::vector<ModelPart> MakeToy(std::string_view name) {
  for (const Toy& toy : Toys()) {
    if (toy.name != name) continue;
    std::vector<ModelPart> parts = toy.make();
    for (ModelPart& part : parts) {
      part.region = toy.name;
      for (Eigen::Vector3d& vertex : part.shape.vertices) vertex.z() += kToyClearance_m;
    }
    return parts;
  }
  // A scene's names were validated by ParseSceneConfig.
  fmt::print(stderr, "MakeToy: there is no toy '{}'\n", name);
  std::abort();
}

}  // namespace tsdfpp
