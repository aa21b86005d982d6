// The pixels of segments, against OpenCV's erosion of each label's mask.
#include "mapper/track/segment_points.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

namespace tsdfpp {
namespace {

std::vector<int> Eroded(const cv::Mat& labels, InstanceId id, int erosion_px) {
  cv::Mat mask = labels == static_cast<double>(id);
  const int side = 2 * erosion_px + 1;
  cv::erode(mask, mask, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  std::vector<int> pixels;
  for (int at = 0; at < mask.rows * mask.cols; ++at) {
    if (mask.at<std::uint8_t>(at / mask.cols, at % mask.cols) != 0) pixels.push_back(at);
  }
  return pixels;
}

// Rectangles of a few labels over each other, some of them as narrow as what erosion takes.
cv::Mat RandomLabels(std::minstd_rand& dice, int cols, int rows) {
  const auto below = [&](int end) { return static_cast<int>(dice() % static_cast<unsigned>(end)); };
  cv::Mat labels(rows, cols, CV_16UC1, cv::Scalar(kBackground));
  for (int i = 0; i < 12; ++i) {
    const cv::Rect box(below(cols), below(rows), 1 + below(cols), 1 + below(rows));
    const int label = below(6);
    labels(box & cv::Rect(0, 0, cols, rows)) = label == 5 ? kNoInstance : label;
  }
  return labels;
}

TEST(SegmentPixels, AreThoseOfErodedMasks) {
  std::minstd_rand dice(1);
  for (int trial = 0; trial < 200; ++trial) {
    const cv::Mat labels = RandomLabels(dice, 1 + trial % 41, 1 + trial % 29);
    for (const int erosion_px : {0, 1, 2, 5, 50}) {
      SCOPED_TRACE(testing::Message() << "trial " << trial << ", " << erosion_px << " px");
      const auto pixels = PixelsByLabel(labels, erosion_px);
      EXPECT_FALSE(pixels.contains(kBackground));
      EXPECT_FALSE(pixels.contains(kNoInstance));
      for (InstanceId id = 1; id < 5; ++id) {
        const bool is_there = cv::countNonZero(labels == static_cast<double>(id)) > 0;
        ASSERT_EQ(pixels.contains(id), is_there) << id;
        if (!is_there) continue;
        EXPECT_EQ(pixels.at(id), Eroded(labels, id, erosion_px)) << id;
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
