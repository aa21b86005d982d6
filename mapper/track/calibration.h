// What segments whose place is known say of the error that an object's model adds to a place.
#pragma once

#include "core/types.h"
#include "mapper/track/known_directions.h"
#include "mapper/track/sdf_registration.h"

namespace tsdfpp {

// Of one such segment, which was registered to the model as it is now.
struct Calibration {
  // Takes where it seems to be to where it is, in the object's lattice.
  Pose correction_L = Pose::Identity();
  KnownDirections known;  // by its points
};

// The correction of the place `found`. The model's error is the same where the same of it is seen.
// `near` is of a segment seen from about here, which corrects every direction, but it is the last
// of many that took over each other's errors. `far` is of fewer: it corrects those along which the
// place found is known as well as by it. Where that knows less, by the share: a box seen from
// the front alone slides along itself, and a segment that showed its corner knows nothing of that.
// And it corrects nothing that it does not know itself, as a ball's turns.
Pose Joined(const Calibration& near, const Calibration& far, const SdfRegistrationResult& found);

}  // namespace tsdfpp
