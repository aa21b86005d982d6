#include "mapper/map_editing.h"

#include <cstdlib>

#include "mapper/map_representation.h"

namespace tsdfpp {

MapEditing& EditingOf(MapRepresentation& map) {
  MapEditing* editing = map.editing();
  if (editing == nullptr) std::abort();
  return *editing;
}

}  // namespace tsdfpp
