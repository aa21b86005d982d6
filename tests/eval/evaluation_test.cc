// Scores of scene meshes that are made by hand, so that each value is known: what is sampled, what
// is removed, who is counted. Longer than most files: each rule has a scene of its own.
#include "eval/score/evaluation.h"

#include <gtest/gtest.h>

#include "eval/score/evaluation_columns.h"
#include "metrics/mesh_tools.h"
#include "tests/eval/table_world.h"

namespace tsdfpp {
namespace {

using test::kCar;
using test::kCup;
using test::kFrames;
using test::kHouse;
using test::kJump;
using test::ObjectMesh;
using test::TableMesh;
using test::Together;

constexpr double kScoreVoxel_m = 0.01;
// Reconstructions are sampled once a square centimetre, in even strata: the border of a patch may
// fall to either side of it by a sample or two.
constexpr double kTwoSamples_m2 = 2e-4;
// Single precision at a metre, twice.
constexpr double kRoundedOff_m = 2e-6;

const std::set<InstanceId> kMovers{kCar, kCup};

double NumberOf(const Measured& measured) {
  EXPECT_TRUE(measured.value.has_value()) << measured.why_not;
  return measured.value.value_or(-1);
}

// The world after a frame.
struct Watched {
  explicit Watched(int last = kFrames)
      : truth(*SceneTruth::Create(world)), stores(MakeLastSeenStores(truth)) {
    ObserveUntil(last);
  }
  void ObserveUntil(int last) {
    for (; seen < last; ++seen) EXPECT_TRUE(truth.Observe(*world.Read(seen + 1)).has_value());
  }
  Evaluation Score(SceneMeshes meshes, double voxel_m = kScoreVoxel_m) {
    return EvaluateMeshes(std::move(meshes), truth, world.info().objects, kMovers, voxel_m, stores);
  }
  // By area, the part of what was seen of object i (where `visible`: and is visible now) that is as
  // `is` says.
  template <typename Is>
  double Share(std::size_t i, bool visible, const Is& is) const {
    const SeenTracker& tracker = truth.trackers()[i];
    double part = 0;
    double all = 0;
    for (std::size_t k = 0; k < tracker.status().size(); ++k) {
      if (!tracker.Seen(k) || (visible && tracker.status()[k] != SampleStatus::kVisible)) continue;
      const double area = tracker.samples_O().area_m2[k];
      all += area;
      if (is(tracker.samples_O().points[k], tracker.samples_O().region[k])) part += area;
    }
    return part / all;
  }
  double VisibleArea_m2(std::size_t i, std::uint16_t region) const {
    const SeenTracker& tracker = truth.trackers()[i];
    double area = 0;
    for (std::size_t k = 0; k < tracker.status().size(); ++k) {
      if (!tracker.Seen(k) || tracker.status()[k] != SampleStatus::kVisible) continue;
      if (tracker.samples_O().region[k] == region) area += tracker.samples_O().area_m2[k];
    }
    return area;
  }

  test::TableWorld world;
  SceneTruth truth;
  LastSeenStores stores;
  int seen = 0;
};

// The true surface of everything but `missing`.
TriangleMesh AllBut(const std::set<InstanceId>& missing, int frame = kFrames) {
  TriangleMesh mesh;
  if (!missing.contains(kBackground)) mesh = Together({TableMesh(), test::FloorMesh()});
  for (const InstanceId id : {kCar, kHouse, kCup}) {
    if (!missing.contains(id)) testing::Append(mesh, ObjectMesh(id, frame));
  }
  return mesh;
}

// What a map without a fault would show.
SceneMeshes TrueMeshes(int frame = kFrames) {
  SceneMeshes meshes;
  meshes.scene = AllBut({}, frame);
  for (const auto& removed : RemovalsOf(kMovers)) meshes.without[removed] = AllBut(removed, frame);
  return meshes;
}

TEST(Evaluation, TheTruthScoresFull) {
  Watched watched;
  const Evaluation evaluation = watched.Score(TrueMeshes());
  EXPECT_EQ(evaluation.frame, kFrames);
  ASSERT_EQ(evaluation.objects.size(), 4U);
  for (const ObjectScores& scores : evaluation.objects) {
    EXPECT_EQ(scores.info, watched.world.info().objects[scores.info.id]);
    EXPECT_EQ(scores.preserved.completion.value, 1.0) << scores.info.name;
    EXPECT_EQ(scores.visible_completion.value, 1.0) << scores.info.name;
    EXPECT_EQ(scores.label_purity.value, 1.0) << scores.info.name;
    EXPECT_EQ(scores.f_score[0].value, 1.0) << scores.info.name;
    EXPECT_LT(NumberOf(scores.accuracy.distance.mean_m), kRoundedOff_m) << scores.info.name;
    EXPECT_LT(NumberOf(scores.completion.mean_m), kRoundedOff_m) << scores.info.name;
  }
  // The car hides table that was seen bare.
  const PreservationScores& table = evaluation.objects.front().preserved;
  EXPECT_GT(table.behind_other_area_cm2, 50);
  EXPECT_EQ(table.preservation_behind_other.value, 1.0);
  EXPECT_EQ(table.by_cause.front().any_label.value, 1.0);
  EXPECT_EQ(evaluation.visible_completion.value, 1.0);
  EXPECT_EQ(evaluation.ghost_area_m2, 0);
  EXPECT_EQ(evaluation.revealed_ghost_area_m2.value, 0.0);
  EXPECT_EQ(evaluation.sanity.all.value, 1.0);
}

// The map loses the objects, the world does not.
TEST(Evaluation, CrustOfARemovedCarUnderTheTablesNameIsImpureAndAGhost) {
  Watched watched;
  SceneMeshes meshes = TrueMeshes();
  const Eigen::Vector3f half = test::HalfOf(kCar);
  TriangleMesh crust = testing::Sheet(
      test::CentreAt(kCar, kFrames) + Eigen::Vector3f(-half.x(), -half.y(), half.z()),
      {2 * half.x(), 0, 0}, {0, 2 * half.y(), 0});
  testing::Label(crust, kBackground);
  const TriangleMesh bare = Together({TableMesh(), ObjectMesh(kHouse, kFrames)});
  meshes.without[kMovers] = Together({bare, crust});
  const Evaluation evaluation = watched.Score(std::move(meshes));
  const double table_m2 = SurfaceArea(TableMesh());
  const double crust_m2 = SurfaceArea(crust);
  ASSERT_NEAR(crust_m2, 0.12 * 0.08, 1e-6);
  EXPECT_NEAR(NumberOf(evaluation.objects.front().label_purity), table_m2 / (table_m2 + crust_m2),
              kTwoSamples_m2 / (table_m2 + crust_m2));
  EXPECT_NEAR(NumberOf(evaluation.revealed_ghost_area_m2), crust_m2, kTwoSamples_m2);
  EXPECT_EQ(evaluation.ghost_area_m2, 0);
}

TEST(Evaluation, OfTheBackgroundTheTableIsScored) {
  Watched watched;
  SceneMeshes no_floor = TrueMeshes();
  no_floor.scene = Together({TableMesh(), AllBut({kBackground})});
  no_floor.without[kMovers] = Together({TableMesh(), ObjectMesh(kHouse, kFrames)});
  const Evaluation table = watched.Score(std::move(no_floor));
  EXPECT_EQ(table.objects.front().preserved.completion.value, 1.0);
  EXPECT_EQ(table.objects.front().recall[1].value, 1.0);
  EXPECT_EQ(table.objects.front().visible_completion.value, 1.0);
  // All that is visible counts, by area, however densely it is sampled.
  double all = watched.VisibleArea_m2(kBackground, 0) + watched.VisibleArea_m2(kBackground, 1);
  for (const InstanceId id : {kCar, kHouse, kCup}) all += watched.VisibleArea_m2(id, 0);
  const double floor = watched.VisibleArea_m2(kBackground, 0);
  ASSERT_GT(floor, 0.01);
  EXPECT_NEAR(NumberOf(table.visible_completion), 1 - floor / all, 1e-9);

  // A floor that is wrong costs the table nothing, and is no table.
  SceneMeshes no_table = TrueMeshes();
  no_table.scene = Together({test::FloorMesh(0.03F), AllBut({kBackground})});
  no_table.without[kMovers] = Together({test::FloorMesh(0.03F), ObjectMesh(kHouse, kFrames)});
  const Evaluation lost = watched.Score(std::move(no_table));
  EXPECT_EQ(lost.objects.front().preserved.completion.value, 0.0);
  EXPECT_EQ(lost.objects.front().visible_completion.value, 0.0);
  EXPECT_FALSE(lost.objects.front().accuracy.distance.mean_m.value.has_value());
}

TEST(Evaluation, AMoverIsScoredWithoutTheOthersAndAllElseWithoutAllOfThem) {
  Watched watched;
  SceneMeshes meshes;
  // Half of the car is there once the cup is removed.
  const Eigen::Vector3f half = test::HalfOf(kCar);
  const Eigen::Vector3f quarter(half.x() / 2, half.y(), half.z());
  const Eigen::Vector3f left = test::CentreAt(kCar, kFrames) - Eigen::Vector3f(half.x() / 2, 0, 0);
  meshes.without[{kCup}] = test::BoxAround(left, quarter, kCar);
  meshes.without[{kCar}] = ObjectMesh(kCar, kFrames);
  meshes.without[kMovers] = Together({TableMesh(), ObjectMesh(kCar, kFrames)});
  meshes.scene = Together({ObjectMesh(kHouse, kFrames), ObjectMesh(kCup, kFrames)});
  const Evaluation evaluation = watched.Score(std::move(meshes));
  const auto& objects = evaluation.objects;
  // The cut through its middle holds what is within a voxel of it.
  const double half_seen =
      watched.Share(kCar, false, [](const Eigen::Vector3f& p, int) { return p.x() < 0; });
  const double and_a_voxel = watched.Share(kCar, false, [](const Eigen::Vector3f& p, int) {
    return p.x() < 1.01F * static_cast<float>(kScoreVoxel_m);
  });
  EXPECT_GE(NumberOf(objects[kCar].preserved.completion), half_seen);
  EXPECT_LE(NumberOf(objects[kCar].preserved.completion), and_a_voxel);
  EXPECT_LT(and_a_voxel, 0.8);
  // Its underside, which nobody saw, counts in neither.
  EXPECT_EQ(objects[kCar].recall[1].value, objects[kCar].preserved.completion.value);
  EXPECT_EQ(objects[kCup].preserved.completion.value, 0.0);
  EXPECT_EQ(objects[kHouse].preserved.completion.value, 0.0);
  EXPECT_EQ(objects[kBackground].preserved.completion.value, 1.0);
  // What the camera sees is asked of the scene as it is.
  EXPECT_EQ(objects[kCar].visible_completion.value, 0.0);
  EXPECT_EQ(objects[kCup].visible_completion.value, 1.0);
  EXPECT_EQ(objects[kHouse].visible_completion.value, 1.0);
  EXPECT_EQ(objects[kBackground].visible_completion.value, 0.0);
  EXPECT_EQ(evaluation.revealed.triangles.size(), 24U);
  // Of the table's own samples, for pictures.
  ASSERT_EQ(evaluation.table_reconstructed.size(), watched.truth.trackers()[0].status().size());
  for (std::size_t k = 0; k < evaluation.table_reconstructed.size(); ++k) {
    const SeenTracker& tracker = watched.truth.trackers().front();
    if (!tracker.Seen(k)) continue;
    ASSERT_EQ(evaluation.table_reconstructed[k] != 0, tracker.samples_O().region[k] == 1) << k;
  }
}

TEST(Evaluation, WhatIsKeptUnderAnotherNameIsKeptForAnyLabelOnly) {
  Watched watched;
  SceneMeshes meshes = TrueMeshes();
  meshes.without[kMovers] = Together({TableMesh(kHouse), ObjectMesh(kHouse, kFrames)});
  const Evaluation evaluation = watched.Score(std::move(meshes));
  const PreservationScores& table = evaluation.objects.front().preserved;
  EXPECT_EQ(table.preservation_behind_other.value, 0.0);
  EXPECT_EQ(table.by_cause.front().any_label.value, 1.0);
}

TEST(Evaluation, RetentionIsOverWhatWasThereWhenLastSeen) {
  Watched watched(kJump - 1);
  watched.Score(TrueMeshes(kJump - 1));
  watched.ObserveUntil(kFrames);
  SceneMeshes lost = TrueMeshes();
  lost.without[kMovers] = ObjectMesh(kHouse, kFrames);
  EXPECT_EQ(watched.Score(std::move(lost)).objects.front().preserved.retention_behind_other.value,
            0.0);
  EXPECT_EQ(watched.Score(TrueMeshes()).objects.front().preserved.retention_behind_other.value,
            1.0);

  Watched never(kJump - 1);
  SceneMeshes bare = TrueMeshes(kJump - 1);
  bare.without[kMovers] = ObjectMesh(kHouse, kJump - 1);
  never.Score(std::move(bare));
  never.ObserveUntil(kFrames);
  EXPECT_FALSE(
      never.Score(TrueMeshes()).objects.front().preserved.retention_behind_other.value.has_value());
}

TEST(Evaluation, ThresholdsAreInVoxels) {
  Watched watched;
  constexpr float kGrown_m = 0.007F;
  const auto score = [&](double voxel_m) {
    SceneMeshes meshes = TrueMeshes();
    meshes.without[kMovers] =
        Together({TableMesh(kBackground, kGrown_m), ObjectMesh(kHouse, kFrames)});
    return watched.Score(std::move(meshes), voxel_m).objects.front();
  };
  const ObjectScores fine = score(0.01);
  EXPECT_EQ(fine.recall[0].value, 0.0);
  EXPECT_EQ(fine.recall[1].value, 1.0);
  EXPECT_EQ(fine.preserved.completion.value, 1.0);
  EXPECT_EQ(fine.accuracy.precision[0].value, 0.0);
  EXPECT_GT(NumberOf(fine.accuracy.precision[1]), 0.9);  // its corners are farther out
  EXPECT_EQ(fine.accuracy.precision[2].value, 1.0);
  const double p = NumberOf(fine.accuracy.precision[1]);
  EXPECT_NEAR(NumberOf(fine.f_score[1]), 2 * p / (p + 1), 1e-12);
  EXPECT_NEAR(NumberOf(fine.completion.mean_m), kGrown_m, kRoundedOff_m);
  EXPECT_NEAR(NumberOf(fine.accuracy.bias_m), NumberOf(fine.accuracy.distance.mean_m),
              kRoundedOff_m);
  EXPECT_EQ(score(0.02).recall[0].value, 1.0);
  const ObjectScores finest = score(0.006);
  EXPECT_EQ(finest.preserved.completion.value, 0.0);
  EXPECT_EQ(finest.recall[2].value, 1.0);
}

TEST(Evaluation, AThingInFreeSpaceIsAGhost) {
  Watched watched;
  constexpr float kSide_m = 0.1F;
  // Over the table alone: of rays that end nowhere nothing is known.
  TriangleMesh sheet = testing::Sheet({-0.07F, -0.2F, 0.08F}, {kSide_m, 0, 0}, {0, kSide_m, 0});
  testing::Label(sheet, kCup);
  SceneMeshes meshes = TrueMeshes();
  const double all_m2 = SurfaceArea(meshes.scene) + SurfaceArea(sheet);
  testing::Append(meshes.scene, sheet);
  const Evaluation evaluation = watched.Score(std::move(meshes));
  EXPECT_NEAR(evaluation.ghost_area_m2, kSide_m * kSide_m, kTwoSamples_m2);
  EXPECT_NEAR(NumberOf(evaluation.ghost_share), evaluation.ghost_area_m2 / all_m2, 1e-6);
  EXPECT_EQ(evaluation.revealed_ghost_area_m2.value, 0.0);
  EXPECT_LT(NumberOf(evaluation.sanity.all), 1.0);
}

TEST(Evaluation, WithoutLabelsAnObjectHasWhatIsNearestToIt) {
  Watched watched;
  constexpr float kGrown_m = 0.004F;
  SceneMeshes meshes;
  meshes.labelled = false;
  meshes.scene = Together({AllBut({kCar}), ObjectMesh(kCar, kFrames, kGrown_m)});
  meshes.scene.face_ids.clear();
  const Evaluation evaluation = watched.Score(std::move(meshes));
  EXPECT_FALSE(evaluation.labelled);
  EXPECT_LT(NumberOf(evaluation.objects[kHouse].accuracy.distance.mean_m), kRoundedOff_m);
  EXPECT_LT(NumberOf(evaluation.objects[kBackground].accuracy.distance.mean_m), 1e-4);
  EXPECT_NEAR(NumberOf(evaluation.objects[kCar].accuracy.distance.p95_m), kGrown_m, 0.002);
  for (const ObjectScores& scores : evaluation.objects) {
    EXPECT_EQ(scores.preserved.completion.value, 1.0) << scores.info.name;
    EXPECT_EQ(scores.visible_completion.value, 1.0) << scores.info.name;
    EXPECT_FALSE(scores.label_purity.value.has_value()) << scores.info.name;
  }
  EXPECT_FALSE(evaluation.revealed_ghost_area_m2.value.has_value());
}

TEST(Removals, AreAllMoversAndAllOthersOfEach) {
  using Sets = std::set<std::set<InstanceId>>;
  EXPECT_EQ(RemovalsOf({1, 3}), (Sets{{1, 3}, {1}, {3}}));
  EXPECT_EQ(RemovalsOf({1, 3, 7}), (Sets{{1, 3, 7}, {1, 3}, {1, 7}, {3, 7}}));
  EXPECT_EQ(RemovalsOf({1}), (Sets{{1}, {}}));
  EXPECT_EQ(RemovalsOf({}), (Sets{{}}));
}

TEST(Removals, ActOnCopiesOfTheMap) {
  test::TableWorld world;
  MapConfig config;
  config.voxel_m = 0.02;
  const auto map = MakeMap(Method::kTsdfpp, config);
  for (int index = 1; index <= 3; ++index) {
    const Frame frame = *world.Read(index);
    for (const auto& [id, T_WO] : frame.T_WO) map->SetObjectPose(id, T_WO);
    map->Fuse(frame, frame.mask);
  }
  SceneMesher mesher;
  const SceneMeshes meshes = MeshesOf(*map, kMovers, mesher);
  const auto ids = [](const TriangleMesh& mesh) {
    return std::set<InstanceId>(mesh.face_ids.begin(), mesh.face_ids.end());
  };
  EXPECT_TRUE(meshes.labelled);
  ASSERT_EQ(meshes.without.size(), 3U);
  EXPECT_EQ(ids(meshes.without.at({kCar})), (std::set<InstanceId>{kBackground, kHouse, kCup}));
  EXPECT_EQ(ids(meshes.without.at({kCup})), (std::set<InstanceId>{kBackground, kCar, kHouse}));
  EXPECT_EQ(ids(meshes.without.at(kMovers)), (std::set<InstanceId>{kBackground, kHouse}));
  const std::set<InstanceId> all{kBackground, kCar, kHouse, kCup};
  EXPECT_EQ(ids(meshes.scene), all);
  EXPECT_EQ(ids(map->SceneMesh()), all);
  EXPECT_EQ(&meshes.Without({}), &meshes.scene);
}

double ColumnOf(const std::string& name, const Evaluation& evaluation) {
  for (const EvaluationColumn& column : EvaluationColumns()) {
    if (column.csv == name) return column.value(kMovers, evaluation).value.value_or(-1);
  }
  ADD_FAILURE() << "no column " << name;
  return -1;
}

// Every figure of its own, so that none can stand for another.
TEST(EvaluationColumns, SayWhatTheirNamesSay) {
  Evaluation evaluation;
  for (const InstanceId id : {kBackground, kCar, kHouse, kCup}) {
    ObjectScores& scores = evaluation.objects.emplace_back();
    scores.info.id = id;
    const double tenth = 0.1 * id;
    scores.preserved.completion = Measured::Of(0.5 + tenth);
    scores.preserved.preservation_behind_other = Measured::Of(0.02 + tenth);
    scores.preserved.retention_behind_other = Measured::Of(0.03 + tenth);
    scores.preserved.hole_area_cm2 = Measured::Of(4 + id);
    scores.preserved.by_cause[0].any_label = Measured::Of(0.05 + tenth);
    scores.preserved.by_cause[1].any_label = Measured::Of(0.051 + tenth);
    scores.visible_completion = Measured::Of(0.06 + tenth);
    scores.label_purity = Measured::Of(0.07 + tenth);
  }
  evaluation.visible_completion = Measured::Of(0.81);
  evaluation.ghost_area_m2 = 0.0009;
  evaluation.revealed_ghost_area_m2 = Measured::Of(0.0011);
  evaluation.revealed_unseen_area_m2 = Measured::Of(0.0013);
  evaluation.seams.beside_objects = {Measured::Of(0.71), Measured::Of(0.72), 0.0017, 0.0019};
  evaluation.seams.elsewhere = {Measured::Of(0.73), Measured::Of(0.74), 0.0021, 0.0023};
  evaluation.sanity.all = Measured::Of(0.95);
  evaluation.sanity.by_object[kCar] = Measured::Of(0.91);
  evaluation.sanity.by_object[kHouse] = Measured::Of(0.93);
  evaluation.sanity.by_object[kCup] = Measured::Undefined("not seen");
  std::set<std::string> asked;
  const auto column = [&](const std::string& name) {
    asked.insert(name);
    return ColumnOf(name, evaluation);
  };
  EXPECT_EQ(column("table_preservation_behind_other"), 0.02);
  EXPECT_EQ(column("table_retention_behind_other"), 0.03);
  EXPECT_EQ(column("table_hole_area_cm2"), 4);
  EXPECT_EQ(column("visible_completion"), 0.81);
  EXPECT_EQ(column("table_visible_completion"), 0.06);
  // The mean of car and cup; the house is none of them.
  EXPECT_DOUBLE_EQ(column("movers_completion"), (0.6 + 0.8) / 2);
  EXPECT_DOUBLE_EQ(column("ghost_area_cm2"), 9);
  EXPECT_DOUBLE_EQ(column("revealed_ghost_area_cm2"), 11);
  EXPECT_DOUBLE_EQ(column("revealed_unseen_area_cm2"), 13);
  EXPECT_EQ(column("seam_share"), 0.71);
  EXPECT_DOUBLE_EQ(column("seam_area_cm2"), 17);
  EXPECT_EQ(column("bulge_share"), 0.72);
  EXPECT_EQ(column("sanity_all"), 0.95);
  EXPECT_EQ(column("sanity_least"), 0.91);
  EXPECT_EQ(column("table_preservation_any_label"), 0.05);
  EXPECT_EQ(column("table_label_purity"), 0.07);
  // A mover that was never seen is not counted; without any there is no mean.
  evaluation.objects[kCup].preserved.completion = Measured::Undefined("not seen");
  EXPECT_EQ(column("movers_completion"), 0.6);
  evaluation.objects[kCar].preserved.completion = Measured::Undefined("not seen");
  EXPECT_EQ(column("movers_completion"), -1);
  for (const EvaluationColumn& each : EvaluationColumns()) {
    EXPECT_TRUE(asked.contains(each.csv)) << each.csv << " has no line here";
  }
}

}  // namespace
}  // namespace tsdfpp
