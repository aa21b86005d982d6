#include "eval/picture/draw_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/limits.h"
#include "eval/picture/record_images.h"
#include "eval/tools/rasteriser.h"

namespace tsdfpp {

Colour ObjectColour(InstanceId id) {
  constexpr std::array<Colour, 7> kPalette{{{0, 114, 178},
                                            {230, 159, 0},
                                            {0, 158, 115},
                                            {204, 121, 167},
                                            {86, 180, 233},
                                            {213, 94, 0},
                                            {240, 228, 66}}};
  if (id == kBackground) return {205, 203, 198};
  if (id == kNoInstance) return {128, 128, 128};  // of no true object
  return kPalette[(id - 1U) % kPalette.size()];
}

cv::Mat DrawScene(const TriangleMesh& scene_W, const Intrinsics& intrinsics, const Pose& T_WC,
                  double scale) {
  const Raster raster = Rasterise(scene_W, intrinsics, T_WC);
  cv::Mat image(intrinsics.height, intrinsics.width, CV_8UC3, cv::Scalar(255, 255, 255));
  const Eigen::Vector3f camera_W = T_WC.translation().cast<float>();
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const int face = raster.face.at<int>(v, u);
      if (face < 0) continue;
      const auto& t = scene_W.triangles[static_cast<std::size_t>(face)];
      const Eigen::Vector3f& a = scene_W.vertices[t[0]];
      const Eigen::Vector3f normal =
          (scene_W.vertices[t[1]] - a).cross(scene_W.vertices[t[2]] - a).stableNormalized();
      // Lit from the camera and from above; what faces away from the camera is darkened.
      const float facing = normal.dot((camera_W - a).normalized());
      const float light =
          facing > 0 ? 0.35F + 0.45F * facing + 0.2F * std::max(0.0F, normal.z()) : 0.2F;
      const Colour base = scene_W.face_ids.empty()
                              ? ObjectColour(kBackground)
                              : ObjectColour(scene_W.face_ids[static_cast<std::size_t>(face)]);
      auto& pixel = image.at<cv::Vec3b>(v, u);
      for (int c = 0; c < 3; ++c) {
        pixel[c] = static_cast<std::uint8_t>(static_cast<float>(base[static_cast<std::size_t>(c)]) *
                                             std::min(1.0F, light));
      }
    }
  }
  return Scaled(image, 1 / scale, cv::INTER_AREA);
}

cv::Mat DrawTable(const SceneTruth& truth, const Selection& reconstructed, double pixel_m) {
  const SeenTracker& tracker = truth.trackers().front();
  if (tracker.id() != kBackground) return {};
  const SampleSet& samples = tracker.samples_O();
  const std::vector<std::string>& regions = truth.surface(0).model().regions;
  // The top alone: what faces up and is as high as the highest.
  float top = -1e9F;
  const auto on_table = [&](std::size_t i) {
    return regions[samples.region[i]] == kTableRegion && samples.normals[i].z() > 0.9F;
  };
  Eigen::AlignedBox2f bounds;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (on_table(i)) top = std::max(top, samples.points[i].z());
  }
  const auto on_top = [&](std::size_t i) {
    return on_table(i) && samples.points[i].z() > top - 0.01F;
  };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (on_top(i)) bounds.extend(samples.points[i].head<2>());
  }
  if (bounds.isEmpty()) return {};
  const auto pixel = static_cast<float>(pixel_m);
  const Eigen::Vector2f sides = (bounds.sizes() / pixel).array().ceil();
  const auto most = static_cast<float>(CurrentLimits().image_side - 1);
  if (!(sides.maxCoeff() < most)) return {};  // no table that is looked at from above
  const int width = static_cast<int>(sides.x()) + 1;
  const int height = static_cast<int>(sides.y()) + 1;
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(150, 150, 150));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!on_top(i)) continue;
    cv::Scalar colour(150, 150, 150);
    if (tracker.Seen(i)) {
      const bool there = i < reconstructed.size() && reconstructed[i] != 0;
      switch (tracker.status()[i]) {
        case SampleStatus::kVisible:
        case SampleStatus::kUnmeasured:
          colour = there ? cv::Scalar(238, 234, 224) : cv::Scalar(245, 170, 60);
          break;
        case SampleStatus::kBehindOther:
          colour = there ? cv::Scalar(86, 150, 210) : cv::Scalar(215, 25, 28);
          break;
        case SampleStatus::kBehindItself:
        case SampleStatus::kOutside:
          colour = there ? cv::Scalar(200, 215, 225) : cv::Scalar(170, 60, 60);
          break;
      }
    }
    const Eigen::Vector2f at = (samples.points[i].head<2>() - bounds.min()) / pixel;
    // Samples are jittered in their cells: squares a little larger than a cell leave no gaps.
    const float half = 0.8F * std::sqrt(samples.area_m2[i]) / pixel;
    // y of the world points up in the picture.
    cv::rectangle(image, cv::Point2f(at.x() - half, static_cast<float>(height) - at.y() - half),
                  cv::Point2f(at.x() + half, static_cast<float>(height) - at.y() + half), colour,
                  cv::FILLED);
  }
  return image;
}

}  // namespace tsdfpp
