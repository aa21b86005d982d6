// Which pixels of a frame belong together (paper III-B): the first verb of the pipeline.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "mapper/segment/depth_segments_config.h"
#include "mapper/segment/instance_finder.h"
#include "mapper/segment/network_config.h"
#include "mapper/segment/segmentation.h"

namespace tsdfpp {

struct Segments {
  // The segment of each pixel: CV_16UC1 of the depth image's size; kBackground is what the room is
  // made of, kNoInstance what belongs to no segment and is not fused. May share its pixels with the
  // frame, or with what the segmenter remembers: nobody writes into them.
  cv::Mat ids;
  // The semantic class of those segments of which it is known, never an empty one; perhaps of
  // segments that the frame lacks, too.
  std::map<InstanceId, std::string> classes{};
  // Segments, in ascending order, that begin no object, since a network knows none there: they
  // belong to one that the map has or will have, or are background.
  std::vector<InstanceId> unknown{};

  // The ids with the background in the place of those that are unknown; may be `ids` itself.
  cv::Mat IdsOfObjects() const;
};

// Whether any pixel (CV_16UC1) is said to be of something, the background perhaps. Between the
// frames that a network looks at, none is.
bool SaysWhatIsWhere(const cv::Mat& ids);

class Segmenter {
 public:
  virtual ~Segmenter() = default;

  // Frames come in order; one counts whether or not what follows accepts it. Errors: kData, a
  // sentence that begins with the frame's number.
  virtual Expected<Segments> Segment(const Frame& frame) = 0;
};

// What a segmenter is told besides.
struct SegmenterParts {
  DepthSegmentsConfig depth{};               // of kDepth and kFull; must be valid
  NetworkConfig network{};                   // of kNetwork and kFull; must be valid
  std::shared_ptr<InstanceFinder> finder{};  // of these; not nullptr then
};

// `objects` are what the ids of the frames' masks stand for; none where those ids are of one frame
// alone.
std::unique_ptr<Segmenter> MakeSegmenter(Segmentation segmentation,
                                         const std::vector<ObjectInfo>& objects,
                                         const SegmenterParts& parts);

}  // namespace tsdfpp
