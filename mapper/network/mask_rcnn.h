// From the outputs of TensorFlow's Mask R-CNN, as OpenCV's sample reads it, to instances
// (docs/segmentation.md, "Networks").
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/network/network_output.h"
#include "mapper/segment/instance_finder.h"
#include "mapper/segment/network_config.h"

namespace tsdfpp {

// Instances, in the order of the detections. `detections` is 1x1xNx7 (image, class, score, left,
// top, right and bottom as shares of the image; rows of zeros at the end are none), `masks`
// NxCxHxW, for each class shares over the box. Those below config.least_score (0: 0.5) go; a pixel
// within the box is the instance's where its class's mask, interpolated linearly, is above
// config.mask_share. Classes without a name are called "class 7". Errors: kData, the layout, what
// was found and what was expected; no name of a file.
Expected<std::vector<Instance>> InstancesOfMaskRcnn(const NetworkOutput& detections,
                                                    const NetworkOutput& masks, cv::Size image,
                                                    const std::vector<std::string>& classes,
                                                    const NetworkConfig& config);

}  // namespace tsdfpp
