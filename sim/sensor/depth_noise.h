// Published noise models of depth cameras; constants and sources as in docs/sources.md, "Depth
// noise", formulae in docs/sensors.md. Every draw is keyed by (seed, frame, pixel).
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "core/error.h"
#include "core/types.h"
#include "sim/config/sensor_config.h"

namespace tsdfpp {

// Nguyen, Izadi and Lovell 2012, Kinect v1. `incidence` in radians; from kNguyenMaxIncidence on,
// far beyond what they measured, as at that angle, since the formulae go to infinity.
inline constexpr double kNguyenMaxIncidence = 85 * 0.017453292519943295;
double NguyenLateralSigma_px(double incidence);
double NguyenAxialSigma_m(double z_m, double incidence);

// Handa et al. 2014 (after Barron and Malik): depth whose disparity, in the device's eighths of a
// pixel, is 35130 / z_cm, rounded after `noise` and a half were added. 0 where the disparity is not
// positive. The half makes depth too short by half a step on average.
inline constexpr double kIclDisparityConstant_cm = 35130;
inline constexpr double kIclDisparitySigma = 1.0 / 6;
inline constexpr double kIclShiftSigma_px = 0.5;
double IclDepth_m(double z_m, double noise);

// simkinect (Handa), after Bohg et al.: the dots' disparity is fx kKinectBaseline_m / z.
inline constexpr double kKinectBaseline_m = 0.075;

// Co-Fusion's synthetic sets (Runz and Agapito 2017): as ICL-NUIM, with other spreads, and shifts
// cast to whole pixels, which leaves 99 in 100 of them 0.
inline constexpr double kCoFusionShiftSigma_px = 0.4;
inline constexpr double kCoFusionDisparitySigma = 0.2;

// Redwood (Choi, Zhou and Koltun 2015; Teichman et al. 2013) without the distortion map of one
// device: each block of 2x2 pixels shares the depth of its first one, disparity in eighths.
inline constexpr double kRedwoodShiftSigma_px = 0.25;
inline constexpr double kRedwoodConstant_m = 35.130;
inline constexpr double kRedwoodDisparitySigma = 0.027778;
inline constexpr double kRedwoodMaxRange_m = 10;
double RedwoodDepth_m(double z_m, double noise);

// Azure Kinect, as in BlenderProc: no depth where the 3x3 neighbourhood of the noisy image spans
// more than kAzureEdge_m, nor where the true colour's grey value is below kAzureDarkLevel.
inline constexpr double kAzureShiftSigma_px = 0.25;
inline constexpr double kAzureEdge_m = 0.8;
inline constexpr double kAzureDarkLevel = 15;
double AzureSigma_m(double z_m);

// RealSense D435, Intel's root-mean-square formula: z^2 s / (f B).
inline constexpr double kD435Subpixel_px = 0.1;
inline constexpr double kD435Baseline_m = 0.05;
double D435Sigma_m(double z_m, double focal_px);

// The depth image, CV_32FC1 in metres, 0 where invalid, that the model alone makes of the
// frame's (true) depth; `frame.colour` is used by kAzure only. The frame's own depth is left as it
// is. Abort: `incidence` (sim/render/incidence.h) is empty for kNguyen2012, colour for kAzure.
cv::Mat ApplyDepthModel(DepthModel model, double noise_scale, std::uint64_t seed,
                        const Frame& frame, const cv::Mat& depth, const cv::Mat& incidence);

// All of `config` in its order: projector shadow, flying pixels, model, drop-out, range,
// quantisation. Incidence and the drop-out's range are those of the frame's depth, the true one.
// The exact config returns the frame's image itself. Errors: kUsage where the model needs colour
// and the frame has none.
Expected<cv::Mat> SenseDepth(const DepthSensorConfig& config, std::uint64_t seed,
                             const Frame& frame);

}  // namespace tsdfpp
