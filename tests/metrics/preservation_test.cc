#include "metrics/preservation.h"

#include <gtest/gtest.h>

#include "metrics/mesh_tools.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kTable = 1;
constexpr InstanceId kPlate = 2;
constexpr double kTau_m = 0.01;
// The tables here are sampled with 4 a cm^2; a share of a square is uncertain only along its
// border.
constexpr double kShare = 0.002;

TriangleMesh Table(int cells = 1) {
  return testing::Sheet({-0.5F, -0.5F, 2}, {0, 1, 0}, {1, 0, 0}, cells);
}

double RecallOf(const SampleSet& samples, const TriangleMesh& reconstruction, double tau_m) {
  const Selection all = SelectAll(samples);
  const SampleMatch match =
      MatchSamples(samples, all, Pose::Identity(), SurfaceIndex(reconstruction), 2 * kTau_m);
  return ShareOf(samples, all, Reconstructed(match, tau_m), "").value.value();
}

TEST(Completion, OffsetPlaneIsItsOffset) {
  const SampleSet samples = SampleMesh(Table(), 4, 1);
  TriangleMesh larger = testing::Sheet({-1, -1, 2.004F}, {0, 2, 0}, {2, 0, 0}, 50);
  const SampleMatch match =
      MatchSamples(samples, SelectAll(samples), Pose::Identity(), SurfaceIndex(larger), kTau_m);
  const DistanceSummary summary = CompletionDistances(samples, SelectAll(samples), match);
  EXPECT_NEAR(*summary.mean_m.value, 0.004, testing::kFloat_m);
  EXPECT_NEAR(*summary.rmse_m.value, 0.004, testing::kFloat_m);
  EXPECT_NEAR(*summary.p95_m.value, 0.004, testing::kFloat_m);
  EXPECT_EQ(RecallOf(samples, larger, 0.005), 1);
  EXPECT_EQ(RecallOf(samples, larger, 0.003), 0);
}

TEST(Completion, HalfATableIsHalfComplete) {
  const SampleSet samples = SampleMesh(Table(), 4, 1);
  const TriangleMesh half = testing::Sheet({-0.5F, -0.5F, 2}, {0, 1, 0}, {0.5F, 0, 0}, 30);
  EXPECT_NEAR(RecallOf(samples, half, kTau_m), 0.5 + kTau_m, kShare);
  const SampleMatch match =
      MatchSamples(samples, SelectAll(samples), Pose::Identity(), SurfaceIndex(half), kTau_m);
  const DistanceSummary summary = CompletionDistances(samples, SelectAll(samples), match);
  // Half the samples are 0 away, the others 0 to 0.5 m evenly: mean 1/8, rmse sqrt(1/24).
  EXPECT_NEAR(*summary.mean_m.value, 0.125, 1e-3);
  EXPECT_NEAR(*summary.rmse_m.value, std::sqrt(1.0 / 24), 1e-3);
  EXPECT_NEAR(*summary.p95_m.value, 0.45, 1e-3);
}

TEST(Completion, ParallelSheetFacingAwayDoesNotCount) {
  const SampleSet samples = SampleMesh(Table(), 4, 1);
  TriangleMesh flipped = Table(20);
  EXPECT_EQ(RecallOf(samples, flipped, kTau_m), 1);
  testing::Flip(flipped);
  EXPECT_EQ(RecallOf(samples, flipped, kTau_m), 0);
}

// A wall of 4 mm, reconstructed 3 mm aside: each true side's nearest triangle is the other side's.
TEST(Completion, ThinWallIsNotLostToItsOtherSide) {
  const SampleSet samples = SampleMesh(testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.004F}), 4, 1);
  const TriangleMesh moved = testing::Box({0, 0, 0.003F}, {0.3F, 0.3F, 0.007F}, 30);
  EXPECT_EQ(RecallOf(samples, moved, kTau_m), 1);
  // With one side only, the other is missing (its narrow edges, 1.6 % of the area, aside).
  TriangleMesh front = testing::Sheet({0, 0, 0.003F}, {0.3F, 0, 0}, {0, 0.3F, 0}, 30);
  EXPECT_NEAR(RecallOf(samples, front, kTau_m), 0.5, 0.02);
}

// A box reconstructed 4 mm too small: near its edges the nearest face is often the wrong one.
TEST(Completion, SharpEdgesCount) {
  const SampleSet samples = SampleMesh(testing::Box({0, 0, 0}, {0.1F, 0.1F, 0.1F}), 4, 1);
  const TriangleMesh shrunk = testing::Box({0.004F, 0.004F, 0.004F}, {0.096F, 0.096F, 0.096F}, 12);
  EXPECT_EQ(RecallOf(samples, shrunk, kTau_m), 1);
}

TEST(Completion, PosesPlaceTheSamples) {
  const SampleSet samples_O = SampleMesh(Table(), 1, 1);
  const Pose T_WO(Eigen::Translation3d(1, 2, 3) *
                  Eigen::AngleAxisd(1.1, Eigen::Vector3d(3, 1, 2).normalized()));
  TriangleMesh placed = Table(20);
  placed.vertices = TransformPoints(T_WO, placed.vertices);
  const Selection all = SelectAll(samples_O);
  const SampleMatch match = MatchSamples(samples_O, all, T_WO, SurfaceIndex(placed), kTau_m);
  EXPECT_EQ(Reconstructed(match, 1e-5), all);
}

TEST(Completion, EmptyReconstruction) {
  const SampleSet samples = SampleMesh(Table(), 1, 1);
  const Selection all = SelectAll(samples);
  const SampleMatch match =
      MatchSamples(samples, all, Pose::Identity(), SurfaceIndex(TriangleMesh{}), kTau_m);
  EXPECT_EQ(RecallOf(samples, TriangleMesh{}, kTau_m), 0);
  const DistanceSummary summary = CompletionDistances(samples, all, match);
  EXPECT_FALSE(summary.mean_m.value);
  EXPECT_EQ(summary.mean_m.why_not, "the reconstruction is empty");
}

TEST(Completion, FScore) {
  EXPECT_NEAR(*FScore(Measured::Of(0.5), Measured::Of(1)).value, 2.0 / 3, 1e-12);
  EXPECT_EQ(*FScore(Measured::Of(0), Measured::Of(0)).value, 0);
  EXPECT_EQ(FScore(Measured::Undefined("why"), Measured::Of(1)).why_not, "why");
}

// Three frames of the bare table, then a plate of 30 cm at half the distance hides 60 cm of it.
class HiddenTable : public ::testing::Test {
 protected:
  HiddenTable() : tracker_(SampleMesh(Table(), 4, 1), kTable) {
    const Frame bare = testing::CastFrame([](double, double) { return testing::Hit{2, kTable}; });
    const Frame covered = testing::CastFrame([](double x, double y) {
      const bool plate = std::abs(x) < 0.15 && std::abs(y) < 0.15;
      return plate ? testing::Hit{1, kPlate} : testing::Hit{2, kTable};
    });
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(tracker_.Observe(bare, Pose::Identity()));
    visible_before_ = SelectSeenWith(tracker_, SampleStatus::kVisible, All());
    EXPECT_TRUE(tracker_.Observe(covered, Pose::Identity()));
  }
  Selection All() const { return SelectAll(tracker_.samples_O()); }
  // The table without a square of this side in its middle.
  Selection WithHole(float side_m) const {
    const float half = side_m / 2;
    TriangleMesh holed = testing::Sheet({-0.5F, -0.5F, 2}, {0, 1, 0}, {0.5F - half, 0, 0}, 20);
    testing::Append(holed, testing::Sheet({half, -0.5F, 2}, {0, 1, 0}, {0.5F - half, 0, 0}, 20));
    testing::Append(holed,
                    testing::Sheet({-half, -0.5F, 2}, {0, 0.5F - half, 0}, {side_m, 0, 0}, 20));
    testing::Append(holed,
                    testing::Sheet({-half, half, 2}, {0, 0.5F - half, 0}, {side_m, 0, 0}, 20));
    const SampleMatch match =
        MatchSamples(tracker_.samples_O(), All(), Pose::Identity(), SurfaceIndex(holed), kTau_m);
    return Reconstructed(match, kTau_m);
  }

  SeenTracker tracker_;
  Selection visible_before_;
};

TEST_F(HiddenTable, KnownHole) {
  LastSeenStore store(tracker_.samples_O().size());
  store.Update(All(), visible_before_);
  const PreservationScores scores = ScorePreservation(tracker_, All(), WithHole(0.2F), store);
  // A point within tau of the hole's border counts as reconstructed: 18 cm x 18 cm are left.
  constexpr double kHole_cm2 = 18 * 18;
  // A pixel of the outline is 6.7 mm on the table, over a perimeter of 2.4 m.
  constexpr double kOutline_cm2 = 0.5 * 0.67 * 240;
  EXPECT_NEAR(*scores.hole_area_cm2.value, kHole_cm2, 4);
  EXPECT_NEAR(scores.behind_other_area_cm2, 3600, kOutline_cm2);
  EXPECT_EQ(scores.hidden_area_cm2, scores.behind_other_area_cm2);
  EXPECT_NEAR(scores.visible_area_cm2, 6400, kOutline_cm2);
  EXPECT_NEAR(*scores.preservation.value, 1 - kHole_cm2 / scores.hidden_area_cm2, kShare);
  EXPECT_EQ(*scores.retention.value, *scores.preservation.value) << "all was there before";
  EXPECT_EQ(*scores.visible_completion.value, 1);
  EXPECT_NEAR(*scores.completion.value, 1 - kHole_cm2 / 1e4, kShare);
  EXPECT_FALSE(scores.preservation_outside.value);
  EXPECT_EQ(scores.preservation_outside.why_not, "no seen sample is outside the image now");
}

// The camera turns away from a table of which a plate hides the middle: each cause has its own set.
TEST_F(HiddenTable, EachCauseHasItsOwnScores) {
  LastSeenStore store(tracker_.samples_O().size());
  store.Update(All(), visible_before_);
  // Under the plate all is kept, but half of it under another label: so the label-aware score
  // loses it.
  const Selection all = All();
  Selection kept = all;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    kept[i] = tracker_.samples_O().points[i].x() > 0 ? 1 : 0;
  }
  PreservationScores scores = ScorePreservation(tracker_, All(), kept, store, &all);
  const HiddenScores& behind_other = scores.by_cause[0];
  EXPECT_EQ(behind_other.area_cm2, scores.behind_other_area_cm2);
  EXPECT_NEAR(*behind_other.preservation.value, 0.5, 0.02);
  EXPECT_EQ(*behind_other.any_label.value, 1);
  EXPECT_NEAR(*behind_other.lost_area_cm2.value, 1800, 0.5 * 0.5 * 0.67 * 240);
  EXPECT_EQ(*behind_other.retention.value, *behind_other.preservation.value);
  EXPECT_EQ(scores.by_cause[1].area_cm2, 0);
  EXPECT_FALSE(scores.by_cause[1].lost_area_cm2.value);
  EXPECT_EQ(scores.by_cause[2].any_label.why_not, "no seen sample is outside the image now");
  EXPECT_FALSE(ScorePreservation(tracker_, All(), kept, store).by_cause[0].any_label.value);

  // Looking the other way, all is outside; turned over, all is behind itself.
  Frame away = testing::CastFrame([](double, double) { return testing::Hit{2, kTable}; });
  away.T_WC = Pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY()));
  ASSERT_TRUE(tracker_.Observe(away, Pose::Identity()));
  scores = ScorePreservation(tracker_, All(), kept, store, &all);
  EXPECT_NEAR(scores.by_cause[2].area_cm2, 1e4, 1);
  EXPECT_NEAR(*scores.by_cause[2].preservation.value, 0.5, kShare);
  EXPECT_EQ(scores.by_cause[0].area_cm2, 0);
  EXPECT_FALSE(scores.hole_area_cm2.value);
  away.T_WC = Pose(Eigen::Translation3d(0, 0, 4)) * away.T_WC;
  ASSERT_TRUE(tracker_.Observe(away, Pose::Identity()));
  scores = ScorePreservation(tracker_, All(), kept, store, &all);
  EXPECT_NEAR(scores.by_cause[1].area_cm2, 1e4, 1);
  EXPECT_NEAR(*scores.preservation_behind_itself.value, 0.5, kShare);
}

// What was never mapped is not forgotten: the same hole before and after is a retention of 1.
TEST_F(HiddenTable, RetentionIsolatesForgetting) {
  LastSeenStore store(tracker_.samples_O().size());
  EXPECT_EQ(ScorePreservation(tracker_, All(), WithHole(0.2F), store).retention.why_not,
            "no hidden sample was visible at an evaluated frame");
  store.Update(WithHole(0.2F), visible_before_);
  EXPECT_EQ(*ScorePreservation(tracker_, All(), WithHole(0.2F), store).retention.value, 1);
  const PreservationScores worse = ScorePreservation(tracker_, All(), WithHole(0.4F), store);
  EXPECT_NEAR(*worse.retention.value, (3600.0 - 38 * 38) / (3600 - 18 * 18), 0.01);
  EXPECT_LT(*worse.preservation.value, *worse.retention.value);
  // A later look at the visible part leaves what is known of the hidden part as it was.
  store.Update(Selection(visible_before_.size(), 0),
               SelectSeenWith(tracker_, SampleStatus::kVisible, All()));
  EXPECT_EQ(*ScorePreservation(tracker_, All(), WithHole(0.2F), store).retention.value, 1);
  store.Update(Selection(visible_before_.size(), 0), visible_before_);
  EXPECT_EQ(ScorePreservation(tracker_, All(), WithHole(0.2F), store).retention.why_not,
            "no hidden sample was reconstructed when last seen");
}

// Half of a table that a plate hides from the first frame on was never seen: it is no loss.
TEST(Preservation, WhatWasNeverSeenDoesNotCount) {
  SeenTracker tracker(SampleMesh(Table(), 4, 1), kTable);
  const Frame half = testing::CastFrame([](double x, double) {
    return x > 0 ? testing::Hit{1, kPlate} : testing::Hit{2, kTable};
  });
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(tracker.Observe(half, Pose::Identity()));
  Selection kept = SelectAll(tracker.samples_O());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    kept[i] = tracker.samples_O().points[i].x() < 0 ? 1 : 0;
  }
  const PreservationScores scores =
      ScorePreservation(tracker, SelectAll(tracker.samples_O()), kept, LastSeenStore(kept.size()));
  // A pixel is 6.7 mm on the table, over its metre.
  EXPECT_NEAR(scores.seen_area_cm2, 5000, 0.67 * 100);
  EXPECT_GT(*scores.completion.value, 0.98);
  EXPECT_LT(scores.hidden_area_cm2, 0.67 * 100);
}

TEST_F(HiddenTable, RegionsAreScoredAlone) {
  LastSeenStore store(tracker_.samples_O().size());
  const PreservationScores none =
      ScorePreservation(tracker_, SelectRegion(tracker_.samples_O(), 5), All(), store);
  EXPECT_FALSE(none.completion.value);
  EXPECT_FALSE(none.hole_area_cm2.value);
  EXPECT_EQ(SelectRegion(tracker_.samples_O(), 0), All());
}

}  // namespace
}  // namespace tsdfpp
