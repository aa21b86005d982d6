// Lists of words and numbers, as most datasets keep their poses and file names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct TextLine {
  int number = 0;  // in the file, from 1
  std::vector<std::string> words;
};

// The lines that are neither blank nor a '#' comment, split at blanks, tabs and commas. Errors:
// kData where the file cannot be read.
Expected<std::vector<TextLine>> ReadTextLines(const std::filesystem::path& path);

// The whole word as a number; "inf" and "nan" are numbers that are not finite.
std::optional<double> ParseNumber(std::string_view word);
// The whole word as a number from 0, digits only.
std::optional<int> ParseWholeNumber(std::string_view word);

// All words of a file as numbers. Errors: kData, naming file, line and word.
Expected<std::vector<double>> ReadNumbers(const std::filesystem::path& path);

// The sorted names of what lies in a folder; none where there is no such folder. Errors: kData
// where it is there and cannot be read.
Expected<std::vector<std::string>> NamesIn(const std::filesystem::path& folder);

// The folder's own name, also where the path ends with a slash or is ".", as text of one line.
std::string NameOfFolder(const std::filesystem::path& folder);

}  // namespace tsdfpp
