// The settings of association by votes (mapper/associate/voxel_votes.h).
#pragma once

#include <string>

#include "core/error.h"
#include "core/toml_reader.h"

namespace tsdfpp {

struct VoteConfig {
  double at_voxels = 1.5;   // a point this near to an object's surface votes for it
  double min_share = 0.3;   // of a segment's points have to vote for the object that it joins
  double cut_share = 0.2;   // of a segment's points make a second object of it, which is cut off
  double near_voxels = 5;   // an object that moved farther than at_voxels is looked for so far away
  double near_share = 0.5;  // of a segment's points have to be that near
  int recent_frames = 3;    // only for objects that had a segment so many frames ago at most
  int max_points = 2000;    // of a segment; more are thinned evenly
  int min_points = 50;      // of a segment that may become a new object
  int confirm_frames = 3;   // it becomes one where it was there in so many frames ...
  int confirm_window = 5;   // ... of so many
  int hold_frames = 45;     // what may be a missing object is held back for so long at most
  // A part of a segment is not of the object that it joins if it is farther outside of the box
  // around all that is known of the object than so much of the box's diagonal (and than
  // near_voxels), and nothing hides what is between (far_part.h); 0: the segment is taken as it is.
  // Below 0: kUsualFarShare where masks are repaired (MaskRepairMode), else 0.
  double far_share = -1;
  static constexpr double kUsualFarShare = 0.15;

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<VoteConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const VoteConfig&) const = default;
};

}  // namespace tsdfpp
