#include "core/data_folder.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::TempFolder;

// "set/" with a file, and one beside it that data has no business with.
class DataFolders : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteFile(folder_ / "set/a/in.txt", "inside").has_value());
    ASSERT_TRUE(WriteFile(folder_ / "secret/out.txt", "outside").has_value());
    ASSERT_TRUE(WriteFile(folder_ / "set2/out.txt", "outside").has_value());
  }
  void TearDown() override { SetLinkPolicy(LinkPolicy::kInside); }
  // What reading says, or the bytes.
  std::string Read(const std::string& relative) const {
    const auto bytes = DataFolder(folder_ / "set").Read(relative);
    if (bytes) return *bytes;
    EXPECT_EQ(bytes.error().kind, ErrorKind::kData);
    return bytes.error().message;
  }
  const TempFolder folder_;
};

TEST_F(DataFolders, PathsInsideAreRead) {
  for (const char* path : {"a/in.txt", "./a/in.txt", "a//in.txt", "a/./in.txt"}) {
    EXPECT_EQ(Read(path), "inside") << path;
  }
  EXPECT_EQ(Read("a/none.txt"), (folder_ / "set/a/none.txt").string() + ": no such file");
}

TEST_F(DataFolders, PathsThatLeaveAreRefused) {
  for (const auto& [path, fault] : {std::pair(std::string("../secret/out.txt"), "holds '..'"),
                                    {"a/../a/in.txt", "holds '..'"},
                                    {"a/..", "holds '..'"},
                                    {"..", "holds '..'"},
                                    {(folder_ / "set/a/in.txt").string(), "is absolute"},
                                    {"/dev/zero", "is absolute"},
                                    {"", "is empty"},
                                    {"a\nb", "holds a control character"},
                                    {std::string("a\0b", 3), "holds a control character"},
                                    {std::string(5000, 'x'), "is longer than 4096 bytes"}}) {
    const std::string said = Read(path);
    EXPECT_NE(said.find(fault), std::string::npos) << said;
    EXPECT_LT(said.size(), 500U);
  }
}

TEST_F(DataFolders, LinksInsideAreFollowedAndOthersOnlyIfAsked) {
  const fs::path set = folder_ / "set";
  fs::create_symlink("a/in.txt", set / "relative");
  fs::create_symlink(set / "a/in.txt", set / "absolute");
  fs::create_symlink("a", set / "folder");
  fs::create_symlink("absolute", set / "twice");
  for (const char* link : {"relative", "absolute", "folder/in.txt", "twice"}) {
    EXPECT_EQ(Read(link), "inside") << link;
  }
  EXPECT_TRUE(CheckLinksBelow(set).has_value());
  fs::create_symlink("../secret/out.txt", set / "b");
  fs::create_symlink(folder_ / "secret", set / "a/c");
  // A folder whose name begins as the set's is another one.
  fs::create_symlink(folder_ / "set2/out.txt", set / "d");
  for (const char* link : {"b", "a/c/out.txt", "d"}) {
    EXPECT_NE(Read(link).find(": leads by a link to '"), std::string::npos) << Read(link);
  }
  const auto below = CheckLinksBelow(set);
  ASSERT_FALSE(below.has_value());
  EXPECT_TRUE(below.error().message.starts_with((set / "a/c").string() + ": leads by a link to"))
      << below.error().message;
  SetLinkPolicy(LinkPolicy::kAnywhere);
  for (const char* link : {"b", "a/c/out.txt", "d"}) EXPECT_EQ(Read(link), "outside") << link;
  EXPECT_TRUE(CheckLinksBelow(set).has_value());
}

TEST_F(DataFolders, ASetThatIsALinkItselfIsAFolderLikeAnother) {
  fs::create_symlink(folder_ / "set", folder_ / "link");
  EXPECT_EQ(DataFolder(folder_ / "link").Read("a/in.txt").value(), "inside");
  EXPECT_TRUE(CheckLinksBelow(folder_ / "link").has_value());
}

TEST_F(DataFolders, LinksThatLeadNowhereOrInACircleHaveASentence) {
  fs::create_symlink("none", folder_ / "set/dangling");
  fs::create_symlink("circle", folder_ / "set/circle");
  EXPECT_NE(Read("dangling").find("no such file"), std::string::npos) << Read("dangling");
  EXPECT_NE(Read("circle").find("cannot be read ("), std::string::npos) << Read("circle");
}

TEST_F(DataFolders, PipesAndDevicesAreNotOpened) {
  ASSERT_EQ(mkfifo((folder_ / "set/pipe").c_str(), 0600), 0);
  EXPECT_EQ(Read("pipe"), (folder_ / "set/pipe").string() + ": is a pipe, expected a regular file");
  SetLinkPolicy(LinkPolicy::kAnywhere);
  fs::create_symlink("/dev/zero", folder_ / "set/zero");
  EXPECT_EQ(Read("zero"),
            (folder_ / "set/zero").string() + ": is a device, expected a regular file");
}

}  // namespace
}  // namespace tsdfpp
