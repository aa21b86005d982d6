#include "eval/score/mapped_pixels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/pixel_ray.h"
#include "metrics/visibility.h"

namespace tsdfpp {
namespace {

cv::Mat EdgePixels(const Frame& frame, double voxel_m, Edges which) {
  cv::Mat edges(frame.depth.size(), CV_8UC1, cv::Scalar(0));
  const auto depth = [&](int v, int u) { return frame.depth.at<float>(v, u); };
  const auto id = [&](int v, int u) { return frame.mask.at<std::uint16_t>(v, u); };
  const auto jump = static_cast<float>(2 * voxel_m);
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      const auto compare = [&](int dv, int du) {
        const int v1 = v + dv;
        const int u1 = u + du;
        if (v1 >= frame.depth.rows || u1 >= frame.depth.cols) return;
        const bool outline = id(v, u) != id(v1, u1);
        bool edge = outline && which != Edges::kBackgroundSteps;
        if (!outline && (which == Edges::kAll ||
                         (which == Edges::kBackgroundSteps && id(v, u) == kBackground))) {
          float step = std::abs(depth(v1, u1) - depth(v, u));
          if (v - dv >= 0 && u - du >= 0) {
            // The slope shown across an edge is none: the step itself has to be large too.
            step =
                std::min(step, std::abs(depth(v1, u1) - 2 * depth(v, u) + depth(v - dv, u - du)));
          }
          edge = step > jump;
        }
        if (edge) edges.at<std::uint8_t>(v, u) = edges.at<std::uint8_t>(v1, u1) = 255;
      };
      compare(0, 1);
      compare(1, 0);
    }
  }
  return edges;
}

bool SawPoint(const Frame& before, const Eigen::Vector3d& p_C, InstanceId id, double voxel_m) {
  const Intrinsics& k = before.intrinsics;
  if (p_C.z() <= 0) return false;
  const int u = static_cast<int>(std::lround(k.fx * p_C.x() / p_C.z() + k.cx));
  const int v = static_cast<int>(std::lround(k.fy * p_C.y() / p_C.z() + k.cy));
  if (u < 0 || v < 0 || u >= k.width || v >= k.height) return false;
  return before.mask.at<std::uint16_t>(v, u) == id &&
         std::abs(before.depth.at<float>(v, u) - p_C.z()) <= voxel_m;
}

// From a point of the object in the world now to the camera of an earlier frame, the object moved
// back.
Pose BackInTime(const Frame& before, const Frame& now, InstanceId id) {
  const auto now_WO = now.T_WO.find(id);
  const auto before_WO = before.T_WO.find(id);
  if (now_WO == now.T_WO.end() || before_WO == before.T_WO.end()) return before.T_WC.inverse();
  return before.T_WC.inverse() * before_WO->second * now_WO->second.inverse();
}

}  // namespace

cv::Mat EdgeBorder(const Frame& frame, double voxel_m, Edges which) {
  const cv::Mat edges = EdgePixels(frame, voxel_m, which);
  cv::Mat border(edges.size(), CV_8UC1, cv::Scalar(0));
  for (int v = 0; v < edges.rows; ++v) {
    for (int u = 0; u < edges.cols; ++u) {
      if (edges.at<std::uint8_t>(v, u) == 0) continue;
      const float z = frame.depth.at<float>(v, u);
      if (!IsValidDepth(z)) continue;
      const int radius =
          std::max(2, static_cast<int>(std::ceil(1.5 * frame.intrinsics.fx * voxel_m / z)));
      cv::rectangle(border, {u - radius, v - radius}, {u + radius, v + radius}, cv::Scalar(255),
                    cv::FILLED);
    }
  }
  return border;
}

cv::Mat SeenByAll(const std::deque<Frame>& recent, double voxel_m) {
  const Frame& now = recent.back();
  const Intrinsics& k = now.intrinsics;
  cv::Mat seen(now.depth.size(), CV_8UC1, cv::Scalar(0));
  tbb::parallel_for(0, k.height, [&](int v) {
    InstanceId last_id = kNoInstance;
    std::vector<Pose> T_before_W(recent.size());
    for (int u = 0; u < k.width; ++u) {
      const float z = now.depth.at<float>(v, u);
      if (!IsValidDepth(z)) continue;
      const InstanceId id = now.mask.at<std::uint16_t>(v, u);
      const Eigen::Vector3d p_W = now.T_WC * (z * PixelRay(k, u, v));
      bool by_all = true;
      for (std::size_t i = 0; i + 1 < recent.size() && by_all; ++i) {
        if (id != last_id) {
          last_id = id;
          for (std::size_t k_before = 0; k_before + 1 < recent.size(); ++k_before) {
            T_before_W[k_before] = BackInTime(recent[k_before], now, id);
          }
        }
        by_all = SawPoint(recent[i], T_before_W[i] * p_W, id, voxel_m);
      }
      if (by_all) seen.at<std::uint8_t>(v, u) = 255;
    }
  });
  return seen;
}

double LeastSeenCosine() {
  return std::cos(VisibilityConfig{}.max_incidence_deg * std::numbers::pi / 180);
}

}  // namespace tsdfpp
