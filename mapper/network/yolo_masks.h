// From the heads of YOLO networks for segments to instances (docs/segmentation.md, "Networks").
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/network/network_output.h"
#include "mapper/segment/instance_finder.h"
#include "mapper/segment/network_config.h"

namespace tsdfpp {

// How a frame lies in a network's input: scaled to whole pixels of it, in its middle; the rest is
// filled up.
struct Letterbox {
  cv::Rect place;
  cv::Size image;
  cv::Size input;

  double scale_x() const { return static_cast<double>(place.width) / image.width; }
  double scale_y() const { return static_cast<double>(place.height) / image.height; }
};
Letterbox LetterboxOf(cv::Size image, cv::Size input);

// Instances, the surest first. `boxes` is 1x(4 + C + M)xN (v8: middle, width and height in pixels
// of the input, a score a class, M weights) or 1xNx(5 + C + M) (v5, with one more score before
// those of classes, by which they are multiplied), `prototypes` 1xMxHxW over the input. C are the
// classes. A box has the class of its greatest score; those below `config.least_score` (0: 0.5) go,
// and of two of one class that overlap (intersection over union) by more than config.most_overlap
// the less sure. A pixel of the image within the box is the instance's where the logistic function
// of the sum of weights times prototypes, interpolated linearly, is above config.mask_share.
// Errors: kData, the layout, what was found and what was expected; no name of a file.
Expected<std::vector<Instance>> InstancesOfYolo(const NetworkOutput& boxes,
                                                const NetworkOutput& prototypes,
                                                const Letterbox& letterbox, cv::Size image,
                                                const std::vector<std::string>& classes,
                                                const NetworkConfig& config);

// More instances in a frame than this are more than there are.
inline constexpr std::size_t kMostInstances = 300;

}  // namespace tsdfpp
