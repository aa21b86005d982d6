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

Expected<Segmentation> SegmentationFromName(std::string_view name) {
  if (name == "gt") return Segmentation::kGiven;
  if (name == "none") return Segmentation::kNone;
  if (name == "depth") return Segmentation::kDepth;
  if (name == "network") return Segmentation::kNetwork;
  if (name == "full") return Segmentation::kFull;
  return UsageError("segmentation '{}' is unknown, expected gt, none, depth, network or full",
                    name);
}

std::string_view SegmentationName(Segmentation segmentation) {
  switch (segmentation) {
    case Segmentation::kGiven:
      return "gt";
    case Segmentation::kNone:
      return "none";
    case Segmentation::kDepth:
      return "depth";
    case Segmentation::kNetwork:
      return "network";
    case Segmentation::kFull:
      return "full";
  }
  std::abort();
}

bool IdsAreOfOneFrame(Segmentation segmentation) {
  return UsesDepth(segmentation) || UsesNetwork(segmentation);
}

bool UsesDepth(Segmentation segmentation) {
  return segmentation == Segmentation::kDepth || segmentation == Segmentation::kFull;
}

bool UsesNetwork(Segmentation segmentation) {
  return segmentation == Segmentation::kNetwork || segmentation == Segmentation::kFull;
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
