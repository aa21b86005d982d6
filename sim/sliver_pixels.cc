#include "sim/sliver_pixels.h"

#include <mujoco/mujoco.h>

#include <array>
#include <cmath>
#include <vector>

namespace tsdfpp {
namespace {

// How far a pixel may be from the line through two neighbours: less than what verification allows
// between a pixel and its model (0.2 mm). Where a surface bends more, sound pixels are cast too.
constexpr float kOffLine_m = 1.5e-4F;

struct Step {
  int u;
  int v;
};
// The image's rows first: on a table they pass at once.
constexpr std::array<Step, 8> kSteps{
    {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}};

}  // namespace

int MendSliverPixels(CompiledScene& scene, const Intrinsics& k, const Pose& T_WC, cv::Mat& depth,
                     cv::Mat& mask) {
  // A plane's inverse depth is linear in the image.
  cv::Mat inverse(depth.size(), CV_32FC1);
  for (int v = 0; v < depth.rows; ++v) {
    const auto* z = depth.ptr<float>(v);
    auto* i = inverse.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) i[u] = z[u] > 0 ? 1.0F / z[u] : 0.0F;
  }
  const auto on_a_line = [&](int u, int v) {
    const InstanceId id = mask.at<InstanceId>(v, u);
    const float here = inverse.at<float>(v, u);
    const float allowed = kOffLine_m * here * here;
    for (const Step& step : kSteps) {
      const int u2 = u + 2 * step.u;
      const int v2 = v + 2 * step.v;
      if (u2 < 0 || v2 < 0 || u2 >= depth.cols || v2 >= depth.rows) continue;
      const int u1 = u + step.u;
      const int v1 = v + step.v;
      if (mask.at<InstanceId>(v1, u1) != id || mask.at<InstanceId>(v2, u2) != id) continue;
      const float expected = 2 * inverse.at<float>(v1, u1) - inverse.at<float>(v2, u2);
      if (std::abs(expected - here) <= allowed) return true;
    }
    return false;
  };
  std::vector<cv::Point> doubtful;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      if (depth.at<float>(v, u) > 0 && !on_a_line(u, v)) doubtful.emplace_back(u, v);
    }
  }
  const Eigen::Vector3d origin = T_WC.translation();
  for (const cv::Point& pixel : doubtful) {
    const Eigen::Vector3d ray_C((pixel.x - k.cx) / k.fx, (pixel.y - k.cy) / k.fy, 1.0);
    const Eigen::Vector3d direction = T_WC.linear() * ray_C;
    int geom = -1;
    const mjtNum range = mj_ray(scene.model(), scene.data(), origin.data(), direction.data(),
                                nullptr, 1, -1, &geom, nullptr);
    if (geom < 0) continue;
    // The direction's z in the camera's frame is one, so its multiple is the depth.
    depth.at<float>(pixel) = static_cast<float>(range);
    mask.at<InstanceId>(pixel) = scene.geoms()[static_cast<std::size_t>(geom)].id;
  }
  return static_cast<int>(doubtful.size());
}

}  // namespace tsdfpp
