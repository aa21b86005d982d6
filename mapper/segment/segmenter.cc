#include "mapper/segment/segmenter.h"

#include <cstdlib>

#include "mapper/segment/given_masks.h"
#include "mapper/segment/no_masks.h"

namespace tsdfpp {

Expected<Segmentation> SegmentationFromName(std::string_view name) {
  if (name == "gt") return Segmentation::kGiven;
  if (name == "none") return Segmentation::kNone;
  return UsageError("segmentation '{}' is unknown, expected gt or none", name);
}

std::string_view SegmentationName(Segmentation segmentation) {
  switch (segmentation) {
    case Segmentation::kGiven:
      return "gt";
    case Segmentation::kNone:
      return "none";
  }
  std::abort();
}

std::unique_ptr<Segmenter> MakeSegmenter(Segmentation segmentation,
                                         const std::vector<ObjectInfo>& objects) {
  switch (segmentation) {
    case Segmentation::kGiven:
      return std::make_unique<GivenMasks>(objects);
    case Segmentation::kNone:
      return std::make_unique<NoMasks>();
  }
  std::abort();
}

}  // namespace tsdfpp
