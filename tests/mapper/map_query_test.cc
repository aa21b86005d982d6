// Questions about points: against true distances, and against the dense references.
#include "mapper/map_query.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <limits>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

class Query : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(Query);

// Those with a volume an object.
class LayeredQuery : public EveryMethodTest {};
TSDFPP_FOR_METHODS(LayeredQuery, LayeredMethods());

// A camera above the plane z = height that looks straight down.
Pose FromAbove(double height_m) {
  Pose T_WC = Pose::Identity();
  T_WC.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  T_WC.translation().z() = height_m;
  return T_WC;
}

TEST_P(Query, DistanceAndGradientOfAPlane) {
  constexpr double kHeight_m = 0.6;
  // Distances are measured along rays: d (1 / cos - 1) too long, that is 1.4 % of 3 cm at 10 cm
  // beside the axis; and the gradient is turned by d x / z^2.
  constexpr double kAlongRays_m = 0.0005;
  constexpr double kSlope = 0.03;
  Scene scene;
  scene.shapes.push_back(reference::Plane(kBackground, {100, 100, 100}, kTableTop_m));
  const auto map = MakeMap(GetParam(), ToyConfig());
  for (int i = 0; i < 3; ++i)
    SetPosesThenFuse(*map, reference::Render(scene, FromAbove(kHeight_m)));
  const MapQuery query = MapQuery::Of(*map).value();
  Dice dice(1);
  for (int i = 0; i < 500; ++i) {
    const double d = dice.Uniform(-0.03, 0.03);
    const Eigen::Vector3d p(dice.Uniform(-0.07, 0.07), dice.Uniform(-0.07, 0.07), kTableTop_m + d);
    const PointAnswer answer = query.At(p);
    ASSERT_TRUE(answer.visible.has_value()) << p.transpose();
    EXPECT_EQ(answer.visible->id, kBackground);
    EXPECT_NEAR(answer.visible->distance_m, d, kAlongRays_m);
    EXPECT_LT((answer.visible->gradient_W - Eigen::Vector3f::UnitZ()).norm(), kSlope);
    EXPECT_FLOAT_EQ(answer.visible->weight, 3);
    ASSERT_EQ(answer.objects.size(), 1U);
    EXPECT_EQ(answer.objects[0].distance_m, answer.visible->distance_m);
  }
  // Truncated, and beyond what was seen.
  const auto high = query.At(Eigen::Vector3d(0, 0, kTableTop_m + 0.1)).visible;
  // The paper's sentences leave free space to whom it is active for.
  ASSERT_EQ(high.has_value(), GetParam() != Method::kTsdfppLiteral);
  if (high) {
    EXPECT_FLOAT_EQ(high->distance_m, ToyConfig().front());
  }
  EXPECT_FALSE(query.At(Eigen::Vector3d(0, 0, -0.3)).visible.has_value());
}

TEST_P(Query, DistanceAndGradientOfASphere) {
  constexpr double kRadius_m = 0.2;
  // Up to 20 deg from the axis a ray meets the sphere at up to 27 deg: half a voxel is 1.2 mm
  // longer along it, half a pixel moves the surface by 0.6 mm, and trilinear interpolation cuts h^2
  // / (4 r), 0.5 mm, off the curve.
  constexpr double kTolerance_m = 0.0025;
  constexpr double kTurn_rad = 0.25;
  Scene scene;
  scene.shapes.push_back(
      reference::Sphere(kBall, {30, 30, 200}, Eigen::Vector3d::Zero(), kRadius_m));
  const Intrinsics camera{320, 240, 266.7, 266.7, 159.5, 119.5};
  const auto map = MakeMap(GetParam(), ToyConfig());
  map->Fuse(reference::Render(scene, FromAbove(0.8), 1, camera),
            reference::Render(scene, FromAbove(0.8), 1, camera).mask);
  const MapQuery query = MapQuery::Of(*map).value();
  Dice dice(2);
  int asked = 0;
  for (int i = 0; i < 1000; ++i) {
    const double tilt = dice.Uniform(0, 0.35);
    const double turn = dice.Uniform(0, 6.28);
    const double d = dice.Uniform(-kToyVoxel_m / 2, kToyVoxel_m / 2);
    const Eigen::Vector3d radial(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn),
                                 std::cos(tilt));
    const auto visible = query.At(Eigen::Vector3d((kRadius_m + d) * radial)).visible;
    ASSERT_TRUE(visible.has_value());
    EXPECT_EQ(visible->id, kBall);
    EXPECT_NEAR(visible->distance_m, d, kTolerance_m);
    const double cosine = visible->gradient_W.cast<double>().normalized().dot(radial);
    EXPECT_LT(std::acos(std::min(1.0, cosine)), kTurn_rad);
    ++asked;
  }
  EXPECT_EQ(asked, 1000);
}

// The trilinear interpolant of the reference's values, in double precision.
struct Slow {
  std::optional<double> distance;
  double weight = 0;
};
Slow SlowAt(const reference::DenseMap& dense, InstanceId id, const Eigen::Vector3d& q,
            const Eigen::Vector3i& base) {
  Slow slow{0.0, 0};
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3i corner = reference::CubeCorner(base, i);
    const auto value = dense.ValueAt(id, corner);
    if (!value) return {};
    double coefficient = 1;
    for (int a = 0; a < 3; ++a) {
      const double f = q[a] - base[a];
      coefficient *= ((i >> a) & 1) != 0 ? f : 1 - f;
    }
    *slow.distance += coefficient * value->distance_m;
    slow.weight += coefficient * value->weight;
  }
  return slow;
}

// Toys on a table, the brick moved, the tray turned over it: answers for every object, through its
// pose, and for the visible scene.
TEST_P(LayeredQuery, AgreesWithTheDenseReference) {
  // Interpolation in single precision of distances below 0.1 m and weights below 100; gradients are
  // differences of distances over a voxel.
  constexpr double kRounding_m = 1e-7;
  constexpr double kWeightRounding = 1e-4;
  constexpr double kGradientRounding = 2e-4;
  SideBySide maps(GetParam(), ToyConfig(), ToyBox(), ToyIds());
  for (int i = 0; i < 3; ++i) maps.SetPosesAndFuse(DriveFrame(i));
  maps.SetObjectPose(kTray, MakePose(0.7, {0.1, 0.2, 1}, {-0.05, 0.0, kTableTop_m + 0.03}));
  const MapQuery query = MapQuery::Of(maps.map()).value();
  Dice dice(3);
  std::map<InstanceId, int> answered;
  int hidden = 0;
  for (int i = 0; i < 6000; ++i) {
    const Eigen::Vector3d p(dice.Uniform(-0.2, 0.2), dice.Uniform(-0.2, 0.2),
                            dice.Uniform(-0.06, 0.12));
    const PointAnswer answer = query.At(p);
    std::size_t expected = 0;
    for (const InstanceId id : ToyIds()) {
      const Pose T_LW = maps.dense().ObjectLattice(id).inverse();
      const Eigen::Vector3d q = T_LW * p / kToyVoxel_m;
      const Eigen::Vector3i base = q.array().floor().matrix().cast<int>();
      const Slow slow = SlowAt(maps.dense(), id, q, base);
      const auto found = std::find_if(answer.objects.begin(), answer.objects.end(),
                                      [id](const SurfaceDistance& s) { return s.id == id; });
      ASSERT_EQ(found != answer.objects.end(), slow.distance.has_value()) << id;
      if (!slow.distance) continue;
      ++expected;
      ++answered[id];
      ASSERT_NEAR(found->distance_m, *slow.distance, kRounding_m);
      ASSERT_NEAR(found->weight, slow.weight, kWeightRounding);
      // Along each axis the interpolant is a straight line.
      constexpr double kStep = 0.25;
      Eigen::Vector3d gradient_L;
      for (int a = 0; a < 3; ++a) {
        const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(a);
        gradient_L[a] = (*SlowAt(maps.dense(), id, q + step, base).distance -
                         *SlowAt(maps.dense(), id, q - step, base).distance) /
                        (2 * kStep * kToyVoxel_m);
      }
      const Eigen::Vector3d gradient_W = T_LW.linear().transpose() * gradient_L;
      ASSERT_LT((found->gradient_W.cast<double>() - gradient_W).norm(), kGradientRounding);
    }
    ASSERT_EQ(answer.objects.size(), expected);
    ASSERT_EQ(answer.visible.has_value(), expected > 0);
    if (expected == 0) continue;
    for (std::size_t k = 1; k < answer.objects.size(); ++k) {
      ASSERT_LE(answer.objects[k - 1].distance_m, answer.objects[k].distance_m);
    }
    const Eigen::Vector3i nearest =
        (p / kToyVoxel_m + Eigen::Vector3d::Constant(0.5)).array().floor().matrix().cast<int>();
    const auto list = maps.dense().ListAt(nearest);
    const bool has_active =
        !list.empty() && std::any_of(answer.objects.begin(), answer.objects.end(),
                                     [&](const auto& s) { return s.id == list[0].id; });
    ASSERT_EQ(answer.visible->id, has_active ? list[0].id : answer.objects[0].id);
    if (list.size() > 1) ++hidden;
  }
  for (const InstanceId id : ToyIds()) EXPECT_GT(answered[id], 100) << id;
  EXPECT_GT(hidden, 50) << "nothing was behind anything";
}

TEST(QueryOfOneField, AnswersWithTheLabelOfTheNearestVoxel) {
  const auto map = DrivenMap(Method::kTsdf, ToyConfig(), 2);
  const MapQuery query = MapQuery::Of(*map).value();
  Dice dice(4);
  std::map<InstanceId, int> answered;
  for (int i = 0; i < 6000; ++i) {
    const Eigen::Vector3d p(dice.Uniform(-0.2, 0.2), dice.Uniform(-0.2, 0.2),
                            dice.Uniform(-0.06, 0.12));
    const PointAnswer answer = query.At(p);
    if (!answer.visible) continue;
    ASSERT_EQ(answer.objects.size(), 1U);
    const Eigen::Vector3i nearest =
        (p / kToyVoxel_m + Eigen::Vector3d::Constant(0.5)).array().floor().matrix().cast<int>();
    const auto list = VoxelsOf(*map).ListAt(nearest);
    ASSERT_EQ(answer.visible->id, list.empty() ? kBackground : list[0].id);
    ++answered[answer.visible->id];
  }
  for (const InstanceId id : ToyIds()) EXPECT_GT(answered[id], 20) << id;
}

bool Same(const SurfaceDistance& a, const SurfaceDistance& b) {
  return a.id == b.id && a.distance_m == b.distance_m && a.gradient_W == b.gradient_W &&
         a.weight == b.weight;
}

TEST_P(Query, ManyPointsAtOnceAreAnsweredAsOneByOne) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 3);
  map->SetObjectPose(kBall, MakePose(1, Eigen::Vector3d::UnitZ(), {0, 0, 0.1}));
  const MapQuery query = MapQuery::Of(*map).value();
  std::vector<Eigen::Vector3d> points;
  Dice dice(5);
  for (int i = 0; i < 3000; ++i) {
    points.emplace_back(dice.Uniform(-0.3, 0.3), dice.Uniform(-0.3, 0.3), dice.Uniform(-0.1, 0.2));
  }
  for (const std::size_t threads : {1U, 4U}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    const std::vector<PointAnswer> answers = query.At(points);
    ASSERT_EQ(answers.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const PointAnswer one = query.At(points[i]);
      ASSERT_EQ(one.visible.has_value(), answers[i].visible.has_value());
      ASSERT_TRUE(!one.visible || Same(*one.visible, *answers[i].visible));
      ASSERT_EQ(one.objects.size(), answers[i].objects.size());
      for (std::size_t k = 0; k < one.objects.size(); ++k) {
        ASSERT_TRUE(Same(one.objects[k], answers[i].objects[k]));
      }
    }
  }
}

TEST_P(Query, WhereNothingIsKnown) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto empty = MakeMap(GetParam(), ToyConfig());
  const auto map = DrivenMap(GetParam(), ToyConfig(), 1);
  for (const auto* of : {empty.get(), map.get()}) {
    const MapQuery query = MapQuery::Of(*of).value();
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(nan, 0, 0), Eigen::Vector3d(0, infinity, 0), Eigen::Vector3d(1e300, 0, 0),
          Eigen::Vector3d(-1e9, 1e9, 0), Eigen::Vector3d(0, 0, 3)}) {
      EXPECT_FALSE(query.At(p).visible.has_value());
      EXPECT_TRUE(query.At(p).objects.empty());
    }
    EXPECT_TRUE(query.At(std::vector<Eigen::Vector3d>{}).empty());
  }
  EXPECT_FALSE(MapQuery::Of(*empty).value().At(Eigen::Vector3d(0, 0, 0)).visible.has_value());
}

}  // namespace
}  // namespace tsdfpp
