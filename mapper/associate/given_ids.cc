#include "mapper/associate/given_ids.h"

namespace tsdfpp {

AssociatedObjects GivenIds::Associate(const Frame& /*frame*/, const Segments& segments,
                                      const MapRepresentation& /*map*/) {
  return {segments.ids, segments.classes};
}

}  // namespace tsdfpp
