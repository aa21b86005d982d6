#include "metrics/accuracy.h"

#include <gtest/gtest.h>

#include "metrics/mesh_tools.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr std::array<double, 3> kThresholds_m = {0.005, 0.01, 0.02};

SampleSet Samples(const TriangleMesh& mesh) { return SampleReconstruction(mesh, {}); }

TEST(Accuracy, OffsetPlaneIsItsOffset) {
  // Inside the true sheet's outline, 4 mm on the outer side of it.
  const TruthSurface truth(testing::Model(1, testing::Sheet({-1, -1, 0}, {2, 0, 0}, {0, 2, 0})));
  TriangleMesh mesh = testing::Sheet({-0.5F, -0.5F, 0.007F}, {1, 0, 0}, {0, 1, 0}, 30);
  const AccuracyScores above =
      ScoreAccuracy(Samples(mesh), {&truth, Pose::Identity()}, std::nullopt, kThresholds_m);
  EXPECT_NEAR(*above.distance.mean_m.value, 0.007, testing::kFloat_m);
  EXPECT_NEAR(*above.distance.rmse_m.value, 0.007, testing::kFloat_m);
  EXPECT_NEAR(*above.distance.p95_m.value, 0.007, testing::kFloat_m);
  EXPECT_NEAR(*above.bias_m.value, 0.007, testing::kFloat_m);
  EXPECT_EQ(*above.precision[0].value, 0);
  EXPECT_EQ(*above.precision[1].value, 1);
  EXPECT_NEAR(above.area_m2, 1, 1e-5);
  for (auto& vertex : mesh.vertices) vertex.z() = -0.007F;
  const AccuracyScores below =
      ScoreAccuracy(Samples(mesh), {&truth, Pose::Identity()}, std::nullopt, kThresholds_m);
  EXPECT_NEAR(*below.bias_m.value, -0.007, testing::kFloat_m);
}

TEST(Accuracy, InflatedSphere) {
  const TruthSurface truth(testing::Model(1, testing::Sphere(0.1F)));
  const Pose T_WO(Eigen::Translation3d(1, 2, 3));
  TriangleMesh inflated = testing::Sphere(0.103F);
  inflated.vertices = TransformPoints(T_WO, inflated.vertices);
  const AccuracyScores scores =
      ScoreAccuracy(Samples(inflated), {&truth, T_WO}, std::nullopt, kThresholds_m);
  // Facets of 2.8 deg stay r (1 - cos 1.4 deg) = 0.03 mm within the sphere.
  EXPECT_NEAR(*scores.distance.mean_m.value, 0.003, 3e-5);
  EXPECT_NEAR(*scores.bias_m.value, 0.003, 3e-5);
}

TEST(Accuracy, RegionTakesWhatIsNearestToIt) {
  TrueModel model = testing::Model(kBackground, testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
  testing::Append(model.mesh_O, testing::Sheet({0, 0, 1}, {1, 0, 0}, {0, 1, 0}));
  model.regions = {"floor", "table"};
  model.face_region = {0, 0, 1, 1};
  const TruthSurface truth(model);
  TriangleMesh mesh = testing::Sheet({0, 0, 0.02F}, {1, 0, 0}, {0, 1, 0});
  testing::Append(mesh, testing::Sheet({0, 0, 0.99F}, {1, 0, 0}, {0, 0.5F, 0}));
  const SampleSet samples = Samples(mesh);
  const auto score = [&](std::uint16_t region) {
    return ScoreAccuracy(samples, {&truth, Pose::Identity()}, region, kThresholds_m);
  };
  EXPECT_NEAR(*score(0).distance.mean_m.value, 0.02, testing::kFloat_m);
  EXPECT_NEAR(*score(1).distance.mean_m.value, 0.01, testing::kFloat_m);
  EXPECT_NEAR(score(1).area_m2, 0.5, 1e-3);
}

TEST(Accuracy, NothingReconstructedIsUndefined) {
  const TruthSurface truth(testing::Model(1, testing::Sphere(0.1F)));
  const AccuracyScores scores = ScoreAccuracy(Samples(TriangleMesh{}), {&truth, Pose::Identity()},
                                              std::nullopt, kThresholds_m);
  EXPECT_FALSE(scores.distance.mean_m.value);
  EXPECT_FALSE(scores.bias_m.value);
  EXPECT_FALSE(scores.precision[0].value);
  EXPECT_FALSE(scores.bias_m.why_not.empty());
}

TEST(Accuracy, SamplesAreCapped) {
  const TriangleMesh mesh = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  EXPECT_EQ(SampleReconstruction(mesh, {1, 50000, 1}).size(), 10000U);
  EXPECT_EQ(SampleReconstruction(mesh, {1, 700, 1}).size(), 700U);
}

// Two boxes 20 cm apart; a fifth of what is labelled 1 lies on box 2.
TEST(LabelPurity, ShareNearestToTheObject) {
  const TruthSurface one(testing::Model(1, testing::Box({0, 0, 0}, {0.1F, 0.1F, 0.1F})));
  const TruthSurface two(testing::Model(2, testing::Box({0, 0, 0}, {0.1F, 0.1F, 0.1F})));
  Pose T_W2 = Pose::Identity();
  T_W2.translation().x() = 0.3;
  const std::vector<PlacedTruth> truths = {{&one, Pose::Identity()}, {&two, T_W2}};
  TriangleMesh labelled_one = testing::Sheet({0, 0, 0.1F}, {0.08F, 0, 0}, {0, 0.1F, 0});
  testing::Append(labelled_one, testing::Sheet({0.3F, 0, 0.1F}, {0.02F, 0, 0}, {0, 0.1F, 0}));
  const SampleSet samples = SampleReconstruction(labelled_one, {100, 50000, 1});
  EXPECT_NEAR(*ScoreLabelPurity(samples, 1, truths).value, 0.8, 0.002);
  EXPECT_NEAR(*ScoreLabelPurity(samples, 2, truths).value, 0.2, 0.002);
  EXPECT_FALSE(ScoreLabelPurity(SampleSet{}, 1, truths).value);
}

TEST(FindNearestTruth, EqualsTheSmallestOfAll) {
  const TruthSurface one(testing::Model(1, testing::Sphere(0.1F, 16)));
  const TruthSurface two(testing::Model(2, testing::Box({0, 0, 0}, {0.1F, 0.2F, 0.1F})));
  const Pose T_W2(Eigen::Translation3d(0.3, 0, 0) *
                  Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()));
  const std::vector<PlacedTruth> truths = {{&one, Pose::Identity()}, {&two, T_W2}};
  const auto points = testing::RandomPoints(2000, {-0.3F, -0.3F, -0.3F}, {0.6F, 0.4F, 0.4F});
  const NearestTruth nearest = FindNearestTruth(points, truths);
  const auto to_one = one.index_O().Nearest(points).distance_m;
  const auto to_two = two.index_O().Nearest(TransformPoints(T_W2.inverse(), points)).distance_m;
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_NEAR(nearest.distance_m[i], std::min(to_one[i], to_two[i]), testing::kFloat_m);
    ASSERT_EQ(nearest.object[i], to_one[i] <= to_two[i] ? 1 : 2);
  }
}

}  // namespace
}  // namespace tsdfpp
