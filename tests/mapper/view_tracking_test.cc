// The tracker with a term of the image in the pipeline.
#include <gtest/gtest.h>

#include "core/units.h"
#include "mapper/pipeline.h"
#include "tests/mapper/drawn_things.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

// A ball that turns on the spot: what its colours tell, and nothing else.
double TurnOffOfBall_rad(double colour_weight) {
  constexpr int kFrames = 12;
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.poses = PoseSource::kTrack;
  config.track.colour_weight = colour_weight;
  Pipeline pipeline(config, {{kBackground, "wall", ""}, {drawn::kThing, "ball", "ball"}});
  const auto pose_at = [](int i) {
    return MakePose(2 * kDegree * (i - 1), {0.2, 1, 0}, {0, 0, 1});
  };
  for (int i = 1; i <= kFrames; ++i) {
    EXPECT_TRUE(pipeline.Process(drawn::Draw(drawn::Ball(), pose_at(i), 1, 0, i)));
  }
  const Pose truth = pose_at(kFrames) * pose_at(1).inverse();
  const Pose& found = pipeline.trajectories().at(drawn::kThing).at(kFrames);
  return Eigen::AngleAxisd(found.linear() * truth.linear().transpose()).angle();
}

TEST(ViewTerms, ColourFollowsABallThatTurns) {
  EXPECT_GT(TurnOffOfBall_rad(0), 20 * kDegree);
  EXPECT_LT(TurnOffOfBall_rad(1), 1 * kDegree);
}

}  // namespace
}  // namespace tsdfpp
