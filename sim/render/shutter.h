// Motion blur and rolling shutter, composed of several renders of one frame (sub-frames).
//
// Time runs from the frame's time stamp, which is the middle of the middle row's exposure. A frame
// takes S = readout_s + exposure_s, from -S/2 to S/2. It is cut into `sub_frames` equal slices; the
// scene is rendered in the middle of each and taken as at rest during it. Row v of H gathers light
// for exposure_s around readout_s ((v + 1/2) / H - 1/2).
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "core/types.h"
#include "sim/config/sensor_config.h"

namespace tsdfpp {

inline bool HasShutter(const ShutterConfig& config) { return config.sub_frames > 1; }

// When to render, seconds from the frame's time stamp, in rising order; {0} without a shutter.
std::vector<double> SubFrameTimes(const ShutterConfig& config);

// The middle of a row's exposure, seconds from the frame's time stamp.
double RowTime(const ShutterConfig& config, int row, int height);

// How much each sub-frame adds to a row of a colour image: the share of the row's exposure that
// falls into its slice. With exposure_s = 0 the slice at RowTime alone. The weights add up to 1.
std::vector<double> RowWeights(const ShutterConfig& config, int row, int height);

// The sub-frame whose slice holds RowTime, an index into SubFrameTimes.
int RowSubFrame(const ShutterConfig& config, int row, int height);

// The mean of equally large CV_8UC3 sRGB images in linear light, rounded to levels: a global
// shutter's motion blur. One image or more.
cv::Mat BlurColour(std::span<const cv::Mat> images);

// Rows of the sub-frames' colour images joined by RowWeights, in linear light. `images` are
// CV_8UC3 sRGB, one for each of SubFrameTimes.
cv::Mat ExposeColour(const ShutterConfig& config, std::span<const cv::Mat> images);

// Each row from the sub-frame RowSubFrame, any type: depth and masks, which do not blur.
cv::Mat ReadOutRows(const ShutterConfig& config, std::span<const cv::Mat> images);

// Colour, depth and mask of `frame` become those of the sub-frames (one for each of
// SubFrameTimes); its time and poses, those at the time stamp, stay. Empty images stay empty.
void ApplyShutter(const ShutterConfig& config, std::span<const Frame> sub_frames, Frame& frame);

}  // namespace tsdfpp
