// What of a frame may be fused while some objects are not where the map has them.
#pragma once

#include "mapper/track/tracker.h"

namespace tsdfpp {

// The labels without those of frozen objects, and without all pixels behind which a block of such
// an object's volume lies that is solid somewhere (the rectangle around it): what is seen there
// would clear what the object is taken to claim (docs/map.md, "`tsdf++` and `tsdf++/anchored`").
// One field has no volumes; of it the labels alone are taken out.
cv::Mat LabelsToFuse(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                     const TrackedPoses& tracked);

}  // namespace tsdfpp
