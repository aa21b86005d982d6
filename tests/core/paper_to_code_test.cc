// docs/paper-to-code.md names files and symbols that are there. In the second column of its tables
// a file stands before its symbols, each in backticks; "-" says that there is no code.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// The parts of a text between separators.
std::vector<std::string> Split(const std::string& text, const std::string& separator) {
  std::vector<std::string> parts;
  std::size_t at = 0;
  for (std::size_t end = 0; end != std::string::npos; at = end + separator.size()) {
    end = text.find(separator, at);
    parts.push_back(text.substr(at, end == std::string::npos ? end : end - at));
  }
  return parts;
}

// A source's identifiers, and names such as A::B, without comments and literals.
std::set<std::string> NamesOf(const std::string& source) {
  std::string code;
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (source.compare(i, 2, "//") == 0) {
      i = std::min(source.find('\n', i), source.size());
    } else if (source[i] == '"') {
      for (++i; i < source.size() && source[i] != '"'; ++i) {
        if (source[i] == '\\') ++i;
      }
    }
    code += i < source.size() && source[i] != '"' ? source[i] : ' ';
  }
  std::set<std::string> names;
  const auto is_part = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == ':';
  };
  for (std::size_t at = 0; at < code.size();) {
    std::size_t end = at;
    while (end < code.size() && is_part(code[end])) ++end;
    const std::string name = code.substr(at, end - at);
    names.insert(name);
    for (const std::string& part : Split(name, "::")) names.insert(part);
    at = end + 1;
  }
  return names;
}

// A source has the name as it stands, a header its parts.
bool Names(const std::set<std::string>& names, const fs::path& file, const std::string& symbol) {
  if (file.extension() == ".cc") return names.contains(symbol);
  const std::vector<std::string> parts = Split(symbol, "::");
  return std::all_of(parts.begin(), parts.end(),
                     [&](const std::string& part) { return names.contains(part); });
}

struct PageCheck {
  int tables = 0;
  int symbols = 0;
  std::vector<std::string> faults;
};

PageCheck CheckPage(const fs::path& root, const std::string& page) {
  PageCheck check;
  const std::string text = ReadFile(root / page).value_or("");
  for (const std::string& line : Split(text, "\n")) {
    if (!line.starts_with("| ")) continue;
    const std::vector<std::string> cells = Split(line, " | ");
    if (cells.size() != 3) {
      check.faults.push_back("the row has not three cells: " + line);
      continue;
    }
    if (cells[1] == "code") ++check.tables;
    if (cells[1] == "code" || cells[1] == "-") continue;
    fs::path file;
    std::set<std::string> names;
    const std::vector<std::string> quoted = Split(cells[1], "`");
    int of_file = 0;
    for (std::size_t i = 1; i < quoted.size(); i += 2) {
      if (quoted[i].find('/') != std::string::npos) {
        file = quoted[i];
        of_file = 0;
        const auto source = ReadFile(root / file);
        if (!source) check.faults.push_back(file.string() + " is not there");
        names = NamesOf(source.value_or(""));
      } else if (++of_file, ++check.symbols; !Names(names, file, quoted[i])) {
        check.faults.push_back(file.string() + " does not name " + quoted[i]);
      }
    }
    if (of_file == 0) check.faults.push_back("the row names no code: " + line);
  }
  return check;
}

TEST(PaperToCode, NamesWhatIsThere) {
  const PageCheck check = CheckPage(TSDFPP_SOURCE_DIR, "docs/paper-to-code.md");
  EXPECT_EQ(check.faults, std::vector<std::string>());
  EXPECT_EQ(check.tables, 8);  // the pipeline, III-A to III-F, ours
  EXPECT_GT(check.symbols, 80);
}

TEST(PaperToCode, AWrongNameIsFound) {
  const test::TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "core/map.h", "class Map {\n  void Move();  // not Moved\n};\n"));
  ASSERT_TRUE(WriteFile(folder / "core/map.cc",
                        "void Map::Move() { Log(\"Lost \\\" Lost\"); }\nvoid Other::Fuse();\n"));
  ASSERT_TRUE(
      WriteFile(folder / "page.md",
                "| the paper | code | remark |\n"
                "|---|---|---|\n"
                "| a | `core/map.h`: `Map`, `Map::Move`; `core/map.cc`: `Map::Move`, `Log` | so |\n"
                "| b | - | not there |\n"
                "| c | `core/map.h`: `Moved`; `core/map.cc`: `Map::Fuse`, `Lost`, `Mov` | so |\n"
                "| d | `core/gone.h`: `Map` | so |\n"
                "| e | somewhere | so |\n"
                "| f | `core/map.h` |\n"));
  const PageCheck check = CheckPage(folder.path(), "page.md");
  EXPECT_EQ(check.tables, 1);
  EXPECT_EQ(check.faults, (std::vector<std::string>{
                              "core/map.h does not name Moved",
                              "core/map.cc does not name Map::Fuse",
                              "core/map.cc does not name Lost",
                              "core/map.cc does not name Mov",
                              "core/gone.h is not there",
                              "core/gone.h does not name Map",
                              "the row names no code: | e | somewhere | so |",
                              "the row has not three cells: | f | `core/map.h` |",
                          }));
}

}  // namespace
}  // namespace tsdfpp
