#include "mapper/methods/cast_by_removal.h"

#include <map>
#include <set>
#include <utility>
#include <vector>

#include "mapper/rays/ray_pass.h"

namespace tsdfpp {
namespace {

void CopyPixel(const RaySurface& from, const cv::Point& pixel, RaySurface& to) {
  to.depth.at<float>(pixel) = from.depth.at<float>(pixel);
  to.normal.at<cv::Vec3f>(pixel) = from.normal.at<cv::Vec3f>(pixel);
  to.id.at<InstanceId>(pixel) = from.id.at<InstanceId>(pixel);
  if (!to.colour.empty()) to.colour.at<cv::Vec3b>(pixel) = from.colour.at<cv::Vec3b>(pixel);
}

}  // namespace

std::vector<RaySurface> CastByRemoval(const MapRepresentation& map, std::vector<RaySurface> front,
                                      const Intrinsics& camera, const Pose& T_WC,
                                      const RayCastOptions& options) {
  RayCastOptions first = options;
  first.surfaces = 1;
  while (static_cast<int>(front.size()) < options.surfaces) {
    RaySurface behind;
    behind.depth = cv::Mat::zeros(camera.height, camera.width, CV_32FC1);
    behind.normal = cv::Mat::zeros(camera.height, camera.width, CV_32FC3);
    behind.id = cv::Mat(camera.height, camera.width, CV_16UC1, cv::Scalar(kNoInstance));
    if (options.colour) behind.colour = cv::Mat::zeros(camera.height, camera.width, CV_8UC3);
    // Lists, as there may be very many sets of few pixels.
    std::map<std::set<InstanceId>, std::vector<cv::Point>> pixels_by_ids;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        if (front.back().id.at<std::uint16_t>(v, u) == kNoInstance) continue;
        std::set<InstanceId> ids;
        for (const RaySurface& surface : front) ids.insert(surface.id.at<std::uint16_t>(v, u));
        pixels_by_ids[ids].emplace_back(u, v);
      }
    }
    for (const auto& [ids, pixels] : pixels_by_ids) {
      const auto without = map.Clone();
      for (const InstanceId id : ids) without->Remove(id);
      const RaySurface seen = without->CastRays(camera, T_WC, first).front();
      for (const cv::Point& pixel : pixels) CopyPixel(seen, pixel, behind);
    }
    front.push_back(std::move(behind));
  }
  return front;
}

std::vector<RaySurface> CastField(const MapRepresentation& map, const TsdfGrid& field,
                                  const std::function<VoxelLabels()>& make_labels,
                                  const Intrinsics& camera, const Pose& T_WC,
                                  const RayCastOptions& options) {
  RayPass pass;
  pass.voxel_m = map.config().voxel_m;
  pass.volumes.push_back({kBackground, &field, Pose::Identity(), true});
  pass.make_labels = make_labels;
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(map, RunRayPass(pass, camera, T_WC, first), camera, T_WC, options);
}

}  // namespace tsdfpp
