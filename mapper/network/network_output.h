// What a network gives, as decoders of formats take it: numbers and how they are laid out, however
// they were made.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace tsdfpp {

// An array of single precision, the last side the fastest.
struct NetworkOutput {
  std::vector<int> sides;
  const float* values = nullptr;

  // "1x4x192x320".
  std::string Shape() const { return fmt::format("{}", fmt::join(sides, "x")); }
};

}  // namespace tsdfpp
