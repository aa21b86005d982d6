// A Co-Fusion set as others make them, written by hand with OpenCV alone.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "core/files.h"

namespace tsdfpp::test {

inline void WriteImage(const std::filesystem::path& path, const cv::Mat& image) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  std::filesystem::create_directories(path.parent_path());
  ASSERT_TRUE(cv::imwrite(path.string(), image)) << path;
}

inline cv::Mat ThreeTimes(const cv::Mat& channel) {
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>{channel, channel, channel}, image);
  return image;
}

// Three frames of 8x6 from number 0 on: depth as three equal channels, masks as grey RGB with ids
// 1, 2 and 5; no size in the calibration, no sequence.json, no noisy depth. ship-1 lacks frame 1;
// two cars have one name; 5 has no trajectory.
inline void WriteForeignSet(const std::filesystem::path& set) {
  const auto text = [&](const char* file, const std::string& bytes) {
    ASSERT_TRUE(WriteFile(set / file, bytes).has_value());
  };
  text("calibration.txt", "9.0 9.0 3.75 2.5\n");
  text("trajectories/gt-cam-0.txt",
       "0 0 0 0 0 0 0 1\n1 0.5 0 0 0 0 0 1\n2 1 0 0 0 0 0.70710678 0.70710678\n");
  text("trajectories/gt-ship-1.txt", "# one gap\n0 1 2 3 0 0 0 1\n2 1 2 4 0 0 0 1\n");
  text("trajectories/gt-car-2.txt", "0 0 0 0 0 0 0 1\n");
  text("trajectories/gt-car-3.txt", "0 0 0 0 0 0 0 1\n");
  text("README", "made by someone else");
  for (int i = 0; i < 3; ++i) {
    const std::string number = "000" + std::to_string(i);
    const cv::Mat colour(6, 8, CV_8UC3, cv::Scalar(10 + i, 20, 30));  // blue, green, red
    const cv::Mat depth(6, 8, CV_32FC1, cv::Scalar(1.25 + i));
    cv::Mat mask(6, 8, CV_8UC1, cv::Scalar(0));
    mask.at<std::uint8_t>(0, 1) = 1;
    mask.at<std::uint8_t>(2, 3) = 2;
    if (i == 2) mask.at<std::uint8_t>(5, 7) = 5;
    WriteImage(set / ("colour/Color" + number + ".png"), colour);
    WriteImage(set / ("depth_original/Depth" + number + ".exr"), ThreeTimes(depth));
    WriteImage(set / ("mask_id/Mask" + number + ".png"), ThreeTimes(mask));
  }
}

}  // namespace tsdfpp::test
