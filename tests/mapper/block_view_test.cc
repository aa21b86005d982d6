// Blocks beside the view: against each of their voxels; and what of a frame waits for frozen
// objects.
#include "mapper/track/block_view.h"

#include <gtest/gtest.h>

#include <random>

#include "core/pixel_ray.h"
#include "mapper/track/frozen_pixels.h"
#include "mapper/volume/object_volume.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

TEST(BlockView, IsLeftByAllVoxelsOfABlock) {
  constexpr int kBlocks = 4000;
  // Of the blocks without a voxel in view; the ball around the others comes into it.
  constexpr double kLeastKnown = 0.9;
  const Intrinsics camera{192, 144, 160.0, 150.0, 90.5, 77.5};
  std::minstd_rand dice(7);
  std::uniform_real_distribution<double> draw(-1, 1);
  int outside = 0;
  int known = 0;
  for (int i = 0; i < kBlocks; ++i) {
    const Pose T_CL = MakePose(3 * draw(dice), {draw(dice), draw(dice), draw(dice) + 2},
                               {draw(dice), draw(dice), draw(dice)});
    const auto index = [&] { return static_cast<int>(std::lround(6 * draw(dice))); };
    const Index3 block{index(), index(), index()};
    bool is_seen = false;
    for (int place = 0; place < kBlockVoxels && !is_seen; ++place) {
      const Index3 v = VoxelAt(block, place);
      const Eigen::Vector3d p_C = T_CL * (kToyVoxel_m * Eigen::Vector3d(v.x, v.y, v.z));
      if (!(p_C.z() > 0)) continue;
      const Eigen::Vector2d pixel = PixelOf(camera, p_C);
      is_seen = pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= camera.width - 0.5 &&
                pixel.y() <= camera.height - 0.5;
    }
    const bool is_out = IsOutOfView(block, T_CL, kToyVoxel_m, camera);
    ASSERT_FALSE(is_out && is_seen) << i;
    outside += is_seen ? 0 : 1;
    known += is_out ? 1 : 0;
  }
  EXPECT_GT(outside, kBlocks / 4);
  EXPECT_GT(known, kLeastKnown * outside);
}

// Around an object that is frozen nothing is fused, but what is beside the camera is around nothing
// that it sees.
TEST(FrozenPixels, AreThoseBeforeTheCamera) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  const Frame before = DriveFrame(0);
  SetPosesThenFuse(*map, before);
  TrackedPoses tracked{before.T_WO};
  tracked.seen[kBrick] = TrackStatus::kFrozen;
  cv::Mat labels(before.depth.size(), CV_16UC1, cv::Scalar(0));
  const int all = static_cast<int>(labels.total());
  const auto left = [&](const Frame& frame) {
    return all - cv::countNonZero(LabelsToFuse(frame, labels, *map, tracked) ==
                                  static_cast<double>(kNoInstance));
  };
  EXPECT_LT(left(before), all);
  EXPECT_GT(left(before), all / 2);
  Frame beside = before;
  // Half a metre to its left, level with it, and looking along the table.
  beside.T_WC =
      reference::LookAt(before.T_WO.at(kBrick).translation() + Eigen::Vector3d(0, 0.5, 0),
                        before.T_WO.at(kBrick).translation() + Eigen::Vector3d(1, 0.5, 0));
  EXPECT_EQ(left(beside), all);
}

}  // namespace
}  // namespace tsdfpp
