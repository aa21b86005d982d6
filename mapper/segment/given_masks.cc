#include "mapper/segment/given_masks.h"

namespace tsdfpp {

GivenMasks::GivenMasks(const std::vector<ObjectInfo>& objects) {
  for (const ObjectInfo& object : objects) {
    if (object.id == kBackground || object.semantic_class.empty()) continue;
    classes_.emplace(object.id, object.semantic_class);
  }
}

Expected<Segments> GivenMasks::Segment(const Frame& frame) {
  return Segments{frame.mask, classes_};
}

}  // namespace tsdfpp
