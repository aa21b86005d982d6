#include "mapper/associate/associator.h"

#include <cstdlib>

namespace tsdfpp {

Expected<AssociationMode> AssociationModeFromName(std::string_view name) {
  if (name == "given") return AssociationMode::kGiven;
  if (name == "votes") return AssociationMode::kVotes;
  return UsageError("association '{}' is unknown, expected given or votes", name);
}

std::string_view AssociationModeName(AssociationMode mode) {
  switch (mode) {
    case AssociationMode::kGiven:
      return "given";
    case AssociationMode::kVotes:
      return "votes";
  }
  std::abort();
}

}  // namespace tsdfpp
