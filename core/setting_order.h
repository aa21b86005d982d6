// Settings of which one bounds another.
#pragma once

#include <string_view>

#include "core/error.h"

namespace tsdfpp {

// Names both: a file may hold one of them alone, and the other is its default then. `kind` begins
// the sentence: "tracking". Errors: kUsage where the smaller one is larger.
inline Expected<void> CheckOrder(std::string_view kind, std::string_view smaller,
                                 double smaller_value, std::string_view larger,
                                 double larger_value) {
  if (smaller_value <= larger_value) return {};
  return UsageError("{} setting '{}' is {}, expected at most '{}', which is {}", kind, smaller,
                    smaller_value, larger, larger_value);
}

}  // namespace tsdfpp
