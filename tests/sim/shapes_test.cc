// The generated solids: closed, outward, of the right size.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "sim/config/spline.h"
#include "sim/models/mesh_shapes.h"
#include "sim/models/room_model.h"
#include "sim/models/toy_models.h"

namespace tsdfpp {
namespace {

// Every edge is used once in each direction.
void ExpectClosed(const Shape& shape, const std::string& name) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& triangle : shape.triangles) {
    for (int k = 0; k < 3; ++k) ++edges[{triangle[k], triangle[(k + 1) % 3]}];
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1) << name;
    ASSERT_TRUE(edges.contains({edge.second, edge.first})) << name;
  }
}

TEST(Shapes, VolumesAreAnalytic) {
  EXPECT_NEAR(SignedVolume(MakeBox({-1, 0, 2}, {1, 3, 2.5}, 0.4)), 3.0, 1e-12);
  // A polygon of n sides has n / 2 sin(2 pi / n) r^2 instead of pi r^2.
  constexpr int kSides = 96;
  const double disc = kSides / 2.0 * std::sin(2 * M_PI / kSides);
  const Shape cylinder = MakeLathe({{0, 0}, {0.5, 0}, {0.5, 2}, {0, 2}}, kSides);
  EXPECT_NEAR(SignedVolume(cylinder), disc * 0.25 * 2, 1e-12);
  const Shape prism = MakeExtrusion({{0, 0}, {2, 0}, {0, 1}}, 0.5, 0.0);
  EXPECT_NEAR(SignedVolume(prism), 1.0, 1e-12);
  constexpr double kFacets = 0.01;  // share of a ball's volume that its facets cut off
  EXPECT_NEAR(SignedVolume(MakeLathe(BallProfile(1, 5), 96)), 4 * M_PI / 3, 4 * M_PI / 3 * kFacets);
  constexpr double kHandleFacets = 0.02;
  const double half_torus = M_PI * M_PI * 0.3 * 0.1 * 0.1;
  EXPECT_NEAR(SignedVolume(MakeHandle(0.3, 0.1)), half_torus, half_torus * kHandleFacets);
}

TEST(Shapes, RoundedRimsStayInside) {
  const Shape solid = MakeExtrusion(RoundedRectangle({-1, 0}, {1, 1}, 0.2), 0.5, 0.1);
  double low_y = 0;
  double high_x = 0;
  for (const Eigen::Vector3d& p : solid.vertices) {
    low_y = std::min(low_y, p.y());
    high_x = std::max(high_x, p.x());
  }
  EXPECT_NEAR(low_y, -0.5, 1e-12);
  EXPECT_NEAR(high_x, 1.0, 1e-12);
}

TEST(Shapes, EveryPartIsClosedAndOutward) {
  std::vector<ModelPart> parts = MakeRoom();
  for (const std::string& name : ToyModelNames()) {
    for (ModelPart& part : MakeToy(name)) parts.push_back(std::move(part));
  }
  for (const ModelPart& part : parts) {
    ExpectClosed(part.shape, part.name);
    EXPECT_GT(SignedVolume(part.shape), 0) << part.name;
    EXPECT_FALSE(part.region.empty());
  }
}

TEST(Shapes, PartNamesAreUniqueInAToy) {
  for (const std::string& toy : ToyModelNames()) {
    std::set<std::string> names;
    for (const ModelPart& part : MakeToy(toy)) EXPECT_TRUE(names.insert(part.name).second);
  }
}

TEST(Toys, StandOnTheGroundAndHaveTheirSize) {
  const std::map<std::string, Eigen::Vector3d> sizes{{"truck", {0.325, 0.156, 0.170}},
                                                     {"car", {0.271, 0.146, 0.120}}};
  constexpr double kLeastSize_m = 0.08;
  constexpr double kLeastPart_m = 0.025;  // or a 1 cm voxel map cannot hold it
  for (const std::string& toy : ToyModelNames()) {
    Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Vector3d high = -low;
    for (const ModelPart& part : MakeToy(toy)) {
      Eigen::Vector3d part_low = Eigen::Vector3d::Constant(1e9);
      Eigen::Vector3d part_high = -part_low;
      for (const Eigen::Vector3d& p : part.shape.vertices) {
        part_low = part_low.cwiseMin(p);
        part_high = part_high.cwiseMax(p);
      }
      EXPECT_GE((part_high - part_low).minCoeff(), kLeastPart_m) << toy << " " << part.name;
      low = low.cwiseMin(part_low);
      high = high.cwiseMax(part_high);
    }
    EXPECT_NEAR(low.z(), kToyClearance_m, 1e-9) << toy;
    EXPECT_GE((high - low).minCoeff(), kLeastSize_m) << toy;
    if (const auto size = sizes.find(toy); size != sizes.end()) {
      constexpr double kSizeTolerance_m = 0.004;
      EXPECT_LT((high - low - size->second).cwiseAbs().maxCoeff(), kSizeTolerance_m)
          << toy << " " << (high - low).transpose();
    }
  }
}

TEST(Spline, PassesThroughItsKnotsAndIsSmooth) {
  const std::vector<double> knots{0, 1, 2.5, 3};
  const std::vector<double> values{1, -1, 0.5, 2};
  const CubicSpline spline(knots, values, 0.7);
  for (std::size_t i = 0; i < knots.size(); ++i) {
    EXPECT_NEAR(spline.Value(knots[i]), values[i], 1e-12);
  }
  EXPECT_NEAR(spline.Slope(0), 0.7, 1e-12);
  constexpr double kStep = 1e-4;
  for (const double knot : {1.0, 2.5}) {
    EXPECT_NEAR(spline.Slope(knot - 1e-9), spline.Slope(knot + 1e-9), 1e-6);
    const double bend_before = (spline.Slope(knot) - spline.Slope(knot - kStep)) / kStep;
    const double bend_after = (spline.Slope(knot + kStep) - spline.Slope(knot)) / kStep;
    EXPECT_NEAR(bend_before, bend_after, 1e-2);
  }
  for (double t = 0.05; t < 3; t += 0.1) {
    EXPECT_NEAR(spline.Slope(t), (spline.Value(t + kStep) - spline.Value(t - kStep)) / (2 * kStep),
                1e-5);
  }
}

// A clamped cubic spline repeats a cubic exactly.
TEST(Spline, RepeatsACubic) {
  const auto cubic = [](double t) { return t * t * t - 2 * t * t + 0.5 * t - 3; };
  const auto slope = [](double t) { return 3 * t * t - 4 * t + 0.5; };
  const std::vector<double> knots{-1, 0, 0.7, 2};
  std::vector<double> values;
  for (const double t : knots) values.push_back(cubic(t));
  const CubicSpline spline(knots, values, slope(-1), slope(2));
  for (double t = -1; t <= 2; t += 0.01) EXPECT_NEAR(spline.Value(t), cubic(t), 1e-12);
}

}  // namespace
}  // namespace tsdfpp
