// Inverse depth: narrow holes bridged, noise averaged out, edges kept. On a plane inverse depth is
// affine in the pixel.
#pragma once

#include "core/types.h"
#include "mapper/segment/depth_segments_config.h"

namespace tsdfpp {

// How far differences reach in a frame, by the noise at its median depth: as far as it takes that
// noise bends a chord by less than kNoiseBend.
struct ChordReach {
  int step_px = 2;    // s: between the middle of a chord and its ends
  int smooth_px = 0;  // m: half the width of the mean that is taken before; 2 m + 1 is at most s
  bool operator==(const ChordReach&) const = default;
};
inline constexpr double kNoiseBend = 0.25;  // tangent; about that of the angle that is looked for
inline constexpr int kLeastStep_px = 2;     // chords of one pixel are bent by a renderer's rounding
inline constexpr int kGreatestStep_px = 10;

// The reach for an image of depth; the least where nothing is valid. `pixel` is a pixel's width at
// 1 m.
ChordReach ChooseReach(const cv::Mat& depth, float pixel, const DepthSegmentsConfig& config);

// 1 / depth; 0 where depth is not valid, or below kNearestInverted_m.
void TakeInverse(const cv::Mat& depth, cv::Mat& inverse);
inline constexpr float kNearestInverted_m = 0.001F;  // nearer, an inverse may be no number

// `bridged` gets `inverse`, and straight lines across holes of up to config.gap_px pixels whose two
// ends are no jump: first along rows (`along_rows`, a scratch image), then along columns of that.
// The ends are a jump where noise and a surface at kSteepest cannot part them.
void BridgeGaps(float pixel, const DepthSegmentsConfig& config, const cv::Mat& inverse,
                cv::Mat& along_rows, cv::Mat& bridged);
inline constexpr float kSteepest = 5.67F;  // tangent of the angle of incidence: 80 deg

// `smooth` gets the mean over a row, then over a column, of each value q0 and those pairs of values
// q-, q+ at -i and +i, i up to m, for which
//   |q- + q+ - 2 q0| <= config.sigmas sqrt(6) (sigma + kSmoothShift_px g),
// sigma the noise of q0 and g the slope |q+ - q-| / 2 i, at most that of a surface at kSteepest: on
// a plane, however steep, pairs have the mean q0, across a jump they do not. `depth` gets its
// inverse; both are 0 where `inverse` is. `scratch` gets what is between the two.
void Smooth(const cv::Mat& inverse, int smooth_px, float pixel, const DepthSegmentsConfig& config,
            cv::Mat& scratch, cv::Mat& smooth, cv::Mat& depth);
// Noise across the ray as far as smoothing allows for it. With more than 0.27 px (2 / (3 sqrt 6)) a
// jump would pass for a steep surface.
inline constexpr float kSmoothShift_px = 0.25F;

}  // namespace tsdfpp
