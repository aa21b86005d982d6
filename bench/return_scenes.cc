#include "bench/return_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/random.h"

namespace tsdfpp {
namespace {

struct Toy {
  std::string_view model;
  double scale = 1;
};
// What stands by itself and is 8 to 27 cm long.
constexpr std::array kToys{Toy{"car"},       Toy{"mug"},
                           Toy{"ball"},      Toy{"house"},
                           Toy{"blocks"},    Toy{"duck"},
                           Toy{"hexagon"},   Toy{"wedge"},
                           Toy{"cone"},      Toy{"bottle"},
                           Toy{"brick"},     Toy{"truck", 0.8},
                           Toy{"pyramid"},   Toy{"rocking_horse", 0.6},
                           Toy{"torus"},     Toy{"cylinder"},
                           Toy{"ship", 0.6}, Toy{"capsule", 1.2}};

// Where toys stand, metres beside the table's middle.
constexpr std::array<std::array<double, 2>, 4> kPlaces{
    {{-0.27, -0.06}, {0.27, -0.06}, {-0.17, 0.24}, {0.17, 0.24}}};
constexpr double kPlaceJitter_m = 0.03;
constexpr double kPaintedShare = 0.5;

constexpr int kLastBefore = 12;
constexpr double kLift_m = 0.25;  // over all that stands there
constexpr double kPush_m = 0.12;
constexpr double kSlowest_m = 0.05;  // a second
constexpr double kFastest_m = 0.4;
constexpr double kPushSpread_rad = 0.9;
constexpr int kFramesAfterPush = 12;
constexpr double kOutside_m = 1.45;  // beside the table's middle, where the camera sees nothing

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : seed_(seed) {}
  // Uniform.
  double Between(double low, double high) {
    return low + (high - low) * UniformDraw(seed_, kStream, drawn_++)[0];
  }
  std::size_t Below(std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(Between(0, static_cast<double>(count))));
  }
  template <typename T>
  void Shuffle(std::vector<T>& all) {
    for (std::size_t i = all.size(); i > 1; --i) std::swap(all[i - 1], all[Below(i)]);
  }

 private:
  static constexpr std::uint32_t kStream = 71;
  std::uint64_t seed_;
  std::uint64_t drawn_ = 0;
};

struct Spot {
  Eigen::Vector3d position_W = Eigen::Vector3d::Zero();
  double yaw_deg = 0;
};

Eigen::Quaterniond Heading(double yaw_deg) { return FromRollPitchYaw({0, 0, yaw_deg}); }

class Stage {
 public:
  Stage(ReturnKind kind, std::uint64_t seed) : draw_(seed) {
    SceneConfig& scene = drawn_.scene;
    drawn_.kind = kind;
    drawn_.last_before = kLastBefore;
    scene.name = "return";
    scene.seed = seed;
    scene.frames = 124;
    scene.intrinsics = {320, 240, 262.5, 262.5, 159.5, 119.5};
    const double turn = draw_.Between(4, 8) * (draw_.Below(2) == 0 ? 1 : -1);
    ArcPath arc{{0, 0, kTableTop_m}, {-90 - turn, -90 + turn}, {0.98, 0.98}, {0.62, 0.62}};
    scene.camera.path = arc;
    for (const Toy& toy : kToys) toys_.push_back(&toy);
    draw_.Shuffle(toys_);
    for (std::size_t i = 0; i < kPlaces.size(); ++i) places_.push_back(i);
    draw_.Shuffle(places_);
  }

  Spot DrawSpot(std::size_t place) {
    return {{kPlaces[place][0] + draw_.Between(-kPlaceJitter_m, kPlaceJitter_m),
             kPlaces[place][1] + draw_.Between(-kPlaceJitter_m, kPlaceJitter_m), kTableTop_m},
            draw_.Between(-180, 180)};
  }
  std::size_t NextPlace() { return places_[next_place_++]; }

  SceneObject& AddToy(const Spot& spot) {
    const Toy& toy = *toys_[next_toy_++];
    SceneObject object;
    object.id = static_cast<InstanceId>(drawn_.scene.objects.size() + 1);
    object.name = toy.model;
    object.semantic_class = toy.model;
    object.model.name = toy.model;
    object.model.scale = toy.scale;
    if (draw_.Between(0, 1) < kPaintedShare) {
      const auto channel = [&] { return static_cast<std::uint8_t>(draw_.Between(30, 240)); };
      object.model.paint = Colour{channel(), channel(), channel()};
    }
    object.x = spot.position_W.x();
    object.y = spot.position_W.y();
    object.yaw_deg = spot.yaw_deg;
    drawn_.scene.objects.push_back(object);
    return drawn_.scene.objects.back();
  }

  int Side() { return draw_.Below(2) == 0 ? 1 : -1; }
  Draw& draw() { return draw_; }
  ReturnScene& drawn() { return drawn_; }

 private:
  ReturnScene drawn_;
  Draw draw_;
  std::vector<const Toy*> toys_;
  std::vector<std::size_t> places_;
  std::size_t next_toy_ = 0;
  std::size_t next_place_ = 0;
};

Eigen::Vector3d Above(const Eigen::Vector3d& p_W) { return p_W + Eigen::Vector3d(0, 0, kLift_m); }

// On the side of the table that it is on, so that two never meet.
Eigen::Vector3d Outside(const Eigen::Vector3d& p_W) {
  return {std::copysign(kOutside_m, p_W.x()), p_W.y() - 0.1, kTableTop_m + kLift_m + 0.14};
}

void CarryOut(SceneObject& object, const Spot& from) {
  object.keyframes = {{kLastBefore, from.position_W, Heading(from.yaw_deg)},
                      {kLastBefore + 8, Above(from.position_W), Heading(from.yaw_deg)},
                      {kLastBefore + 46, Outside(from.position_W), Heading(from.yaw_deg)}};
}

void CarryIn(SceneObject& object, const Spot& to) {
  // Behind the camera's back.
  object.keyframes.push_back({60, {0, -4, kTableTop_m}, Heading(to.yaw_deg)});
  object.keyframes.push_back({62, Outside(to.position_W), Heading(to.yaw_deg)});
  object.keyframes.push_back({98, Above(to.position_W), Heading(to.yaw_deg)});
  object.keyframes.push_back({106, to.position_W, Heading(to.yaw_deg)});
}

void Carry(Stage& stage, const Spot& from, const Spot& to) {
  SceneObject& object = stage.AddToy(from);
  CarryOut(object, from);
  CarryIn(object, to);
  stage.drawn().returning.push_back(object.id);
}

// From the left, before the object, and on to the right.
void Screen(Stage& stage, const Spot& behind) {
  SceneObject& screen = stage.AddToy({});
  screen.name = screen.semantic_class = "screen";
  screen.model = ModelSpec{};
  screen.model.name = "brick";
  screen.model.paint = Colour{150, 150, 140};
  screen.model.size_m = Eigen::Vector3d(0.36, 0.02, 0.34);
  const double y = behind.position_W.y() - 0.26;
  const Eigen::Vector3d before(0.79 * behind.position_W.x(), y, kTableTop_m);
  const int side = stage.Side();
  const auto at = [&](double x) { return Eigen::Vector3d(x, y, kTableTop_m); };
  screen.x = side * kOutside_m;
  screen.y = y;
  screen.yaw_deg = 0;
  screen.keyframes = {{kLastBefore, at(side * kOutside_m), Heading(0)},
                      {kLastBefore + 20, before, Heading(0)},
                      {kLastBefore + 40, before, Heading(0)},
                      {kLastBefore + 60, at(-side * kOutside_m), Heading(0)}};
}

void Hide(Stage& stage, bool is_moved) {
  // One of the far places, so that there is room for the screen.
  Spot spot = stage.DrawSpot(2 + stage.draw().Below(2));
  SceneObject& object = stage.AddToy(spot);
  if (is_moved) {
    Spot to = spot;
    to.position_W.x() += stage.draw().Between(-0.1, 0.1);
    to.position_W.y() += stage.draw().Between(-0.04, 0.06);
    to.yaw_deg += stage.draw().Between(-40, 40);
    object.keyframes = {{kLastBefore + 22, spot.position_W, Heading(spot.yaw_deg)},
                        {kLastBefore + 38, to.position_W, Heading(to.yaw_deg)}};
  }
  stage.drawn().returning.push_back(object.id);
  stage.AddToy(stage.DrawSpot(stage.draw().Below(2)));
  Screen(stage, spot);
}

void PlaceOthers(Stage& stage, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) stage.AddToy(stage.DrawSpot(stage.NextPlace()));
}

// Towards the table's middle, more or less.
void Push(Stage& stage) {
  const Spot from = stage.DrawSpot(stage.NextPlace());
  SceneObject& object = stage.AddToy(from);
  ReturnScene& drawn = stage.drawn();
  drawn.pushed = object.id;
  drawn.speed_m = std::exp(stage.draw().Between(std::log(kSlowest_m), std::log(kFastest_m)));
  const double angle = std::atan2(-from.position_W.y(), -from.position_W.x()) +
                       stage.draw().Between(-kPushSpread_rad, kPushSpread_rad);
  Spot to = from;
  to.position_W += kPush_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
  to.yaw_deg += stage.draw().Between(-40, 40);
  const int frames = static_cast<int>(std::lround(kPush_m / drawn.speed_m * drawn.scene.rate_hz));
  object.keyframes = {{kLastBefore, from.position_W, Heading(from.yaw_deg)},
                      {kLastBefore + frames, to.position_W, Heading(to.yaw_deg)}};
  drawn.scene.frames = kLastBefore + frames + kFramesAfterPush;
}

}  // namespace

ReturnScene DrawReturnScene(ReturnKind kind, std::uint64_t seed) {
  Stage stage(kind, seed);
  if (kind == ReturnKind::kPushed || kind == ReturnKind::kStill) {
    if (kind == ReturnKind::kPushed) Push(stage);
    PlaceOthers(stage, kind == ReturnKind::kPushed ? kPlaces.size() - 1 : kPlaces.size());
    return stage.drawn();
  }
  const bool is_carried = kind != ReturnKind::kHidden && kind != ReturnKind::kMoved;
  if (!is_carried) {
    Hide(stage, kind == ReturnKind::kMoved);
  } else {
    const Spot from = stage.DrawSpot(stage.NextPlace());
    const std::size_t other = stage.NextPlace();
    if (kind == ReturnKind::kReplaced) {
      CarryOut(stage.AddToy(from), from);
      const Spot to = stage.DrawSpot(other);
      SceneObject& newcomer = stage.AddToy({Outside(to.position_W), 0});
      CarryIn(newcomer, to);
      newcomer.z = newcomer.keyframes.front().position_W.z();
    } else if (kind == ReturnKind::kTwo) {
      // To each other's place.
      const Spot from_2 = stage.DrawSpot(other);
      Carry(stage, from, stage.DrawSpot(other));
      Carry(stage, from_2, {from.position_W, stage.draw().Between(-180, 180)});
    } else {
      Carry(stage, from, stage.DrawSpot(other));
    }
    PlaceOthers(stage, 2);
  }
  return stage.drawn();
}

}  // namespace tsdfpp
