// Scenes of planes, spheres and boxes, cast exactly, as frames for a mapper.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "core/types.h"

namespace tsdfpp::reference {

struct Shape {
  enum class Kind { kPlane, kSphere, kBox };
  Kind kind = Kind::kSphere;
  InstanceId id = kBackground;
  Colour colour{};
  Pose T_OS = Pose::Identity();                      // the shape in its object
  Eigen::Vector3d half_m = Eigen::Vector3d::Ones();  // of a box; x of a sphere is its radius
};

// The plane z = height with its free side upwards.
inline Shape Plane(InstanceId id, Colour colour, double height_m) {
  Shape shape{Shape::Kind::kPlane, id, colour};
  shape.T_OS.translation().z() = height_m;
  return shape;
}
inline Shape Sphere(InstanceId id, Colour colour, const Eigen::Vector3d& centre, double radius_m) {
  Shape shape{Shape::Kind::kSphere, id, colour};
  shape.T_OS.translation() = centre;
  shape.half_m.x() = radius_m;
  return shape;
}
inline Shape Cuboid(InstanceId id, Colour colour, const Pose& T_OS, const Eigen::Vector3d& half_m) {
  return {Shape::Kind::kBox, id, colour, T_OS, half_m};
}

// A pose from a turn about an axis (through a quaternion, as poses from files are) and a shift.
inline Pose MakePose(double angle_rad, const Eigen::Vector3d& axis, const Eigen::Vector3d& shift) {
  Pose pose = Pose::Identity();
  pose.linear() =
      Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis.normalized())).toRotationMatrix();
  pose.translation() = shift;
  return pose;
}

// T_WC of a camera at `eye` that looks at `target`, image rows running down along -z.
inline Pose LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_WC = Pose::Identity();
  T_WC.linear().col(0) = right;
  T_WC.linear().col(1) = forward.cross(right);
  T_WC.linear().col(2) = forward;
  T_WC.translation() = eye;
  return T_WC;
}

struct Scene {
  std::vector<Shape> shapes;
  std::map<InstanceId, Pose> T_WO;  // the identity for an object without one

  Pose ObjectPose(InstanceId id) const {
    const auto found = T_WO.find(id);
    return found == T_WO.end() ? Pose::Identity() : found->second;
  }
  void Erase(InstanceId id) {
    std::erase_if(shapes, [id](const Shape& shape) { return shape.id == id; });
    T_WO.erase(id);
  }
};

// The range at which a ray (in the shape's frame, unit direction) first meets it from outside.
inline std::optional<double> Cast(const Shape& shape, const Eigen::Vector3d& origin,
                                  const Eigen::Vector3d& direction) {
  switch (shape.kind) {
    case Shape::Kind::kPlane: {
      if (direction.z() >= 0 || origin.z() <= 0) return std::nullopt;
      return -origin.z() / direction.z();
    }
    case Shape::Kind::kSphere: {
      const double radius = shape.half_m.x();
      const double b = origin.dot(direction);
      const double root = b * b - origin.squaredNorm() + radius * radius;
      if (root < 0 || -b - std::sqrt(root) <= 0) return std::nullopt;
      return -b - std::sqrt(root);
    }
    case Shape::Kind::kBox: {
      double enter = 0;
      double leave = std::numeric_limits<double>::infinity();
      for (int a = 0; a < 3; ++a) {
        const double t0 = (-shape.half_m[a] - origin[a]) / direction[a];
        const double t1 = (shape.half_m[a] - origin[a]) / direction[a];
        enter = std::max(enter, std::min(t0, t1));
        leave = std::min(leave, std::max(t0, t1));
      }
      if (enter <= 0 || enter > leave) return std::nullopt;
      return enter;
    }
  }
  return std::nullopt;
}

inline Intrinsics SmallCamera() { return {96, 72, 80.0, 80.0, 47.5, 35.5}; }

// Nearest hit wins; depth is 0 and the label kBackground where nothing is hit. Colours vary over a
// surface by up to 30 levels. `T_WO` of the frame is the scene's.
inline Frame Render(const Scene& scene, const Pose& T_WC, int index = 1,
                    const Intrinsics& camera = SmallCamera()) {
  Frame frame;
  frame.index = index;
  frame.intrinsics = camera;
  frame.T_WC = T_WC;
  frame.T_WO = scene.T_WO;
  frame.depth = cv::Mat::zeros(camera.height, camera.width, CV_32FC1);
  frame.colour = cv::Mat::zeros(camera.height, camera.width, CV_8UC3);
  frame.mask = cv::Mat::zeros(camera.height, camera.width, CV_16UC1);
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray_C((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
      double nearest = std::numeric_limits<double>::infinity();
      for (const Shape& shape : scene.shapes) {
        const Pose T_SC = (scene.ObjectPose(shape.id) * shape.T_OS).inverse() * T_WC;
        const Eigen::Vector3d direction = T_SC.linear() * ray_C.normalized();
        const auto range = Cast(shape, T_SC.translation(), direction);
        if (!range || *range >= nearest) continue;
        nearest = *range;
        const Eigen::Vector3d p_S = T_SC.translation() + *range * direction;
        frame.depth.at<float>(v, u) = static_cast<float>(*range / ray_C.norm());
        frame.mask.at<std::uint16_t>(v, u) = shape.id;
        for (int c = 0; c < 3; ++c) {
          const double shade = 30.0 * std::abs(std::sin(20.0 * p_S[c]));
          frame.colour.at<cv::Vec3b>(v, u)[c] =
              static_cast<std::uint8_t>(std::min(255.0, shape.colour[c] + shade));
        }
      }
    }
  }
  return frame;
}

}  // namespace tsdfpp::reference
