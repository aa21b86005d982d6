// Segments of depth and a network's instances joined (paper III-B): against the rule spelled out
// pixel by pixel.
#include "mapper/segment/joined_segments.h"

#include <gtest/gtest.h>

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

TEST(JoinSegments, ByHand) {
  // Two halves of a mug, a cube beside it, and a table.
  const cv::Mat depth = (cv::Mat_<std::uint16_t>(2, 10) << 1, 1, 1, 1, 1, 2, 2, 2, 3, 0,  //
                         1, 1, 1, 1, 1, 2, 2, 2, 3, kNoInstance);
  const std::vector<Instance> instances{BoxOf({9, 0, 1, 2}, "cup", 1),
                                        BoxOf({0, 0, 8, 2}, "mug", 1)};
  const Segments joined =
      JoinSegments(depth, PaintInstances(instances, depth.size()), instances, 0.8);
  const cv::Mat expected = (cv::Mat_<std::uint16_t>(2, 10) << 1, 1, 1, 1, 1, 1, 1, 1, 2, 0,  //
                            1, 1, 1, 1, 1, 1, 1, 1, 2, kNoInstance);
  EXPECT_EQ(cv::countNonZero(joined.ids != expected), 0) << joined.ids;
  EXPECT_EQ(joined.classes, (std::map<InstanceId, std::string>{{1, "mug"}}));
}

// Exactly the threshold is not above it.
TEST(JoinSegments, EightOfTenAreNotMoreThanEightTenths) {
  const cv::Mat depth(1, 10, CV_16UC1, cv::Scalar(1));
  for (const int pixels : {8, 9}) {
    const std::vector<Instance> instances{BoxOf({0, 0, pixels, 1}, "cup", 1)};
    const Segments joined =
        JoinSegments(depth, PaintInstances(instances, depth.size()), instances, 0.8);
    EXPECT_EQ(joined.classes.size(), pixels == 9 ? 1U : 0U);
    EXPECT_EQ(joined.ids.at<InstanceId>(0, 9), 1);
  }
}

// The rule for one segment, counted afresh for each pixel that asks.
std::size_t InstanceByRule(const cv::Mat& depth, const cv::Mat& painted, InstanceId segment,
                           double overlap) {
  std::map<std::uint16_t, int> on;
  int all = 0;
  for (int i = 0; i < static_cast<int>(depth.total()); ++i) {
    const cv::Point at(i % depth.cols, i / depth.cols);
    if (depth.at<InstanceId>(at) != segment) continue;
    ++all;
    ++on[painted.at<std::uint16_t>(at)];
  }
  for (const auto& [instance, count] : on) {
    if (instance != 0 && count > overlap * all) return instance;
  }
  return 0;
}

TEST(JoinSegments, AgreesWithTheRuleOnRandomImages) {
  std::mt19937 draw(23);
  for (int round = 0; round < 40; ++round) {
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
      instances.push_back(
          BoxOf(box, std::string(1, static_cast<char>('a' + i)), static_cast<float>(draw() % 3)));
    }
    const cv::Mat painted = PaintInstances(instances, depth.size());
    const double overlap = 0.5 + 0.1 * static_cast<double>(draw() % 5);
    const Segments joined = JoinSegments(depth, painted, instances, overlap);
    // Two pixels are one where the rule says so, with its class.
    std::map<InstanceId, std::set<std::pair<bool, std::size_t>>> meant;
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        const InstanceId before = depth.at<InstanceId>(v, u);
        const InstanceId after = joined.ids.at<InstanceId>(v, u);
        if (before == kBackground || before == kNoInstance) {
          EXPECT_EQ(after, before);
          continue;
        }
        const std::size_t instance = InstanceByRule(depth, painted, before, overlap);
        meant[after].insert({instance != 0, instance != 0 ? instance : before});
        const auto name = joined.classes.find(after);
        EXPECT_EQ(name != joined.classes.end(), instance != 0);
        if (instance != 0 && name != joined.classes.end()) {
          EXPECT_EQ(name->second, instances[instance - 1].semantic_class);
        }
      }
    }
    InstanceId next = 1;
    for (const auto& [after, befores] : meant) {
      EXPECT_EQ(after, next++);
      EXPECT_EQ(befores.size(), 1U);
    }
  }
}

// Finds one box, and counts how often it was asked.
class BoxFinder : public InstanceFinder {
 public:
  Expected<std::vector<Instance>> Find(const Frame&) override {
    ++asked;
    return std::vector<Instance>{BoxOf({1, 1, 2, 2}, "box", 1)};
  }
  int asked = 0;
};

TEST(InstanceSegments, FramesBetweenHaveNone) {
  const auto finder = std::make_shared<BoxFinder>();
  NetworkConfig config;
  config.every = 3;
  InstanceSegments segmenter(finder, config);
  Frame frame;
  frame.depth = cv::Mat(4, 4, CV_32FC1, cv::Scalar(1));
  for (int i = 0; i < 7; ++i) {
    const Segments segments = segmenter.Segment(frame).value();
    if (i % 3 == 0) {
      EXPECT_EQ(cv::countNonZero(segments.ids == 1), 4);
      EXPECT_EQ(cv::countNonZero(segments.ids == kBackground), 12);
      EXPECT_EQ(segments.classes.at(1), "box");
    } else {
      EXPECT_EQ(cv::countNonZero(segments.ids == kNoInstance), 16);
      EXPECT_TRUE(segments.classes.empty());
    }
  }
  EXPECT_EQ(finder->asked, 3);
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
  config.join_overlap = 0.7;
  EXPECT_EQ(NetworkConfig::FromToml(config.ToToml(), "x").value(), config);
  const auto refused = [](NetworkConfig wrong) { return !wrong.Validate().has_value(); };
  EXPECT_TRUE(refused({.width = -1}));
  EXPECT_TRUE(refused({.every = 0}));
  EXPECT_TRUE(refused({.join_overlap = 0.4}));
  EXPECT_TRUE(refused({.classes = {""}}));
}

}  // namespace
}  // namespace tsdfpp
