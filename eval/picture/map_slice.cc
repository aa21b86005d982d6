#include "eval/picture/map_slice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mapper/map_query.h"

namespace tsdfpp {
namespace {

// Okabe and Ito's, the background's first.
constexpr std::array<Colour, 7> kPalette{{{86, 180, 233},
                                          {213, 94, 0},
                                          {0, 158, 115},
                                          {204, 121, 167},
                                          {230, 159, 0},
                                          {0, 114, 178},
                                          {240, 228, 66}}};

cv::Vec3b Shade(InstanceId id, float distance_m, const MapConfig& config) {
  const Colour& base = id == kBackground ? kPalette[0] : kPalette[1 + (id - 1U) % 6];
  const double limit = distance_m >= 0 ? config.front() : config.back();
  const double far = std::min(1.0, std::abs(distance_m) / limit);
  cv::Vec3b shade;
  for (int c = 0; c < 3; ++c) {
    const double level = base[static_cast<std::size_t>(c)];
    shade[c] = cv::saturate_cast<std::uint8_t>(
        distance_m >= 0 ? level + (255 - level) * (0.45 + 0.5 * far) : level * (0.85 - 0.45 * far));
  }
  return shade;
}

}  // namespace

Expected<MapSlice> CutMap(const MapRepresentation& map, const SliceFrame& frame) {
  TSDFPP_ASSIGN(const MapQuery query, MapQuery::Of(map));
  const int columns = std::max(1, static_cast<int>(std::lround(frame.width_m / frame.pixel_m)));
  const int rows = std::max(1, static_cast<int>(std::lround(frame.height_m / frame.pixel_m)));
  std::vector<Eigen::Vector3d> points_W;
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      const double right = (u + 0.5 - 0.5 * columns) * frame.pixel_m;
      const double up = (0.5 * rows - v - 0.5) * frame.pixel_m;
      points_W.push_back(frame.middle_W + right * frame.along_W + up * Eigen::Vector3d::UnitZ());
    }
  }
  const std::vector<PointAnswer> answers = query.At(points_W);
  MapSlice slice;
  slice.distance =
      cv::Mat(rows, columns, CV_32FC1, cv::Scalar(std::numeric_limits<double>::quiet_NaN()));
  slice.id = cv::Mat(rows, columns, CV_16UC1, cv::Scalar(kNoInstance));
  slice.picture = cv::Mat(rows, columns, CV_8UC3, cv::Scalar::all(255));
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      const auto& visible = answers[static_cast<std::size_t>(v * columns + u)].visible;
      if (!visible) continue;
      slice.distance.at<float>(v, u) = visible->distance_m;
      slice.id.at<InstanceId>(v, u) = visible->id;
      slice.picture.at<cv::Vec3b>(v, u) = Shade(visible->id, visible->distance_m, map.config());
    }
  }
  // The surface: between neighbours, of one object, on its two sides.
  const auto crosses = [&](int v, int u, int other_v, int other_u) {
    if (other_v >= rows || other_u >= columns) return false;
    const float here = slice.distance.at<float>(v, u);
    const float there = slice.distance.at<float>(other_v, other_u);
    return slice.id.at<InstanceId>(v, u) == slice.id.at<InstanceId>(other_v, other_u) &&
           ((here <= 0 && there > 0) || (here > 0 && there <= 0));
  };
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      if (crosses(v, u, v + 1, u) || crosses(v, u, v, u + 1)) {
        slice.picture.at<cv::Vec3b>(v, u) = {0, 0, 0};
      }
    }
  }
  return slice;
}

}  // namespace tsdfpp
