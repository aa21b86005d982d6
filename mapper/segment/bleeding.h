// Pixels beside an outline whose depth is that of the other side. A camera for depth is right along
// its axis and off by a pixel or two across it, so what a mask gives to an object has, here and
// there, the depth of what is behind or before it. Fused, it takes off the object's rim and sticks
// a fringe on, and the object is then tracked to a model that is not its own (docs/tracking.md,
// "Bleeding").
#pragma once

#include <opencv2/core.hpp>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

// What becomes of them.
enum class BleedingPixels {
  kAuto,  // kWait where objects or the camera are tracked by signed distances, kKeep elsewhere
  kKeep,  // they are mapped like the others
  kWait,  // they belong to no segment in this frame
};

// "auto", "keep" or "wait". Errors: kUsage.
Expected<BleedingPixels> BleedingPixelsFromName(std::string_view name);
std::string_view BleedingPixelsName(BleedingPixels bleeding);

// How far depth may be off across the axis, pixels: 2.5 of the 0.8 that Nguyen, Izadi and Lovell
// 2012 measured as a Kinect's deviation.
inline constexpr int kBleedingReach_px = 2;
// Nearer to each other than this both sides of an outline are one surface, voxels.
inline constexpr double kBleedingStep_voxels = 2;

// So many steps behind the depth of its own side a pixel bleeds whatever the other side seems to
// have, as where pixels of the other side bleed, too. A toy's own parts are not so far apart in so
// small a part of the picture.
inline constexpr float kStray_steps = 5;

// A camera that bleeds does so along all outlines: 0.14 to 0.20 of the pixels beside steps did with
// a Kinect's noise, and at most 0.012 seemed to with exact depth, where an object hides itself
// (five scenes). A frame in which fewer than this share do is taken as it is.
inline constexpr double kLeastBleedingShare = 0.05;

// `ids` (CV_16UC1) with kNoInstance where `depth` (CV_32FC1, metres, of the same size) bleeds: of
// the valid depths of the pixels within kBleedingReach_px rows and columns those with the pixel's
// id and those with another have medians (of an even number the upper one) that are more than
// `step_m` apart, and the pixel's own is nearer to that of the others, or it is more than
// kStray_steps times `step_m` behind that of its own id. Pixels without valid depth, and those that
// are kNoInstance, are neither looked at nor counted. Where fewer than kLeastBleedingShare of the
// pixels with medians so far apart bleed, or none, the result shares its pixels with `ids`. In
// parallel, the same for any number of threads.
cv::Mat WithoutBleeding(const cv::Mat& depth, const cv::Mat& ids, float step_m);

}  // namespace tsdfpp
