// Lost objects that are more than are searched for in a frame.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

// More than are searched for in a frame: none loses its model by waiting for its turn.
TEST(ManyLostObjects, AllHaveTheirTurn) {
  constexpr int kCount = 10;
  enum class Shown { kBricks, kNothing, kBalls, kElsewhere };
  const auto frame_of = [](int index, Shown shown) {
    reference::Scene scene;
    scene.shapes.push_back(reference::Cuboid(
        kBackground, {150, 110, 70},
        reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, kTableTop_m - 0.05}),
        {0.7, 0.9, 0.05}));
    for (int k = 0; k < kCount && shown != Shown::kNothing; ++k) {
      const auto id = static_cast<InstanceId>(1 + k);
      const int row = k / 2;
      const Eigen::Vector3d cell(k % 2 == 1 ? 0.2 : -0.2, -0.5 + 0.25 * row, 0);
      if (shown == Shown::kBalls) {
        scene.shapes.push_back(reference::Sphere(id, {200, 30, 30}, Eigen::Vector3d::Zero(), 0.05));
        scene.T_WO[id] = reference::MakePose(
            0, Eigen::Vector3d::UnitZ(), cell + Eigen::Vector3d(0.08, 0.05, kTableTop_m + 0.05));
        continue;
      }
      const bool is_elsewhere = shown == Shown::kElsewhere;
      scene.shapes.push_back(
          reference::Cuboid(id, {200, 30, 30}, Pose::Identity(), {0.075, 0.05, 0.045}));
      scene.shapes.push_back(reference::Cuboid(
          id, {200, 30, 30}, reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0.045, 0.02, 0.075}),
          {0.025, 0.03, 0.03}));
      scene.T_WO[id] = reference::MakePose(
          is_elsewhere ? 1.0 : 0.3, Eigen::Vector3d::UnitZ(),
          cell + Eigen::Vector3d(is_elsewhere ? 0.1 : -0.08, is_elsewhere ? 0.02 : -0.04,
                                 kTableTop_m + 0.045));
    }
    const double angle = 0.01 * index;
    return reference::Render(
        scene,
        reference::LookAt({0.95 * std::cos(angle), 0.95 * std::sin(angle), 0.9}, {0.0, 0.0, 0.03}),
        index, {640, 480, 460.0, 460.0, 319.5, 239.5});
  };
  std::vector<ObjectInfo> objects{{kBackground, "background", ""}};
  for (int k = 1; k <= kCount; ++k) {
    objects.push_back({static_cast<InstanceId>(k), fmt::format("brick{}", k), "toy"});
  }
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.map = ToyConfig();
  config.poses = PoseSource::kTrack;
  Pipeline pipeline(config, objects);
  const auto voxels_of = [&](int k) {
    return VoxelsOf(pipeline.map()).ObservedVoxels(static_cast<InstanceId>(k)).size();
  };
  int index = 0;
  const auto show = [&](Shown shown, int frames) {
    for (int i = 0; i < frames; ++i) {
      ++index;
      ASSERT_TRUE(pipeline.Process(frame_of(index, shown)));
      // What is said to be lost is not in the map.
      for (const std::string& remark : pipeline.Remarks()) {
        for (int k = 1; k <= kCount; ++k) {
          const bool is_lost = (remark + ",").find(fmt::format("brick{},", k)) != remark.npos;
          EXPECT_TRUE(!is_lost || voxels_of(k) == 0) << index << ": " << remark;
        }
      }
    }
  };
  show(Shown::kBricks, 5);
  std::vector<std::size_t> before;
  for (int k = 1; k <= kCount; ++k) {
    before.push_back(voxels_of(k));
  }
  show(Shown::kNothing, 3);
  show(Shown::kBalls, 17);  // on which they begin anew, on trial
  show(Shown::kElsewhere, 2);
  show(Shown::kNothing, 2);
  show(Shown::kElsewhere, 8);
  for (int k = 1; k <= kCount; ++k) {
    EXPECT_GE(voxels_of(k), before[static_cast<std::size_t>(k - 1)]) << k;
  }
}

}  // namespace
}  // namespace tsdfpp
