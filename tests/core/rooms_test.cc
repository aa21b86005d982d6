// The rooms (docs/architecture.md): a lower one includes no higher one, and within the large rooms
// what includes what never leads back.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// The room of a file, by its path in the large room: its folder, or the file itself (header and
// source together) where it lies at the top.
std::string RoomOf(const fs::path& path) {
  return path.has_parent_path() ? path.begin()->string() : path.stem().string();
}

using Arrows = std::map<std::string, std::map<std::string, std::string>>;  // with one include each

Arrows ArrowsIn(const fs::path& source, const std::string& large) {
  Arrows arrows;
  const std::regex include("#include \"" + large + "/([^\"]+)\"");
  for (const auto& entry : fs::recursive_directory_iterator(source / large)) {
    const fs::path extension = entry.path().extension();
    if (!entry.is_regular_file() || (extension != ".h" && extension != ".cc")) continue;
    const fs::path file = entry.path().lexically_relative(source / large);
    const std::string text = ReadFile(entry.path()).value();
    for (std::sregex_iterator at(text.begin(), text.end(), include), end; at != end; ++at) {
      const std::string included = (*at)[1];
      const std::string from = RoomOf(file);
      const std::string to = RoomOf(included);
      if (from != to) arrows[from].try_emplace(to, file.string() + " includes " + included);
    }
  }
  return arrows;
}

// The includes on a way from `room` back to it; empty where there is none.
std::string WayBack(const Arrows& arrows, const std::string& room, const std::string& at,
                    std::set<std::string>& visited) {
  const auto from = arrows.find(at);
  if (from == arrows.end()) return "";
  for (const auto& [to, include] : from->second) {
    if (to == room) return include;
    if (!visited.insert(to).second) continue;
    std::string rest = WayBack(arrows, room, to, visited);
    if (!rest.empty()) return rest.insert(0, include + ", ");
  }
  return "";
}

std::string Circle(const Arrows& arrows) {
  for (const auto& [room, to] : arrows) {
    std::set<std::string> visited;
    std::string way = WayBack(arrows, room, room, visited);
    if (!way.empty()) return way;
  }
  return "";
}

// The other rooms that a room's files include, each with one of them.
std::map<std::string, std::string> RoomsIncludedBy(const fs::path& source,
                                                   const std::string& room) {
  std::map<std::string, std::string> included;
  const std::regex include(
      "#include \"(bench|cli|core|eval|mapper|metrics|sequence|sim|tests|viewer)/");
  for (const auto& entry : fs::recursive_directory_iterator(source / room)) {
    const fs::path extension = entry.path().extension();
    if (!entry.is_regular_file() || (extension != ".h" && extension != ".cc")) continue;
    const std::string text = ReadFile(entry.path()).value();
    for (std::sregex_iterator at(text.begin(), text.end(), include), end; at != end; ++at) {
      if ((*at)[1] != room) {
        included.try_emplace((*at)[1], entry.path().lexically_relative(source).string());
      }
    }
  }
  return included;
}

// Those of them that are not `allowed`, a sentence each.
std::vector<std::string> NotAllowed(const fs::path& source, const std::string& room,
                                    const std::set<std::string>& allowed) {
  std::vector<std::string> faults;
  for (const auto& [other, file] : RoomsIncludedBy(source, room)) {
    if (!allowed.contains(other))
      faults.push_back(fmt::format("{} includes a header of {}", file, other));
  }
  return faults;
}

// The sources of a folder that are longer than kLines and do not begin by saying why.
std::set<std::string> LongWithoutAReason(const fs::path& source, const std::string& room) {
  constexpr std::ptrdiff_t kLines = 400;  // past which a file may have two subjects
  std::set<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(source / room)) {
    const fs::path extension = entry.path().extension();
    if (!entry.is_regular_file() || (extension != ".h" && extension != ".cc")) continue;
    const std::string text = ReadFile(entry.path()).value();
    const std::string head = text.substr(0, text.find("#include"));
    if (std::ranges::count(text, '\n') > kLines &&
        head.find("Longer than most files: ") == std::string::npos) {
      files.insert(entry.path().lexically_relative(source).string());
    }
  }
  return files;
}

TEST(Rooms, ALowerOneIncludesNoHigherOne) {
  const std::map<std::string, std::set<std::string>> allowed{
      {"core", {}},
      {"sim", {"core"}},
      {"sequence", {"core"}},
      {"mapper", {"core"}},
      {"metrics", {"core"}},
      {"eval", {"core", "sim", "sequence", "mapper", "metrics", "viewer"}},
      {"cli", {"core", "sim", "sequence", "mapper", "metrics", "eval"}},
  };
  for (const auto& [room, others] : allowed) {
    EXPECT_EQ(NotAllowed(TSDFPP_SOURCE_DIR, room, others), std::vector<std::string>()) << room;
  }
}

TEST(Rooms, AHigherOneIsFound) {
  const test::TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "mapper/index/list.h",
                        "#include \"mapper/map.h\"\n#include \"core/types.h\"\n"));
  EXPECT_EQ(NotAllowed(folder.path(), "mapper", {"core"}), std::vector<std::string>());
  ASSERT_TRUE(WriteFile(folder / "mapper/map.cc", "#include \"metrics/measured.h\"\n"));
  EXPECT_EQ(NotAllowed(folder.path(), "mapper", {"core"}),
            std::vector<std::string>{"mapper/map.cc includes a header of metrics"});
}

TEST(Rooms, LongFilesSayWhy) {
  for (const char* room :
       {"bench", "cli", "core", "eval", "mapper", "metrics", "sequence", "sim", "tests"}) {
    for (const std::string& file : LongWithoutAReason(fs::path(TSDFPP_SOURCE_DIR), room)) {
      ADD_FAILURE() << file << ": expected \"Longer than most files: \" and why, at its top";
    }
  }
}

TEST(Rooms, ALongFileWithoutAReasonIsFound) {
  const test::TempFolder folder;
  const std::string lines(401, '\n');
  ASSERT_TRUE(WriteFile(folder / "room/short.cc", lines.substr(1)));
  ASSERT_TRUE(WriteFile(folder / "room/long.cc", lines));
  ASSERT_TRUE(WriteFile(folder / "room/why.cc", "// Longer than most files: one table." + lines));
  EXPECT_EQ(LongWithoutAReason(folder.path(), "room"), std::set<std::string>{"room/long.cc"});
}

TEST(Rooms, NoneLeadsBack) {
  for (const std::string large : {"mapper", "eval", "sim"}) {
    const Arrows arrows = ArrowsIn(TSDFPP_SOURCE_DIR, large);
    EXPECT_GE(arrows.size(), 7U) << large;
    EXPECT_EQ(Circle(arrows), "") << large;
  }
}

TEST(Rooms, AWayBackIsFound) {
  const test::TempFolder folder;
  const auto write = [&](const std::string& file, const std::string& included) {
    ASSERT_TRUE(WriteFile(folder / ("house/" + file), "#include \"house/" + included + "\"\n"));
  };
  write("door.h", "kitchen/stove.h");
  write("kitchen/stove.cc", "cellar/oven.h");
  write("cellar/oven.h", "cellar/coal.h");
  EXPECT_EQ(Circle(ArrowsIn(folder.path(), "house")), "");
  write("cellar/coal.cc", "door.h");
  EXPECT_NE(Circle(ArrowsIn(folder.path(), "house")).find("cellar/coal.cc includes door.h"),
            std::string::npos);
}

}  // namespace
}  // namespace tsdfpp
