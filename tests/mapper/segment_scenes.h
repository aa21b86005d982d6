// Analytic scenes for the tests of segmentation, and noise at a model's level.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <set>

#include "core/random.h"
#include "mapper/segment/depth_segments.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp::test {

// Half of a usual depth camera's resolution, at its angle of view.
inline Intrinsics HalfVga() { return {320, 240, 260, 260, 159.5, 119.5}; }

inline reference::Shape Table() { return reference::Plane(kBackground, {90, 60, 30}, 0); }
inline reference::Shape Block(InstanceId id, const Eigen::Vector3d& centre,
                              const Eigen::Vector3d& half_m, double yaw_rad = 0.5) {
  return reference::Cuboid(id, {200, 40, 40},
                           reference::MakePose(yaw_rad, Eigen::Vector3d::UnitZ(), centre), half_m);
}
inline Frame Look(const std::vector<reference::Shape>& shapes,
                  const Eigen::Vector3d& eye = {0.1, -0.8, 0.7},
                  const Eigen::Vector3d& target = {0, 0, 0.05}) {
  reference::Scene scene;
  scene.shapes = shapes;
  return reference::Render(scene, reference::LookAt(eye, target), 1, HalfVga());
}

// Depth with noise along the ray of nguyen2012's size at right angles to a surface.
inline Frame WithNoise(Frame frame, std::uint64_t seed) {
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      float& z = frame.depth.at<float>(v, u);
      const auto pixel = static_cast<std::uint64_t>(v * frame.depth.cols + u);
      const double sigma_m = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);
      if (z > 0) z += static_cast<float>(sigma_m * GaussianDraw(seed, 1, pixel)[0]);
    }
  }
  return frame;
}

inline cv::Mat SegmentsOf(const Frame& frame, const DepthSegmentsConfig& config = {}) {
  DepthSegments segmenter(config);
  const auto segments = segmenter.Segment(frame);
  EXPECT_TRUE(segments.has_value());
  return segments ? segments->ids : cv::Mat();
}

inline DepthSegmentsConfig ExactConfig() {
  DepthSegmentsConfig config;
  config.noise = DepthNoise::kExact;
  return config;
}

// The id that most of an object's pixels have, and how good it is: intersection over union.
struct BestSegment {
  InstanceId id = kNoInstance;
  double iou = 0;
};
inline BestSegment BestFor(InstanceId object, const cv::Mat& truth, const cv::Mat& ids) {
  std::map<InstanceId, int> both;
  std::map<InstanceId, int> pixels;
  int of_object = 0;
  for (int v = 0; v < ids.rows; ++v) {
    for (int u = 0; u < ids.cols; ++u) {
      const auto id = ids.at<InstanceId>(v, u);
      ++pixels[id];
      if (truth.at<InstanceId>(v, u) != object) continue;
      ++of_object;
      ++both[id];
    }
  }
  BestSegment best;
  for (const auto& [id, count] : both) {
    const double iou = static_cast<double>(count) / (pixels[id] + of_object - count);
    if (iou > best.iou) best = {id, iou};
  }
  return best;
}
inline std::set<InstanceId> IdsIn(const cv::Mat& ids) {
  std::set<InstanceId> found;
  for (int v = 0; v < ids.rows; ++v) {
    for (int u = 0; u < ids.cols; ++u) found.insert(ids.at<InstanceId>(v, u));
  }
  return found;
}

}  // namespace tsdfpp::test
