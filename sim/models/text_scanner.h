// Lines and words of a text file, without copies.
#pragma once

#include <cctype>
#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

namespace tsdfpp {

// The words of a line, which blanks separate.
inline std::vector<std::string_view> WordsOf(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t at = 0;
  const auto is_blank = [&](std::size_t i) {
    return std::isspace(static_cast<unsigned char>(line[i])) != 0;
  };
  while (at < line.size()) {
    while (at < line.size() && is_blank(at)) ++at;
    const std::size_t first = at;
    while (at < line.size() && !is_blank(at)) ++at;
    if (at > first) words.push_back(line.substr(first, at - first));
  }
  return words;
}

// The whole word as a number ("nan" and "inf" included), or nothing.
template <typename Number>
std::optional<Number> NumberIn(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  Number value{};
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (status != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

}  // namespace tsdfpp
