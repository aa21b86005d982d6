// What is known of the truth after each frame of a small world.
#include "eval/truth/scene_truth.h"

#include <gtest/gtest.h>

#include "tests/eval/table_world.h"

namespace tsdfpp {
namespace {

using test::kCar;
using test::kCup;
using test::kHouse;
using test::kJump;

Expected<void> ObserveUntil(SceneTruth& truth, test::TableWorld& world, int last) {
  const int first = truth.recent().empty() ? 1 : truth.recent().back().index + 1;
  for (int index = first; index <= last; ++index) {
    TSDFPP_ASSIGN(const Frame frame, world.Read(index));
    TSDFPP_RETURN_IF_ERROR(truth.Observe(frame));
  }
  return {};
}

TEST(SceneTruth, HasTheObjectsInTheOrderOfTheirIds) {
  test::TableWorld world;
  const auto truth = SceneTruth::Create(world);
  ASSERT_TRUE(truth.has_value());
  ASSERT_EQ(truth->trackers().size(), 4U);
  for (InstanceId id = 0; id < 4; ++id) {
    EXPECT_EQ(truth->trackers()[id].id(), id);
    EXPECT_EQ(truth->surface(id).id(), id);
    EXPECT_EQ(truth->surface(id).model().info.name, world.info().objects[id].name);
  }
}

TEST(SceneTruth, HasMovedWhatHasAnotherPoseThanBefore) {
  test::TableWorld world;
  auto truth = SceneTruth::Create(world);
  ASSERT_TRUE(truth.has_value());
  ASSERT_TRUE(ObserveUntil(*truth, world, kJump - 1).has_value());
  EXPECT_TRUE(truth->moved().empty());
  ASSERT_TRUE(ObserveUntil(*truth, world, kJump).has_value());
  EXPECT_EQ(truth->moved(), (std::set<InstanceId>{kCar, kCup}));
  EXPECT_EQ(truth->trajectories().at(kHouse).size(), static_cast<std::size_t>(kJump));

  // Who has no pose in a frame stays, and those who have moved have moved.
  Frame blind = *world.Read(kJump + 1);
  blind.T_WO.clear();
  ASSERT_TRUE(truth->Observe(blind).has_value());
  EXPECT_EQ(truth->T_WO(kCar).translation().cast<float>(), test::CentreAt(kCar, kJump));
  EXPECT_EQ(truth->moved(), (std::set<InstanceId>{kCar, kCup}));
  EXPECT_FALSE(truth->trajectories().at(kCar).contains(kJump + 1));
}

TEST(SceneTruth, PlacesAllSurfacesButTheRemovedWhereTheyAreNow) {
  test::TableWorld world;
  auto truth = SceneTruth::Create(world);
  ASSERT_TRUE(truth.has_value());
  ASSERT_TRUE(ObserveUntil(*truth, world, kJump).has_value());
  const auto ids = [&](const std::set<InstanceId>& removed) {
    std::vector<InstanceId> placed;
    for (const PlacedTruth& one : truth->PlacedWithout(removed))
      placed.push_back(one.surface->id());
    return placed;
  };
  EXPECT_EQ(ids({}), (std::vector<InstanceId>{kBackground, kCar, kHouse, kCup}));
  EXPECT_EQ(ids({kCar, kCup}), (std::vector<InstanceId>{kBackground, kHouse}));
  for (const PlacedTruth& placed : truth->PlacedWithout({kBackground})) {
    EXPECT_EQ(placed.T_WO.translation().cast<float>(), test::CentreAt(placed.surface->id(), kJump));
  }
}

TEST(SceneTruth, KeepsTheLastThreeFrames) {
  test::TableWorld world;
  auto truth = SceneTruth::Create(world);
  ASSERT_TRUE(truth.has_value());
  for (int last = 1; last <= 6; ++last) {
    ASSERT_TRUE(ObserveUntil(*truth, world, last).has_value());
    ASSERT_EQ(truth->recent().size(), static_cast<std::size_t>(std::min(last, 3)));
    EXPECT_EQ(truth->recent().back().index, last);
    EXPECT_EQ(truth->recent().front().index, std::max(1, last - 2));
  }
}

// Parts of a model go on inside one another; nobody can see them there.
TEST(SceneTruth, HasNoSamplesInsideASolid) {
  class Crossed : public test::TableWorld {
   public:
    Expected<std::vector<TrueModel>> Truth() override {
      return std::vector<TrueModel>{testing::Model(
          kBackground, test::Together({test::BoxAround({0, 0, 0}, {0.3F, 0.05F, 0.05F}, 0),
                                       test::BoxAround({0, 0, 0}, {0.04F, 0.3F, 0.04F}, 0)}))};
    }
  } world;
  TruthOptions options;
  options.sampling.coarse_per_cm2 = 4;
  const auto truth = SceneTruth::Create(world, options);
  ASSERT_TRUE(truth.has_value());
  const SampleSet& samples = truth->trackers().front().samples_O();
  EXPECT_GT(samples.size(), 1000U);
  for (const Eigen::Vector3f& point : samples.points) {
    const Eigen::Array3f at = point.array().abs();
    EXPECT_FALSE(at.x() < 0.039F && at.y() < 0.049F && at.z() < 0.049F) << point.transpose();
  }
}

TEST(MoversNow, AreThoseThatTheSceneNamesElseThoseThatHaveMoved) {
  test::TableWorld world;
  auto truth = SceneTruth::Create(world);
  ASSERT_TRUE(truth.has_value());
  ASSERT_TRUE(ObserveUntil(*truth, world, kJump).has_value());
  EXPECT_EQ(MoversNow(world.info(), *truth), (std::set<InstanceId>{kCar, kCup}));
  world.info_.reveal = RevealPlan{kJump, {}};
  EXPECT_EQ(MoversNow(world.info(), *truth), (std::set<InstanceId>{kCar, kCup}));
  world.info_.reveal = RevealPlan{kJump, {kHouse}};
  EXPECT_EQ(MoversNow(world.info(), *truth), (std::set<InstanceId>{kHouse}));
}

}  // namespace
}  // namespace tsdfpp
