// Slow and obvious geometry of the objects of a scene, for tests.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "sim/config/scene_config.h"

namespace tsdfpp {

// One object's parts, in its own frame.
struct Solid {
  InstanceId id = 0;
  std::vector<ModelPart> parts;
};

inline std::vector<Solid> SolidsOf(const SceneConfig& config) {
  std::vector<Solid> solids;
  for (const SceneObject& object : config.objects) {
    solids.push_back({object.id, MakeModel(object.model).value()});
  }
  return solids;
}

// Where the line p + t d crosses the triangles: the values of t.
inline std::vector<double> Crossings(const Shape& shape, const Eigen::Vector3d& p,
                                     const Eigen::Vector3d& d) {
  std::vector<double> at;
  for (const auto& [i, j, k] : shape.triangles) {
    Eigen::Matrix3d m;
    m << shape.vertices[j] - shape.vertices[i], shape.vertices[k] - shape.vertices[i], -d;
    if (std::abs(m.determinant()) < 1e-18) continue;
    const Eigen::Vector3d uvt = m.inverse() * (p - shape.vertices[i]);
    if (uvt.x() >= 0 && uvt.y() >= 0 && uvt.x() + uvt.y() <= 1) at.push_back(uvt.z());
  }
  return at;
}

// The ids of the objects that a vertical line through (x, y) crosses.
inline std::set<InstanceId> ObjectsOnVertical(const std::vector<Solid>& solids,
                                              const std::map<InstanceId, Pose>& T_WO, double x,
                                              double y) {
  std::set<InstanceId> ids;
  for (const Solid& solid : solids) {
    const Pose T_OW = T_WO.at(solid.id).inverse();
    for (const ModelPart& part : solid.parts) {
      if (!Crossings(part.shape, T_OW * Eigen::Vector3d(x, y, 0),
                     T_OW.linear() * Eigen::Vector3d::UnitZ())
               .empty()) {
        ids.insert(solid.id);
      }
    }
  }
  return ids;
}

inline Eigen::AlignedBox3d BoxOf(const Shape& shape) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p : shape.vertices) box.extend(p);
  return box;
}

inline double DistanceToSegment(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b) {
  const Eigen::Vector3d along = b - a;
  const double length2 = along.squaredNorm();
  const double t = length2 > 0 ? std::clamp((p - a).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * along).norm();
}

inline double DistanceToSurface(const Shape& shape, const Eigen::Vector3d& p) {
  double distance = std::numeric_limits<double>::infinity();
  for (const auto& [i, j, k] : shape.triangles) {
    const Eigen::Vector3d& a = shape.vertices[i];
    const Eigen::Vector3d& b = shape.vertices[j];
    const Eigen::Vector3d& c = shape.vertices[k];
    const Eigen::Vector3d n = (b - a).cross(c - a);
    const bool above = n.dot((b - a).cross(p - a)) >= 0 && n.dot((c - b).cross(p - b)) >= 0 &&
                       n.dot((a - c).cross(p - c)) >= 0;
    if (above && n.squaredNorm() > 0) {
      distance = std::min(distance, std::abs(n.normalized().dot(p - a)));
    } else {
      distance = std::min({distance, DistanceToSegment(p, a, b), DistanceToSegment(p, b, c),
                           DistanceToSegment(p, c, a)});
    }
  }
  return distance;
}

// How deep the vertices of one object are inside the closed parts of another, metres; 0 where none
// is. Edges that cross without a vertex inside are not seen.
inline double DeepestVertex(const Solid& one, const Pose& T_WA, const Solid& other,
                            const Pose& T_WB) {
  double deepest = 0;
  const Pose T_BA = T_WB.inverse() * T_WA;
  // Askew, so that it runs along no face.
  const Eigen::Vector3d direction(0.1234, -0.0571, 1);
  for (const ModelPart& part : other.parts) {
    const Eigen::AlignedBox3d box = BoxOf(part.shape);
    for (const ModelPart& from : one.parts) {
      for (const Eigen::Vector3d& p_A : from.shape.vertices) {
        const Eigen::Vector3d p = T_BA * p_A;
        if (!box.contains(p)) continue;
        const std::vector<double> at = Crossings(part.shape, p, direction);
        const auto ahead = std::count_if(at.begin(), at.end(), [](double t) { return t > 0; });
        if (ahead % 2 == 1) deepest = std::max(deepest, DistanceToSurface(part.shape, p));
      }
    }
  }
  return deepest;
}

// The deepest vertex of any object in any other.
inline double DeepestOverlap(const std::vector<Solid>& solids,
                             const std::map<InstanceId, Pose>& T_WO) {
  double deepest = 0;
  for (const Solid& one : solids) {
    for (const Solid& other : solids) {
      if (one.id == other.id) continue;
      deepest = std::max(deepest, DeepestVertex(one, T_WO.at(one.id), other, T_WO.at(other.id)));
    }
  }
  return deepest;
}

// How deep the vertices are inside the table's top or below the floor, metres.
inline double DeepestInGround(const std::vector<Solid>& solids,
                              const std::map<InstanceId, Pose>& T_WO, const RoomSpec& room) {
  double deepest = 0;
  for (const Solid& solid : solids) {
    const Pose& pose = T_WO.at(solid.id);
    for (const ModelPart& part : solid.parts) {
      for (const Eigen::Vector3d& p_O : part.shape.vertices) {
        const Eigen::Vector3d p = pose * p_O;
        deepest = std::max(deepest, -p.z());
        if (room.table && std::abs(p.x()) < kTableHalfX_m && std::abs(p.y()) < kTableHalfY_m &&
            p.z() > kTableTop_m - kTableThickness_m) {
          deepest = std::max(deepest, kTableTop_m - p.z());
        }
      }
    }
  }
  return deepest;
}

}  // namespace tsdfpp
