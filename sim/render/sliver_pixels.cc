#include "sim/render/sliver_pixels.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/pixel_ray.h"
namespace tsdfpp {
namespace {

// How far a pixel may be from the line through two neighbours: less than what verification allows
// between a pixel and its model (0.2 mm). Where a surface bends more, sound pixels are cast too.
constexpr float kOffLine_m = 1.5e-4F;

struct Step {
  int u;
  int v;
};
constexpr std::array<Step, 8> kSteps{
    {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}};

// Inverse depths and instances of an image.
struct Surfaces {
  const cv::Mat& inverse;
  const cv::Mat& mask;

  // Is the pixel between two neighbours of the same instance, or behind two or three, on a line or
  // a parabola with them?
  bool Continues(int u, int v, const Step& step) const;
};

bool Surfaces::Continues(int u, int v, const Step& step) const {
  const auto on_object = [&](int n) {
    const int x = u + n * step.u;
    const int y = v + n * step.v;
    return x >= 0 && y >= 0 && x < mask.cols && y < mask.rows &&
           mask.at<InstanceId>(y, x) == mask.at<InstanceId>(v, u);
  };
  const auto at = [&](int n) { return inverse.at<float>(v + n * step.v, u + n * step.u); };
  if (!on_object(1)) return false;
  const float here = at(0);
  const float allowed = kOffLine_m * here * here;
  if (on_object(-1) && std::abs((at(1) + at(-1)) / 2 - here) <= allowed) return true;
  if (!on_object(2)) return false;
  if (std::abs(2 * at(1) - at(2) - here) <= allowed) return true;
  return on_object(3) && std::abs(3 * (at(1) - at(2)) + at(3) - here) <= allowed;
}

// Marks the pixels of a row that are on a line with the two on their right. One loop without
// branches, since nearly all pixels pass here.
void MarkLines(const float* inverse, const InstanceId* ids, int cols, unsigned char* passes) {
  for (int u = 0; u < cols; ++u) passes[u] = 0;
  for (int u = 0; u + 2 < cols; ++u) {
    const float here = inverse[u];
    const float off = std::abs(2 * inverse[u + 1] - inverse[u + 2] - here);
    const int same =
        static_cast<int>(ids[u] == ids[u + 1]) & static_cast<int>(ids[u] == ids[u + 2]);
    passes[u] =
        static_cast<unsigned char>(same & static_cast<int>(off <= kOffLine_m * here * here));
  }
}

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
  const Surfaces surfaces{inverse, mask};
  std::vector<cv::Point> doubtful;
  std::vector<unsigned char> passes(static_cast<std::size_t>(depth.cols));
  for (int v = 0; v < depth.rows; ++v) {
    MarkLines(inverse.ptr<float>(v), mask.ptr<InstanceId>(v), depth.cols, passes.data());
    for (int u = 0; u < depth.cols; ++u) {
      if (passes[static_cast<std::size_t>(u)] != 0 || depth.at<float>(v, u) <= 0) continue;
      const bool sound = std::any_of(kSteps.begin(), kSteps.end(), [&](const Step& step) {
        return surfaces.Continues(u, v, step);
      });
      if (!sound) doubtful.emplace_back(u, v);
    }
  }
  const Eigen::Vector3d origin = T_WC.translation();
  for (const cv::Point& pixel : doubtful) {
    const Eigen::Vector3d ray_C = PixelRay(k, pixel.x, pixel.y);
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
