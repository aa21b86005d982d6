// Segments whose ids are those of objects already, as the renderer's and an annotator's are.
#pragma once

#include "mapper/associate/associator.h"

namespace tsdfpp {

class GivenIds : public Associator {
 public:
  // The segments themselves, with their classes.
  AssociatedObjects Associate(const Frame& frame, const Segments& segments,
                              const MapRepresentation& map) override;
};

}  // namespace tsdfpp
