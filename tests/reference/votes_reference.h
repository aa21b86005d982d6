// Votes of a segment's points, slowly and plainly, from single voxels.
#pragma once

#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp::reference {

// The distance of a point to an object's surface in voxels, without sign, or -1 where the object's
// volume says nothing there, or that all is free as far as it is truncated: the mean over the
// observed ones of the eight voxels around the point, weighted by their trilinear coefficients, if
// those make up half.
inline double DistanceTo(const MapRepresentation& map, InstanceId id, const Eigen::Vector3d& p_W) {
  const double h = map.config().voxel_m;
  const Eigen::Vector3d q = map.ObjectLattice(id).inverse() * p_W / h;
  double known = 0;
  double sum = 0;
  for (int x = 0; x < 2; ++x) {
    for (int y = 0; y < 2; ++y) {
      for (int z = 0; z < 2; ++z) {
        const Eigen::Vector3i corner(static_cast<int>(std::floor(q.x())) + x,
                                     static_cast<int>(std::floor(q.y())) + y,
                                     static_cast<int>(std::floor(q.z())) + z);
        const auto value = VoxelsOf(map).ValueAt(id, corner);
        if (!value) continue;
        double coefficient = 1;
        for (int a = 0; a < 3; ++a) coefficient *= 1 - std::abs(q[a] - corner[a]);
        known += coefficient;
        sum += coefficient * static_cast<double>(value->distance_m) / h;
      }
    }
  }
  constexpr double kHalfsRounding = 0.001;
  const double free = (1 - kHalfsRounding) * map.config().trunc_front_voxels;
  return known >= 0.5 && sum / known < free ? std::abs(sum / known) : -1;
}

struct Votes {
  int points = 0;
  std::map<InstanceId, int> nearest;  // points nearest to the object, within `at_voxels`
};

// Of all pixels of a segment with valid depth.
inline Votes CountVotes(const MapRepresentation& map, const Frame& frame, const cv::Mat& segments,
                        InstanceId segment, double at_voxels) {
  Votes votes;
  for (int v = 0; v < segments.rows; ++v) {
    for (int u = 0; u < segments.cols; ++u) {
      const float depth = frame.depth.at<float>(v, u);
      if (segments.at<InstanceId>(v, u) != segment || !IsValidDepth(depth)) continue;
      ++votes.points;
      const Intrinsics& camera = frame.intrinsics;
      const Eigen::Vector3d p_W = frame.T_WC * (static_cast<double>(depth) *
                                                Eigen::Vector3d((u - camera.cx) / camera.fx,
                                                                (v - camera.cy) / camera.fy, 1));
      InstanceId best = kNoInstance;
      double least = at_voxels;
      for (const InstanceId id : map.Objects()) {
        if (id == kBackground) continue;
        const double distance = DistanceTo(map, id, p_W);
        if (distance < 0 || distance > least || (best != kNoInstance && distance == least))
          continue;
        best = id;
        least = distance;
      }
      if (best != kNoInstance) ++votes.nearest[best];
    }
  }
  return votes;
}

}  // namespace tsdfpp::reference
