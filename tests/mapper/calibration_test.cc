// How the corrections of two segments whose place is known become the one of a place that was
// found.
#include "mapper/track/calibration.h"

#include <gtest/gtest.h>

namespace tsdfpp {
namespace {

constexpr double kRounding_m = 1e-12;

SdfRegistrationResult Found(const KnownDirections& known) {
  SdfRegistrationResult found;
  found.frame = {{0.1, -0.2, 0.3}, 0.05};
  found.known = known;
  return found;
}

KnownDirections Knowing(const Eigen::Vector3d& shifts, const Eigen::Vector3d& turns) {
  KnownDirections known;
  known.shift_shares = shifts;
  known.turn_shares = turns;
  return known;
}

// The same about axes of which the first is `x`.
KnownDirections About(KnownDirections known, const Eigen::Vector3d& x) {
  const Eigen::Matrix3d R =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), x).toRotationMatrix();
  known.shifts = R;
  known.turns = R;
  return known;
}

Vector6 Six(double a, double b, double c, double d, double e, double f) {
  return (Vector6() << a, b, c, d, e, f).finished();
}

class JoinedTest : public testing::Test {
 protected:
  // In the lengths of the place found.
  Vector6 Join(const KnownDirections& found, const KnownDirections& far) const {
    const SdfRegistrationResult place = Found(found);
    const Calibration near{place.frame.MotionOf(near_), {}};
    const Calibration of_far{place.frame.MotionOf(far_), far};
    return place.frame.LengthsOf(Joined(near, of_far, place));
  }

  const Vector6 near_ = Six(0.001, 0.002, -0.001, 0.0005, 0, -0.001);
  const Vector6 far_ = Six(-0.002, 0.001, 0.003, 0, 0.001, 0.002);
  const Eigen::Vector3d all_{0.2, 0.3, 0.5};
};

TEST_F(JoinedTest, WhatIsKnownAsWellIsOfTheFarOne) {
  const KnownDirections same = Knowing(all_, all_);
  EXPECT_LT((Join(same, same) - far_).norm(), kRounding_m);
  // Better, too, and about whatever axes.
  const Eigen::Vector3d aslant(1, 2, -1);
  EXPECT_LT((Join(Knowing({0.5, 0.5, 0.5}, {0.5, 0.5, 0.5}), About(same, aslant)) - far_).norm(),
            kRounding_m);
}

TEST_F(JoinedTest, WhatIsKnownLessIsOfTheNearOneByTheShare) {
  const KnownDirections far = Knowing(all_, all_);
  // Free along the first axis of shifts, known by a quarter of what the far one knows about the
  // second of turns.
  const Vector6 joined = Join(Knowing({0, 0.3, 0.5}, {0.2, 0.075, 0.5}), far);
  EXPECT_NEAR(joined[0], near_[0], kRounding_m);
  EXPECT_NEAR(joined[1], far_[1], kRounding_m);
  EXPECT_NEAR(joined[2], far_[2], kRounding_m);
  EXPECT_NEAR(joined[3], far_[3], kRounding_m);
  EXPECT_NEAR(joined[4], 0.75 * near_[4] + 0.25 * far_[4], kRounding_m);
  EXPECT_NEAR(joined[5], far_[5], kRounding_m);
}

TEST_F(JoinedTest, SharesAreThoseAlongTheDirectionsOfThePlaceFound) {
  // Of the far one a third speaks along every axis but its first, `free`.
  const Eigen::Vector3d free = Eigen::Vector3d(1, 1, 0).normalized();
  const KnownDirections far = About(Knowing({0, 1.0 / 3, 1.0 / 3}, all_), free);
  // Along x, half way between `free` and one of the others, it knows a sixth.
  const Vector6 joined = Join(Knowing({1.0 / 12, 1, 1}, all_ * 3), far);
  EXPECT_NEAR(joined[0], 0.5 * near_[0] + 0.5 * far_[0], kRounding_m);
  EXPECT_NEAR(joined[1], far_[1], kRounding_m);
}

TEST_F(JoinedTest, TheFarOneCorrectsNothingThatItDoesNotKnow) {
  // Colours may tell what turns of a ball no distance does.
  const KnownDirections ball = Knowing(all_, {0, 0, 0.01});
  const Vector6 joined = Join(Knowing(all_, all_), ball);
  EXPECT_LT((joined.head<3>() - far_.head<3>()).norm(), kRounding_m);
  EXPECT_NEAR(joined[3], near_[3], kRounding_m);
  EXPECT_NEAR(joined[4], near_[4], kRounding_m);
  EXPECT_NEAR(joined[5], 0.5 * near_[5] + 0.5 * far_[5], kRounding_m);
}

TEST_F(JoinedTest, WhereNothingIsKnownIsTheNearOne) {
  const KnownDirections nothing;
  EXPECT_LT((Join(nothing, nothing) - near_).norm(), kRounding_m);
  EXPECT_LT((Join(nothing, Knowing(all_, all_)) - near_).norm(), kRounding_m);
}

}  // namespace
}  // namespace tsdfpp
