// Segments of depth and a network's instances joined (paper III-B): against the rule spelled out
// pixel by pixel.
#include "mapper/segment/joined_segments.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>

namespace tsdfpp {
namespace {

Instance BoxOf(const cv::Rect& box, const std::string& name, float score) {
  return {box, cv::Mat(box.size(), CV_8UC1, cv::Scalar(255)), name, score};
}

TEST(PaintInstances, TheSurestIsOnTop) {
  const std::vector<Instance> instances{
      BoxOf({0, 0, 4, 2}, "a", 0.5F), BoxOf({2, 0, 4, 2}, "b", 0.9F),
      BoxOf({3, 0, 4, 2}, "c", 0.5F), BoxOf({0, 0, 1, 1}, "d", 0.5F)};
  const cv::Mat painted = PaintInstances(instances, {8, 2});
  // Of equal scores the first: "d" is below "a".
  EXPECT_EQ(cv::countNonZero(painted.row(0) !=
                             cv::Mat(cv::Matx<std::uint16_t, 1, 8>(1, 1, 2, 2, 2, 2, 3, 0))),
            0)
      << painted;
}

cv::Mat Row(std::initializer_list<std::uint16_t> ids) {
  return cv::Mat(std::vector<std::uint16_t>(ids), true).reshape(1, 1);
}

Segments Join(const cv::Mat& depth, const std::vector<Instance>& instances,
              const NetworkConfig& config = {}) {
  return JoinSegments(depth, PaintInstances(instances, depth.size()), instances, config);
}

TEST(JoinSegments, ByHand) {
  // Two halves of a mug, a cube beside it, and a table.
  const cv::Mat depth = (cv::Mat_<std::uint16_t>(2, 10) << 1, 1, 1, 1, 1, 2, 2, 2, 3, 0,  //
                         1, 1, 1, 1, 1, 2, 2, 2, 3, kNoInstance);
  const std::vector<Instance> instances{BoxOf({9, 0, 1, 1}, "cup", 0.5F),
                                        BoxOf({0, 0, 8, 2}, "mug", 1)};
  NetworkConfig config;
  for (const bool unknown_objects : {false, true}) {
    config.unknown_objects = unknown_objects;
    const Segments joined = Join(depth, instances, config);
    const cv::Mat expected = (cv::Mat_<std::uint16_t>(2, 10) << 1, 1, 1, 1, 1, 1, 1, 1, 2, 0,  //
                              1, 1, 1, 1, 1, 1, 1, 1, 2, kNoInstance);
    EXPECT_EQ(cv::countNonZero(joined.ids != expected), 0) << joined.ids;
    EXPECT_EQ(joined.classes, (std::map<InstanceId, std::string>{{1, "mug"}}));
    // Of the cube no network knows.
    EXPECT_EQ(joined.unknown,
              unknown_objects ? std::vector<InstanceId>{} : std::vector<InstanceId>{2});
    const cv::Mat known = (cv::Mat_<std::uint16_t>(2, 10) << 1, 1, 1, 1, 1, 1, 1, 1, 0, 0,  //
                           1, 1, 1, 1, 1, 1, 1, 1, 0, kNoInstance);
    EXPECT_EQ(cv::countNonZero(joined.IdsOfObjects() != (unknown_objects ? expected : known)), 0);
  }
}

// Exactly the threshold is not above it.
TEST(JoinSegments, EightOfTenAreNotMoreThanEightTenths) {
  const cv::Mat depth(1, 10, CV_16UC1, cv::Scalar(1));
  NetworkConfig config;
  config.join_iou = 1;
  for (const int pixels : {8, 9}) {
    const Segments joined = Join(depth, {BoxOf({0, 0, pixels, 1}, "cup", 0.5F)}, config);
    EXPECT_EQ(joined.classes.size(), pixels == 9 ? 1U : 0U);
    EXPECT_EQ(joined.ids.at<InstanceId>(0, 9), 1);
  }
}

// A mask that lacks a third of a thing is its all the same; one of half of it is not.
TEST(JoinSegments, WhatIsMostlyTheSameIsOne) {
  const cv::Mat depth = Row({1, 1, 1, 1, 1, 1, 0, 0});
  for (const int pixels : {3, 4}) {
    const Segments joined = Join(depth, {BoxOf({0, 0, pixels, 1}, "cup", 0.5F)});
    EXPECT_EQ(joined.classes.size(), pixels == 4 ? 1U : 0U);
    EXPECT_EQ(joined.unknown.size(), pixels == 4 ? 0U : 1U);
  }
}

// A book on a table: depth sees but the table.
TEST(JoinSegments, ASureInstanceWithoutSegmentsKeepsItsMask) {
  const cv::Mat depth = Row({0, 0, 0, 0, 1, 1, 2, 2, 2, 2, 2, 2});
  for (const float score : {0.5F, 0.9F}) {
    const Segments joined =
        Join(depth, {BoxOf({1, 0, 4, 1}, "book", score), BoxOf({6, 0, 6, 1}, "cup", 1)});
    const cv::Mat expected = score > 0.8F ? Row({0, 1, 1, 1, 1, 3, 2, 2, 2, 2, 2, 2})
                                          : Row({0, 0, 0, 0, 2, 2, 1, 1, 1, 1, 1, 1});
    EXPECT_EQ(cv::countNonZero(joined.ids != expected), 0) << joined.ids;
  }
}

// Segments of two pixels, of each of which an instance has one: together more than there are ids.
TEST(JoinSegments, IdsDoNotWrap) {
  constexpr int kSegments = 40000;
  cv::Mat depth(200, 2 * kSegments / 200, CV_16UC1);
  std::vector<Instance> instances;
  for (int i = 0; i < kSegments; ++i) {
    const cv::Rect pair(2 * i % depth.cols, 2 * i / depth.cols, 2, 1);
    depth(pair) = i + 1;
    instances.push_back(BoxOf({pair.x, pair.y, 1, 1}, "cup", 1));
  }
  const Segments joined = Join(depth, instances);
  EXPECT_EQ(joined.classes.size(), std::size_t{kNoInstance - 1 - kSegments});
  EXPECT_EQ(joined.unknown.size(), std::size_t{kSegments});
  EXPECT_EQ(joined.unknown.front(), joined.classes.size() + 1);
  EXPECT_EQ(joined.unknown.back(), kNoInstance - 1);
  EXPECT_EQ(joined.ids.at<InstanceId>(0, 0), 1);
  EXPECT_EQ(joined.ids.at<InstanceId>(depth.rows - 1, depth.cols - 2), kNoInstance - 1);
}

// The rule for one segment, counted afresh for each pixel that asks.
std::size_t InstanceByRule(const cv::Mat& depth, const cv::Mat& painted, InstanceId segment,
                           const NetworkConfig& config) {
  std::map<std::uint16_t, int> on;
  std::map<std::uint16_t, int> areas;
  int all = 0;
  for (int i = 0; i < static_cast<int>(depth.total()); ++i) {
    const cv::Point at(i % depth.cols, i / depth.cols);
    if (depth.at<InstanceId>(at) == kNoInstance) continue;
    ++areas[painted.at<std::uint16_t>(at)];
    if (depth.at<InstanceId>(at) != segment) continue;
    ++all;
    ++on[painted.at<std::uint16_t>(at)];
  }
  for (const auto& [instance, count] : on) {
    if (instance == 0) continue;
    if (count > config.join_overlap * all ||
        count > config.join_iou * (all + areas[instance] - count)) {
      return instance;
    }
  }
  return 0;
}

// Whether an instance keeps its mask, counted afresh.
bool KeepsByRule(const cv::Mat& depth, const cv::Mat& painted, std::size_t instance, float score,
                 const NetworkConfig& config) {
  int area = 0;
  int held = 0;
  bool is_there = false;
  for (int i = 0; i < static_cast<int>(depth.total()); ++i) {
    const cv::Point at(i % depth.cols, i / depth.cols);
    const InstanceId segment = depth.at<InstanceId>(at);
    is_there = is_there || painted.at<std::uint16_t>(at) == instance;
    if (painted.at<std::uint16_t>(at) != instance || segment == kNoInstance) continue;
    ++area;
    if (segment == kBackground) continue;
    held += InstanceByRule(depth, painted, segment, config) == instance ? 1 : 0;
  }
  return score >= config.mask_score && is_there && (area == 0 || held < 0.5 * area);
}

TEST(JoinSegments, AgreesWithTheRuleOnRandomImages) {
  std::mt19937 draw(23);
  int kept = 0;
  int filled = 0;
  for (int round = 0; round < 60; ++round) {
    cv::Mat depth(12, 16, CV_16UC1);
    const int cell = 2 + static_cast<int>(draw() % 4);
    const auto salt = draw();
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        const auto place = static_cast<std::uint32_t>(v / cell * 31 + u / cell * 17);
        const auto number = (place * 2654435761U + salt) >> 8U;
        depth.at<InstanceId>(v, u) = number % 9 == 8 ? kNoInstance : number % 9;
      }
    }
    std::vector<Instance> instances;
    for (int i = 0; i < 4; ++i) {
      const cv::Rect box(static_cast<int>(draw() % 10), static_cast<int>(draw() % 8),
                         1 + static_cast<int>(draw() % 6), 1 + static_cast<int>(draw() % 4));
      instances.push_back(BoxOf(box, std::string(1, static_cast<char>('a' + i)),
                                0.5F * static_cast<float>(draw() % 3)));
    }
    const cv::Mat painted = PaintInstances(instances, depth.size());
    NetworkConfig config;
    config.join_overlap = 0.5 + 0.1 * static_cast<double>(draw() % 5);
    config.join_iou = 0.5 + 0.1 * static_cast<double>(draw() % 5);
    const Segments joined = Join(depth, instances, config);
    std::vector<bool> keeps(instances.size() + 1);
    for (std::size_t i = 1; i <= instances.size(); ++i) {
      keeps[i] = KeepsByRule(depth, painted, i, instances[i - 1].score, config);
    }
    // What each new id means: an instance, or a segment.
    std::map<InstanceId, std::set<std::pair<bool, std::size_t>>> meant;
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        const InstanceId before = depth.at<InstanceId>(v, u);
        const InstanceId after = joined.ids.at<InstanceId>(v, u);
        const std::size_t on = painted.at<std::uint16_t>(v, u);
        std::size_t instance = 0;
        if (before != kBackground && before != kNoInstance) {
          instance = InstanceByRule(depth, painted, before, config);
        }
        if (instance == 0 && before != kNoInstance && keeps[on]) {
          instance = on;
          ++kept;
        }
        if (before == kNoInstance) {
          // The instance's that is there, if any: checked below by what it means.
          if (after == kNoInstance) continue;
          instance = on;
          ++filled;
          ASSERT_NE(on, 0U);
        }
        if (instance == 0 && before == kBackground) {
          EXPECT_EQ(after, kBackground);
          continue;
        }
        meant[after].insert({instance != 0, instance != 0 ? instance : before});
        const auto name = joined.classes.find(after);
        EXPECT_EQ(name != joined.classes.end(), instance != 0);
        EXPECT_EQ(std::binary_search(joined.unknown.begin(), joined.unknown.end(), after),
                  instance == 0);
        if (instance != 0 && name != joined.classes.end()) {
          EXPECT_EQ(name->second, instances[instance - 1].semantic_class);
        }
      }
    }
    InstanceId next = 1;
    std::set<std::size_t> there;
    for (const auto& [after, befores] : meant) {
      EXPECT_EQ(after, next++);
      EXPECT_EQ(befores.size(), 1U);
      if (befores.begin()->first) there.insert(befores.begin()->second);
    }
    for (int i = 0; i < static_cast<int>(depth.total()); ++i) {
      const cv::Point at(i % depth.cols, i / depth.cols);
      if (depth.at<InstanceId>(at) != kNoInstance) continue;
      EXPECT_EQ(joined.ids.at<InstanceId>(at) != kNoInstance,
                there.contains(painted.at<std::uint16_t>(at)));
    }
  }
  EXPECT_GT(kept, 50);
  EXPECT_GT(filled, 50);
}

TEST(NetworkConfig, ComesBackFromToml) {
  NetworkConfig config;
  config.format = NetworkFormat::kYolo;
  config.classes = {"cup", "car"};
  config.graph = "x.pbtxt";
  config.width = 320;
  config.height = 192;
  config.least_score = 0.25;
  config.most_overlap = 0.6;
  config.mask_share = 0.4;
  config.every = 5;
  config.latency = 4;
  config.gives_way = true;
  config.join_overlap = 0.7;
  config.join_iou = 0.6;
  config.mask_score = 0.9;
  config.unknown_objects = true;
  EXPECT_EQ(NetworkConfig::FromToml(config.ToToml(), "x").value(), config);
  const auto refused = [](const NetworkConfig& wrong) { return !wrong.Validate().has_value(); };
  EXPECT_TRUE(refused({.width = -1}));
  EXPECT_TRUE(refused({.every = 0}));
  EXPECT_TRUE(refused({.every = 2, .latency = 3}));
  EXPECT_TRUE(refused({.every = 2, .gives_way = true}));
  EXPECT_TRUE(refused({.join_overlap = 0.4}));
  EXPECT_TRUE(refused({.join_iou = 0.4}));
  EXPECT_TRUE(refused({.mask_score = 1.1}));
  EXPECT_TRUE(refused({.classes = {""}}));
}

}  // namespace
}  // namespace tsdfpp
