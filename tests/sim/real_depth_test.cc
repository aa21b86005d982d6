// The depth models beside real and published data that we did not make (../shared/data).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <vector>

#include "sim/sensor/depth_noise.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

// The distinct valid values of a folder's 16-bit depth images.
std::set<int> DepthValues(const std::filesystem::path& folder) {
  std::set<int> values;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".png") continue;
    const cv::Mat image = cv::imread(file.path().string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(image.type(), CV_16UC1) << file.path();
    for (int v = 0; v < image.rows; ++v) {
      const auto* row = image.ptr<std::uint16_t>(v);
      for (int u = 0; u < image.cols; ++u) {
        if (row[u] != 0) values.insert(row[u]);
      }
    }
  }
  return values;
}

// Redwood's own simulated depth (whole millimetres, rounded down): every value is one of our
// levels.
TEST(RealDepth, RedwoodsFilesHoldOurLevels) {
  TSDFPP_NEEDS_SHARED("open3d_redwood5");
  const std::set<int> values = DepthValues(test::SharedData("open3d_redwood5/depth"));
  ASSERT_GT(values.size(), 100U);
  for (const int millimetres : values) {
    // The level nearest to the middle of what was rounded down; levels are 2 mm apart or more.
    ASSERT_GT(millimetres, 800);
    const double level_m = RedwoodDepth_m((millimetres + 0.5) / 1000, 0);
    EXPECT_EQ(static_cast<int>(std::floor(1000 * level_m)), millimetres);
  }
}

// A real Kinect's levels are as far apart as those of ICL-NUIM's constant, in disparity. Its
// calibration differs from device to device, and TUM scaled the depth of this one.
TEST(RealDepth, KinectStepsAreIclNuimSteps) {
  constexpr double kCalibration = 0.04;
  constexpr double kUnitsPerMetre = 5000;
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  const std::set<int> values = DepthValues(test::SharedData("tum_fr1_rpy_subset/depth"));
  std::vector<double> steps;  // of inverse depth, 1 / m
  for (auto value = values.begin(); std::next(value) != values.end(); ++value) {
    steps.push_back(kUnitsPerMetre / *value - kUnitsPerMetre / *std::next(value));
  }
  ASSERT_GT(steps.size(), 300U);
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2),
                   steps.end());
  const double ours = 1 / (kIclDisparityConstant_cm / 100);
  EXPECT_NEAR(steps[steps.size() / 2] / ours, 1, kCalibration);
}

}  // namespace
}  // namespace tsdfpp
