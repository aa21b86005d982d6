// What a mask merges with an object from far behind it is not the object's.
#include "mapper/associate/far_part.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mapper/associate/vote_config.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/toy_votes.h"

namespace tsdfpp {
namespace {

constexpr double kStep_m = 0.08;
// From the brick's box: more than its diagonal's 15 %, and than five voxels.
constexpr double kLeast_m = 0.1;
const FarPartConfig kConfig{.share = 0.15, .least_m = kLeast_m, .step_m = kStep_m};
// At an outline depth steps within a pixel, and the part is to either side of it.
constexpr int kMostOff_px = 40;
constexpr double kNearlyAll = 0.9;  // of a part, but for its outline

const Eigen::Vector3d kNear(0.12, 0, kTableTop_m + 0.045);

// Seen from low on the side of positive x.
Frame View(const reference::Scene& scene, int index) {
  const Pose T_WC = reference::LookAt({0.7, 0.02 * index, 0.2}, {0, 0, 0.05});
  return reference::Render(scene, T_WC, index, {256, 192, 215.0, 215.0, 127.5, 95.5});
}

reference::Scene BrickAlone() {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0, kNear);
  return scene;
}

cv::Mat MergedMask(const Frame& frame) {
  cv::Mat mask = frame.mask.clone();
  mask.setTo(static_cast<double>(kBrick), mask == static_cast<double>(kBall));
  return mask;
}

std::vector<int> PixelsOf(const Frame& frame, const cv::Mat& mask, InstanceId id) {
  std::vector<int> pixels;
  for (int pixel = 0; pixel < mask.rows * mask.cols; ++pixel) {
    const int v = pixel / mask.cols;
    const int u = pixel % mask.cols;
    if (mask.at<InstanceId>(v, u) == id && IsValidDepth(frame.depth.at<float>(v, u))) {
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

VoteConfig Parting() {
  VoteConfig votes;
  votes.far_share = VoteConfig::kUsualFarShare;
  return votes;
}

ObjectLookup::SurfaceBox BoxOf(const ObjectLookup& lookup, std::size_t object) {
  return lookup.BoxesOfSurfaces({&object, 1}).front();
}

class FarPartOfMethod : public EveryMethodTest {
 protected:
  FarPartOfMethod() : map_(MakeMap(GetParam(), ToyConfig())) {
    for (int i = 0; i < 3; ++i) SetPosesThenFuse(*map_, View(BrickAlone(), i));
  }
  std::vector<int> Far(const Frame& frame, const cv::Mat& mask,
                       const FarPartConfig& config = kConfig) const {
    const ObjectLookup lookup(*map_);
    return FindFarPart(frame, mask, PixelsOf(frame, mask, kBrick),
                       BoxOf(lookup, *lookup.NumberOf(kBrick)), config);
  }
  // Of the pixels that are far, those of the ball and others.
  static void ExpectTheBall(const Frame& frame, const std::vector<int>& far) {
    const auto ball = PixelsOf(frame, frame.mask, kBall);
    std::vector<int> off;
    std::ranges::set_symmetric_difference(ball, far, std::back_inserter(off));
    EXPECT_GT(ball.size(), 10 * off.size());
    EXPECT_LE(off.size(), kMostOff_px);
  }

  std::unique_ptr<MapRepresentation> map_;
};
TSDFPP_FOR_EVERY_VOXEL_METHOD(FarPartOfMethod);

// Its half is hidden by the brick, or nothing of it is.
TEST_P(FarPartOfMethod, IsWhatComesOutFarBehind) {
  for (const double y : {0.09, 0.18}) {
    SCOPED_TRACE(y);
    reference::Scene scene = BrickAlone();
    AddBall(scene, {-0.2, y, kTableTop_m + 0.055});
    const Frame frame = View(scene, 3);
    ExpectTheBall(frame, Far(frame, MergedMask(frame)));
  }
}

TEST_P(FarPartOfMethod, IsNothingOfTheObjectItself) {
  const Frame frame = View(BrickAlone(), 4);
  EXPECT_TRUE(Far(frame, frame.mask).empty());
}

// Something new of an object begins where what is known of it ends.
TEST_P(FarPartOfMethod, IsNotWhatIsNear) {
  reference::Scene scene = BrickAlone();
  AddBall(scene, kNear + Eigen::Vector3d(-0.12, 0.1, 0.01));
  const Frame frame = View(scene, 3);
  EXPECT_TRUE(Far(frame, MergedMask(frame)).empty());
}

// A long object that goes on behind something. Each part is asked by itself, and of few pixels
// nothing is believed.
TEST_P(FarPartOfMethod, IsNotWhatMayBeConnectedWhereSomethingHidesIt) {
  constexpr InstanceId kEnd = 4;
  reference::Scene scene = BrickAlone();
  scene.shapes.push_back(
      reference::Cuboid(kEnd, {200, 30, 30}, Pose::Identity(), {0.075, 0.03, 0.045}));
  scene.T_WO[kEnd] = reference::MakePose(0, Eigen::Vector3d::UnitZ(), kNear);
  scene.T_WO[kEnd].translation().y() = 0.22;
  AddBall(scene, {-0.2, -0.2, kTableTop_m + 0.055});
  const auto far_in = [&](const Frame& frame, int least_pixels) {
    cv::Mat mask = MergedMask(frame);
    mask.setTo(static_cast<double>(kBrick), mask == static_cast<double>(kEnd));
    FarPartConfig config = kConfig;
    config.least_pixels = least_pixels;
    return Far(frame, mask, config);
  };
  const auto share_of_end = [](const Frame& frame, const std::vector<int>& far) {
    const auto end = PixelsOf(frame, frame.mask, kEnd);
    std::vector<int> both;
    std::ranges::set_intersection(end, far, std::back_inserter(both));
    return static_cast<double>(both.size()) / static_cast<double>(end.size());
  };
  const Frame open = View(scene, 0);
  EXPECT_GT(share_of_end(open, far_in(open, kConfig.least_pixels)), kNearlyAll);
  scene.shapes.push_back(
      reference::Cuboid(kTray, {30, 180, 30}, Pose::Identity(), {0.005, 0.02, 0.1}));
  scene.T_WO[kTray] = reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0.35, 0.12, 0.1});
  const Frame hidden = View(scene, 0);
  const int pixels = static_cast<int>(PixelsOf(hidden, hidden.mask, kEnd).size());
  ASSERT_GT(pixels, kConfig.least_pixels);
  ExpectTheBall(hidden, far_in(hidden, kConfig.least_pixels));
  EXPECT_GT(share_of_end(hidden, far_in(hidden, pixels + 1)), kNearlyAll);
}

// The picture's edge hides as well.
TEST_P(FarPartOfMethod, IsNotWhatGoesOnOutsideOfThePicture) {
  for (const double y : {0.25, 0.41}) {
    SCOPED_TRACE(y);
    reference::Scene scene = BrickAlone();
    AddBall(scene, {0.05, y, kTableTop_m + 0.055});
    const Frame frame = View(scene, 0);
    ASSERT_FALSE(PixelsOf(frame, frame.mask, kBall).empty());
    EXPECT_EQ(Far(frame, MergedMask(frame)).empty(), y > 0.3);
  }
}

// From the voxels, one by one.
TEST_P(FarPartOfMethod, IsMeasuredFromTheBoxOfTheSurface) {
  const ObjectLookup lookup(*map_);
  const auto found = BoxOf(lookup, *lookup.NumberOf(kBrick));
  std::array<std::vector<int>, 3> along;
  for (const Eigen::Vector3i& voxel : VoxelsOf(*map_).ObservedVoxels(kBrick)) {
    const auto value = VoxelsOf(*map_).ValueAt(kBrick, voxel);
    if (std::abs(value->distance_m) > kToyVoxel_m) continue;
    for (int axis = 0; axis < 3; ++axis) {
      along[static_cast<std::size_t>(axis)].push_back(voxel[axis]);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<int>& values = along[static_cast<std::size_t>(axis)];
    std::ranges::sort(values);
    const auto stray = static_cast<std::size_t>(0.03 * static_cast<double>(values.size()));
    ASSERT_GT(stray, 0U);
    EXPECT_EQ(found.box_L.min()[axis], kToyVoxel_m * values[stray]);
    EXPECT_EQ(found.box_L.max()[axis], kToyVoxel_m * values[values.size() - 1 - stray]);
  }
}

// In the pipeline's second verb: nothing of the ball becomes the brick's, with which its mask is
// merged. It is no object as long as no mask shows it alone; what shows it then is.
TEST(FarPart, IsNobodysUntilAMaskShowsItAlone) {
  constexpr int kAlone = 10;
  const auto map_all = [](int frames, double far_share) {
    VoteConfig votes;
    votes.far_share = far_share;
    VoteWorld world(Method::kTsdfppAnchored, ToyConfig(), votes);
    for (int i = 0; i < frames; ++i) {
      reference::Scene scene = BrickAlone();
      if (i > 3) AddBall(scene, {-0.2, 0.05 + 0.015 * (i - 4), kTableTop_m + 0.055});
      const Frame frame = View(scene, i);
      world.Map(frame,
                {world.ids().Of(i < kAlone ? MergedMask(frame) : cv::Mat(frame.mask)), {}, {}});
    }
    const ObjectLookup lookup(world.map());
    return std::pair(world.map().Objects(), BoxOf(lookup, 0).box_L.sizes().maxCoeff());
  };
  const double far_share = VoteConfig::kUsualFarShare;
  const auto [objects, length_m] = map_all(kAlone, far_share);
  EXPECT_EQ(objects, (std::vector<InstanceId>{0, 1}));
  EXPECT_LT(length_m, 0.15 + 3 * kToyVoxel_m);
  EXPECT_EQ(map_all(kAlone + kConfirmed, far_share).first, (std::vector<InstanceId>{0, 1, 2}));
  const auto [without, long_m] = map_all(kAlone, 0);
  EXPECT_EQ(without, (std::vector<InstanceId>{0, 1}));
  EXPECT_GT(long_m, 0.3);
}

// Nor may a lost object's model begin on it.
TEST(FarPart, BeginsNothing) {
  ToyVotes world(Method::kTsdfppAnchored, Parting());
  for (int i = 0; i < 5; ++i) world.Map(View(BrickAlone(), i));
  reference::Scene scene = BrickAlone();
  AddBall(scene, {-0.2, 0.05, kTableTop_m + 0.055});
  const Frame frame = View(scene, 5);
  const auto merged = world.ids().Of(MergedMask(frame));
  const auto found = world.votes().Associate(frame, {merged, {}, {}}, world.map());
  ASSERT_EQ(found.unclaimed.size(), 1U);
  EXPECT_EQ(found.unclaimed[0], PixelsOf(frame, frame.mask, kBall));
  EXPECT_EQ(found.may_begin, std::vector<bool>{false});
}

// That nearly all of the brick and of the ball has the label of its object.
void ExpectBothHaveTheirs(const Frame& frame, const cv::Mat& labels,
                          const std::map<InstanceId, InstanceId>& id_of) {
  for (const InstanceId truth : {kBrick, kBall}) {
    const auto pixels = PixelsOf(frame, frame.mask, truth);
    const auto right = std::ranges::count_if(pixels, [&](int pixel) {
      return labels.at<InstanceId>(pixel / labels.cols, pixel % labels.cols) == id_of.at(truth);
    });
    EXPECT_GT(static_cast<double>(right), kNearlyAll * static_cast<double>(pixels.size())) << truth;
  }
}

// Nor is it nobody's where the map has the object that it is of.
TEST(FarPart, IsGivenToAnObjectOfTheMap) {
  ToyVotes world(Method::kTsdfppAnchored, Parting());
  const auto frame_of = [](int index) {
    reference::Scene scene = BrickAlone();
    AddBall(scene, {-0.2, 0.2, kTableTop_m + 0.055});
    return View(scene, index);
  };
  int index = 0;
  for (; index < 5; ++index) world.Map(frame_of(index));
  std::map<InstanceId, InstanceId> id_of;
  for (const auto& [id, truth] : world.truth_of()) id_of[truth] = id;
  const Frame frame = frame_of(index);
  const cv::Mat labels = world.Map(frame, {world.ids().Of(MergedMask(frame)), {}, {}});
  ExpectBothHaveTheirs(frame, labels, id_of);
}

// A little of it got into the object before it was far from anything known; that takes no more.
TEST(FarPart, DoesNotComeBackThroughWhatOfItIsInTheObject) {
  // So fine that what gets in is a small share of the brick's surface, and more than a voxel.
  MapConfig config = ToyConfig();
  config.voxel_m = kToyVoxel_m / 2;
  VoteWorld world(Method::kTsdfppAnchored, config, Parting());
  reference::Scene scene = BrickAlone();
  AddBall(scene, {-0.2, 0.2, kTableTop_m + 0.055});
  for (int i = 0; i < 3 * kConfirmed; ++i) {
    const Frame frame = View(scene, i);
    const cv::Moments ball = cv::moments(frame.mask == static_cast<double>(kBall), true);
    const cv::Rect patch(static_cast<int>(ball.m10 / ball.m00) - 2,
                         static_cast<int>(ball.m01 / ball.m00) - 2, 5, 5);
    cv::Mat mask = frame.mask.clone();
    mask.setTo(static_cast<double>(kNoInstance), mask == static_cast<double>(kBall));
    mask(patch) = static_cast<double>(kBrick);
    const cv::Mat labels = world.Map(frame, {world.ids().Of(mask), {}, {}});
    const int taken = cv::countNonZero(labels(patch) != static_cast<double>(kNoInstance));
    if (i + 1 < kConfirmed) continue;
    EXPECT_EQ(taken, i + 1 == kConfirmed ? patch.area() : 0) << i;
  }
}

// Of another object that the map knows one part is far, the other near: a mask over all is cut
// between the two objects.
TEST(FarPart, DoesNotKeepTheRestFromBeingCut) {
  ToyVotes world(Method::kTsdfppAnchored, Parting());
  const auto frame_of = [](int index) {
    reference::Scene scene = BrickAlone();
    AddBall(scene, {-0.2, 0.2, kTableTop_m + 0.055});
    // Its other end.
    scene.shapes.push_back(reference::Sphere(kBall, {30, 30, 200}, {0.24, -0.06, 0}, 0.055));
    return View(scene, index);
  };
  int index = 0;
  for (; index < 5; ++index) world.Map(frame_of(index));
  const Frame frame = frame_of(index);
  const cv::Mat merged = MergedMask(frame);
  const ObjectLookup lookup(world.map());
  std::map<InstanceId, InstanceId> id_of;
  for (const auto& [id, truth] : world.truth_of()) id_of[truth] = id;
  const auto far = FindFarPart(frame, merged, PixelsOf(frame, merged, kBrick),
                               BoxOf(lookup, *lookup.NumberOf(id_of.at(kBrick))), kConfig);
  const auto ball = PixelsOf(frame, frame.mask, kBall);
  ASSERT_GT(far.size(), ball.size() / 5);
  ASSERT_LT(far.size(), ball.size() / 2);
  const cv::Mat labels = world.Map(frame, {world.ids().Of(merged), {}, {}});
  ExpectBothHaveTheirs(frame, labels, id_of);
}

}  // namespace
}  // namespace tsdfpp
