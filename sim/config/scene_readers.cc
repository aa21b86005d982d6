#include "sim/config/scene_readers.h"

#include <algorithm>
#include <cctype>
#include <cmath>

namespace tsdfpp {
namespace {

constexpr int kMaxImageSide = 8192;

}  // namespace

void CheckPlainName(TomlReader& reader, std::string_view name) {
  const bool plain = !name.empty() && std::islower(static_cast<unsigned char>(name.front())) != 0 &&
                     std::all_of(name.begin(), name.end(), [](unsigned char c) {
                       return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '_';
                     });
  if (!plain) {
    reader.Fault("name", fmt::format("is '{}', expected lower-case letters, digits and '_'", name));
  }
}

void GetSeed(TomlReader& reader, std::string_view key, std::uint64_t& seed) {
  auto value = static_cast<std::int64_t>(seed);
  reader.Get(key, value);
  if (value < 0) {
    reader.Fault(key, fmt::format("is {}, expected 0 or more", value));
    return;
  }
  seed = static_cast<std::uint64_t>(value);
}

void GetColour(TomlReader& reader, std::string_view key, Colour& colour) {
  std::vector<double> numbers;
  reader.Get(key, numbers);
  const bool valid = numbers.size() == 3 &&
                     std::all_of(numbers.begin(), numbers.end(),
                                 [](double c) { return c >= 0 && c <= 255 && c == std::floor(c); });
  if (!valid) {
    reader.Fault(key, "is no colour: expected [red, green, blue], whole numbers from 0 to 255");
    return;
  }
  for (std::size_t k = 0; k < 3; ++k) colour[k] = static_cast<std::uint8_t>(numbers[k]);
}

void GetRange(TomlReader& reader, std::string_view key, Eigen::Vector2d& range, double least,
              double most) {
  std::vector<double> numbers{range[0], range[1]};
  reader.Get(key, numbers);
  if (numbers.size() != 2 || numbers[0] > numbers[1] || numbers[0] < least || numbers[1] > most) {
    reader.Fault(key, fmt::format("is [{}], expected [low, high] within {} and {}",
                                  fmt::join(numbers, ", "), least, most));
    return;
  }
  range = Eigen::Vector2d(numbers[0], numbers[1]);
}

void ReadIntrinsics(TomlReader& reader, const toml::table& table, Intrinsics& k) {
  double f = 0;
  reader.Get("width", k.width, true).Get("height", k.height, true);
  reader.Get("f", f).Get("fx", k.fx).Get("fy", k.fy);
  reader.Get("cx", k.cx, true).Get("cy", k.cy, true);
  const bool has_f = table.contains("f");
  const bool has_fx = table.contains("fx");
  const bool has_fy = table.contains("fy");
  if (has_f && (has_fx || has_fy))
    reader.Fault("f", "stands beside fx or fy: give one or the other");
  if (!has_f && !(has_fx && has_fy)) reader.Fault("f", "is missing (or both fx and fy)");
  if (has_f) k.fx = k.fy = f;
  CheckRange(reader, "width", k.width, 1, kMaxImageSide);
  CheckRange(reader, "height", k.height, 1, kMaxImageSide);
  if (has_f && !(f > 0)) reader.Fault("f", fmt::format("is {}, expected a positive number", f));
  if (has_fx && !(k.fx > 0)) reader.Fault("fx", fmt::format("is {}, expected > 0", k.fx));
  if (has_fy && !(k.fy > 0)) reader.Fault("fy", fmt::format("is {}, expected > 0", k.fy));
  CheckRange(reader, "cx", k.cx, 0.0, static_cast<double>(k.width));
  CheckRange(reader, "cy", k.cy, 0.0, static_cast<double>(k.height));
}

}  // namespace tsdfpp
