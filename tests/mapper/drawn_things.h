// A plate and a ball with a smooth pattern before a wall, drawn by exact rays.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/pixel_ray.h"
#include "core/types.h"

namespace tsdfpp::drawn {

inline constexpr InstanceId kThing = 3;
inline constexpr double kWall_m = 1.5;

inline Intrinsics Camera() { return {320, 240, 300.0, 300.0, 159.5, 119.5}; }

// Of a place on the thing, in its own frame.
inline double Grey(const Eigen::Vector3d& p_O) {
  return 128 + 50 * std::sin(60 * p_O.x()) + 40 * std::sin(70 * p_O.y() + 1) +
         25 * std::sin(55 * p_O.z());
}

struct Hit {
  double t = 0;  // along the ray
  Eigen::Vector3d p_O = Eigen::Vector3d::Zero();
};

struct Thing {
  virtual ~Thing() = default;
  virtual std::optional<Hit> Meet(const Eigen::Vector3d& eye_O,
                                  const Eigen::Vector3d& ray_O) const = 0;
};
// In the plane of x and y.
struct Plate : Thing {
  std::optional<Hit> Meet(const Eigen::Vector3d& eye_O,
                          const Eigen::Vector3d& ray_O) const override {
    const double t = -eye_O.z() / ray_O.z();
    const Eigen::Vector3d p_O = eye_O + t * ray_O;
    if (!(t > 0) || std::abs(p_O.x()) > 0.14 || std::abs(p_O.y()) > 0.1) return std::nullopt;
    return Hit{t, p_O};
  }
};
struct Ball : Thing {
  std::optional<Hit> Meet(const Eigen::Vector3d& eye_O,
                          const Eigen::Vector3d& ray_O) const override {
    constexpr double kRadius_m = 0.12;
    const double along = -eye_O.dot(ray_O) / ray_O.squaredNorm();
    const double away = (eye_O + along * ray_O).squaredNorm();
    if (away > kRadius_m * kRadius_m) return std::nullopt;
    const double t = along - std::sqrt((kRadius_m * kRadius_m - away) / ray_O.squaredNorm());
    return Hit{t, eye_O + t * ray_O};
  }
};

// Before a wall, by a camera at the origin. Light: grey values are `gain` times, and so much more.
inline Frame Draw(const Thing& thing, const Pose& T_CO, double gain = 1, double offset = 0,
                  int index = 1) {
  const Intrinsics camera = Camera();
  Frame frame;
  frame.index = index;
  frame.intrinsics = camera;
  frame.depth = cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar(kWall_m));
  frame.colour = cv::Mat(camera.height, camera.width, CV_8UC3, cv::Scalar(90, 90, 90));
  frame.mask = cv::Mat(camera.height, camera.width, CV_16UC1, cv::Scalar(kBackground));
  const Eigen::Vector3d eye_O = T_CO.inverse().translation();
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray_O = T_CO.linear().transpose() * PixelRay(camera, u, v);
      const std::optional<Hit> hit = thing.Meet(eye_O, ray_O);
      if (!hit) continue;
      frame.depth.at<float>(v, u) = static_cast<float>(hit->t);
      const double grey = std::clamp(gain * Grey(hit->p_O) + offset, 0.0, 255.0);
      frame.colour.at<cv::Vec3b>(v, u) = cv::Vec3b::all(static_cast<std::uint8_t>(grey + 0.5));
      frame.mask.at<InstanceId>(v, u) = kThing;
    }
  }
  return frame;
}

}  // namespace tsdfpp::drawn
