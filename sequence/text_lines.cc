#include "sequence/text_lines.h"

#include <algorithm>
#include <charconv>

#include "core/files.h"
#include "core/folders.h"
#include "core/one_line.h"
#include "core/plain_name.h"

namespace tsdfpp {
namespace fs = std::filesystem;

Expected<std::vector<TextLine>> ReadTextLines(const fs::path& path) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path, &Limits::text_bytes));
  constexpr std::string_view kBlanks = " \t\r,";
  std::vector<TextLine> lines;
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = rest.find('\n');
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    TextLine words{number, {}};
    for (;;) {
      line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
      if (line.empty() || (words.words.empty() && line.front() == '#')) break;
      const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
      words.words.emplace_back(word);
      line.remove_prefix(word.size());
    }
    if (!words.words.empty()) lines.push_back(std::move(words));
  }
  return lines;
}

std::optional<double> ParseNumber(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double number = 0;
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (status != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return number;
}

std::optional<int> ParseWholeNumber(std::string_view word) {
  int number = 0;
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (status != std::errc() || end != word.data() + word.size() || word.front() == '-') {
    return std::nullopt;
  }
  return number;
}

Expected<std::vector<double>> ReadNumbers(const fs::path& path) {
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(path));
  std::vector<double> numbers;
  for (const TextLine& line : lines) {
    for (const std::string& word : line.words) {
      const auto number = ParseNumber(word);
      if (!number) {
        return DataError("{}:{}: '{}' is not a number", path.string(), line.number, word);
      }
      numbers.push_back(*number);
    }
  }
  return numbers;
}

Expected<std::vector<std::string>> NamesIn(const fs::path& folder) {
  std::error_code code;
  const fs::file_type type = fs::status(folder, code).type();
  std::vector<std::string> names;
  if (type == fs::file_type::not_found || (!code && type != fs::file_type::directory)) return names;
  TSDFPP_ASSIGN(const std::vector<fs::path> entries, ListFolder(folder));
  for (const fs::path& entry : entries) names.push_back(entry.filename().string());
  return names;
}

std::string NameOfFolder(const fs::path& folder) {
  return OneLine(OwnName(folder), kMostNameBytes);
}

}  // namespace tsdfpp
