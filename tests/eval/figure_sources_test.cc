// What the figures of an experiment are made by is all in the program's identity, so that a cell
// of another program is never taken for one of this program.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/files.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

std::string Text(const fs::path& file) { return ReadFile(file).value_or(""); }

// A source with its header, and all that either includes of the room.
std::set<std::string> AllThatIsIncluded(const std::string& first, const std::string& room) {
  const std::regex include("#include \"(" + room + "/[^\"]+)\\.h\"");
  std::set<std::string> seen;
  std::vector<std::string> left{first};
  while (!left.empty()) {
    const std::string name = left.back();
    left.pop_back();
    for (const char* ending : {".h", ".cc"}) {
      const std::string file = name + ending;
      const fs::path path = fs::path(TSDFPP_SOURCE_DIR) / file;
      if (!fs::exists(path) || !seen.insert(file).second) continue;
      const std::string text = Text(path);
      for (std::sregex_iterator found(text.begin(), text.end(), include), end; found != end;
           ++found) {
        left.push_back((*found)[1]);
      }
    }
  }
  return seen;
}

TEST(FigureSources, AreAllThatACellIsMadeBy) {
  std::set<std::string> listed;
  std::istringstream list(Text(TSDFPP_FIGURE_SOURCES));
  for (std::string line; std::getline(list, line);) listed.insert(line);
  ASSERT_TRUE(listed.contains("eval/sweep/cell_run.cc"));
  // Which cells there are, and where a sequence is: neither changes what comes out of a cell.
  const std::set<std::string> others{"eval/run/open_source.cc", "eval/run/open_source.h",
                                     "eval/sweep/experiment.cc", "eval/sweep/experiment.h"};
  const std::set<std::string> included = AllThatIsIncluded("eval/sweep/cell_run", "eval");
  EXPECT_TRUE(included.contains("eval/score/evaluation.cc"));
  for (const std::string& file : included) {
    EXPECT_TRUE(listed.contains(file) || others.contains(file))
        << file << ": expected in figure_sources of eval/CMakeLists.txt";
  }
}

}  // namespace
}  // namespace tsdfpp
