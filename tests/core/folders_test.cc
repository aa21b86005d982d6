#include "core/folders.h"

#include <gtest/gtest.h>

#include <fstream>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::TempFolder;

TEST(Folders, EntriesComeInOrder) {
  const TempFolder folder;
  for (const char* name : {"b/2", "a", "c", "b/1/x"}) {
    ASSERT_TRUE(WriteFile(folder / name, "").has_value());
  }
  EXPECT_EQ(ListFolder(folder.path()).value(),
            (std::vector<fs::path>{folder / "a", folder / "b", folder / "c"}));
  EXPECT_EQ(ListFilesBelow(folder.path()).value(),
            (std::vector<fs::path>{folder / "a", folder / "b/1/x", folder / "b/2", folder / "c"}));
}

TEST(Folders, WhatCannotBeReadIsAnErrorOrNone) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "file", "").has_value());
  const std::string longer(300, 'n');
  fs::create_symlink("circle", folder / "circle");
  for (const fs::path& wrong : {folder / "none", folder / "file", folder / longer,
                                folder / "circle", fs::path(folder / "file" / "below")}) {
    const auto listed = ListFolder(wrong);
    ASSERT_FALSE(listed.has_value()) << wrong;
    EXPECT_EQ(listed.error().kind, ErrorKind::kData);
    EXPECT_TRUE(
        listed.error().message.starts_with(wrong.string() + ": cannot be read as a folder ("))
        << listed.error().message;
    EXPECT_TRUE(EntriesOf(wrong).empty());
    EXPECT_FALSE(ListFilesBelow(wrong).has_value());
    EXPECT_FALSE(IsFolder(wrong));
  }
  EXPECT_FALSE(IsThere(folder / longer));
  EXPECT_FALSE(IsThere(folder / "circle"));
  // A link that goes round is a file among the others, and nothing is entered twice.
  fs::create_directory_symlink(folder.path(), folder / "up");
  EXPECT_EQ(ListFilesBelow(folder.path()).value().size(), 3U);
}

TEST(Folders, NamesOfAnyPath) {
  EXPECT_EQ(OwnName("/a/b"), "b");
  EXPECT_EQ(OwnName("/a/b/"), "b");
  EXPECT_EQ(OwnName("/a/b/."), "b");
  EXPECT_EQ(OwnName("."), fs::current_path().filename().string());
  EXPECT_EQ(AbsolutePath("/a/../b"), "/a/../b");
  EXPECT_TRUE(AbsolutePath("x").is_absolute());
}

TEST(Folders, WhatLiesInWhat) {
  const TempFolder folder;
  fs::create_directories(folder / "a" / "b");
  std::ofstream(folder / "a" / "file").put('x');
  fs::create_directory_symlink(folder / "a", folder / "link");
  const fs::path a = folder / "a";
  EXPECT_TRUE(LiesIn(a, a));
  EXPECT_TRUE(LiesIn(a / "b", a));
  EXPECT_TRUE(LiesIn(a / "not there", a));
  EXPECT_TRUE(LiesIn(a / "file", a / "file"));
  EXPECT_TRUE(LiesIn(folder / "link" / "b" / "not there", a));
  EXPECT_FALSE(LiesIn(a / ".." / "ab", a));
  EXPECT_FALSE(LiesIn(folder.path(), a));
  EXPECT_FALSE(LiesIn(a / "b", folder / "not there"));
  EXPECT_FALSE(LiesIn(a, ""));
}

// However a path is spelled that is not there yet.
TEST(Folders, WhatIsNotThereLiesInWhatIsNotThere) {
  const TempFolder folder;
  const fs::path before = fs::current_path();
  fs::current_path(folder.path());
  const fs::path here = fs::current_path();
  for (const fs::path& place :
       {fs::path("new"), here / "new", fs::path("./new/"), here / "new/."}) {
    for (const fs::path& path : {fs::path("new/a"), here / "new/a", fs::path("./x/../new/a")}) {
      EXPECT_TRUE(LiesIn(path, place)) << path << place;
    }
    EXPECT_FALSE(LiesIn("newer", place)) << place;
  }
  EXPECT_TRUE(LiesIn("new.map", "."));
  EXPECT_TRUE(LiesIn("new/a.map", here));
  EXPECT_FALSE(LiesIn("../new.map", here));
  EXPECT_EQ(TruePath("new/../a"), here / "a");
  fs::current_path(before);
}

TEST(Folders, AWayLeadsThroughNoLinkAndNoFile) {
  const TempFolder folder;
  fs::create_directories(folder / "out/a/b");
  fs::create_directories(folder / "elsewhere");
  ASSERT_TRUE(WriteFile(folder / "out/file", "").has_value());
  fs::create_directory_symlink(folder / "elsewhere", folder / "out/a/link");
  fs::create_symlink("nowhere", folder / "out/dangling");
  fs::create_directory_symlink(folder / "out", folder / "typed");
  for (const char* place : {"new", "a/b/new", "not/there/new", "a/link", "file", "dangling"}) {
    EXPECT_TRUE(CheckWay(folder / "out", place).has_value()) << place;
    EXPECT_TRUE(CheckWay(folder / "typed", place).has_value()) << place;
  }
  const auto refused = [&](const std::string& way, const std::string& kind) {
    for (const char* below : {"/new", "/new/er"}) {
      const auto checked = CheckWay(folder / "out", way + below);
      ASSERT_FALSE(checked.has_value()) << way;
      EXPECT_EQ(checked.error().kind, ErrorKind::kUsage);
      EXPECT_EQ(checked.error().message, (folder / "out" / way).string() + ": is a " + kind +
                                             ", expected a folder or nothing");
      EXPECT_TRUE(CheckWay(folder / "out", way + below, {way}).has_value()) << way;
    }
  };
  refused("a/link", "link");
  refused("dangling", "link");
  refused("file", "file");
}

TEST(Folders, AWorkingFolderThatIsGoneIsNoException) {
  const TempFolder folder;
  const fs::path before = fs::current_path();
  fs::create_directories(folder / "gone");
  fs::current_path(folder / "gone");
  fs::remove(folder / "gone");
  EXPECT_EQ(AbsolutePath("x/y"), "x/y");
  EXPECT_EQ(OwnName("x"), "x");
  fs::current_path(before);
}

}  // namespace
}  // namespace tsdfpp
