// Each sabotage breaks what it says, and nothing else.
#include "eval/sweep/sabotage.h"

#include <gtest/gtest.h>

#include "eval/sweep/sequence_variant.h"

namespace tsdfpp {
namespace {

FrameChoice SmallFrames() {
  FrameChoice choice;
  choice.scale = 0.25;
  choice.stride = 4;
  return choice;
}

Expected<SequenceVariant> Variant(Sabotage sabotage, const FrameChoice& choice = SmallFrames()) {
  VariantMaker maker(std::filesystem::path(TSDFPP_SOURCE_DIR) / "scenes", choice);
  CellSettings settings;
  settings.scene = "mini.toml";
  settings.sabotage = sabotage;
  return maker.Make(settings);
}

bool SameImage(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_L1) == 0;
}

bool SamePoses(const std::map<InstanceId, Pose>& a, const std::map<InstanceId, Pose>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) {
    return x.first == y.first && x.second.matrix() == y.second.matrix();
  });
}

// Which fields of a frame differ.
std::string Differences(const Frame& a, const Frame& b) {
  std::string text;
  if (!SameImage(a.depth, b.depth)) text += "depth ";
  if (!SameImage(a.mask, b.mask)) text += "mask ";
  if (!SameImage(a.colour, b.colour)) text += "colour ";
  if (!(a.intrinsics == b.intrinsics)) text += "intrinsics ";
  if (a.T_WC.matrix() != b.T_WC.matrix()) text += "camera ";
  if (!SamePoses(a.T_WO, b.T_WO)) text += "objects ";
  return text;
}

struct Both {
  std::vector<VariantFrame> plain;
  std::vector<VariantFrame> broken;
  // The differences of what the mapper is given, a frame.
  std::vector<std::string> differences;
};

Both ReadBoth(Sabotage sabotage) {
  Both both;
  const auto plain = Variant(Sabotage::kNone);
  const auto broken = Variant(sabotage);
  EXPECT_TRUE(plain && broken);
  EXPECT_NE(plain->Key(), broken->Key()) << "cells would be taken for one another";
  auto plain_source = VariantSource::Open(*plain);
  auto broken_source = VariantSource::Open(*broken);
  EXPECT_TRUE(plain_source && broken_source);
  for (const int index : plain->frames) {
    both.plain.push_back(*plain_source->Read(index));
    both.broken.push_back(*broken_source->Read(index));
    both.differences.push_back(Differences(both.plain.back().frame, both.broken.back().frame));
    EXPECT_EQ(Differences(both.plain.back().truth, both.broken.back().truth), "")
        << "the truth stays";
  }
  EXPECT_GE(both.plain.size(), 8U);
  return both;
}

constexpr InstanceId kCar = 1;
constexpr InstanceId kHouse = 2;

TEST(Sabotage, ObjectPose) {
  const Both both = ReadBoth(Sabotage::kObjectPose);
  const std::size_t third = both.plain.size() / 3;
  for (std::size_t i = 0; i < both.plain.size(); ++i) {
    EXPECT_EQ(both.differences[i], i < third ? "" : "objects ") << i;
    const Pose T = both.plain[i].frame.T_WO.at(kCar).inverse() * both.broken[i].frame.T_WO.at(kCar);
    EXPECT_NEAR(T.translation().norm(), i < third ? 0 : 0.005, 1e-12) << i;
    EXPECT_EQ(both.plain[i].frame.T_WO.at(kHouse).matrix(),
              both.broken[i].frame.T_WO.at(kHouse).matrix());
  }
}

TEST(Sabotage, FrozenObject) {
  const Both both = ReadBoth(Sabotage::kFrozenObject);
  EXPECT_EQ(both.differences.front(), "");
  EXPECT_EQ(both.differences.back(), "objects ");
  for (const VariantFrame& frame : both.broken) {
    EXPECT_TRUE(SamePoses(frame.frame.T_WO, both.plain.front().frame.T_WO));
  }
}

// The car has the true pose of the recorded frame before, not of the used one before, of which
// there is one in four; what rests stays, and so does the first frame, before which there is none.
TEST(Sabotage, ObjectLate) {
  const Both both = ReadBoth(Sabotage::kObjectLate);
  const auto variant = Variant(Sabotage::kNone);
  auto source = VariantSource::Open(*variant);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < both.plain.size(); ++i) {
    const int before = std::max(0, both.plain[i].frame.index - 1);
    const Frame truth = *source->source().Read(before);
    EXPECT_EQ(both.broken[i].frame.T_WO.at(kCar).matrix(), truth.T_WO.at(kCar).matrix()) << i;
    EXPECT_EQ(both.broken[i].frame.T_WO.at(kHouse).matrix(),
              both.plain[i].frame.T_WO.at(kHouse).matrix());
    if (both.differences[i] == "objects ")
      ++moved;
    else
      EXPECT_EQ(both.differences[i], "") << i;
  }
  EXPECT_EQ(both.differences.front(), "");
  EXPECT_GE(moved, both.plain.size() / 2) << "the car drives for most of the sequence";
}

// Nothing was recorded before the first frame of all.
TEST(Sabotage, ObjectLateBeginsWithTheFirstFrame) {
  FrameChoice every = SmallFrames();
  every.stride = 1;
  const auto late = Variant(Sabotage::kObjectLate, every);
  ASSERT_TRUE(late.has_value());
  ASSERT_EQ(late->frames.front(), kFirstFrame);
  auto source = VariantSource::Open(*late);
  ASSERT_TRUE(source.has_value());
  const auto first = source->Read(kFirstFrame);
  ASSERT_TRUE(first.has_value()) << first.error().message;
  EXPECT_TRUE(SamePoses(first->frame.T_WO, first->truth.T_WO));
}

TEST(Sabotage, StalePose) {
  const Both both = ReadBoth(Sabotage::kStalePose);
  const std::size_t middle = both.plain.size() / 2;
  for (std::size_t i = 0; i < both.plain.size(); ++i) {
    EXPECT_EQ(both.differences[i], i == middle ? "camera objects " : "") << i;
  }
  EXPECT_EQ(both.broken[middle].frame.T_WC.matrix(), both.plain[middle - 1].frame.T_WC.matrix());
}

TEST(Sabotage, MasksSwapped) {
  const Both both = ReadBoth(Sabotage::kMasksSwapped);
  for (std::size_t i = 0; i < both.plain.size(); ++i) {
    EXPECT_EQ(both.differences[i], "mask ") << i;
    const cv::Mat& plain = both.plain[i].frame.mask;
    const cv::Mat& broken = both.broken[i].frame.mask;
    EXPECT_EQ(cv::countNonZero(plain == kCar), cv::countNonZero(broken == kHouse));
    EXPECT_EQ(cv::countNonZero((plain == kHouse) & (broken != kCar)), 0);
    EXPECT_EQ(cv::countNonZero((plain == kBackground) & (broken != kBackground)), 0);
  }
}

// Pixel by pixel: the car's where it or one of the eight pixels beside it was the car's.
TEST(Sabotage, MaskDilated) {
  const Both both = ReadBoth(Sabotage::kMaskDilated);
  for (std::size_t i = 0; i < both.plain.size(); ++i) {
    EXPECT_EQ(both.differences[i], "mask ") << i;
    const cv::Mat& plain = both.plain[i].frame.mask;
    const cv::Mat& broken = both.broken[i].frame.mask;
    int wrong = 0;
    for (int v = 0; v < plain.rows; ++v) {
      for (int u = 0; u < plain.cols; ++u) {
        bool beside = false;
        for (int dv = -1; dv <= 1; ++dv) {
          for (int du = -1; du <= 1; ++du) {
            const cv::Point p(u + du, v + dv);
            if (!cv::Rect(0, 0, plain.cols, plain.rows).contains(p)) continue;
            beside = beside || plain.at<std::uint16_t>(p) == kCar;
          }
        }
        const int expected = beside ? kCar : plain.at<std::uint16_t>(v, u);
        if (broken.at<std::uint16_t>(v, u) != expected) ++wrong;
      }
    }
    EXPECT_EQ(wrong, 0) << i;
  }
}

TEST(Sabotage, PrincipalPointAndDepthScale) {
  const Both point = ReadBoth(Sabotage::kPrincipalPoint);
  EXPECT_EQ(point.differences.back(), "intrinsics ");
  EXPECT_EQ(point.broken.back().frame.intrinsics.cx, point.plain.back().frame.intrinsics.cx + 1);
  const Both depth = ReadBoth(Sabotage::kDepthScale);
  EXPECT_EQ(depth.differences.back(), "depth ");
  cv::Mat ratio;
  cv::divide(depth.broken.back().frame.depth, depth.plain.back().frame.depth, ratio);
  double least = 0;
  double greatest = 0;
  cv::minMaxLoc(ratio, &least, &greatest, nullptr, nullptr, depth.plain.back().frame.depth > 0);
  EXPECT_NEAR(least, 1.005, 1e-6);
  EXPECT_NEAR(greatest, 1.005, 1e-6);
}

TEST(Sabotage, TruthShiftedChangesTheModelsAlone) {
  const Both both = ReadBoth(Sabotage::kTruthShifted);
  for (const std::string& difference : both.differences) EXPECT_EQ(difference, "");
  const auto variant = Variant(Sabotage::kTruthShifted);
  auto source = VariantSource::Open(*variant);
  const auto plain = SabotagedTruth(Sabotage::kNone, source->source(), 0.01);
  const auto raised = SabotagedTruth(Sabotage::kTruthShifted, source->source(), 0.01);
  ASSERT_TRUE(plain && raised);
  for (std::size_t i = 0; i < plain->trackers().size(); ++i) {
    const auto& a = plain->surface(i).model().mesh_O.vertices;
    const auto& b = raised->surface(i).model().mesh_O.vertices;
    ASSERT_EQ(a.size(), b.size());
    EXPECT_LT((b.front() - a.front() - Eigen::Vector3f(0, 0, 0.01F)).norm(), 1e-6F);
  }
}

TEST(Sabotage, MapSettings) {
  PipelineConfig plain;
  for (const Sabotage sabotage : Sabotages()) {
    PipelineConfig config;
    SabotageMap(sabotage, config);
    const bool of_map = sabotage == Sabotage::kTruncationHalved ||
                        sabotage == Sabotage::kContradictionOff ||
                        sabotage == Sabotage::kNearestResampling || sabotage == Sabotage::kRimsOff;
    EXPECT_EQ(config.map == plain.map, !of_map) << SabotageName(sabotage);
    CellSettings settings;
    const std::string key = MapKey(settings);
    settings.sabotage = sabotage;
    EXPECT_EQ(MapKey(settings) == key, IsOfSequence(sabotage)) << SabotageName(sabotage);
  }
}

SceneMeshes TwoObjectsOnATable() {
  SceneMeshes meshes;
  meshes.scene.vertices.assign(3, Eigen::Vector3f::Zero());
  meshes.scene.triangles.assign(4, {0, 1, 2});
  meshes.scene.face_ids = {0, 1, 2, 2};
  meshes.without[{1}] = meshes.scene;
  meshes.without[{1}].triangles.resize(5, {0, 1, 2});  // the table under object 1 is there
  meshes.without[{1}].face_ids = {0, 0, 0, 2, 2};
  return meshes;
}

TEST(Sabotage, Meshes) {
  SceneMeshes dropped = TwoObjectsOnATable();
  SabotageMeshes(Sabotage::kInactiveDropped, dropped);
  EXPECT_EQ(dropped.without[{1}].face_ids, (std::vector<InstanceId>{0, 2, 2}));
  EXPECT_EQ(dropped.scene.face_ids, TwoObjectsOnATable().scene.face_ids);

  SceneMeshes permuted = TwoObjectsOnATable();
  SabotageMeshes(Sabotage::kLabelsPermuted, permuted);
  EXPECT_EQ(permuted.scene.face_ids, (std::vector<InstanceId>{0, 2, 1, 1}));
  EXPECT_EQ(permuted.without[{1}].face_ids, (std::vector<InstanceId>{0, 0, 0, 1, 1}));
}

TEST(Sabotage, NamesComeBack) {
  EXPECT_EQ(Sabotages().size(), 16U);
  for (const Sabotage sabotage : Sabotages()) {
    EXPECT_EQ(*SabotageFromName(SabotageName(sabotage)), sabotage);
    EXPECT_FALSE(SabotageWords(sabotage).empty());
  }
  EXPECT_FALSE(SabotageFromName("frozen").has_value());
}

}  // namespace
}  // namespace tsdfpp
