#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "sim/models/blob_shapes.h"
#include "sim/models/profile_shapes.h"
#include "sim/models/toys.h"

namespace tsdfpp {
namespace {

using V = Eigen::Vector3d;

constexpr Colour kDark{34, 34, 38};

Shape Ball(const V& centre, double radius, int segments) {
  return Translated(MakeLathe(BallProfile(radius, 0), segments), centre.x(), centre.y(),
                    centre.z());
}

Eigen::AlignedBox3d Box(const V& low, const V& high) { return {low, high}; }

}  // namespace

std::vector<ModelPart> MakeDuck() {
  constexpr double kCell_m = 0.006;
  // A belly with a tail that points up, cut flat below.
  const BlobField trunk = Joined({Ellipsoid({-0.004, 0, 0.042}, {0.066, 0.050, 0.044}),
                                  Limb({-0.050, 0, 0.058}, {-0.078, 0, 0.086}, 0.020, 0.008)},
                                 0.030);
  const BlobField neck = Limb({0.034, 0, 0.064}, {0.040, 0, 0.090}, 0.026, 0.024);
  const BlobField head = Ellipsoid({0.044, 0, 0.116}, {0.034, 0.032, 0.032});
  const BlobField body =
      Common(Joined({trunk, neck, head}, 0.020), Below({0, 0, 0.004}, {0, 0, -1}), 0.008);
  std::vector<ModelPart> parts;
  const Colour yellow{246, 200, 48};
  parts.push_back({"body",
                   MakeBlob(body, Box({-0.095, -0.055, -0.005}, {0.085, 0.055, 0.155}), kCell_m),
                   yellow, "", ""});
  const BlobField bill = Joined({Ellipsoid({0.080, 0, 0.112}, {0.022, 0.019, 0.0075}),
                                 Ellipsoid({0.076, 0, 0.104}, {0.017, 0.014, 0.0065})},
                                0.004);
  parts.push_back({"bill",
                   MakeBlob(bill, Box({0.05, -0.022, 0.09}, {0.105, 0.022, 0.125}), 0.003),
                   {232, 112, 36},
                   "",
                   ""});
  for (const int side : {-1, 1}) {
    const std::string which = side < 0 ? "right" : "left";
    const BlobField wing =
        Joined({Ellipsoid({-0.006, side * 0.045, 0.056}, {0.036, 0.013, 0.021}),
                Limb({-0.026, side * 0.046, 0.062}, {-0.052, side * 0.048, 0.074}, 0.011, 0.006)},
               0.014);
    parts.push_back(
        {"wing_" + which,
         MakeBlob(wing,
                  Box({-0.065, side * 0.045 - 0.02, 0.025}, {0.04, side * 0.045 + 0.02, 0.09}),
                  kCell_m),
         {238, 184, 36},
         "",
         ""});
    parts.push_back(
        {"eye_" + which, Ball({0.0645, side * 0.0225, 0.124}, 0.0055, 16), kDark, "", ""});
  }
  return parts;
}

namespace {

// Of the rocking horse, whose hooves stand on the rockers.
V OnRockers(double x, double y, double z) {
  constexpr double kLift_m = 0.046;
  return {x, y, z + kLift_m};
}

BlobField HorseBarrel() {
  return Joined({Limb(OnRockers(-0.060, 0, 0.125), OnRockers(0.060, 0, 0.125), 0.043, 0.041),
                 Ellipsoid(OnRockers(-0.066, 0, 0.130), {0.044, 0.044, 0.046})},
                0.02);
}

BlobField HorseBody(const BlobField& barrel) {
  const BlobField neck = Limb(OnRockers(0.072, 0, 0.140), OnRockers(0.112, 0, 0.200), 0.034, 0.024);
  const BlobField head =
      Joined({Limb(OnRockers(0.112, 0, 0.210), OnRockers(0.166, 0, 0.176), 0.026, 0.018)}, 0.01);
  std::vector<BlobField> all{barrel, neck, head};
  for (const int side : {-1, 1}) {
    all.push_back(Limb(OnRockers(0.068, side * 0.024, 0.110), OnRockers(0.098, side * 0.046, 0),
                       0.024, 0.0155));
    all.push_back(Limb(OnRockers(-0.072, side * 0.024, 0.110), OnRockers(-0.104, side * 0.046, 0),
                       0.026, 0.0155));
    all.push_back(Limb(OnRockers(0.104, side * 0.013, 0.228), OnRockers(0.100, side * 0.017, 0.250),
                       0.010, 0.0065));
  }
  return Joined(all, 0.016);
}

BlobField Saddle(const BlobField& barrel) {
  return Common(Swollen(barrel, 0.006),
                Common(Below(OnRockers(0.034, 0, 0), {1, 0, 0.1}),
                       Common(Below(OnRockers(-0.034, 0, 0), {-1, 0, 0.1}),
                              Below(OnRockers(0, 0, 0.112), {0, 0, -1}), 0.004),
                       0.004),
                0.006);
}

// A bow that touches the ground in the middle.
std::vector<Eigen::Vector2d> RockerOutline() {
  constexpr int kSteps = 28;
  const double radius = 0.36;
  const double height = 0.028;
  std::vector<Eigen::Vector2d> bow;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = -0.46 + 0.92 * i / kSteps;
    bow.emplace_back(radius * std::sin(angle), radius - radius * std::cos(angle));
  }
  for (int i = kSteps; i >= 0; --i) {
    const double angle = -0.46 + 0.92 * i / kSteps;
    const double inner = radius - height;
    bow.emplace_back(inner * std::sin(angle), radius - inner * std::cos(angle));
  }
  return bow;
}

}  // namespace

std::vector<ModelPart> MakeRockingHorse() {
  constexpr double kCell_m = 0.0092;
  const BlobField barrel = HorseBarrel();
  std::vector<ModelPart> parts;
  parts.push_back(
      {"horse",
       MakeBlob(HorseBody(barrel), Box({-0.14, -0.075, 0.01}, {0.20, 0.075, 0.315}), kCell_m),
       {186, 126, 74},
       "",
       ""});
  parts.push_back({"saddle",
                   MakeBlob(Saddle(barrel), Box({-0.05, -0.06, 0.14}, {0.05, 0.06, 0.235}), 0.006),
                   {164, 40, 52},
                   "",
                   ""});
  const BlobField mane =
      Joined({Limb(OnRockers(0.090, 0, 0.238), OnRockers(0.060, 0, 0.190), 0.014, 0.015),
              Limb(OnRockers(0.060, 0, 0.190), OnRockers(0.034, 0, 0.166), 0.015, 0.010),
              Limb(OnRockers(0.090, 0, 0.238), OnRockers(0.122, 0, 0.240), 0.014, 0.009)},
             0.012);
  parts.push_back({"mane",
                   MakeBlob(mane, Box({0.01, -0.025, 0.18}, {0.14, 0.025, 0.31}), 0.005),
                   {78, 50, 34},
                   "",
                   ""});
  const BlobField tail =
      Joined({Limb(OnRockers(-0.104, 0, 0.150), OnRockers(-0.132, 0, 0.118), 0.014, 0.016),
              Limb(OnRockers(-0.132, 0, 0.118), OnRockers(-0.138, 0, 0.070), 0.016, 0.009)},
             0.012);
  parts.push_back({"tail",
                   MakeBlob(tail, Box({-0.165, -0.025, 0.09}, {-0.08, 0.025, 0.22}), 0.005),
                   {78, 50, 34},
                   "",
                   ""});
  for (const int side : {-1, 1}) {
    const std::string which = side < 0 ? "right" : "left";
    parts.push_back(
        {"eye_" + which, Ball(OnRockers(0.126, side * 0.0225, 0.207), 0.0055, 16), kDark, "", ""});
    parts.push_back({"rocker_" + which,
                     Translated(MakePrism(RockerOutline(), 0.0135, 0.003), 0, side * 0.046, 0),
                     {70, 118, 150},
                     "",
                     ""});
  }
  // Two bars between the rockers.
  for (const double x : {-0.104, 0.098}) {
    parts.push_back(
        {x < 0 ? "bar_rear" : "bar_front",
         MakeExtrusion(RoundedRectangle({x - 0.014, 0.0225}, {x + 0.014, 0.0495}, 0.004), 0.056,
                       0.003),
         {58, 98, 128},
         "",
         ""});
  }
  return parts;
}

namespace {

// The hull of the ship, `swell` outside its beam and up to `rise` above its deck: the whole of it
// or the rail alone.
Shape ShipHull(double swell, double rise, bool whole) {
  constexpr int kSections = 28;
  constexpr int kRibs = 20;
  const double half_length = 0.180;
  // Half the beam, the keel's and the deck's height at s = -1 (stern) to 1 (bow).
  const auto beam = [](double s) {
    const double taper = s > 0 ? std::pow(std::max(1 - s * s, 0.0), 0.75)
                               : std::pow(std::max(1 - std::pow(-s, 5), 0.0), 0.5);
    return 0.004 + 0.056 * taper;
  };
  const auto keel = [](double s) {
    return s > 0.45 ? 0.045 * std::pow((s - 0.45) / 0.55, 2) : 0.0;
  };
  const auto deck = [](double s) { return 0.060 + 0.030 * (s > 0 ? s * s : 0.35 * s * s); };
  std::vector<std::vector<V>> rings;
  for (int i = 0; i <= kSections; ++i) {
    const double s = std::sin(std::numbers::pi * (static_cast<double>(i) / kSections - 0.5));
    const double x = half_length * s + (s > 0 ? 0.012 * s * s : 0);
    const double b = beam(s) + swell;
    const double top = deck(s) + rise;
    const double low = whole ? keel(s) : deck(s) - 0.016;
    std::vector<V> ring;
    for (int r = 0; r <= kRibs; ++r) {
      const double angle = std::numbers::pi * r / kRibs;
      const double c = std::cos(angle);
      // A superellipse: full in the bilge, upright at the sides.
      const double power = whole ? 0.62 : 0.2;
      const double y = b * std::copysign(std::pow(std::abs(c), power), c);
      ring.emplace_back(x, y, top - (top - low) * std::pow(std::sin(angle) + 1e-12, power));
    }
    rings.push_back(ring);
  }
  return MakeLoft(rings);
}

}  // namespace

std::vector<ModelPart> MakeShip() {
  const auto block = [](double x0, double x1, double low, double high, double half, double bevel) {
    return MakeExtrusion(RoundedRectangle({x0, low}, {x1, high}, bevel * 1.6), half, bevel);
  };
  const auto turned = [](double radius, double low, double high, double x) {
    return Translated(MakeLathe(CylinderProfile(radius, low, high, 0.002), 32), x, 0, 0);
  };
  const Colour white{238, 236, 228};
  std::vector<ModelPart> parts;
  parts.push_back({"hull", ShipHull(0, 0, true), {38, 70, 120}, "", ""});
  parts.push_back({"rail", ShipHull(0.003, 0.004, false), {196, 152, 98}, "", ""});
  parts.push_back({"house", block(-0.104, 0.062, 0.055, 0.098, 0.038, 0.006), white, "", ""});
  parts.push_back({"bridge", block(-0.010, 0.050, 0.090, 0.132, 0.033, 0.006), white, "", ""});
  parts.push_back(
      {"windows", block(-0.0104, 0.0504, 0.110, 0.122, 0.0334, 0.001), {60, 92, 118}, "", ""});
  for (const double x : {-0.040, -0.082}) {
    const std::string which = x > -0.06 ? "front" : "rear";
    parts.push_back({"funnel_" + which, turned(0.0155, 0.090, 0.160, x), {206, 62, 46}, "", ""});
    parts.push_back({"funnel_top_" + which, turned(0.0159, 0.144, 0.1605, x), kDark, "", ""});
  }
  parts.push_back(
      {"hatch", block(0.088, 0.122, 0.060, 0.084, 0.020, 0.003), {150, 104, 66}, "", ""});
  // 2.5 cm across, as thick as a map of 1 cm voxels needs.
  parts.push_back({"mast", turned(0.0126, 0.120, 0.196, 0.020), {196, 152, 98}, "", ""});
  return parts;
}

}  // namespace tsdfpp
