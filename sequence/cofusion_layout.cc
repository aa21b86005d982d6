#include "sequence/cofusion_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>

namespace tsdfpp::cofusion {
namespace {

template <typename T>
std::optional<T> WholeNumber(std::string_view digits) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (digits.empty() || !std::all_of(digits.begin(), digits.end(), is_digit)) return std::nullopt;
  T number{};
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (status != std::errc()) return std::nullopt;
  return number;
}

// What stands between prefix and suffix.
std::optional<std::string_view> Middle(std::string_view name, std::string_view prefix,
                                       std::string_view suffix) {
  if (name.size() < prefix.size() + suffix.size() || !name.starts_with(prefix) ||
      !name.ends_with(suffix)) {
    return std::nullopt;
  }
  return name.substr(prefix.size(), name.size() - prefix.size() - suffix.size());
}

}  // namespace

std::string ColourFile(int index) { return fmt::format("{}/Color{:04d}.png", kColour, index); }
std::string DepthFile(int index) { return fmt::format("{}/Depth{:04d}.exr", kDepth, index); }
std::string MaskFile(int index) { return fmt::format("{}/Mask{:04d}.png", kMask, index); }
std::string SensedDepthFile(int index) {
  return fmt::format("{}/Depth{:04d}.exr", kSensedDepth, index);
}
std::string SensedMaskFile(int index) {
  return fmt::format("{}/Mask{:04d}.png", kSensedMask, index);
}
std::string TrajectoryFile(const ObjectInfo& object) {
  return fmt::format("{}/gt-{}-{}.txt", kTrajectories, object.name, object.id);
}
std::string ModelFile(const ObjectInfo& object) {
  return fmt::format("{}/{}-{}.ply", kModels, object.name, object.id);
}

std::optional<int> NumberOf(const std::string& file_name, const std::string& prefix,
                            const std::string& suffix) {
  const auto middle = Middle(file_name, prefix, suffix);
  return middle ? WholeNumber<int>(*middle) : std::nullopt;
}

std::optional<ObjectInfo> ObjectOf(const std::string& file_name, const std::string& prefix,
                                   const std::string& suffix) {
  const auto middle = Middle(file_name, prefix, suffix);
  if (!middle) return std::nullopt;
  const std::size_t dash = middle->rfind('-');
  if (dash == std::string_view::npos || dash == 0) return std::nullopt;
  const auto id = WholeNumber<InstanceId>(middle->substr(dash + 1));
  if (!id || *id == kNoInstance) return std::nullopt;
  const std::string name(middle->substr(0, dash));
  return ObjectInfo{*id, name, name};
}

bool IsCofusion(const std::filesystem::path& folder) {
  std::error_code code;
  return std::filesystem::is_regular_file(folder / kCalibration, code) &&
         std::filesystem::is_directory(folder / kColour, code);
}

}  // namespace tsdfpp::cofusion
