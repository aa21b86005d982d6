#include "eval/score/scene_seams.h"

#include <array>
#include <cmath>
#include <optional>

#include "core/pixel_ray.h"
#include "eval/score/mapped_pixels.h"

namespace tsdfpp {
namespace {

class SurfaceOfPixels {
 public:
  SurfaceOfPixels(const Frame& frame, double voxel_m) : frame_(frame), jump_m_(2 * voxel_m) {}

  Eigen::Vector3d Ray(int v, int u) const { return PixelRay(frame_.intrinsics, u, v); }

  // Nothing where the neighbours do not tell.
  std::optional<Eigen::Vector3d> Normal(int v, int u) const {
    const auto right = Along(v, u, 0, 1);
    const auto down = Along(v, u, 1, 0);
    if (!right || !down) return std::nullopt;
    return right->cross(*down).normalized();
  }

 private:
  Eigen::Vector3d Point(int v, int u) const {
    return double{frame_.depth.at<float>(v, u)} * Ray(v, u);
  }

  // The step to a neighbour of the same object, if there is one.
  std::optional<Eigen::Vector3d> Step(int v, int u, int dv, int du) const {
    const int v1 = v + dv;
    const int u1 = u + du;
    if (v1 < 0 || u1 < 0 || v1 >= frame_.depth.rows || u1 >= frame_.depth.cols) return {};
    if (frame_.mask.at<std::uint16_t>(v1, u1) != frame_.mask.at<std::uint16_t>(v, u)) return {};
    if (!IsValidDepth(frame_.depth.at<float>(v1, u1))) return {};
    return Eigen::Vector3d(Point(v1, u1) - Point(v, u));
  }

  // The surface's direction per pixel: by both neighbours, unless the depth jumps between them.
  std::optional<Eigen::Vector3d> Along(int v, int u, int dv, int du) const {
    const auto ahead = Step(v, u, dv, du);
    auto back = Step(v, u, -dv, -du);
    if (back) *back = -*back;
    if (!ahead || !back) return ahead ? ahead : back;
    if (std::abs(ahead->z() - back->z()) <= jump_m_) return Eigen::Vector3d((*ahead + *back) / 2);
    return std::abs(ahead->z()) < std::abs(back->z()) ? ahead : back;
  }

  const Frame& frame_;
  double jump_m_;
};

Measured ShareOfAsked(int pixels, int asked) {
  if (asked == 0) return Measured::Undefined("no mapped background beside an edge");
  return Measured::Of(static_cast<double>(pixels) / asked);
}

}  // namespace

SeamScores ScoreSeams(const cv::Mat& depth, const std::deque<Frame>& recent, double voxel_m) {
  const Frame& now = recent.back();
  const cv::Mat candidates = EdgeBorder(now, voxel_m) & SeenByAll(recent, voxel_m);
  const cv::Mat steps = EdgeBorder(now, voxel_m, Edges::kBackgroundSteps);
  const SurfaceOfPixels surface(now, voxel_m);
  const double least_cosine = LeastSeenCosine();
  SeamScores scores;
  scores.seams = cv::Mat(now.depth.size(), CV_8UC1, cv::Scalar(0));
  std::array<SeamScore*, 2> by_kind{&scores.elsewhere, &scores.beside_objects};
  std::array<int, 2> asked{};
  std::array<int, 2> seams{};
  std::array<int, 2> hidden{};
  for (int v = 0; v < now.depth.rows; ++v) {
    for (int u = 0; u < now.depth.cols; ++u) {
      if (candidates.at<std::uint8_t>(v, u) == 0) continue;
      if (now.mask.at<std::uint16_t>(v, u) != kBackground) continue;
      const auto normal = surface.Normal(v, u);
      if (!normal) continue;
      const double along_ray = std::abs(normal->dot(surface.Ray(v, u)));
      if (!(along_ray > least_cosine * surface.Ray(v, u).norm())) continue;
      const double z = now.depth.at<float>(v, u);
      const double area_m2 = z * z / (now.intrinsics.fx * now.intrinsics.fy * along_ray);
      const std::size_t kind = steps.at<std::uint8_t>(v, u) != 0 ? 0 : 1;
      ++asked[kind];
      by_kind[kind]->asked_area_m2 += area_m2;
      const double hit = depth.at<float>(v, u);
      if (hit > 0 && hit < z - voxel_m) ++hidden[kind];
      if (hit > 0 && hit <= z + voxel_m) continue;
      ++seams[kind];
      by_kind[kind]->area_m2 += area_m2;
      scores.seams.at<std::uint8_t>(v, u) = 255;
    }
  }
  for (std::size_t kind = 0; kind < by_kind.size(); ++kind) {
    by_kind[kind]->share = ShareOfAsked(seams[kind], asked[kind]);
    by_kind[kind]->in_front = ShareOfAsked(hidden[kind], asked[kind]);
  }
  return scores;
}

}  // namespace tsdfpp
