#include "mapper/associate/given_ids.h"

namespace tsdfpp {

Association GivenIds::Associate(const Frame& /*frame*/, const Segments& segments,
                                const MapRepresentation& /*map*/,
                                const std::set<InstanceId>& /*movable*/) {
  return {segments.ids, segments.classes};
}

}  // namespace tsdfpp
