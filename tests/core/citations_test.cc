// Comments and pages cite files and sections that are there. The rules:
// - A path is ours where it begins with one of our folders or ends in ".md"; of other projects it
//   has a host in front. It is there seen from the root, or from the folder of what cites it.
// - Signs such as * < { % and a name in capitals alone stand for something: no path.
// - A header or source cited without a folder is somewhere among ours, or included there.
// - What is quoted behind a page is a section of it: a heading, the part of one before its colon,
//   or the bold words that a paragraph or a list's item begins with.
// - What .gitignore leaves out is generated, and what docs/tables.toml names has its own check.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

std::string Without(std::string text, std::string_view signs) {
  std::erase_if(text, [&](char c) { return signs.find(c) != std::string_view::npos; });
  return text;
}

// What begins a comment in a file; empty where the file has none.
std::string CommentMark(const fs::path& file) {
  static const std::map<std::string, std::string> kMarks = {
      {".h", "//"}, {".cc", "//"}, {".c", "//"},   {".js", "//"},   {".mjs", "//"},
      {".py", "#"}, {".sh", "#"},  {".toml", "#"}, {".cmake", "#"}, {".txt", "#"}};
  if (file.extension() == ".txt" && file.filename() != "CMakeLists.txt") return "";
  const auto mark = kMarks.find(file.extension().string());
  return mark == kMarks.end() ? "" : mark->second;
}

// Where the line's comment begins: outside of quotes, at the start or behind a blank.
std::size_t CommentAt(const std::string& line, const std::string& mark) {
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\\') ++i;
    if (i < line.size() && line[i] == '"') quoted = !quoted;
    if (!quoted && line.compare(i, mark.size(), mark) == 0 && (i == 0 || line[i - 1] == ' ')) {
      return i;
    }
  }
  return std::string::npos;
}

// What a file says to its readers, without line ends: the comments that follow each other as one
// text, or the whole of a page.
std::vector<std::string> TextsOf(const fs::path& file, const std::string& content) {
  const bool is_page = file.extension() == ".md";
  const std::string mark = CommentMark(file);
  std::vector<std::string> texts(1);
  if (!is_page && mark.empty()) return {};
  for (const std::string& line : LinesOf(content)) {
    std::size_t first = is_page ? 0 : CommentAt(line, mark);
    if (first == std::string::npos) {
      if (!texts.back().empty()) texts.emplace_back();
      continue;
    }
    first = line.find_first_not_of(is_page ? " " : mark + " ", first);
    if (first == std::string::npos) continue;
    // A comment's path may go on in the next line.
    if (is_page || !texts.back().ends_with('/')) texts.back() += ' ';
    texts.back() += line.substr(first);
  }
  return texts;
}

// Of a page: what stands outside of fences.
std::vector<std::string> ProseOf(const std::string& page) {
  std::vector<std::string> prose;
  bool fenced = false;
  for (const std::string& line : LinesOf(page)) {
    if (line.starts_with("```")) {
      fenced = !fenced;
    } else if (!fenced) {
      prose.push_back(line);
    }
  }
  return prose;
}

std::set<std::string> HeadingsOf(const std::string& page) {
  std::set<std::string> headings;
  for (const std::string& line : ProseOf(page)) {
    const std::size_t level = line.find_first_not_of('#');
    if (level == 0 || level == std::string::npos || line[level] != ' ') continue;
    headings.insert(Without(line.substr(level + 1), "`"));
  }
  return headings;
}

std::set<std::string> SectionsOf(const std::string& page) {
  std::set<std::string> sections;
  for (const std::string& heading : HeadingsOf(page)) {
    sections.insert(heading);
    sections.insert(heading.substr(0, heading.find(':')));
  }
  for (const std::string& line : ProseOf(page)) {
    const std::size_t bold = line.starts_with("- **") ? 4 : 2;
    if (!line.starts_with("**") && bold == 2) continue;
    const std::size_t end = line.find("**", bold);
    if (end == std::string::npos) continue;
    std::string words = Without(line.substr(bold, end - bold), "`");
    if (words.ends_with('.')) words.pop_back();
    sections.insert(words);
  }
  return sections;
}

// The name of a heading in a link, as GitHub makes it.
std::string AnchorOf(const std::string& heading) {
  std::string anchor;
  for (const char c : heading) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == ' ') {
      anchor += '-';
    } else if (byte >= 0x80 || std::isalnum(byte) != 0 || c == '-' || c == '_') {
      anchor += static_cast<char>(std::tolower(byte));
    }
  }
  return anchor;
}

// In capitals alone, as in FOLDER/NAME; but a README is a file.
bool IsPlaceholder(const fs::path& path) {
  return std::any_of(path.begin(), path.end(), [](const fs::path& part) {
    const std::string stem = part.stem().string();
    return stem != "README" &&
           std::any_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isupper(c); }) &&
           std::none_of(stem.begin(), stem.end(), [](unsigned char c) { return std::islower(c); });
  });
}

class Citations {
 public:
  explicit Citations(fs::path root) : root_(std::move(root)) {
    for (const std::string& line : LinesOf(TextOf(".gitignore"))) {
      if (line.starts_with('/') && line.ends_with('/')) {
        generated_.insert(line.substr(1, line.size() - 2));
      }
    }
    registry_ = TextOf("docs/tables.toml");
    for (auto at = fs::recursive_directory_iterator(root_);
         at != fs::recursive_directory_iterator(); ++at) {
      const std::string path = at->path().lexically_relative(root_).string();
      if (at->is_directory()) {
        if (path == ".git" || generated_.contains(path)) {
          at.disable_recursion_pending();
        } else if (at.depth() == 0) {
          folders_.insert(path);
        }
      } else if (at->is_regular_file()) {
        files_.push_back(path);
        names_.insert(at->path().filename().string());
      }
    }
    std::sort(files_.begin(), files_.end());
  }

  // A line each: who cites what.
  std::vector<std::string> Faults() {
    for (const std::string& file : files_) {
      citing_ = file;
      const bool is_page = citing_.extension() == ".md";
      if (!is_page && CommentMark(citing_).empty()) continue;
      const std::string content = TextOf(file);
      includes_.clear();
      for (const std::string& line : LinesOf(content)) {
        if (line.starts_with("#include")) includes_ += line + '\n';
      }
      for (const std::string& text : TextsOf(citing_, content)) LookAtPaths(text);
      if (is_page) LookAtLinks(content);
    }
    return faults_;
  }
  int checked() const { return checked_; }

 private:
  std::string TextOf(const fs::path& file) const { return ReadFile(root_ / file).value_or(""); }

  void Expect(bool is_right, const std::string& what) {
    ++checked_;
    if (!is_right) faults_.push_back(citing_.string() + ": " + what);
  }

  // The path from the root, or nothing.
  fs::path Find(const std::string& path) const {
    for (const fs::path& from : {fs::path(), citing_.parent_path()}) {
      fs::path found = (from / path).lexically_normal();
      if (fs::exists(root_ / found)) return found;
    }
    return {};
  }

  void LookAtPaths(const std::string& text) {
    constexpr std::string_view kOthers = "_./+-<>{}*$%~@";
    const auto is_part = [&](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
             kOthers.find(c) != std::string_view::npos;
    };
    std::size_t end = 0;
    for (std::size_t at = 0; at < text.size(); at = end + 1) {
      for (end = at; end < text.size() && is_part(text[end]); ++end) {
      }
      std::string path = text.substr(at, end - at);
      if (path.find_first_of("<>{}*$%~@") != std::string::npos) continue;
      while (path.ends_with('.') || path.ends_with('-')) path.pop_back();
      if (path.empty() || path.starts_with('/')) continue;
      LookAt(path);
      if (path.ends_with(".md") && !Find(path).empty()) LookAtSections(Find(path), text, end);
    }
  }

  void LookAt(const std::string& path) {
    const std::string first = path.substr(0, path.find('/'));
    const std::string ending = fs::path(path).extension().string();
    if (first == path) {
      if (ending != ".h" && ending != ".cc") return;
      if (path == ending || IsPlaceholder(path)) return;
      Expect(names_.contains(path) || includes_.find(path) != std::string::npos,
             path + " is no file of ours");
      return;
    }
    const bool is_host = first != ".." && first.find('.') != std::string::npos;
    const bool is_ours = folders_.contains(first) || (ending == ".md" && !is_host);
    if (!is_ours || generated_.contains(first) || IsPlaceholder(path)) return;
    if (registry_.find('"' + path + '"') != std::string::npos) return;
    Expect(!Find(path).empty(), path + " is not there");
  }

  // Behind a page: , "one section" and "another".
  void LookAtSections(const fs::path& page, const std::string& text, std::size_t at) {
    while (at < text.size() && (text[at] == '`' || text[at] == ')')) ++at;
    std::string_view rest = std::string_view(text).substr(at);
    for (std::size_t count = 0;; ++count) {
      std::size_t quote = std::string::npos;
      for (const std::string_view between : {", \"", " and \"", ", and \""}) {
        if (rest.starts_with(between) && (count > 0 || between == ", \"")) quote = between.size();
      }
      if (quote == std::string::npos) return;
      rest.remove_prefix(quote);
      const std::size_t end = rest.find('"');
      if (end == std::string_view::npos) return;
      const std::string section(rest.substr(0, end));
      Expect(SectionsOf(TextOf(page)).contains(Without(section, "`")),
             page.string() + " has no section \"" + section + '"');
      rest.remove_prefix(end + 1);
    }
  }

  void LookAtLinks(const std::string& content) {
    bool in_code = false;
    std::string prose;
    for (const std::string& line : ProseOf(content)) {
      for (const char c : line + '\n') {
        if (c == '`') in_code = !in_code;
        if (c != '`' && !in_code) prose += c;
      }
    }
    for (std::size_t at = prose.find("]("); at != std::string::npos; at = prose.find("](", at)) {
      at += 2;
      const std::string target = prose.substr(at, prose.find(')', at) - at);
      if (target.find(':') != std::string::npos) continue;
      const std::size_t hash = std::min(target.find('#'), target.size());
      const fs::path page =
          hash == 0 ? citing_ : (citing_.parent_path() / target.substr(0, hash)).lexically_normal();
      if (registry_.find('"' + page.string() + '"') != std::string::npos) continue;
      Expect(fs::exists(root_ / page), "the link " + target + " leads nowhere");
      if (hash == target.size() || !fs::exists(root_ / page)) continue;
      const std::set<std::string> headings = HeadingsOf(TextOf(page));
      Expect(std::any_of(headings.begin(), headings.end(),
                         [&](const auto& h) { return AnchorOf(h) == target.substr(hash + 1); }),
             "the link " + target + " leads to no heading");
    }
  }

  fs::path root_;
  std::set<std::string> generated_;  // folders
  std::string registry_;             // docs/tables.toml
  std::set<std::string> folders_;    // at the root
  std::vector<std::string> files_;
  std::set<std::string> names_;  // of files, without folders
  fs::path citing_;
  std::string includes_;  // of the citing file
  std::vector<std::string> faults_;
  int checked_ = 0;
};

TEST(Citations, AreOfWhatIsThere) {
  Citations citations(TSDFPP_SOURCE_DIR);
  EXPECT_EQ(citations.Faults(), std::vector<std::string>());
  EXPECT_GT(citations.checked(), 800);
}

class PlantedCitations : public testing::Test {
 protected:
  PlantedCitations() {
    Write(
        "docs/map.md",
        "# Maps\n\n## `one`: a field\n\n- **Rims** (all)\n\n**Range.** Far.\n\n### What's in it\n");
    Write("core/half.h", "");
    Write(".gitignore", "/out/\n");
  }
  void Write(const std::string& file, const std::string& text) {
    ASSERT_TRUE(WriteFile(folder_ / file, text));
  }
  std::vector<std::string> Faults() { return Citations(folder_.path()).Faults(); }

  test::TempFolder folder_;
};

TEST_F(PlantedCitations, RightOnesPass) {
  Write("core/a.h",
        "#include <other/far.h>  // before far.h\n"
        "// See half.h, core/half.h, and docs/map.md, \"`one`\", \"Rims\" and \"Range\"; docs/\n"
        "// map.md, \"What's in it\". Not: core/*.h, core/<name>.h, core/NAME.h, FOLDER/x.md,\n"
        "// out/run.md, github.com/a/b/c.md, models/x.ply, core/.\n"
        "const char* text = \"// core/gone.h\";\n");
  Write("docs/x.md",
        "[maps](map.md), \"Maps\"; [in it](map.md#whats-in-it); `../core/half.h`; "
        "[code](../core/half.h), `f[](gone)`.\n```\nf[](gone)\n```\n");
  EXPECT_EQ(Faults(), std::vector<std::string>());
}

TEST_F(PlantedCitations, WrongOnesAreFound) {
  Write("core/a.h",
        "int a;  // as core/gone.h\n"
        "\n"
        "// Of facts/gone.md, and docs/map.md, \"Rims\" and\n"
        "// \"Walls\".\n"
        "\n"
        "// See gone.h.\n");
  Write("docs/x.md",
        "`core/gone.cc`, [a](gone.md), [b](map.md#walls), [map.md](map.md), \"Edges\"\n");
  Write("scripts/x.sh", "echo  # as scripts/gone.sh\n");
  EXPECT_EQ(Faults(), (std::vector<std::string>{
                          "core/a.h: core/gone.h is not there",
                          "core/a.h: facts/gone.md is not there",
                          "core/a.h: docs/map.md has no section \"Walls\"",
                          "core/a.h: gone.h is no file of ours",
                          "docs/x.md: core/gone.cc is not there",
                          "docs/x.md: docs/map.md has no section \"Edges\"",
                          "docs/x.md: the link gone.md leads nowhere",
                          "docs/x.md: the link map.md#walls leads to no heading",
                          "scripts/x.sh: scripts/gone.sh is not there",
                      }));
}

}  // namespace
}  // namespace tsdfpp
