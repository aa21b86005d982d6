// Covers after frames that change a few voxels: those found anew from all masks around.
#include "mapper/index/cover.h"

#include <gtest/gtest.h>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

using reference::Scene;

class CoverTest : public ::testing::TestWithParam<Method> {
 protected:
  static constexpr int kWindows = 800;
  static constexpr int kSide = 5;  // pixels: less than a block, so that few slices change at once

  // Fuses windows of frames of the scene and compares covers with those from all masks around.
  template <typename Render>
  void FuseAndCompare(const Render& render) {
    const auto map = MakeMap(GetParam(), ToyConfig());
    Dice dice(11);
    for (int i = 0; i < 4; ++i) SetPosesThenFuse(*map, render(dice, i));
    for (int i = 0; i < kWindows; ++i) {
      Frame frame = render(dice, i);
      const cv::Rect window(dice.Whole(frame.mask.cols - kSide),
                            dice.Whole(frame.mask.rows - kSide), kSide, kSide);
      cv::Mat labels(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
      frame.mask(window).copyTo(labels(window));
      // As if the surface were up to a voxel nearer or farther.
      frame.depth(window) += dice.Uniform(-1, 1) * kToyVoxel_m;
      map->Fuse(frame, labels);
      for (const InstanceId id : map->Objects()) {
        const TsdfGrid& grid = *VoxelsOf(*map).GridOf(id);
        for (const auto& entry : grid.entries()) {
          ASSERT_EQ(entry.block->cover, FindCover(grid, entry.index)) << "window " << i;
        }
      }
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Methods, CoverTest,
                         ::testing::Values(Method::kTsdfpp, Method::kTsdfppAnchored));

TEST_P(CoverTest, IsUpToDateInEverySliceSeenFromAbove) {
  FuseAndCompare([scene = TableWithToys()](Dice& dice, int i) {
    return RenderToys(scene, dice.Uniform(0, 6), i);
  });
}

TEST_P(CoverTest, IsUpToDateInEverySliceSeenFromAllSides) {
  // It ends where a block does.
  const Eigen::Vector3d centre(0.5, 0.5, 0.096);
  Scene scene;
  scene.shapes.push_back(reference::Sphere(kBackground, {30, 30, 200}, centre, 0.09));
  FuseAndCompare([&](Dice& dice, int i) {
    const Eigen::Vector3d away(dice.Uniform(-1, 1), dice.Uniform(-1, 1), dice.Uniform(-1, 1));
    return reference::Render(scene, reference::LookAt(centre + 0.4 * away.normalized(), centre), i);
  });
}

}  // namespace
}  // namespace tsdfpp
