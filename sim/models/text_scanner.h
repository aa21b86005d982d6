// Lines and words of a text file, without copies.
#pragma once

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>
#include <string>
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

// The rest of a line after its first word: a name, which may hold blanks.
inline std::string RestOf(std::string_view line, std::string_view first_word) {
  const char* rest = first_word.data() + first_word.size();
  std::string name(rest, static_cast<std::size_t>(line.data() + line.size() - rest));
  const auto blank = [](unsigned char c) { return std::isspace(c) != 0; };
  name.erase(name.begin(), std::find_if_not(name.begin(), name.end(), blank));
  name.erase(std::find_if_not(name.rbegin(), name.rend(), blank).base(), name.end());
  return name;
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
