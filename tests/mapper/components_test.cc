#include "mapper/segment/components.h"

#include <gtest/gtest.h>

#include <deque>

#include "core/random.h"

namespace tsdfpp {
namespace {

// A random image of members and links, denser or thinner by `share`.
struct RandomLinks {
  cv::Mat member, right, down;
  RandomLinks(int rows, int cols, double share, std::uint64_t seed)
      : member(rows, cols, CV_8UC1), right(rows, cols, CV_8UC1), down(rows, cols, CV_8UC1) {
    for (int v = 0; v < rows; ++v) {
      for (int u = 0; u < cols; ++u) {
        const auto draw = UniformDraw(seed, 2, static_cast<std::uint64_t>(v * cols + u));
        member.at<std::uint8_t>(v, u) = draw[0] < share ? 255 : 0;
        right.at<std::uint8_t>(v, u) = u + 1 < cols && draw[1] < share ? 1 : 0;
        down.at<std::uint8_t>(v, u) = v + 1 < rows && draw[2] < share ? 1 : 0;
      }
    }
  }
};

std::vector<cv::Point> NeighboursOf(const cv::Point& p, const RandomLinks& links) {
  std::vector<cv::Point> found;
  const cv::Rect image({0, 0}, links.member.size());
  const cv::Point above(p.x, p.y - 1);
  const cv::Point left(p.x - 1, p.y);
  if (image.contains(above) && links.down.at<std::uint8_t>(above) != 0) found.push_back(above);
  if (image.contains(left) && links.right.at<std::uint8_t>(left) != 0) found.push_back(left);
  if (links.right.at<std::uint8_t>(p) != 0) found.emplace_back(p.x + 1, p.y);
  if (links.down.at<std::uint8_t>(p) != 0) found.emplace_back(p.x, p.y + 1);
  return found;
}

// Floods from each pixel in order of rows.
cv::Mat Flood(const RandomLinks& links, std::int32_t first) {
  cv::Mat labels = cv::Mat::zeros(links.member.size(), CV_32SC1);
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      if (links.member.at<std::uint8_t>(v, u) == 0 || labels.at<std::int32_t>(v, u) != 0) continue;
      std::deque<cv::Point> queue{{u, v}};
      labels.at<std::int32_t>(v, u) = first;
      while (!queue.empty()) {
        const cv::Point at = queue.front();
        queue.pop_front();
        for (const cv::Point& next : NeighboursOf(at, links)) {
          if (links.member.at<std::uint8_t>(next) == 0 || labels.at<std::int32_t>(next) != 0) {
            continue;
          }
          labels.at<std::int32_t>(next) = first;
          queue.push_back(next);
        }
      }
      ++first;
    }
  }
  return labels;
}

TEST(Components, AreThoseThatFloodingFinds) {
  for (const double share : {0.3, 0.6, 0.8, 0.95}) {
    const RandomLinks links(53, 71, share, 11);
    const cv::Mat expected = Flood(links, 5);
    cv::Mat labels = cv::Mat::zeros(expected.size(), CV_32SC1);
    const std::int32_t end = LabelComponents(links.member, {links.right, links.down}, 5, labels);
    EXPECT_EQ(cv::countNonZero(labels != expected), 0) << share;
    double greatest = 0;
    cv::minMaxLoc(expected, nullptr, &greatest);
    EXPECT_EQ(end, static_cast<std::int32_t>(greatest) + 1);
  }
}

TEST(Components, GrowToTheNearestLabel) {
  const RandomLinks links(40, 60, 0.8, 12);
  cv::Mat known(40, 60, CV_32FC1);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      known.at<float>(v, u) = links.member.at<std::uint8_t>(v, u) == 0 ? 0.0F : 1.0F;
    }
  }
  cv::Mat labels = cv::Mat::zeros(40, 60, CV_32SC1);
  for (const cv::Point& seed : {cv::Point(10, 10), cv::Point(50, 5), cv::Point(30, 33)}) {
    labels.at<std::int32_t>(seed) = seed.x;
    known.at<float>(seed) = 1;
  }
  // Steps from each seed, one seed at a time.
  std::map<int, cv::Mat> steps;
  for (const cv::Point& seed : {cv::Point(10, 10), cv::Point(50, 5), cv::Point(30, 33)}) {
    cv::Mat away(40, 60, CV_32SC1, cv::Scalar(1 << 20));
    std::deque<cv::Point> queue{seed};
    away.at<std::int32_t>(seed) = 0;
    while (!queue.empty()) {
      const cv::Point at = queue.front();
      queue.pop_front();
      for (const cv::Point& next : NeighboursOf(at, links)) {
        if (known.at<float>(next) == 0 || away.at<std::int32_t>(next) < (1 << 20)) continue;
        away.at<std::int32_t>(next) = away.at<std::int32_t>(at) + 1;
        queue.push_back(next);
      }
    }
    steps[seed.x] = away;
  }
  cv::Mat scratch;
  GrowLabels(known, {links.right, links.down}, scratch, labels);
  int grown = 0;
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      const std::int32_t label = labels.at<std::int32_t>(v, u);
      int least = 1 << 20;
      for (const auto& [seed, away] : steps) least = std::min(least, away.at<std::int32_t>(v, u));
      if (label == 0) {
        ASSERT_TRUE(least == 1 << 20 || known.at<float>(v, u) == 0) << u << ' ' << v;
      } else {
        ++grown;
        ASSERT_EQ(steps[label].at<std::int32_t>(v, u), least) << u << ' ' << v;
      }
    }
  }
  EXPECT_GT(grown, 1000);
}

// Stripes of 6, 1, 2 and 6 columns, all linked, and a lone pixel.
TEST(Components, SmallOnesJoinTheNeighbourThatTheyShareMostWith) {
  constexpr int kRows = 4;
  cv::Mat labels(kRows, 17, CV_32SC1);
  for (int v = 0; v < kRows; ++v) {
    for (int u = 0; u < 17; ++u) {
      labels.at<std::int32_t>(v, u) = u < 6 ? 1 : u < 7 ? 2 : u < 9 ? 3 : u < 15 ? 4 : 0;
    }
  }
  labels.at<std::int32_t>(2, 16) = 5;
  // One link between the stripes 2 and 3 is missing, so 2 shares more with 1.
  cv::Mat right(kRows, 17, CV_8UC1, cv::Scalar(1));
  cv::Mat down(kRows, 17, CV_8UC1, cv::Scalar(1));
  right.at<std::uint8_t>(0, 6) = 0;
  right.col(15).setTo(0);
  const auto sizes = MeasureParts(labels, cv::Mat(kRows, 17, CV_32FC1, cv::Scalar(2)), 0.01F, 6);
  EXPECT_EQ(sizes[3].pixels, 8);
  EXPECT_NEAR(sizes[3].area_m2, 8 * 0.02 * 0.02, 1e-9);
  cv::Mat joined = labels.clone();
  EXPECT_EQ(JoinSmall({right, down}, {10, 0}, 3, sizes, joined), 5);
  for (int u = 0; u < 15; ++u) {
    EXPECT_EQ(joined.at<std::int32_t>(1, u), u < 7 ? 3 : 4) << u;
  }
  EXPECT_EQ(joined.at<std::int32_t>(2, 16), 0);
  // Small in area alone is small, too: all but the two widest.
  cv::Mat by_area = labels.clone();
  EXPECT_EQ(JoinSmall({right, down}, {0, 10 * 0.02 * 0.02}, 3, sizes, by_area), 5);
  EXPECT_EQ(cv::countNonZero(by_area != joined), 0);
  cv::Mat kept = labels.clone();
  EXPECT_EQ(JoinSmall({right, down}, {1, 0}, 1, sizes, kept), 6);
  EXPECT_EQ(cv::countNonZero(kept != labels), 0);
}

}  // namespace
}  // namespace tsdfpp
