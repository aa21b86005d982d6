// The tracker's terms of the image, on a plate and a ball: what each fixes that the distances leave
// free, and that its slopes are those of its cost.
#include "mapper/track/view_terms.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/units.h"
#include "mapper/track/sdf_registration.h"
#include "tests/mapper/drawn_things.h"
#include "tests/mapper/noisy_toys.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

constexpr double kVoxel_m = 0.01;
// Of a pixel, at a metre; an outline of whole pixels says where something is to a small part of
// one, as does a smooth texture.
constexpr double kPixel_m = 1 / 300.0;
constexpr double kOutline_pixels = 0.15;
constexpr double kColour_pixels = 0.1;

std::vector<SegmentPoint> PointsOf(const Frame& frame, const SdfTrackConfig& config) {
  const auto pixels = PixelsByLabel(frame.mask, config.mask_erosion_px);
  return SegmentPointsOf(frame, pixels.at(drawn::kThing), kVoxel_m, config);
}

// The plate's plane, observed far beyond the plate: nothing of the distances holds it in the plane.
TsdfGrid PlaneGrid() {
  TsdfGrid grid;
  for (int x = -5; x < 5; ++x) {
    for (int y = -5; y < 5; ++y) {
      for (int z = -2; z < 2; ++z) {
        TsdfBlock& block = grid.FindOrAdd({x, y, z});
        for (int place = 0; place < kBlockVoxels; ++place) {
          const auto i = static_cast<std::size_t>(place);
          const Index3 voxel = VoxelAt({x, y, z}, place);
          block.distance[i] = static_cast<float>(-kVoxel_m * voxel.z);
          block.weight[i] = 50;
        }
        block.UpdateMasks(static_cast<float>(kVoxel_m));
      }
    }
  }
  return grid;
}

const Pose kPlateBefore = MakePose(0, {0, 0, 1}, {0.01, 0.02, 1.0});
constexpr double kWallBehind_m = drawn::kWall_m - 1.0;  // the plate
// In its plane: 4 pixels to the side, 3 down, and a turn by 2 degrees.
Pose PlateAfter() { return kPlateBefore * MakePose(2 * kDegree, {0, 0, 1}, {0.0133, -0.01, 0}); }

SdfTrackConfig With(double free_space, double outline, double colour) {
  SdfTrackConfig config;
  config.free_space_weight = free_space;
  config.outline_weight = outline;
  config.colour_weight = colour;
  return config;
}

// The plate, kept as a keyframe where it was, and where it is now.
struct Slide {
  Slide(const SdfTrackConfig& config, double gain, double offset)
      : before(drawn::Draw(drawn::Plate(), kPlateBefore)),
        after(drawn::Draw(drawn::Plate(), PlateAfter(), gain, offset)),
        key(KeyViewOf(SegmentView(before, before.mask, drawn::kThing, 2 * kVoxel_m),
                      PointsOf(before, config), drawn::Camera(), config)),
        view(after, after.mask, drawn::kThing, 2 * kVoxel_m),
        points(PointsOf(after, config)) {
    parts = {&after, &view, &key, kPlateBefore.inverse(), &grid, &reader, kVoxel_m};
  }
  Frame before;
  Frame after;
  TsdfGrid grid = PlaneGrid();
  SurfaceReader reader{grid, kVoxel_m};
  KeyView key;
  SegmentView view;
  std::vector<SegmentPoint> points;
  ViewTermParts parts;
};

SdfRegistrationResult Found(const Slide& slide, const SdfTrackConfig& config) {
  const auto terms = ViewTermsOf(slide.parts, config);
  SdfRegistration task{&slide.reader, slide.points, kVoxel_m, drawn::Camera()};
  task.T_LC_expected = kPlateBefore.inverse();
  task.others = terms;
  const auto outline = OutlineTermOf(slide.parts, config);
  task.outline = [&] { return outline.get(); };
  return RegisterToDistances(task, config);
}

double ShiftOff_m(const SdfRegistrationResult& found) {
  return (found.T_LC * PlateAfter()).translation().norm();
}
double TurnOff_rad(const SdfRegistrationResult& found) {
  return Eigen::AngleAxisd((found.T_LC * PlateAfter()).linear()).angle();
}

TEST(ViewTerms, OutlineHoldsAPlateAgainstShifts) {
  const SdfTrackConfig config = With(0, 1, 0);
  const Slide slide(config, 1, 0);
  const auto alone = Found(slide, With(0, 0, 0));
  EXPECT_GT(ShiftOff_m(alone), 3 * kPixel_m) << "a plane's distances know nothing of it";
  EXPECT_EQ(alone.known.CountBelow(config.weak_share), 3);
  const auto found = Found(slide, config);
  ASSERT_TRUE(found.converged);
  // The turn is left, so that the rims do not fit, and what is expected has a little say.
  constexpr double kLeft = 0.25;
  EXPECT_LT(ShiftOff_m(found), kLeft * ShiftOff_m(alone));
  constexpr double kSame_rad = 1e-3;  // a fortieth of the turn: distances hold the plate's plane
  EXPECT_NEAR(TurnOff_rad(found), 2 * kDegree, kSame_rad) << "of turns it says nothing";
  EXPECT_EQ(found.known.CountBelow(config.weak_share), 3) << "what distances know is what it was";
}

// It has a say up to a share, whether or not what is expected has one.
TEST(ViewTerms, OutlineNeedsNoExpectation) {
  SdfTrackConfig config = With(0, 1, 0);
  config.weak_share = 0;
  const Slide slide(config, 1, 0);
  EXPECT_LT(ShiftOff_m(Found(slide, config)), kOutline_pixels * kPixel_m);
}

// From farther to a rim's own side what was behind it may be in sight, and makes the outline.
TEST(ViewTerms, ARimCountsUntilItIsSeenFromItsOwnSide) {
  const SdfTrackConfig config = With(0, 1, 0);
  const MotionFrame frame{{0, 0, 0}, 0.1};
  const Frame before = drawn::Draw(drawn::Plate(), kPlateBefore);
  const KeyView key = KeyViewOf(SegmentView(before, before.mask, drawn::kThing, 2 * kVoxel_m),
                                PointsOf(before, config), drawn::Camera(), config);
  const TsdfGrid grid = PlaneGrid();
  const SurfaceReader reader(grid, kVoxel_m);
  // What the rims know of shifts along the plate's x and y, from a camera that is so far aside.
  const auto known = [&](const Eigen::Vector3d& aside_m) {
    const Pose T_CO = Eigen::Translation3d(-aside_m) * kPlateBefore;
    const Frame now = drawn::Draw(drawn::Plate(), T_CO);
    const SegmentView view(now, now.mask, drawn::kThing, 2 * kVoxel_m);
    const auto term = OutlineTermOf(
        {&now, &view, &key, kPlateBefore.inverse(), &grid, &reader, kVoxel_m}, config);
    term->KeepAt(T_CO.inverse(), 0.001);
    const Matrix6 H = term->Sums(T_CO.inverse(), frame).H;
    return std::pair{H(0, 0), H(1, 1)};
  };
  // Shares: rims at the picture's other side are at other pixels, and a few are lost.
  constexpr double kFew = 0.1;
  const auto [x, y] = known({0, 0, 0});
  const auto [x_aside, y_aside] = known({0.1, 0, 0});
  EXPECT_NEAR(x_aside / x, 0.5, kFew) << "the rim at the far side alone";
  EXPECT_NEAR(y_aside / y, 1, kFew) << "of those above and below, both";
  const auto [x_below, y_below] = known({0, 0.1, 0});
  EXPECT_NEAR(x_below / x, 1, kFew);
  EXPECT_NEAR(y_below / y, 0.5, kFew);
}

TEST(ViewTerms, ColourHoldsAPlateInItsPlaneWhateverTheLight) {
  const SdfTrackConfig config = With(0, 0, 1);
  for (const auto& [gain, offset] : {std::pair{1.0, 0.0}, std::pair{0.7, 20.0}}) {
    const Slide slide(config, gain, offset);
    const auto found = Found(slide, config);
    ASSERT_TRUE(found.converged);
    EXPECT_LT(ShiftOff_m(found), kColour_pixels * kPixel_m);
    EXPECT_LT(TurnOff_rad(found), kColour_pixels * kPixel_m / 0.1);
    EXPECT_EQ(found.known.CountBelow(config.weak_share), 0);
  }
}

// A model that claims what the frame sees through costs, the less the further back it is.
TEST(ViewTerms, FreeSpacePushesAModelBack) {
  const SdfTrackConfig config = With(1, 0, 0);
  const Slide slide(config, 1, 0);
  const auto terms = ViewTermsOf(slide.parts, config);
  ASSERT_EQ(terms.size(), 1U);
  const MotionFrame frame{{0, 0, 0}, 0.1};
  // Of the plane, which is in the picture beside the plate, before the wall.
  const auto behind = [](double further_m) {
    return Pose(Eigen::Translation3d(0, 0, -further_m)) * kPlateBefore.inverse();
  };
  constexpr double kDeviation_m = 0.001;
  terms.front()->KeepAt(behind(0), kDeviation_m);
  const auto cost_at = [&](double further_m) {
    return terms.front()->Sums(behind(further_m), frame).cost;
  };
  EXPECT_GT(cost_at(0), cost_at(0.2));
  EXPECT_GT(cost_at(0.2), cost_at(0.4));
  EXPECT_GT(cost_at(0.4), 0);
  EXPECT_EQ(cost_at(kWallBehind_m), 0);
  // Along the picture's axis, which is the lattice's z; nothing pulls it aside.
  const NormalEquations here = terms.front()->Sums(behind(0.2), frame);
  EXPECT_GT(here.g[2], 0);
  EXPECT_EQ(here.g[0], 0);
  EXPECT_EQ(here.g[1], 0);
}

// The cost falls as its slopes say, to the second order; images are linear between pixels, so that
// a few points pass a kink.
TEST(ViewTerms, HaveTheSlopesOfTheirCosts) {
  constexpr double kStep_m = 2e-5;
  constexpr double kKinks = 0.03;
  for (const SdfTrackConfig& config : {With(0, 1, 0), With(0, 0, 1)}) {
    const Slide slide(config, 0.8, 10);
    auto terms = ViewTermsOf(slide.parts, config);
    if (auto outline = OutlineTermOf(slide.parts, config)) terms.push_back(std::move(outline));
    ASSERT_EQ(terms.size(), 1U);
    const MotionFrame frame{{0.02, -0.01, 0}, 0.1};
    const Pose T_LC = MakePose(0.01, {0.2, 0.5, 1}, {0.002, 0.003, 0.001}) * PlateAfter().inverse();
    terms.front()->KeepAt(T_LC, 0.001);
    const NormalEquations here = terms.front()->Sums(T_LC, frame);
    for (int i = 0; i < 6; ++i) {
      const Vector6 step = kStep_m * Vector6::Unit(i);
      const double up = terms.front()->Sums(frame.MotionOf(step) * T_LC, frame).cost;
      const double down = terms.front()->Sums(frame.MotionOf(-step) * T_LC, frame).cost;
      EXPECT_NEAR((up - down) / (2 * kStep_m), here.g[i], kKinks * here.g.cwiseAbs().maxCoeff())
          << i;
    }
  }
}

// Beside a nearer thing an outline is that thing's; at the picture's edge it is nobody's.
TEST(SegmentView, TellsItsOwnOutlineFromOthers) {
  Frame frame = drawn::Draw(drawn::Plate(), kPlateBefore);
  const auto columns = [&](const SegmentView& view) {
    std::pair<double, double> ends{1e9, -1e9};
    for (const RimPoint& point : view.Rim()) {
      ends.first = std::min(ends.first, point.pixel.x());
      ends.second = std::max(ends.second, point.pixel.x());
    }
    return ends;
  };
  const auto whole = columns(SegmentView(frame, frame.mask, drawn::kThing, 2 * kVoxel_m));
  EXPECT_NEAR(whole.second - whole.first, 0.28 / kPixel_m, 1);
  // A bar stands before its right end.
  const cv::Rect bar(180, 0, 40, 240);
  frame.depth(bar) = 0.7F;
  frame.mask(bar) = 9;
  const auto hidden = columns(SegmentView(frame, frame.mask, drawn::kThing, 2 * kVoxel_m));
  EXPECT_EQ(hidden.first, whole.first);
  EXPECT_LE(hidden.second, 180 - 2) << "the outline at the bar is the bar's";
  // Its right end lies beyond the picture; its rows there are those about 125.
  const Frame cut = drawn::Draw(drawn::Plate(), MakePose(0, {0, 0, 1}, {0.45, 0.02, 1.0}));
  ASSERT_EQ(cut.mask.at<InstanceId>(125, cut.mask.cols - 1), drawn::kThing);
  int at_left = 0;
  for (const RimPoint& point : SegmentView(cut, cut.mask, drawn::kThing, 2 * kVoxel_m).Rim()) {
    if (std::abs(point.pixel.y() - 125) > 20) continue;
    EXPECT_LT(point.pixel.x(), cut.mask.cols / 2 + 100) << "beyond the picture nothing is known";
    ++at_left;
  }
  EXPECT_GT(at_left, 20);
}

TEST(SegmentView, HasNoRimWhereASurfaceTurnsAway) {
  Frame frame = drawn::Draw(drawn::Ball(), MakePose(0, {0, 0, 1}, {0, 0, 1}));
  EXPECT_TRUE(SegmentView(frame, frame.mask, drawn::kThing, 2 * kVoxel_m).Rim().empty());
  // With noise, too, but for a few.
  constexpr double kNoise_m = 0.002;
  constexpr std::size_t kFew = 5;
  frame = WithNoise(std::move(frame), kNoise_m);
  EXPECT_LE(SegmentView(frame, frame.mask, drawn::kThing, 2 * kVoxel_m).Rim().size(), kFew);
}

// What makes the outline of a rounded edge lies behind the face, by the radius.
TEST(SegmentView, ARoundedEdgeIsWhereItsOutlineIs) {
  Frame frame = drawn::Draw(drawn::Plate(), kPlateBefore);
  constexpr float kRadius_m = 0.008F;  // 2.4 pixels
  const cv::Mat face = frame.mask == static_cast<double>(drawn::kThing);
  cv::Mat to_outside;
  cv::distanceTransform(face, to_outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      const float inside_m = (to_outside.at<float>(v, u) - 0.5F) * static_cast<float>(kPixel_m);
      if (inside_m < 0 || inside_m >= kRadius_m) continue;
      const float x_m = kRadius_m - inside_m;
      frame.depth.at<float>(v, u) += kRadius_m - std::sqrt(kRadius_m * kRadius_m - x_m * x_m);
    }
  }
  // The last part of it, over half a pixel, is steeper than a line through the last two pixels.
  constexpr double kMost_m = 0.6 * double{kRadius_m};
  const auto rim = SegmentView(frame, frame.mask, drawn::kThing, 2 * kVoxel_m).Rim();
  ASSERT_GT(rim.size(), 200U);
  std::vector<double> behind_m;
  behind_m.reserve(rim.size());
  for (const RimPoint& point : rim) behind_m.push_back(point.depth_m - 1);
  std::ranges::sort(behind_m);
  const double middle_m = behind_m[behind_m.size() / 2];
  EXPECT_GT(middle_m, double{kRadius_m} - kMost_m);
  EXPECT_LT(middle_m, double{kRadius_m} + kMost_m);
}

TEST(SdfTrackConfig, ImageTermsNeedAKeyframe) {
  for (SdfTrackConfig config : {With(0, 1, 0), With(0, 0, 1)}) {
    EXPECT_TRUE(config.Validate());
    config.keyframe_turn_rad = 0;
    const auto refused = config.Validate();
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("keyframe_turn_rad"), std::string::npos);
  }
}

}  // namespace
}  // namespace tsdfpp
