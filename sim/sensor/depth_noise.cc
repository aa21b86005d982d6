#include "sim/sensor/depth_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "sim/render/incidence.h"
#include "sim/render/parallel_rows.h"
#include "sim/sensor/depth_faults.h"
#include "sim/sensor/dot_pattern.h"
#include "sim/sensor/sensor_streams.h"

namespace tsdfpp {
namespace {

// A depth that later readers take for valid, or 0.
float ToDepth(double z) {
  const auto depth = static_cast<float>(z);
  return IsValidDepth(depth) ? depth : 0.0F;
}

// What the models draw from: shifts along u and v, and one number for the depth itself.
struct PixelNoise {
  double shift_u = 0;
  double shift_v = 0;
  double axial = 0;
};

class ModelImage {
 public:
  ModelImage(double noise_scale, std::uint64_t seed, const Frame& frame, const cv::Mat& depth)
      : depth_(depth), scale_(noise_scale), seed_(seed), frame_(frame.index) {}

  // For each pixel, pixel_function(u, v, noise) with standard normal noise.
  template <typename PixelFunction>
  cv::Mat Map(const PixelFunction& pixel_function) const {
    cv::Mat result(depth_.size(), CV_32FC1);
    ParallelRows(depth_.rows, [&](int v) {
      auto* out = result.ptr<float>(v);
      for (int u = 0; u < depth_.cols; ++u) {
        const auto draw = GaussianDraw(seed_, kStreamDepthModel, static_cast<std::uint64_t>(frame_),
                                       static_cast<std::uint32_t>(v * depth_.cols + u));
        out[u] = ToDepth(
            pixel_function(u, v, PixelNoise{scale_ * draw[0], scale_ * draw[1], scale_ * draw[2]}));
      }
    });
    return result;
  }

  // Valid depth at this pixel, clamped to the image, or 0.
  double At(int u, int v) const {
    const float z =
        depth_.at<float>(std::clamp(v, 0, depth_.rows - 1), std::clamp(u, 0, depth_.cols - 1));
    return IsValidDepth(z) ? z : 0;
  }

  // At the nearest pixel.
  double Nearest(double u, double v) const {
    return At(static_cast<int>(std::floor(u + 0.5)), static_cast<int>(std::floor(v + 0.5)));
  }

  // Between the four pixels around; 0 where one that counts is invalid.
  double Bilinear(double u, double v) const {
    u = std::clamp(u, 0.0, depth_.cols - 1.0);
    v = std::clamp(v, 0.0, depth_.rows - 1.0);
    const int u0 = static_cast<int>(u);
    const int v0 = static_cast<int>(v);
    const double a = u - u0;
    const double b = v - v0;
    double sum = 0;
    for (const auto& [du, dv, weight] :
         {std::tuple{0, 0, (1 - a) * (1 - b)}, std::tuple{1, 0, a * (1 - b)},
          std::tuple{0, 1, (1 - a) * b}, std::tuple{1, 1, a * b}}) {
      if (weight == 0) continue;
      const double z = At(u0 + du, v0 + dv);
      if (z == 0) return 0;
      sum += weight * z;
    }
    return sum;
  }

 private:
  const cv::Mat& depth_;
  double scale_;
  std::uint64_t seed_;
  int frame_;
};

// 1 / 0 at unknown depth would be an infinite disparity.
template <typename Formula>
double IfKnown(double z, const Formula& formula) {
  return z > 0 ? formula(z) : 0.0;
}

cv::Mat SimKinect(const ModelImage& image, std::uint64_t seed, const Frame& frame) {
  const double focal_baseline = frame.intrinsics.fx * kKinectBaseline_m;
  const auto round_to_step = [](double d) {
    return std::round(d / kDisparityStep_px) * kDisparityStep_px;
  };
  // A disparity image, not a depth image: beyond 100 px it is as valid as before.
  cv::Mat disparity(frame.depth.size(), CV_32FC1);
  const cv::Mat shifted = image.Map([&](int u, int v, const PixelNoise& noise) {
    return image.Bilinear(u + kIclShiftSigma_px * noise.shift_u,
                          v + kIclShiftSigma_px * noise.shift_v);
  });
  ParallelRows(disparity.rows, [&](int v) {
    for (int u = 0; u < disparity.cols; ++u) {
      disparity.at<float>(v, u) = static_cast<float>(IfKnown(
          shifted.at<float>(v, u), [&](double z) { return round_to_step(focal_baseline / z); }));
    }
  });
  const cv::Mat matched = MatchDots(disparity, MakeDotPattern(seed, disparity.size()));
  return image.Map([&](int u, int v, const PixelNoise& noise) {
    return IfKnown(matched.at<float>(v, u), [&](double d) {
      return IclDepth_m(focal_baseline / d, kIclDisparitySigma * noise.axial);
    });
  });
}

cv::Mat Nguyen(const ModelImage& image, const cv::Mat& incidence) {
  return image.Map([&](int u, int v, const PixelNoise& noise) {
    const double lateral = NguyenLateralSigma_px(incidence.at<float>(v, u));
    const double z = image.Nearest(u + lateral * noise.shift_u, v + lateral * noise.shift_v);
    return IfKnown(z, [&](double known) {
      return known + NguyenAxialSigma_m(known, incidence.at<float>(v, u)) * noise.axial;
    });
  });
}

cv::Mat IclNuim(const ModelImage& image) {
  return image.Map([&](int u, int v, const PixelNoise& noise) {
    const double z = image.Bilinear(u + kIclShiftSigma_px * noise.shift_u,
                                    v + kIclShiftSigma_px * noise.shift_v);
    return IfKnown(
        z, [&](double known) { return IclDepth_m(known, kIclDisparitySigma * noise.axial); });
  });
}

cv::Mat CoFusion(const ModelImage& image) {
  return image.Map([&](int u, int v, const PixelNoise& noise) {
    const double z = image.At(u + static_cast<int>(kCoFusionShiftSigma_px * noise.shift_u),
                              v + static_cast<int>(kCoFusionShiftSigma_px * noise.shift_v));
    return IfKnown(
        z, [&](double known) { return IclDepth_m(known, kCoFusionDisparitySigma * noise.axial); });
  });
}

cv::Mat Redwood(const ModelImage& image, const cv::Size& size) {
  return image.Map([&](int u, int v, const PixelNoise& noise) {
    const auto even = [](double at, int end) {
      const int nearest = std::clamp(static_cast<int>(std::floor(at + 0.5)), 0, end - 1);
      return nearest - nearest % 2;
    };
    const double z = image.At(even(u + kRedwoodShiftSigma_px * noise.shift_u, size.width),
                              even(v + kRedwoodShiftSigma_px * noise.shift_v, size.height));
    if (z >= kRedwoodMaxRange_m) return 0.0;
    return IfKnown(z, [&](double known) {
      return RedwoodDepth_m(known, kRedwoodDisparitySigma * noise.axial);
    });
  });
}

// Depth 0 at edges and on dark surfaces.
cv::Mat CutAzure(const cv::Mat& noisy, const cv::Mat& colour) {
  cv::Mat result = noisy.clone();
  ParallelRows(noisy.rows, [&](int v) {
    for (int u = 0; u < noisy.cols; ++u) {
      float low = noisy.at<float>(v, u);
      float high = low;
      for (int y = std::max(0, v - 1); y <= std::min(noisy.rows - 1, v + 1); ++y) {
        for (int x = std::max(0, u - 1); x <= std::min(noisy.cols - 1, u + 1); ++x) {
          low = std::min(low, noisy.at<float>(y, x));
          high = std::max(high, noisy.at<float>(y, x));
        }
      }
      const auto& rgb = colour.at<cv::Vec3b>(v, u);
      // The luma of ITU-R BT.601.
      const double grey = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
      if (high - low > kAzureEdge_m || grey < kAzureDarkLevel) result.at<float>(v, u) = 0;
    }
  });
  return result;
}

cv::Mat Azure(const ModelImage& image, const cv::Mat& colour) {
  return CutAzure(image.Map([&](int u, int v, const PixelNoise& noise) {
    const double z = image.Bilinear(u + kAzureShiftSigma_px * noise.shift_u,
                                    v + kAzureShiftSigma_px * noise.shift_v);
    return IfKnown(z, [&](double known) { return known + AzureSigma_m(known) * noise.axial; });
  }),
                  colour);
}

cv::Mat D435(const ModelImage& image, double focal_px) {
  return image.Map([&](int u, int v, const PixelNoise& noise) {
    return IfKnown(image.At(u, v), [&](double known) {
      return known + D435Sigma_m(known, focal_px) * noise.axial;
    });
  });
}

}  // namespace

double NguyenLateralSigma_px(double incidence) {
  const double angle = std::min(incidence, kNguyenMaxIncidence);
  return 0.8 + 0.035 * angle / (std::numbers::pi / 2 - angle);
}

double NguyenAxialSigma_m(double z_m, double incidence) {
  const double angle = std::min(incidence, kNguyenMaxIncidence);
  const double near = 0.0012 + 0.0019 * (z_m - 0.4) * (z_m - 0.4);
  if (angle <= std::numbers::pi / 3) return near;
  const double rest = std::numbers::pi / 2 - angle;
  return near + 0.0001 / std::sqrt(z_m) * angle * angle / (rest * rest);
}

double IclDepth_m(double z_m, double noise) {
  const double disparity = std::round(kIclDisparityConstant_cm / (100 * z_m) + noise + 0.5);
  return disparity > 0 ? kIclDisparityConstant_cm / disparity / 100 : 0;
}

double RedwoodDepth_m(double z_m, double noise) {
  const double disparity = std::round((kRedwoodConstant_m / z_m + noise) * 8);
  return disparity > 0 ? kRedwoodConstant_m * 8 / disparity : 0;
}

double AzureSigma_m(double z_m) { return 0.0005 + std::max(0.001 * (z_m - 0.5), 0.0); }

double D435Sigma_m(double z_m, double focal_px) {
  return z_m * z_m * kD435Subpixel_px / (focal_px * kD435Baseline_m);
}

cv::Mat ApplyDepthModel(DepthModel model, double noise_scale, std::uint64_t seed,
                        const Frame& frame, const cv::Mat& depth, const cv::Mat& incidence) {
  CV_Assert(depth.type() == CV_32FC1);
  const ModelImage image(noise_scale, seed, frame, depth);
  switch (model) {
    case DepthModel::kExact:
      return depth;
    case DepthModel::kNguyen2012:
      CV_Assert(incidence.size() == depth.size());
      return Nguyen(image, incidence);
    case DepthModel::kIclNuim:
      return IclNuim(image);
    case DepthModel::kSimKinect:
      return SimKinect(image, seed, frame);
    case DepthModel::kCoFusion:
      return CoFusion(image);
    case DepthModel::kRedwood:
      return Redwood(image, depth.size());
    case DepthModel::kAzure:
      CV_Assert(frame.colour.size() == depth.size());
      return Azure(image, frame.colour);
    case DepthModel::kD435:
      return D435(image, frame.intrinsics.fx);
  }
  return depth;
}

Expected<cv::Mat> SenseDepth(const DepthSensorConfig& config, std::uint64_t seed,
                             const Frame& frame) {
  const DepthSensorConfig exact;
  cv::Mat depth = frame.depth;
  if (config.model == DepthModel::kAzure && frame.colour.empty()) {
    return UsageError(
        "the depth model 'azure' needs colour images (dark surfaces give no depth), and frame {} "
        "has none",
        frame.index);
  }
  cv::Mat incidence;
  if (config.model == DepthModel::kNguyen2012 || DropsByIncidence(config)) {
    incidence = IncidenceAngles(frame.depth, frame.intrinsics);
  }
  if (config.shadow_baseline_m > 0) {
    depth = CastProjectorShadow(depth, frame.intrinsics, config.shadow_baseline_m);
  }
  if (config.flying_pixel_rate > 0) {
    depth = MixFlyingPixels(depth, config.flying_pixel_rate, config.flying_pixel_step_m, seed,
                            frame.index);
  }
  depth = ApplyDepthModel(config.model, config.noise_scale, seed, frame, depth, incidence);
  if (DropsByIncidence(config) || DropsByRange(config)) {
    depth = DropOut(depth, frame.depth, incidence, config, seed, frame.index);
  }
  if (config.min_range_m != exact.min_range_m || config.max_range_m != exact.max_range_m) {
    depth = CutRange(depth, config.min_range_m, config.max_range_m);
  }
  if (config.unit_m > 0) depth = QuantiseDepth(depth, config.unit_m);
  return depth;
}

}  // namespace tsdfpp
