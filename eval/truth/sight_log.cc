#include "eval/truth/sight_log.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

constexpr int kStride = 4;  // pixels between the depths kept

}  // namespace

std::size_t TrackerOf(const SceneTruth& truth, InstanceId id) {
  std::size_t i = 0;
  while (i < truth.trackers().size() && truth.trackers()[i].id() != id) ++i;
  return i;
}

void SightLog::See(const Frame& true_frame) {
  cv::Mat depth((true_frame.depth.rows + kStride - 1) / kStride,
                (true_frame.depth.cols + kStride - 1) / kStride, CV_32FC1);
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      depth.at<float>(v, u) = true_frame.depth.at<float>(v * kStride, u * kStride);
    }
  }
  sights_.push_back({true_frame.index, true_frame.intrinsics, true_frame.T_WC, depth});
}

VertexMeasures SightLog::Measure(const TriangleMesh& mesh_W, InstanceId id, const SceneTruth& truth,
                                 double slack_m, int frames) const {
  VertexMeasures measures;
  measures.error.resize(mesh_W.vertices.size(), 255);
  measures.age.resize(mesh_W.vertices.size(), kNeverSeen);
  const std::size_t i = TrackerOf(truth, id);
  if (i == truth.trackers().size()) return measures;
  const Pose T_OW = truth.T_WO(i).inverse();
  std::vector<Eigen::Vector3f> points_O;
  points_O.reserve(mesh_W.vertices.size());
  for (const Eigen::Vector3f& p : mesh_W.vertices) {
    points_O.push_back((T_OW * p.cast<double>()).cast<float>());
  }
  const NearestSurface nearest = truth.surface(i).index_O().Nearest(points_O);
  for (std::size_t v = 0; v < points_O.size(); ++v) {
    measures.error[v] = static_cast<std::uint8_t>(
        std::clamp(std::round(nearest.distance_m[v] / kErrorStep_m), 0.0, 255.0));
  }
  // An object carries its surface along: where its points were at a frame is asked of its poses.
  std::vector<Pose> T_CO;
  const auto trajectory = truth.trajectories().find(id);
  for (const Sight& sight : sights_) {
    Pose T_WO = truth.T_WO(i);
    if (trajectory != truth.trajectories().end()) {
      const auto at = trajectory->second.find(sight.frame);
      if (at != trajectory->second.end()) T_WO = at->second;
    }
    T_CO.push_back(sight.T_WC.inverse() * T_WO);
  }
  const int now = sights_.empty() ? 0 : sights_.back().frame;
  for (std::size_t v = 0; v < points_O.size(); ++v) {
    for (std::size_t s = sights_.size(); s-- > 0;) {
      const Sight& sight = sights_[s];
      const Intrinsics& k = sight.intrinsics;
      const Eigen::Vector3d p_C = T_CO[s] * points_O[v].cast<double>();
      if (p_C.z() <= 0) continue;
      const int u = static_cast<int>(std::lround((k.fx * p_C.x() / p_C.z() + k.cx) / kStride));
      const int w = static_cast<int>(std::lround((k.fy * p_C.y() / p_C.z() + k.cy) / kStride));
      if (u < 0 || w < 0 || u >= sight.depth.cols || w >= sight.depth.rows) continue;
      const float depth_m = sight.depth.at<float>(w, u);
      if (!IsValidDepth(depth_m) || std::abs(depth_m - p_C.z()) > slack_m) continue;
      measures.age[v] = static_cast<std::uint8_t>(
          std::min(kAgeSteps, std::round((now - sight.frame) * kAgeSteps / frames)));
      break;
    }
  }
  return measures;
}

}  // namespace tsdfpp
