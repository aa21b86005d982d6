#include <cmath>
#include <numbers>

#include "sim/models/profile_shapes.h"
#include "sim/models/toys.h"

namespace tsdfpp {
namespace {

using Profile = std::vector<Eigen::Vector2d>;

constexpr int kVesselSegments = 64;  // of a turned shape
constexpr double kCupHeight_m = 0.105;
constexpr double kProud_m = 0.0003;  // of a painted band

Shape CupShape() { return MakeCup(0.040, 0.052, kCupHeight_m, 0.006, kVesselSegments); }

// A painted band around the cup, from one height to another.
Shape CupBand(double low, double high) {
  const auto radius = [](double z) { return 0.040 + 0.012 * z / kCupHeight_m + kProud_m; };
  // Its inside runs in the middle of the wall.
  const double inside = 0.003;
  return MakeLathe({{0, 0.003},
                    {0.030, 0.003},
                    {radius(low) - inside, low},
                    {radius(low), low},
                    {radius(high), high},
                    {radius(high) - inside, high},
                    {0.030, 0.0045},
                    {0, 0.0045}},
                   kVesselSegments);
}

}  // namespace

std::vector<ModelPart> MakeOpenCup() {
  return {{"cup", CupShape(), {214, 84, 70}, "", ""},
          {"band", CupBand(0.052, 0.076), {244, 234, 214}, "", ""}};
}

std::vector<ModelPart> MakeCover() {
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()).toRotationMatrix();
  T.translation().z() = kCupHeight_m;
  std::vector<ModelPart> parts = MakeOpenCup();
  for (ModelPart& part : parts) part.shape = Transformed(std::move(part.shape), T);
  return parts;
}

std::vector<ModelPart> MakeBowl() {
  Profile profile{{0, 0.003}, {0.024, 0.003}, {0.027, 0}, {0.033, 0}, {0.036, 0.003}};
  // A quarter of an ellipse up the outside, over the rim, and one down the inside.
  constexpr int kSteps = 14;
  const double wall = 0.006;
  const auto side = [&](double radius, double low, double angle) {
    return Eigen::Vector2d(radius * std::cos(angle), 0.066 + (low - 0.066) * std::sin(angle));
  };
  for (int i = 4; i <= kSteps; ++i) {
    profile.push_back(side(0.085, 0, std::numbers::pi / 2 * (1 - static_cast<double>(i) / kSteps)));
  }
  profile.emplace_back(0.085 - wall / 2, 0.066 + wall / 2);
  for (int i = kSteps; i >= 1; --i) {
    profile.push_back(side(0.085 - wall, wall + 0.003,
                           std::numbers::pi / 2 * (1 - static_cast<double>(i) / kSteps)));
  }
  profile.emplace_back(0, wall + 0.003);
  return {{"bowl", MakeLathe(profile, kVesselSegments), {92, 150, 140}, "", ""}};
}

std::vector<ModelPart> MakePlate() {
  const Profile profile{{0, 0.002},       {0.058, 0.002},  {0.061, 0},      {0.066, 0},
                        {0.070, 0.002},   {0.088, 0.0095}, {0.108, 0.0160}, {0.110, 0.0175},
                        {0.1095, 0.0195}, {0.107, 0.0200}, {0.086, 0.0140}, {0.070, 0.0070},
                        {0.064, 0.0060},  {0.030, 0.0060}, {0, 0.0060}};
  // Comes out of the plate on its slope alone.
  const Profile ring{{0, 0.003},       {0.066, 0.003},  {0.089, 0.0110}, {0.0985, 0.0145},
                     {0.0985, 0.0179}, {0.089, 0.0152}, {0.070, 0.0050}, {0, 0.0045}};
  return {{"plate", MakeLathe(profile, kVesselSegments), {236, 236, 230}, "", ""},
          {"ring", MakeLathe(ring, kVesselSegments), {52, 92, 156}, "", ""}};
}

std::vector<ModelPart> MakeTray() {
  return {{"tray", MakeVessel(0.160, 0.110, 0.030, 0.026, 0.006, 0.008), {70, 110, 92}, "", ""}};
}

std::vector<ModelPart> MakeBottle() {
  const Profile body{{0, 0.004},      {0.022, 0.004},  {0.026, 0},     {0.031, 0},
                     {0.035, 0.003},  {0.037, 0.009},  {0.037, 0.060}, {0.037, 0.110},
                     {0.035, 0.124},  {0.029, 0.138},  {0.021, 0.152}, {0.016, 0.164},
                     {0.0145, 0.176}, {0.0145, 0.190}, {0, 0.190}};
  return {
      {"body", MakeLathe(body, kVesselSegments), {46, 118, 84}, "", ""},
      {"label",
       MakeLathe(CylinderProfile(0.037 + kProud_m, 0.030, 0.096, 0.0005), kVesselSegments),
       {240, 226, 180},
       "",
       ""},
      {"cap", MakeLathe(CylinderProfile(0.017, 0.180, 0.206, 0.002), 48), {180, 52, 48}, "", ""}};
}

std::vector<ModelPart> MakeTorus() {
  constexpr int kAround = 72;
  std::vector<Eigen::Vector3d> path;
  for (int i = 0; i < kAround; ++i) {
    const double angle = 2 * std::numbers::pi * i / kAround;
    path.emplace_back(0.060 * std::cos(angle), 0.060 * std::sin(angle), 0.022);
  }
  return {{"torus", MakeRing(path, 0.022, 32), {228, 118, 160}, "", ""}};
}

// A trefoil.
std::vector<ModelPart> MakeKnot() {
  constexpr int kAlong = 160;
  std::vector<Eigen::Vector3d> path;
  for (int i = 0; i < kAlong; ++i) {
    const double t = 2 * std::numbers::pi * i / kAlong;
    path.emplace_back(0.030 * (std::sin(t) + 2 * std::sin(2 * t)),
                      0.030 * (std::cos(t) - 2 * std::cos(2 * t)), 0.034 * std::sin(3 * t));
  }
  return {{"knot", Translated(MakeRing(path, 0.0145, 24), 0, 0, 0.0485), {98, 92, 190}, "", ""}};
}

}  // namespace tsdfpp
