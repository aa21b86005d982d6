#include "mapper/segment/segmenter.h"

#include <cstdlib>

#include "mapper/segment/depth_segments.h"
#include "mapper/segment/given_masks.h"
#include "mapper/segment/no_masks.h"

namespace tsdfpp {

Expected<Segmentation> SegmentationFromName(std::string_view name) {
  if (name == "gt") return Segmentation::kGiven;
  if (name == "none") return Segmentation::kNone;
  if (name == "depth") return Segmentation::kDepth;
  return UsageError("segmentation '{}' is unknown, expected gt, none or depth", name);
}

std::string_view SegmentationName(Segmentation segmentation) {
  switch (segmentation) {
    case Segmentation::kGiven:
      return "gt";
    case Segmentation::kNone:
      return "none";
    case Segmentation::kDepth:
      return "depth";
  }
  std::abort();
}

std::unique_ptr<Segmenter> MakeSegmenter(Segmentation segmentation,
                                         const std::vector<ObjectInfo>& objects,
                                         const DepthSegmentsConfig& depth) {
  switch (segmentation) {
    case Segmentation::kGiven:
      return std::make_unique<GivenMasks>(objects);
    case Segmentation::kNone:
      return std::make_unique<NoMasks>();
    case Segmentation::kDepth:
      return std::make_unique<DepthSegments>(depth);
  }
  std::abort();
}

}  // namespace tsdfpp
