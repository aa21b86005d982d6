// The dot pattern and its matching against the published algorithm, written as it is published:
// dots in reading order scatter their value into the pixels around.
#include "sim/sensor/dot_pattern.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/random.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

TEST(DotPattern, HasOneDotACell) {
  const cv::Mat dots = MakeDotPattern(3, cv::Size(63, 48));
  for (int v = 0; v < 48; v += 3) {
    for (int u = 0; u < 63; u += 3) {
      EXPECT_EQ(cv::countNonZero(dots(cv::Rect(u, v, 3, 3))), 1);
    }
  }
  // All nine places are equally likely.
  const cv::Mat large = MakeDotPattern(4, cv::Size(600, 600));
  std::vector<int> places(9, 0);
  for (int v = 0; v < 600; ++v) {
    for (int u = 0; u < 600; ++u) {
      if (large.at<std::uint8_t>(v, u) != 0) ++places[static_cast<std::size_t>(v % 3 * 3 + u % 3)];
    }
  }
  for (const int count : places) ExpectShare(count, 200 * 200, 1.0 / 9);
  EXPECT_FALSE(SameBytes(dots, MakeDotPattern(5, cv::Size(63, 48))));
  EXPECT_TRUE(SameBytes(dots, MakeDotPattern(3, cv::Size(63, 48))));
  // A size that cells do not fill.
  EXPECT_EQ(MakeDotPattern(3, cv::Size(64, 47)).size(), cv::Size(64, 47));
}

// Disparity <= 0 is unknown, as is 0 in the result.
cv::Mat ScatterDots(const cv::Mat& disparity, const cv::Mat& dots) {
  cv::Mat result = cv::Mat::zeros(disparity.size(), CV_32FC1);
  cv::Mat interpolation = cv::Mat::zeros(disparity.size(), CV_64FC1);
  for (int top = 0; top + 9 <= disparity.rows; ++top) {
    for (int left = 0; left + 9 <= disparity.cols; ++left) {
      if (dots.at<std::uint8_t>(top + 4, left + 4) == 0) continue;
      std::vector<double> known;
      double all_dots = 0;
      double known_dots = 0;
      for (int i = 0; i < 81; ++i) {
        const float d = disparity.at<float>(top + i / 9, left + i % 9);
        const int dot = dots.at<std::uint8_t>(top + i / 9, left + i % 9);
        all_dots += dot;
        if (d > 0) known.push_back(d);
        if (d > 0) known_dots += dot;
      }
      if (!(known_dots > all_dots / 1.2)) continue;
      double mean = 0;
      for (const double d : known) mean += d;
      mean /= static_cast<double>(known.size());
      double agreeing = 0;
      for (int i = 0; i < 81; ++i) {
        const float d = disparity.at<float>(top + i / 9, left + i % 9);
        const double x = i % 9 - 4;
        const double y = i / 9 - 4;
        const double value = (x * x + y * y) * 1.2 * 1.2;
        const double weight = value == 0 ? 1 : 1 / value;
        if (d > 0 && std::abs(d - mean) * weight < 0.1) {
          agreeing += dots.at<std::uint8_t>(top + i / 9, left + i % 9);
        }
      }
      const float centre = disparity.at<float>(top + 4, left + 4);
      if (!(agreeing > all_dots / 1.2) || centre <= 0) continue;
      const float value = std::round(centre * 8) / 8;
      for (int i = 0; i < 81; ++i) {
        const double square = (i % 9 - 4) * (i % 9 - 4) + (i / 9 - 4) * (i / 9 - 4);
        if (square > 9) continue;
        double& best = interpolation.at<double>(top + i / 9, left + i % 9);
        if (best >= 1 / (1 + square)) continue;
        best = 1 / (1 + square);
        result.at<float>(top + i / 9, left + i % 9) = value;
      }
    }
  }
  return result;
}

TEST(DotPattern, MatchesAsPublished) {
  int matched = 0;
  int holes = 0;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const cv::Size size(120, 90);
    cv::Mat disparity(size, CV_32FC1);
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const auto draw =
            UniformDraw(seed, 0, static_cast<std::uint64_t>(v), static_cast<std::uint32_t>(u));
        // Slopes, steps of several heights, noise, and unknown pixels, more of them on the right.
        double d = 20 + 0.02 * u + 0.05 * v + 0.2 * draw[0];
        if (u > 40 + v / 4) d -= 0.7 * static_cast<double>(seed);
        if (draw[1] < 0.3 * u / size.width) d = 0;
        disparity.at<float>(v, u) = static_cast<float>(d);
      }
    }
    const cv::Mat dots = MakeDotPattern(seed, size);
    const cv::Mat result = MatchDots(disparity, dots);
    EXPECT_TRUE(SameBytes(result, ScatterDots(disparity, dots))) << seed;
    matched += cv::countNonZero(result);
    holes += static_cast<int>(result.total()) - cv::countNonZero(result);
  }
  // Both happen, or the comparison would show little.
  EXPECT_GT(matched, 5000);
  EXPECT_GT(holes, 5000);
}

TEST(DotPattern, AFlatImageHasNoHoles) {
  const cv::Size size(90, 60);
  const cv::Mat result =
      MatchDots(cv::Mat(size, CV_32FC1, cv::Scalar(20.3)), MakeDotPattern(1, size));
  for (int v = 8; v < size.height - 8; ++v) {
    for (int u = 8; u < size.width - 8; ++u) EXPECT_EQ(result.at<float>(v, u), 20.25F);
  }
  const cv::Mat nothing = MatchDots(cv::Mat::zeros(size, CV_32FC1), MakeDotPattern(1, size));
  EXPECT_EQ(cv::countNonZero(nothing), 0);
}

}  // namespace
}  // namespace tsdfpp
