#include "mapper/segment/segmentation.h"

#include <cstdlib>

namespace tsdfpp {

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

}  // namespace tsdfpp
