#include "tests/reference/dense_voxel.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace tsdfpp::reference {

// By OpenCV's half precision, not the mapper's.
float Kept(float distance) {
  const auto kept = static_cast<float>(cv::float16_t(distance));
  return kept == 0 ? 0.0F : kept;
}

Colour DenseVoxel::Rounded() const {
  Colour rounded{};
  for (int c = 0; c < 3; ++c) {
    rounded[c] = static_cast<std::uint8_t>(std::floor(colour[c] / 256.0F + 0.5F));
  }
  return rounded;
}

View::View(const Frame& frame, const cv::Mat& labels, const Pose& T_WL, const MapConfig& config)
    : frame_(frame), labels_(labels), h_(config.voxel()) {
  M_ = (frame.T_WC.inverse() * T_WL).matrix().cast<float>();
}

std::optional<Seen> View::Look(const Eigen::Vector3i& voxel) const {
  const float px = static_cast<float>(voxel.x()) * h_;
  const float py = static_cast<float>(voxel.y()) * h_;
  const float pz = static_cast<float>(voxel.z()) * h_;
  std::array<float, 3> p_C{};
  for (int r = 0; r < 3; ++r) {
    p_C[r] = ((M_(r, 1) * py + M_(r, 2) * pz) + M_(r, 3)) + M_(r, 0) * px;
  }
  if (!(p_C[2] >= 0.05F)) return std::nullopt;

  const auto fx = static_cast<float>(frame_.intrinsics.fx);
  const auto fy = static_cast<float>(frame_.intrinsics.fy);
  const auto cx = static_cast<float>(frame_.intrinsics.cx);
  const auto cy = static_cast<float>(frame_.intrinsics.cy);
  const float iz = 1.0F / p_C[2];
  const float u = std::floor((fx * p_C[0]) * iz + cx + 0.5F);
  const float v = std::floor((fy * p_C[1]) * iz + cy + 0.5F);
  const auto width = static_cast<float>(frame_.intrinsics.width);
  const auto height = static_cast<float>(frame_.intrinsics.height);
  if (!(u >= 0 && u < width && v >= 0 && v < height)) return std::nullopt;
  const auto column = static_cast<int>(u);
  const auto row = static_cast<int>(v);

  const float z = frame_.depth.at<float>(row, column);
  if (!IsValidDepth(z)) return std::nullopt;
  Seen seen;
  seen.label = labels_.at<std::uint16_t>(row, column);
  if (seen.label == kNoInstance) return std::nullopt;
  const float ray = std::sqrt((p_C[0] * p_C[0] + p_C[1] * p_C[1]) + p_C[2] * p_C[2]);
  seen.pixel = row * frame_.intrinsics.width + column;
  seen.s = (z - p_C[2]) * (ray * iz);
  seen.surface_z = z;
  seen.voxel_z = p_C[2];
  const auto& rgb = frame_.colour.at<cv::Vec3b>(row, column);
  seen.colour = {rgb[0], rgb[1], rgb[2]};
  return seen;
}

bool InBand(float s, const MapConfig& config) { return -config.back() <= s && s <= config.front(); }

void FuseSeen(const Seen& seen, const MapConfig& config, DenseVoxel& voxel, bool colour_all) {
  if (seen.s < -config.back()) return;
  const auto cap = static_cast<float>(config.weight_cap);
  const float s = std::min(seen.s, config.front());
  const float part = 1.0F / (voxel.weight + 1.0F);
  voxel.distance = Kept(voxel.distance + (s - voxel.distance) * part);
  voxel.weight = std::min(voxel.weight + 1.0F, cap);
  const auto colour_band = static_cast<float>((voxel.colours > 0 ? 2 : 3) * config.voxel_m);
  if (!InBand(seen.s, config)) return;
  if (!colour_all && !config.colour_whole_band && !(std::abs(seen.s) <= colour_band)) return;
  const float share = 1.0F / (static_cast<float>(voxel.colours) + 1.0F);
  for (int c = 0; c < 3; ++c) {
    const float old = voxel.colour[c];
    voxel.colour[c] = std::floor(old + (256.0F * seen.colour[c] - old) * share + 0.5F);
  }
  voxel.colours = std::min(voxel.colours + 1, config.weight_cap);
}

Neighbourhood::Neighbourhood(const Eigen::Vector3d& q) {
  for (int a = 0; a < 3; ++a) {
    base[a] = static_cast<int>(std::floor(q[a]));
    f[a] = static_cast<float>(q[a] - std::floor(q[a]));
  }
}

float Neighbourhood::Coefficient(int corner) const {
  float coefficient = 1;
  for (int a = 0; a < 3; ++a) coefficient *= ((corner >> a) & 1) != 0 ? f[a] : 1.0F - f[a];
  return coefficient;
}

float Neighbourhood::Interpolate(const std::array<float, 8>& c) const {
  const float c00 = c[0] * (1.0F - f[0]) + c[1] * f[0];  // y = 0, z = 0
  const float c10 = c[2] * (1.0F - f[0]) + c[3] * f[0];  // y = 1, z = 0
  const float c01 = c[4] * (1.0F - f[0]) + c[5] * f[0];  // y = 0, z = 1
  const float c11 = c[6] * (1.0F - f[0]) + c[7] * f[0];  // y = 1, z = 1
  const float c0 = c00 * (1.0F - f[1]) + c10 * f[1];
  const float c1 = c01 * (1.0F - f[1]) + c11 * f[1];
  return c0 * (1.0F - f[2]) + c1 * f[2];
}

int NearestCorner(const Neighbourhood& place) {
  int corner = 0;
  for (int a = 0; a < 3; ++a) corner += place.f[a] >= 0.5F ? 1 << a : 0;
  return corner;
}

std::optional<DenseVoxel> InterpolateVoxel(const Neighbourhood& place,
                                           const std::array<DenseVoxel, 8>& corners,
                                           Resampling resampling) {
  const auto observed = std::count_if(corners.begin(), corners.end(),
                                      [](const DenseVoxel& voxel) { return voxel.observed(); });
  if (resampling == Resampling::kAll && observed < 8) return std::nullopt;
  const DenseVoxel& nearest = corners[NearestCorner(place)];
  if (!nearest.observed()) return std::nullopt;
  if (resampling == Resampling::kNearest) return nearest;
  const auto mean = [&](const auto& value_of) {
    std::array<float, 8> values{};
    for (int i = 0; i < 8; ++i) values[i] = value_of(corners[i]);
    if (observed == 8) return place.Interpolate(values);
    float sum = 0;
    float total = 0;
    for (int i = 0; i < 8; ++i) {
      if (!corners[i].observed()) continue;
      total += place.Coefficient(i);
      sum += place.Coefficient(i) * values[i];
    }
    return sum / total;
  };
  DenseVoxel voxel;
  voxel.distance = Kept(mean([](const DenseVoxel& corner) { return corner.distance; }));
  voxel.weight = std::floor(mean([](const DenseVoxel& corner) { return corner.weight; }) + 0.5F);
  const float count =
      mean([](const DenseVoxel& corner) { return static_cast<float>(corner.colours); });
  voxel.colours = static_cast<int>(std::floor(count + 0.5F));

  std::array<double, 3> colour{};
  double coloured = 0;
  for (int i = 0; i < 8; ++i) {
    if (!corners[i].observed() || corners[i].colours == 0) continue;
    coloured += place.Coefficient(i);
    for (int c = 0; c < 3; ++c) colour[c] += place.Coefficient(i) * corners[i].colour[c];
  }
  for (int c = 0; c < 3 && coloured > 0 && voxel.colours > 0; ++c) {
    voxel.colour[c] = static_cast<float>(std::floor(colour[c] / coloured + 0.5));
  }
  return voxel;
}

}  // namespace tsdfpp::reference
