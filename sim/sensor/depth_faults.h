// Faults of depth images that belong to no one camera model: the projector's shadow, flying
// pixels, drop-out, range, quantisation. Depth is CV_32FC1, metres, 0 where invalid; each function
// returns a new image.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "core/types.h"
#include "sim/config/sensor_config.h"

namespace tsdfpp {

// Depth becomes 0 where a projector at (baseline_m, 0, 0) in the camera's frame does not shine: the
// pixels of a row are drawn into the projector's own row (column u - fx baseline_m / z) with a
// depth buffer, neighbours joined where their disparities differ by at most a pixel; a pixel that
// lies more than kShadowSlack_px of disparity behind what the projector sees is in shadow. A
// projector on the right throws shadows to the left of near objects.
cv::Mat CastProjectorShadow(const cv::Mat& depth, const Intrinsics& intrinsics, double baseline_m);
inline constexpr double kShadowSlack_px = 1;

// A pixel one of whose eight valid neighbours differs by more than `step_m` takes, with probability
// `rate`, the depth z + t (z_n - z), t uniform in [0, 1), z_n that of the neighbour that differs
// most. Drawn for (seed, frame, pixel).
cv::Mat MixFlyingPixels(const cv::Mat& depth, double rate, double step_m, std::uint64_t seed,
                        int frame);

// The probability that a ramp from 0 at `start` to 1 at `end` gives a value; where both are equal,
// values above them have probability 1.
double RampProbability(double value, double start, double end);

// Depth becomes 0 with probability 1 - (1 - p_incidence) (1 - p_range) of the ramps of `config`,
// by the true angle of incidence (radians, sim/render/incidence.h; may be empty where the config's
// incidence ramp starts at 90 deg) and the true depth. Drawn for (seed, frame, pixel).
cv::Mat DropOut(const cv::Mat& depth, const cv::Mat& true_depth, const cv::Mat& incidence,
                const DepthSensorConfig& config, std::uint64_t seed, int frame);
bool DropsByIncidence(const DepthSensorConfig& config);
bool DropsByRange(const DepthSensorConfig& config);

// Depth outside [min_m, max_m], invalid depth included, becomes 0.
cv::Mat CutRange(const cv::Mat& depth, double min_m, double max_m);

// Depth becomes the nearest multiple of unit_m, halves away from zero; unit_m > 0.
cv::Mat QuantiseDepth(const cv::Mat& depth, double unit_m);

}  // namespace tsdfpp
