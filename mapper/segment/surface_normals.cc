#include "mapper/segment/surface_normals.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tsdfpp {
namespace {

// The slope at a value from the values s pixels before and after it; 0: there is none.
inline float SlopeAt(float before, float q, float after, float per_step, float tolerance) {
  const float back = (q - before) * per_step;
  const float ahead = (after - q) * per_step;
  const float nearer = std::abs(back) < std::abs(ahead) ? back : ahead;
  const float both = std::abs(back - ahead) <= tolerance ? (back + ahead) / 2 : nearer;
  const float one = before != 0 ? back : (after != 0 ? ahead : 0);
  return (before != 0) & (after != 0) ? both : one;
}

struct NormalScale {
  NoiseModel noise;
  float sigmas;
  float pixel_width;
  float per_step;
  float per_x;
  float per_y;
};

struct NormalAndSigma {
  float x, y, z;
  float sigma;
};

// Without branches, so that rows are computed several pixels at once; 0 where q is.
inline NormalAndSigma NormalAt(float q, float before, float after, float above, float below,
                               float ray_x, float ray_y, const NormalScale& scale) {
  const float tolerance =
      (scale.sigmas * scale.noise.HeadOnInverse(q) + scale.pixel_width * q) * scale.per_step;
  const float slope_x = SlopeAt(before, q, after, scale.per_step, tolerance);
  const float slope_y = SlopeAt(above, q, below, scale.per_step, tolerance);
  const float a = slope_x * scale.per_x;
  const float b = slope_y * scale.per_y;
  const float c = q - a * ray_x - b * ray_y;
  const bool known = q != 0;
  // q is the plane's inverse distance times ray * normal, and positive.
  const float length = std::sqrt(a * a + b * b + c * c);
  const float per_length = known ? -1 / length : 0;
  const float cosine = -q * per_length / std::sqrt(ray_x * ray_x + ray_y * ray_y + 1);
  const float z = known ? 1 / q : 1;
  const float along = scale.noise.Axial_m(z, cosine);
  const float slope = std::sqrt(slope_x * slope_x + slope_y * slope_y) * z * z;
  const float across = scale.noise.Lateral_px(cosine) * slope;
  const float sigma = std::sqrt(along * along + across * across);
  return {a * per_length, b * per_length, c * per_length, known ? sigma : 0};
}

}  // namespace

void ComputeNormals(const PixelRays& rays, const ChordReach& reach,
                    const DepthSegmentsConfig& config, const cv::Mat& inverse, cv::Mat& normal,
                    cv::Mat& sigma) {
  const int rows = inverse.rows;
  const int cols = inverse.cols;
  const int step = reach.step_px;
  const NormalScale scale{NoiseModel(config.noise, config.noise_scale),
                          static_cast<float>(config.sigmas),
                          rays.pixel_width,
                          1 / static_cast<float>(step),
                          rays.per_x,
                          rays.per_y};
  normal.create(inverse.size(), CV_32FC3);
  sigma.create(inverse.size(), CV_32FC1);
  // Rows with nothing before and behind them; those of the image, with nothing beside them.
  const std::vector<float> nothing(static_cast<std::size_t>(cols), 0.0F);
  ForEachRow(rows, [&](int v) {
    std::vector<float> padded(static_cast<std::size_t>(cols + 2 * step), 0.0F);
    const auto* row = inverse.ptr<float>(v);
    std::copy(row, row + cols, padded.begin() + step);
    const float* before = padded.data();
    const float* after = before + 2 * step;
    const float* above = v >= step ? inverse.ptr<float>(v - step) : nothing.data();
    const float* below = v + step < rows ? inverse.ptr<float>(v + step) : nothing.data();
    auto* to = normal.ptr<float>(v);
    auto* noise = sigma.ptr<float>(v);
    const float* ray_x = rays.x.data();
    const float ray_y = rays.y[static_cast<std::size_t>(v)];
    for (int u = 0; u < cols; ++u) {
      const NormalAndSigma at =
          NormalAt(row[u], before[u], after[u], above[u], below[u], ray_x[u], ray_y, scale);
      to[3 * u] = at.x;
      to[3 * u + 1] = at.y;
      to[3 * u + 2] = at.z;
      noise[u] = at.sigma;
    }
  });
}

}  // namespace tsdfpp
