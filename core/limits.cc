#include "core/limits.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <limits>

#include "core/one_line.h"

namespace tsdfpp {
namespace {

constexpr std::int64_t kAnySize = std::numeric_limits<std::int64_t>::max() / 4;
// A reader keeps a place on the stack for each level.
constexpr std::int64_t kMostNesting = 1000;
// OpenCV's own bound, and what 32 bits can count the bytes of three channels of.
constexpr std::int64_t kMostSide = 1 << 20;
constexpr std::int64_t kMostPixels = 500'000'000;
// Numbers of frames are 32-bit.
constexpr std::int64_t kMostFrames = 1'000'000'000;
// Vertices are counted in 32 bits.
constexpr std::int64_t kMostElements = 4'000'000'000;

constexpr std::array<NamedLimit, 9> kAllLimits = {{
    {"file_bytes", &Limits::file_bytes, 1, kAnySize, "bytes of a file that is read whole"},
    {"text_bytes", &Limits::text_bytes, 1, kAnySize,
     "bytes of a list of poses, times or names, and of a TOML file"},
    {"json_bytes", &Limits::json_bytes, 1, kAnySize, "bytes of a JSON file"},
    {"nesting", &Limits::nesting, 1, kMostNesting,
     "lists and objects within one another, in JSON and in TOML"},
    {"image_side", &Limits::image_side, 2, kMostSide, "pixels of an image's width or height"},
    {"image_pixels", &Limits::image_pixels, 4, kMostPixels,
     "pixels of an image, and of the boxes of a frame's masks together (`--masks`)"},
    {"frames", &Limits::frames, 1, kMostFrames, "frames of a sequence"},
    {"map_bytes", &Limits::map_bytes, 1, kAnySize, "bytes of a saved map once it is unfolded"},
    {"mesh_elements", &Limits::mesh_elements, 1, kMostElements,
     "vertices, faces or corners of a PLY or glTF file"},
}};

Limits& LimitsInForce() {
  static Limits limits;
  return limits;
}

}  // namespace

const std::array<NamedLimit, 9>& AllLimits() { return kAllLimits; }

const Limits& CurrentLimits() { return LimitsInForce(); }

void SetLimits(const Limits& limits) { LimitsInForce() = limits; }

Expected<Limits> LimitsFromText(std::string_view text) {
  Limits limits;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(','));
    text.remove_prefix(std::min(word.size() + 1, text.size()));
    const std::size_t equals = word.find('=');
    const std::string_view name = word.substr(0, equals);
    const auto* known = std::find_if(kAllLimits.begin(), kAllLimits.end(),
                                     [&](const NamedLimit& each) { return each.name == name; });
    if (equals == std::string_view::npos || known == kAllLimits.end()) {
      std::string names;
      for (const NamedLimit& each : kAllLimits) {
        names += fmt::format("{}{}", names.empty() ? "" : ", ", each.name);
      }
      return UsageError("TSDFPP_LIMITS: {} is no name=value with one of the names {}", Quoted(word),
                        names);
    }
    const std::string_view digits = word.substr(equals + 1);
    std::int64_t value = 0;
    const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (status != std::errc() || end != digits.data() + digits.size() || value < known->least ||
        value > known->most) {
      return UsageError("TSDFPP_LIMITS: {} is {}, expected a whole number from {} to {}", name,
                        Quoted(digits), known->least, known->most);
    }
    limits.*(known->limit) = value;
  }
  return limits;
}

Expected<void> SetLimitsFromEnvironment() {
  const char* text = std::getenv("TSDFPP_LIMITS");
  TSDFPP_ASSIGN(const Limits limits, LimitsFromText(text == nullptr ? "" : text));
  SetLimits(limits);
  return {};
}

Expected<void> CheckLimit(Limit limit, std::int64_t found, std::string_view what,
                          std::string_view unit) {
  const std::int64_t most = CurrentLimits().*limit;
  if (found <= most) return {};
  const auto* known = std::find_if(kAllLimits.begin(), kAllLimits.end(),
                                   [&](const NamedLimit& each) { return each.limit == limit; });
  return DataError("{}: {} {}, over the limit of {} (TSDFPP_LIMITS={}=... raises it)", what, found,
                   unit, most, known->name);
}

}  // namespace tsdfpp
