// How large what enters may be (docs/limits.md, which has the same table).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

struct Limits {
  std::int64_t file_bytes = std::int64_t{4} << 30U;
  std::int64_t text_bytes = std::int64_t{256} << 20U;
  std::int64_t json_bytes = std::int64_t{512} << 20U;
  std::int64_t nesting = 64;
  std::int64_t image_side = 16384;
  std::int64_t image_pixels = 100'000'000;
  std::int64_t frames = 1'000'000;
  std::int64_t map_bytes = std::int64_t{4} << 30U;
  std::int64_t mesh_elements = 200'000'000;
  bool operator==(const Limits&) const = default;
};

using Limit = std::int64_t Limits::*;

struct NamedLimit {
  std::string_view name;
  Limit limit;
  std::int64_t least;  // that it can be set to
  std::int64_t most;
  std::string_view what;
};

// All of them, in the page's order.
const std::array<NamedLimit, 9>& AllLimits();

// Those in force: the defaults, until a program sets others as it begins.
const Limits& CurrentLimits();
// While nothing else runs that looks at them.
void SetLimits(const Limits& limits);

// "json_bytes=1000000,nesting=128" over the defaults; empty text is the defaults. Errors: kUsage,
// beginning with TSDFPP_LIMITS, the environment variable that has the text.
Expected<Limits> LimitsFromText(std::string_view text);

// Sets the limits that the environment variable TSDFPP_LIMITS names. Errors: those of
// LimitsFromText.
Expected<void> SetLimitsFromEnvironment();

// Errors: kData where `found` is over the limit: "<what>: <found> <unit>, over the limit ...".
Expected<void> CheckLimit(Limit limit, std::int64_t found, std::string_view what,
                          std::string_view unit);

}  // namespace tsdfpp
