// Mends the pixels at which a rasteriser's depth cannot be trusted.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {

// A triangle that is seen nearly edge-on covers a pixel's centre now and then by the last bit
// alone, and its depth there, extrapolated along a slope of hundreds, is off by up to centimetres
// (measured: some ten pixels in a hundred million, on the rims of cups, wheels and roofs). Such a
// pixel lies on no line with two neighbours of its instance, behind or between them, and on no
// parabola with three behind which it lies, along any of the eight directions. Those that do not
// are cast again by mj_ray in the scene's present state, and take its depth and instance. `depth`
// (metres, 0 where nothing was hit) and `mask` are those of RenderedImages; returns the number of
// pixels that were cast.
int MendSliverPixels(CompiledScene& scene, const Intrinsics& intrinsics, const Pose& T_WC,
                     cv::Mat& depth, cv::Mat& mask);

}  // namespace tsdfpp
