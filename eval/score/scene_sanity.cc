#include "eval/score/scene_sanity.h"

#include <tbb/parallel_for.h>

#include <cmath>

#include "core/pixel_ray.h"
#include "eval/score/mapped_pixels.h"

namespace tsdfpp {
namespace {

// Whether the surface at the pixel, by the depth of its neighbours, is seen at less than the
// steepest incidence at which a sample counts as seen.
bool SeenSquarely(const Frame& frame, int v, int u) {
  static const double kLeastCosine = LeastSeenCosine();
  const Intrinsics& k = frame.intrinsics;
  const auto point = [&](int pv, int pu) -> Eigen::Vector3d {
    const double z = frame.depth.at<float>(pv, pu);
    return z * PixelRay(k, pu, pv);
  };
  const Eigen::Vector3d right =
      point(v, std::min(u + 1, k.width - 1)) - point(v, std::max(u - 1, 0));
  const Eigen::Vector3d down =
      point(std::min(v + 1, k.height - 1), u) - point(std::max(v - 1, 0), u);
  const Eigen::Vector3d normal = right.cross(down).normalized();
  return std::abs(normal.dot(point(v, u).normalized())) > kLeastCosine;
}

}  // namespace

cv::Mat MappedPixels(const std::deque<Frame>& recent, double voxel_m) {
  const Frame& now = recent.back();
  cv::Mat mapped = SeenByAll(recent, voxel_m) & ~EdgeBorder(now, voxel_m);
  tbb::parallel_for(0, mapped.rows, [&](int v) {
    for (int u = 0; u < mapped.cols; ++u) {
      std::uint8_t& pixel = mapped.at<std::uint8_t>(v, u);
      if (pixel != 0 && !SeenSquarely(now, v, u)) pixel = 0;
    }
  });
  return mapped;
}

SanityScores ScoreSanity(const TriangleMesh& scene_W, const Raster& raster,
                         const std::deque<Frame>& recent, double voxel_m) {
  const Frame& now = recent.back();
  const cv::Mat mapped = MappedPixels(recent, voxel_m);
  struct Count {
    int mapped = 0;
    int right = 0;
  };
  std::map<InstanceId, Count> counts;
  Count all;
  for (int v = 0; v < now.depth.rows; ++v) {
    for (int u = 0; u < now.depth.cols; ++u) {
      const InstanceId id = now.mask.at<std::uint16_t>(v, u);
      Count& count = counts[id];
      if (mapped.at<std::uint8_t>(v, u) == 0) continue;
      const int face = raster.face.at<int>(v, u);
      const bool right =
          face >= 0 &&
          (scene_W.face_ids.empty() || scene_W.face_ids[static_cast<std::size_t>(face)] == id) &&
          std::abs(raster.depth.at<float>(v, u) - now.depth.at<float>(v, u)) <= voxel_m;
      for (Count* of : {&count, &all}) {
        ++of->mapped;
        of->right += right ? 1 : 0;
      }
    }
  }
  const auto share = [](const Count& count) {
    return count.mapped == 0 ? Measured::Undefined("no mapped pixel away from edges")
                             : Measured::Of(static_cast<double>(count.right) / count.mapped);
  };
  SanityScores scores{share(all), {}};
  for (const auto& [id, count] : counts) scores.by_object[id] = share(count);
  return scores;
}

}  // namespace tsdfpp
