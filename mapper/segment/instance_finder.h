// Who finds instances in a frame: a network (mapper/instance_network.h), or a program's
// own.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// One thing that a frame shows, as a network says.
struct Instance {
  cv::Rect box;                // within the image
  cv::Mat mask;                // CV_8UC1 of the box's size, not 0 where the thing is
  std::string semantic_class;  // never empty
  float score = 1;             // how sure it is of it, 0 to 1
};

class InstanceFinder {
 public:
  virtual ~InstanceFinder() = default;

  // The instances that the frame shows, in any order, which may overlap; the same for the same
  // frame. It may lack its mask and the objects' poses. Segmenters that share a finder may call it
  // at the same time, and each from any thread. Errors: kData, a sentence that begins with the
  // frame's number.
  virtual Expected<std::vector<Instance>> Find(const Frame& frame) = 0;
};

// What the finder finds in the frame, in its order. Errors: the finder's; kData, a sentence that
// begins with the frame's number, where it finds more than ids can name (kNoInstance - 1), or what
// is no Instance.
Expected<std::vector<Instance>> FindInstances(InstanceFinder& finder, const Frame& frame);

}  // namespace tsdfpp
