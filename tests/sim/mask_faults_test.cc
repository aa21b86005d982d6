// Mask faults: rates and durations, and each step against brute force over all pairs of pixels.
// Longer than most files: a test for each fault.
#include "sim/sensor/mask_faults.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>
#include <set>

#include "core/random.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kMaskSeed = 31;

const std::vector<ObjectInfo>& Objects() {
  static const std::vector<ObjectInfo> kObjects = {{0, "background", ""},
                                                   {1, "car", "car"},
                                                   {2, "house", "house"},
                                                   {3, "mug", "mug"},
                                                   {4, "truck", "car"}};
  return kObjects;
}

// Discs and boxes of ids 1 to 4, some of which overlap, touch, or are cut by the border.
cv::Mat RandomMask(std::uint64_t seed, cv::Size size = {48, 36}) {
  cv::Mat mask = cv::Mat::zeros(size, CV_16UC1);
  for (std::uint16_t id = 1; id <= 4; ++id) {
    const auto draw = UniformDraw(seed, 0, id);
    const double radius = 2 + 7 * draw[2];
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const double du = std::abs(u - draw[0] * size.width);
        const double dv = std::abs(v - draw[1] * size.height);
        const double distance = id % 2 == 0 ? std::max(du, dv) : std::hypot(du, dv);
        if (distance < radius) mask.at<std::uint16_t>(v, u) = id;
      }
    }
  }
  return mask;
}

std::set<InstanceId> IdsIn(const cv::Mat& mask) {
  std::set<InstanceId> ids;
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) ids.insert(mask.at<std::uint16_t>(v, u));
  }
  ids.erase(kBackground);
  return ids;
}

// The squared distance from a pixel to the nearest one for which `is` holds; a large number if
// none.
template <typename Is>
int SquareTo(const cv::Mat& mask, int u, int v, const Is& is) {
  int least = 1 << 30;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (is(mask.at<std::uint16_t>(y, x))) {
        least = std::min(least, (x - u) * (x - u) + (y - v) * (y - v));
      }
    }
  }
  return least;
}

TEST(MaskFaults, RateIsTheShareOfFrames) {
  constexpr int kFrames = 40000;
  for (const int frames : {1, 3, 10}) {
    for (const double rate : {0.02, 0.3, 0.9}) {
      int active = 0;
      int run = 0;
      for (int frame = 1; frame <= kFrames; ++frame) {
        const auto start = FaultStart({rate, frames}, kMaskSeed, kStreamMaskBleed, frame, 2);
        if (start) {
          ++active;
          ++run;
          EXPECT_LE(*start, frame);
          EXPECT_GT(*start, frame - frames);
        } else {
          // A fault that was seen to begin lasts its frames at least.
          if (run > 0 && run < frame - 1) {
            EXPECT_GE(run, frames);
          }
          run = 0;
        }
      }
      // Neighbouring frames share their faults: at most 2 `frames` count as one draw.
      EXPECT_NEAR(static_cast<double>(active) / kFrames, rate,
                  kSigmas * std::sqrt(rate * (1 - rate) * 2 * frames / kFrames));
    }
  }
}

TEST(MaskFaults, RateNoneAndAll) {
  for (int frame = -5; frame < 100; ++frame) {
    EXPECT_FALSE(FaultStart({0, 5}, kMaskSeed, kStreamMaskBleed, frame, 2).has_value());
    EXPECT_EQ(FaultStart({1, 5}, kMaskSeed, kStreamMaskBleed, frame, 2), frame);
  }
}

TEST(MaskFaults, ObjectsAndKindsFailIndependently) {
  constexpr int kFrames = 20000;
  constexpr double kRate = 0.3;
  int objects = 0;
  int kinds = 0;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const bool one = FaultStart({kRate, 1}, kMaskSeed, kStreamMaskBleed, frame, 1).has_value();
    const bool two = FaultStart({kRate, 1}, kMaskSeed, kStreamMaskBleed, frame, 2).has_value();
    const bool other = FaultStart({kRate, 1}, kMaskSeed, kStreamMaskMissing, frame, 1).has_value();
    objects += one && two ? 1 : 0;
    kinds += one && other ? 1 : 0;
  }
  ExpectShare(objects, kFrames, kRate * kRate);
  ExpectShare(kinds, kFrames, kRate * kRate);
}

TEST(MaskFaults, ShrinkIsTheDistanceToWhatIsElse) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const cv::Mat mask = RandomMask(seed);
    for (const int pixels : {1, 2, 5}) {
      const cv::Mat shrunk = ShrinkMasks(mask, {1, 3}, pixels);
      for (int v = 0; v < mask.rows; ++v) {
        for (int u = 0; u < mask.cols; ++u) {
          const InstanceId id = mask.at<std::uint16_t>(v, u);
          const bool freed = (id == 1 || id == 3) && SquareTo(mask, u, v, [&](InstanceId other) {
                                                       return other != id;
                                                     }) <= pixels * pixels;
          ASSERT_EQ(shrunk.at<std::uint16_t>(v, u), freed ? kBackground : id);
        }
      }
    }
  }
}

TEST(MaskFaults, GrowIsTheDistanceToTheNearestObject) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const cv::Mat mask = RandomMask(seed);
    for (const int pixels : {1, 2, 5}) {
      const std::vector<InstanceId> growing = {4, 1};
      const cv::Mat grown = GrowMasks(mask, growing, pixels);
      for (int v = 0; v < mask.rows; ++v) {
        for (int u = 0; u < mask.cols; ++u) {
          const InstanceId id = mask.at<std::uint16_t>(v, u);
          InstanceId expected = id;
          if (id != 1 && id != 4) {
            const int to_1 = SquareTo(mask, u, v, [](InstanceId other) { return other == 1; });
            const int to_4 = SquareTo(mask, u, v, [](InstanceId other) { return other == 4; });
            if (std::min(to_1, to_4) <= pixels * pixels) expected = to_1 <= to_4 ? 1 : 4;
          }
          ASSERT_EQ(grown.at<std::uint16_t>(v, u), expected);
        }
      }
    }
  }
}

TEST(MaskFaults, AreaGrowsAndShrinksWithThePixels) {
  const cv::Mat mask = RandomMask(3);
  const auto area = [](const cv::Mat& image) { return cv::countNonZero(image == 1); };
  int grown = area(mask);
  int shrunk = area(mask);
  for (int pixels = 1; pixels < 5; ++pixels) {
    const int more = area(GrowMasks(mask, {1}, pixels));
    const int less = area(ShrinkMasks(mask, {1}, pixels));
    EXPECT_GT(more, grown);
    EXPECT_LT(less, shrunk);
    grown = more;
    shrunk = less;
  }
}

TEST(MaskFaults, SplitIsALineThroughTheMiddle) {
  cv::Mat mask = cv::Mat::zeros(61, 81, CV_16UC1);
  mask(cv::Rect(20, 10, 41, 41)).setTo(2);
  for (int step = 0; step < 12; ++step) {
    const double angle = (step + 0.3) * std::numbers::pi / 12;
    const cv::Mat split = SplitMask(mask, 2, angle, 200);
    int sides[2] = {0, 0};
    for (int v = 0; v < mask.rows; ++v) {
      for (int u = 0; u < mask.cols; ++u) {
        const InstanceId id = split.at<std::uint16_t>(v, u);
        if (mask.at<std::uint16_t>(v, u) == 0) {
          ASSERT_EQ(id, 0);
          continue;
        }
        // The line's normal, from the middle (40, 30).
        const double side = -std::sin(angle) * (u - 40) + std::cos(angle) * (v - 30);
        ASSERT_EQ(id, side > 0 ? 200 : 2);
        ++sides[id == 200 ? 1 : 0];
      }
    }
    // A line through the middle of a square halves it; the middle pixels lie on it.
    EXPECT_NEAR(sides[0], sides[1], 2);
  }
  // One pixel cannot be split.
  cv::Mat pixel = cv::Mat::zeros(5, 5, CV_16UC1);
  pixel.at<std::uint16_t>(2, 2) = 2;
  EXPECT_TRUE(SameBytes(SplitMask(pixel, 2, 1, 200), pixel));
}

TEST(MaskFaults, TouchingIsTheLongestContact) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const cv::Mat mask = RandomMask(seed);
    for (const int pixels : {1, 4}) {
      std::map<InstanceId, int> contact;
      for (int v = 0; v < mask.rows; ++v) {
        for (int u = 0; u < mask.cols; ++u) {
          const InstanceId id = mask.at<std::uint16_t>(v, u);
          if (id == 0 || id == 2) continue;
          const int square = SquareTo(mask, u, v, [](InstanceId other) { return other == 2; });
          if (square <= pixels * pixels) ++contact[id];
        }
      }
      InstanceId expected = kNoInstance;
      int most = 0;
      for (const auto& [id, count] : contact) {
        if (count > most) expected = id;
        most = std::max(most, count);
      }
      std::vector<InstanceId> others;
      others.reserve(contact.size());
      for (const auto& [id, count] : contact) others.push_back(id);
      EXPECT_EQ(TouchingObject(mask, 2, pixels, others), expected) << seed << " " << pixels;
    }
  }
}

TEST(MaskFaults, ExactChangesNothing) {
  const cv::Mat mask = RandomMask(1);
  const SensedMask sensed = SenseMask({}, kMaskSeed, 5, mask, Objects());
  EXPECT_TRUE(SameBytes(sensed.mask, mask));
  ASSERT_EQ(sensed.segments.size(), IdsIn(mask).size());
  for (const MaskSegment& segment : sensed.segments) {
    EXPECT_EQ(segment.id, segment.object);
    EXPECT_EQ(segment.semantic_class, Objects()[segment.id].semantic_class);
  }
}

MaskFaultConfig Only(FaultTiming MaskFaultConfig::*fault, FaultTiming timing) {
  MaskFaultConfig config;
  config.*fault = timing;
  return config;
}

TEST(MaskFaults, MissingLastsItsFrames) {
  const cv::Mat mask = RandomMask(1);
  const MaskFaultConfig config = Only(&MaskFaultConfig::missing, {0.2, 4});
  int gone = 0;
  for (int frame = 1; frame <= 300; ++frame) {
    const SensedMask sensed = SenseMask(config, kMaskSeed, frame, mask, Objects());
    for (const InstanceId id : IdsIn(mask)) {
      const bool missing =
          FaultStart(config.missing, kMaskSeed, kStreamMaskMissing, frame, id).has_value();
      EXPECT_EQ(IdsIn(sensed.mask).contains(id), !missing);
      gone += missing ? 1 : 0;
    }
    // What is left is where it was.
    const cv::Mat left = sensed.mask != 0;
    cv::Mat same;
    cv::bitwise_and(left, sensed.mask != mask, same);
    EXPECT_EQ(cv::countNonZero(same), 0);
  }
  EXPECT_GT(gone, 0);
}

TEST(MaskFaults, MergedObjectsShareTheLowestId) {
  cv::Mat mask = cv::Mat::zeros(20, 60, CV_16UC1);
  mask(cv::Rect(2, 2, 10, 10)).setTo(3);
  mask(cv::Rect(12, 2, 10, 10)).setTo(1);  // touches 3
  mask(cv::Rect(40, 2, 10, 10)).setTo(2);  // alone
  MaskFaultConfig config;
  config.merged = {{1, 1}, 2};
  const SensedMask sensed = SenseMask(config, kMaskSeed, 5, mask, Objects());
  EXPECT_EQ(IdsIn(sensed.mask), (std::set<InstanceId>{1, 2}));
  EXPECT_EQ(cv::countNonZero(sensed.mask == 1), 200);
  const std::vector<MaskSegment> expected = {{1, 1, "car"}, {2, 2, "house"}};
  EXPECT_EQ(sensed.segments, expected);
  // A chain becomes one.
  mask(cv::Rect(22, 2, 18, 10)).setTo(4);
  const SensedMask chain = SenseMask(config, kMaskSeed, 5, mask, Objects());
  EXPECT_EQ(IdsIn(chain.mask), (std::set<InstanceId>{1}));
}

TEST(MaskFaults, FlickerInventsOneIdAFault) {
  const cv::Mat mask = RandomMask(1);
  const MaskFaultConfig config = Only(&MaskFaultConfig::flicker, {0.4, 3});
  std::map<std::pair<InstanceId, int>, std::set<InstanceId>> invented;
  for (int frame = 1; frame <= 200; ++frame) {
    const SensedMask sensed = SenseMask(config, kMaskSeed, frame, mask, Objects());
    EXPECT_EQ(sensed.segments.size(), IdsIn(mask).size());
    EXPECT_TRUE(SameBytes(sensed.mask != 0, mask != 0));
    for (const MaskSegment& segment : sensed.segments) {
      const auto start =
          FaultStart(config.flicker, kMaskSeed, kStreamMaskFlicker, frame, segment.object);
      EXPECT_EQ(segment.id != segment.object, start.has_value());
      EXPECT_TRUE(SameBytes(sensed.mask == segment.id, mask == segment.object));
      if (!start) continue;
      EXPECT_GE(segment.id, kFirstInventedId);
      EXPECT_LE(segment.id, kLastInventedId);
      invented[{segment.object, *start}].insert(segment.id);
    }
  }
  // The same id for all frames of a fault, but where two objects drew the same in one frame.
  int changing = 0;
  std::set<InstanceId> all;
  for (const auto& [fault, ids] : invented) {
    changing += ids.size() > 1 ? 1 : 0;
    all.insert(ids.begin(), ids.end());
  }
  EXPECT_LT(changing * 20, static_cast<int>(invented.size()));
  EXPECT_GT(all.size(), 50U);
}

TEST(MaskFaults, SplitPartsBelongToTheirObject) {
  const cv::Mat mask = RandomMask(1);
  const SensedMask sensed =
      SenseMask(Only(&MaskFaultConfig::split, {1, 1}), kMaskSeed, 9, mask, Objects());
  EXPECT_EQ(sensed.segments.size(), 2 * IdsIn(mask).size());
  std::map<InstanceId, int> parts;
  for (const MaskSegment& segment : sensed.segments) {
    ++parts[segment.object];
    cv::Mat outside;
    cv::bitwise_and(sensed.mask == segment.id, mask != segment.object, outside);
    EXPECT_EQ(cv::countNonZero(outside), 0);
  }
  for (const auto& [object, count] : parts) EXPECT_EQ(count, 2) << object;
}

TEST(MaskFaults, WrongClassIsAnotherOnesClass) {
  const cv::Mat mask = RandomMask(1);
  const MaskFaultConfig config = Only(&MaskFaultConfig::wrong_class, {0.5, 2});
  std::map<std::string, int> named;
  int wrong = 0;
  constexpr int kFrames = 4000;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const SensedMask sensed = SenseMask(config, kMaskSeed, frame, mask, Objects());
    EXPECT_TRUE(SameBytes(sensed.mask, mask));
    for (const MaskSegment& segment : sensed.segments) {
      if (segment.object != 3) continue;
      const bool fault =
          FaultStart(config.wrong_class, kMaskSeed, kStreamMaskWrongClass, frame, 3).has_value();
      EXPECT_EQ(segment.semantic_class != "mug", fault);
      ++named[segment.semantic_class];
      wrong += fault ? 1 : 0;
    }
  }
  // "car" (of two objects) and "house" alike.
  EXPECT_EQ(named.size(), 3U);
  EXPECT_NEAR(named["car"], wrong / 2.0, kSigmas * std::sqrt(wrong * 0.25 * 2));
  // Without another class in the scene there is none.
  const SensedMask alone = SenseMask(Only(&MaskFaultConfig::wrong_class, {1, 1}), kMaskSeed, 1,
                                     mask, {{0, "background", ""}, {3, "mug", "mug"}});
  for (const MaskSegment& segment : alone.segments) {
    if (segment.object == 3) {
      EXPECT_EQ(segment.semantic_class, "");
    }
  }
}

// Ids of one frame say nothing of the next, and there is a segment for each object.
TEST(MaskFaults, RedrawnIdsAreOfOneFrame) {
  EXPECT_FALSE(DrawsEveryId({}));
  EXPECT_FALSE(DrawsEveryId(Only(&MaskFaultConfig::flicker, {0.99, 1})));
  const MaskFaultConfig config = SensorPresetNamed("masks_redrawn").value().masks;
  EXPECT_TRUE(DrawsEveryId(config));
  const cv::Mat mask = RandomMask(1);
  std::map<InstanceId, InstanceId> before;  // by object
  int same = 0;
  constexpr int kFrames = 400;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const SensedMask sensed = SenseMask(config, kMaskSeed, frame, mask, Objects());
    EXPECT_EQ(sensed.segments.size(), IdsIn(mask).size());
    for (const MaskSegment& segment : sensed.segments) {
      EXPECT_GE(segment.id, kFirstInventedId);
      EXPECT_TRUE(SameBytes(sensed.mask == segment.id, mask == segment.object));
      same += before[segment.object] == segment.id ? 1 : 0;
      before[segment.object] = segment.id;
    }
  }
  const double draws = static_cast<double>(kFrames * IdsIn(mask).size());
  const double chance = 1.0 / (kLastInventedId - kFirstInventedId + 1);
  EXPECT_NEAR(same, draws * chance, kSigmas * std::sqrt(draws * chance));
}

TEST(MaskFaults, AllAtOnceKeepIdsAndSegmentsTogether) {
  MaskFaultConfig config;
  config.missing = {0.2, 3};
  config.undershoot = {{0.3, 3}, 2};
  config.bleed = {{0.3, 3}, 3};
  config.split = {0.4, 3};
  config.merged = {{0.4, 3}, 3};
  config.flicker = {0.4, 3};
  config.wrong_class = {0.4, 3};
  for (int frame = 1; frame <= 300; ++frame) {
    const cv::Mat mask = RandomMask(static_cast<std::uint64_t>(frame));
    const SensedMask sensed = SenseMask(config, kMaskSeed, frame, mask, Objects());
    std::set<InstanceId> named;
    for (const MaskSegment& segment : sensed.segments) {
      named.insert(segment.id);
      EXPECT_TRUE(IdsIn(mask).contains(segment.object));
    }
    EXPECT_EQ(named, IdsIn(sensed.mask));
    EXPECT_EQ(named.size(), sensed.segments.size());
  }
}

}  // namespace
}  // namespace tsdfpp
