// What the readers of scene files share: checks and values of several numbers.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "core/toml_reader.h"
#include "core/types.h"

namespace tsdfpp {

// A fault unless `name` can be part of a file's name, e.g. trajectories/gt-truck-1.txt.
void CheckPlainName(TomlReader& reader, std::string_view name);

template <typename T>
void CheckRange(TomlReader& reader, std::string_view key, T value, T low, T high) {
  if (!(value >= low && value <= high)) {
    reader.Fault(key, fmt::format("is {}, expected {} to {}", value, low, high));
  }
}

// Reads a whole number from 0 to the largest that TOML has, 2^63 - 1.
void GetSeed(TomlReader& reader, std::string_view key, std::uint64_t& seed);
// Reads [red, green, blue], each 0 to 255.
void GetColour(TomlReader& reader, std::string_view key, Colour& colour);
// Reads a range [low, high], low <= high, within `least` and `most`.
void GetRange(TomlReader& reader, std::string_view key, Eigen::Vector2d& range, double least,
              double most);
// Reads width, height, f (or fx and fy), cx, cy.
void ReadIntrinsics(TomlReader& reader, const toml::table& table, Intrinsics& k);

}  // namespace tsdfpp
