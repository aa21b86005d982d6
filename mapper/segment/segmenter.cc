#include "mapper/segment/segmenter.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "mapper/segment/depth_segments.h"
#include "mapper/segment/given_masks.h"
#include "mapper/segment/joined_segments.h"
#include "mapper/segment/no_masks.h"

namespace tsdfpp {

cv::Mat Segments::IdsOfObjects() const {
  if (unknown.empty()) return ids;
  std::vector<InstanceId> id_of(std::size_t{kNoInstance} + 1);
  std::iota(id_of.begin(), id_of.end(), InstanceId{0});
  for (const InstanceId id : unknown) id_of[id] = kBackground;
  cv::Mat of_objects(ids.size(), CV_16UC1);
  std::transform(ids.begin<InstanceId>(), ids.end<InstanceId>(), of_objects.begin<InstanceId>(),
                 [&](InstanceId id) { return id_of[id]; });
  return of_objects;
}

bool SaysWhatIsWhere(const cv::Mat& ids) {
  return cv::countNonZero(ids != static_cast<double>(kNoInstance)) > 0;
}

std::unique_ptr<Segmenter> MakeSegmenter(Segmentation segmentation,
                                         const std::vector<ObjectInfo>& objects,
                                         const SegmenterParts& parts) {
  switch (segmentation) {
    case Segmentation::kGiven:
      return std::make_unique<GivenMasks>(objects);
    case Segmentation::kNone:
      return std::make_unique<NoMasks>();
    case Segmentation::kDepth:
      return std::make_unique<DepthSegments>(parts.depth);
    case Segmentation::kNetwork:
      return std::make_unique<InstanceSegments>(parts.finder, parts.network);
    case Segmentation::kFull:
      return std::make_unique<JoinedSegments>(parts.finder, parts.network, parts.depth);
  }
  std::abort();
}

}  // namespace tsdfpp
