// Outlines of toys on the table and the gaps between them.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <vector>

#include "core/types.h"
#include "sim/models/model_catalogue.h"

namespace tsdfpp {

using Outline = std::vector<Eigen::Vector2d>;  // convex, counter-clockwise

inline double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// The convex hull of the parts seen from above, at T_WO (monotone chain).
inline Outline FootprintOf(const std::vector<ModelPart>& parts, const Pose& T_WO) {
  std::vector<Eigen::Vector2d> points;
  for (const ModelPart& part : parts) {
    for (const Eigen::Vector3d& p_O : part.shape.vertices) {
      points.emplace_back((T_WO * p_O).head<2>());
    }
  }
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  Outline hull;
  for (const bool upper : {false, true}) {
    const std::size_t first = hull.size();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d& p = upper ? points[points.size() - 1 - i] : points[i];
      while (hull.size() >= first + 2 &&
             Cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0) {
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();
  }
  return hull;
}

inline Outline FootprintOf(const ModelSpec& model, const Pose& T_WO) {
  return FootprintOf(MakeModel(model).value(), T_WO);
}

inline bool Contains(const Outline& outline, const Eigen::Vector2d& p) {
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d& a = outline[i];
    if (Cross(outline[(i + 1) % outline.size()] - a, p - a) < 0) return false;
  }
  return true;
}

// The smallest distance between two convex outlines, metres; 0 where they meet.
inline double Gap(const Outline& one, const Outline& other) {
  double gap = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : {std::pair{&one, &other}, std::pair{&other, &one}}) {
    for (const Eigen::Vector2d& p : *a) {
      if (Contains(*b, p)) return 0;
      for (std::size_t i = 0; i < b->size(); ++i) {
        const Eigen::Vector2d start = (*b)[i];
        const Eigen::Vector2d along = (*b)[(i + 1) % b->size()] - start;
        const double t = std::clamp((p - start).dot(along) / along.squaredNorm(), 0.0, 1.0);
        gap = std::min(gap, (p - start - t * along).norm());
      }
    }
  }
  return gap;
}

}  // namespace tsdfpp
