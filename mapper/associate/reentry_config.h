// The settings of how objects that were lost are found again (mapper/associate/reentry.h).
#pragma once

#include <string>

#include "core/error.h"
#include "core/toml_reader.h"

namespace tsdfpp {

struct ReentryConfig {
  bool enabled = true;
  // Frames that a new segment is held back longer while an object is lost: what comes into view bit
  // by bit is looked at until it is there.
  int wait_frames = 8;
  double speed_m_s = 5;         // a lost object is looked for as far as it can have got since
  int directions = 40;          // from which the model is looked at
  int turns = 12;               // about each of them
  int refined = 40;             // of these places, the best by distance
  int max_points = 300;         // of the segment, in the refinement
  double min_on_surface = 0.8;  // Reentry's measures, where it is believed
  double min_seen = 0.75;
  double max_colour = 0.12;
  double min_lead = 0.03;  // of the best object's score over the second one's

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<ReentryConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const ReentryConfig&) const = default;
};

}  // namespace tsdfpp
