// The settings of the tracker.
#include "mapper/track/sdf_track_config.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace tsdfpp {
namespace {

TEST(SdfTrackConfig, RoundTripsThroughToml) {
  SdfTrackConfig config;
  config.curved = false;
  config.max_slope = 3;
  config.max_fall = 2;
  config.certain_slope = 1.5;
  config.anchor_turn_rad = 0.5;
  config.rest_turn_rad = 0.06;
  config.rest_trend = 4;
  config.weak_share = 0.03;
  config.keyframe_points = 77;
  config.free_space_weight = 0.5;
  config.outline_weight = 0.25;
  config.colour_weight = 2;
  config.colour_points = 88;
  config.motion_frames = 5;
  config.motion_evidence = 7;
  config.motion_evidence_sum = 50;
  config.motion_points = 99;
  EXPECT_EQ(SdfTrackConfig::FromToml(config.ToToml(), "t").value(), config);
  EXPECT_TRUE(SdfTrackConfig().Validate());
  config.min_points = config.max_points + 1;
  const auto refused = config.Validate();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(refused.error().message,
            fmt::format("tracking setting 'min_points' is {}, expected at most 'max_points', which "
                        "is {}",
                        config.min_points, config.max_points));
  config = {};
  config.rest_trend = 5;
  EXPECT_TRUE(config.Validate());
  config.rest_frames = 1;
  const auto too_few = config.Validate();
  ASSERT_FALSE(too_few);
  EXPECT_EQ(too_few.error().message,
            "tracking setting 'rest_trend' is 5, and 1 frames have no trend: expected rest_frames "
            "of at least 2");
}

}  // namespace
}  // namespace tsdfpp
