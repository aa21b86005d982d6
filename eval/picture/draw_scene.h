// Drawings of meshes and of the table.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"
#include "eval/truth/scene_truth.h"

namespace tsdfpp {

// Okabe and Ito's colours, which colour-blind readers can tell apart, in turn by id; the background
// is grey.
Colour ObjectColour(InstanceId id);

// A mesh as the frame's camera sees it, `scale` times smaller: one colour an object (the
// background's where there are no face ids), shaded; white where there is nothing. CV_8UC3,
// red-green-blue.
cv::Mat DrawScene(const TriangleMesh& scene_W, const Intrinsics& intrinsics, const Pose& T_WC,
                  double scale);

// The table's samples from above: grey where not seen yet, light where visible and mapped, blue
// where hidden and kept, red where hidden behind an object and missing, orange where visible and
// missing. CV_8UC3, red-green-blue.
cv::Mat DrawTable(const SceneTruth& truth, const Selection& reconstructed, double pixel_m);

}  // namespace tsdfpp
