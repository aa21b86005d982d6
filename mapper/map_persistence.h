// What a map writes to a file and reads from it (docs/map.md, "The map file"). A map may have none
// of it (MapRepresentation::persistence); to save a map and to load one, mapper/map_file.h.
#pragma once

#include <optional>

#include "core/error.h"
#include "core/types.h"
#include "mapper/store/section_file.h"

namespace tsdfpp {

class MapPersistence {
 public:
  virtual ~MapPersistence() = default;

  // The map's content as named sections of a file, always of the same names.
  virtual void Save(Sections& sections) const = 0;

  // Makes the map the saved one, bit for bit. It must have the same method and settings and be as
  // MakeMap made it; `sections` have the names that Save() gives them. Errors: kData, a fragment
  // that says what no map can hold; the map is then unusable.
  virtual Expected<void> Load(const Sections& sections) = 0;

  // T_WO that the object was given last, which is kept, too; nothing where there was none.
  virtual std::optional<Pose> LastPose(InstanceId id) const = 0;
};

}  // namespace tsdfpp
