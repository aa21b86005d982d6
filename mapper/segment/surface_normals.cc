#include "mapper/segment/surface_normals.h"

#include <algorithm>
#include <vector>

#include "mapper/segment/surface_kernels.h"

namespace tsdfpp {

void ComputeNormals(const PixelRays& rays, const ChordReach& reach,
                    const DepthSegmentsConfig& config, const cv::Mat& inverse, cv::Mat& normal,
                    cv::Mat& sigma) {
  const int rows = inverse.rows;
  const int cols = inverse.cols;
  const int step = reach.step_px;
  const NormalScale scale{NoiseModel(config.noise, config.noise_scale).scale,
                          static_cast<float>(config.sigmas),
                          rays.pixel_width,
                          1 / static_cast<float>(step),
                          rays.per_x,
                          rays.per_y};
  normal.create(inverse.size(), CV_32FC3);
  sigma.create(inverse.size(), CV_32FC1);
  const std::vector<float> nothing(static_cast<std::size_t>(cols), 0.0F);
  ForEachRow(rows, [&](int v) {
    const auto* row = inverse.ptr<float>(v);
    // The row with nothing before and behind it.
    std::vector<float> padded(static_cast<std::size_t>(cols + 2 * step), 0.0F);
    std::copy(row, row + cols, padded.begin() + step);
    const NormalRow pixels{row,
                           padded.data(),
                           padded.data() + 2 * step,
                           v >= step ? inverse.ptr<float>(v - step) : nothing.data(),
                           v + step < rows ? inverse.ptr<float>(v + step) : nothing.data(),
                           rays.x.data(),
                           rays.y[static_cast<std::size_t>(v)]};
    NormalsOfRow(pixels, static_cast<std::size_t>(cols), scale, normal.ptr<float>(v),
                 sigma.ptr<float>(v));
  });
}

}  // namespace tsdfpp
