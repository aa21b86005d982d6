// Frames with analytic surfaces and a few statistics, for the tests of the sensor models.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <opencv2/core.hpp>

#include "core/types.h"

namespace tsdfpp {

// How far a statistic of a correct model may be from its expectation, in its standard deviations:
// one in 5e8 draws of a seed would exceed it, and the seeds are fixed.
inline constexpr double kSigmas = 6;

inline Intrinsics TestCamera(int width, int height, double f) {
  return {width, height, f, f, (width - 1) / 2.0, (height - 1) / 2.0};
}

// A frame whose depth is depth_m(u, v), all white.
inline Frame FrameOf(const Intrinsics& k, const std::function<double(int, int)>& depth_m,
                     int index = 1) {
  Frame frame;
  frame.index = index;
  frame.intrinsics = k;
  frame.depth.create(k.height, k.width, CV_32FC1);
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      frame.depth.at<float>(v, u) = static_cast<float>(depth_m(u, v));
    }
  }
  frame.colour = cv::Mat(frame.depth.size(), CV_8UC3, cv::Scalar::all(255));
  frame.mask = cv::Mat::zeros(frame.depth.size(), CV_16UC1);
  return frame;
}

inline Frame WallFrame(const Intrinsics& k, double z_m, int index = 1) {
  return FrameOf(
      k, [&](int, int) { return z_m; }, index);
}

// Depth of the plane n . p = d at a pixel, metres.
inline double PlaneDepth(const Intrinsics& k, const Eigen::Vector3d& n, double d, double u,
                         double v) {
  return d / n.dot(Eigen::Vector3d((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1));
}

// Two balls (ids 1 and 2) over a tilted table before a wall, in colours, like what the scenes show.
inline Frame ToyFrame(int index = 1) {
  const Intrinsics k = TestCamera(160, 120, 140);
  Frame frame = WallFrame(k, 2.4, index);
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const Eigen::Vector3d ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1);
      double z = 2.4;
      InstanceId id = kBackground;
      cv::Vec3b rgb(180, 170, 160);
      const double table = PlaneDepth(k, {0, 0.8, 0.6}, 0.85, u, v);
      if (table > 0 && table < z) {
        z = table;
        rgb = cv::Vec3b(160, static_cast<std::uint8_t>(90 + u / 4), 60);
      }
      const Eigen::Vector3d centres[] = {{-0.12, 0.05, 1.05}, {0.13, 0.02, 1.15}};
      for (int ball = 0; ball < 2; ++ball) {
        const Eigen::Vector3d& centre = centres[ball];
        const double b = ray.dot(centre);
        const double root = b * b - ray.squaredNorm() * (centre.squaredNorm() - 0.15 * 0.15);
        const double hit = root > 0 ? (b - std::sqrt(root)) / ray.squaredNorm() : 0;
        if (hit <= 0 || hit >= z) continue;
        z = hit;
        id = static_cast<InstanceId>(ball + 1);
        rgb = ball == 0 ? cv::Vec3b(200, 30, 40) : cv::Vec3b(5, 10, 8);
      }
      frame.depth.at<float>(v, u) = static_cast<float>(z);
      frame.mask.at<std::uint16_t>(v, u) = id;
      frame.colour.at<cv::Vec3b>(v, u) = rgb;
    }
  }
  frame.T_WC.translation() = Eigen::Vector3d(0.1, -0.7, 1.3);
  frame.T_WC.linear() = Eigen::AngleAxisd(-2.0, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return frame;
}

inline bool SameBytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.type() != b.type() || a.size() != b.size()) return false;
  for (int row = 0; row < a.rows; ++row) {
    if (std::memcmp(a.ptr(row), b.ptr(row), static_cast<std::size_t>(a.cols) * a.elemSize()) != 0) {
      return false;
    }
  }
  return true;
}

// Running mean and variance.
struct Moments {
  double count = 0;
  double sum = 0;
  double squares = 0;
  void Add(double x) {
    ++count;
    sum += x;
    squares += x * x;
  }
  double Mean() const { return sum / count; }
  double Variance() const { return squares / count - Mean() * Mean(); }
};

// The samples have this mean and standard deviation, as far as independent normal ones can tell.
inline void ExpectNormal(const Moments& moments, double mean, double sigma) {
  EXPECT_NEAR(moments.Mean(), mean, kSigmas * sigma / std::sqrt(moments.count));
  EXPECT_NEAR(std::sqrt(moments.Variance()), sigma, kSigmas * sigma / std::sqrt(2 * moments.count));
}

// A share of `count` independent draws.
inline void ExpectShare(double hits, double count, double probability) {
  EXPECT_NEAR(hits / count, probability,
              kSigmas * std::sqrt(probability * (1 - probability) / count) + 1 / count);
}

inline double NormalCdf(double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; }

}  // namespace tsdfpp
