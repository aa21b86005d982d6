// From the maps of our own network to instances: things by pixels, each of which points to its
// thing's centre (docs/segmentation.md, "Our own network").
#pragma once

#include <string>
#include <vector>

#include "mapper/network/network_output.h"
#include "mapper/segment/instance_finder.h"

namespace tsdfpp {

// A centre is the greatest of those within so many pixels to each side.
inline constexpr int kCentreReach_px = 4;
// Less of the network's pixels are no thing.
inline constexpr int kLeastThing_px = 20;

// Instances, in order of their centres by row. `maps` is 1x4xHxW (or more rows and columns, which
// are not looked at): the logit of a pixel being a thing's (a thing above 0), the logit of it being
// the centre of one, and the way from it to the centre of its thing, columns and rows. `part` is
// what is the frame's of the maps' pixels, from the first on; `image` is the frame's size. Each
// pixel of a thing belongs to the centre that is nearest to where it points. Centres count that are
// a thing's pixels, and surer than `least_score`, which is then the instance's. A pixel of the
// image is what the network's pixel below its middle is. The maps' shape must be right.
std::vector<Instance> InstancesOfCentres(const NetworkOutput& maps, cv::Size part, cv::Size image,
                                         float least_score, const std::string& semantic_class);

}  // namespace tsdfpp
