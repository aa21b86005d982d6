// A run is one thing, at whatever change of its folder it is killed or the disk is full.
#include "eval/run/run_folder.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/files.h"
#include "tests/core/temp_folder.h"
#include "tests/kill/shimmed.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::ContentOf;
using test::Ending;
using test::RunShimmed;
using test::TempFolder;
using Content = std::map<std::string, std::string>;

constexpr int kEnvironmentCode = 3;

std::vector<std::string> Words(const fs::path& out, std::vector<std::string> files) {
  files.insert(files.begin(), {TSDFPP_WRITE_RUN, out.string()});
  return files;
}
// Two runs that leave some of the same files and some of their own; a folder of the one is a file
// of the other.
std::vector<std::string> First(const fs::path& out) {
  return Words(out, {"mesh/a.ply", "mesh/both.ply", "place", "deep/er/only.txt", "first"});
}
std::vector<std::string> Second(const fs::path& out) {
  return Words(out, {"mesh/b.ply", "mesh/both.ply", "place/inside.txt", "table.txt", "second"});
}

// What a run left, but for its name.
Content Named(const fs::path& folder) {
  Content content = ContentOf(folder);
  content.erase("run.json");
  if (content.contains("summary.json")) content["summary.json"] = "a summary";
  return content;
}

std::set<std::string> NamesOf(const Content& content) {
  std::set<std::string> names;
  for (const auto& [name, bytes] : content) names.insert(name);
  return names;
}

// Whether readers take the folder.
Expected<void> Check(const fs::path& folder) {
  const auto text = ReadFile(folder / "summary.json");
  const auto summary = nlohmann::json::parse(text.value_or(""), nullptr, false);
  std::set<std::string> files = NamesOf(ContentOf(folder));
  for (const char* other : {"run.json", "letter.txt", ".tsdfpp-moving"}) files.erase(other);
  std::erase_if(files, [](const std::string& name) {
    return name.starts_with(".tsdfpp-run/") || name == ".tsdfpp-run";
  });
  return CheckOneRun(folder, RunOfSummary(summary), files);
}

class RunFolderFaults : public testing::Test {
 protected:
  // The folder after the first run, with something of somebody else's in it.
  fs::path Begun(const std::string& name) {
    fs::path out = folder_ / name;
    fs::remove_all(out);
    EXPECT_EQ(RunShimmed(First(out), {out}, folder_.path()).exit_code, 0);
    EXPECT_TRUE(WriteFile(out / "mesh/letter.txt", "kept").has_value());
    fs::rename(out / "mesh/letter.txt", out / "letter.txt");
    return out;
  }
  // The second run is struck at each of its changes; readers must find the first run, the second or
  // a sentence, and the same command again must leave what it leaves undisturbed.
  void StrikeEverywhere(const std::string& how) {
    const fs::path first = Begun("first");
    const fs::path whole = Begun("whole");
    ASSERT_EQ(RunShimmed(Second(whole), {whole}, folder_.path()).exit_code, 0);
    const int changes = test::Changes(folder_.path());
    ASSERT_GT(changes, 30);
    ASSERT_TRUE(Check(whole).has_value()) << Check(whole).error().message;
    int before = 0;
    int refused = 0;
    int after = 0;
    for (int k = 1; k <= changes; ++k) {
      SCOPED_TRACE(k);
      const fs::path out = Begun("out");
      const Ending ending = RunShimmed(Second(out), {out, k, how}, folder_.path());
      if (how == "kill") {
        EXPECT_EQ(ending.signal, SIGKILL);
      } else if (ending.exit_code != 0) {
        EXPECT_EQ(ending.exit_code, kEnvironmentCode) << ending.err;
        EXPECT_NE(ending.err.find(out.string()), std::string::npos) << ending.err;
      }
      Content left = Named(out);
      std::erase_if(left, [](const auto& file) { return file.first.starts_with(".tsdfpp-"); });
      const auto checked = Check(out);
      if (checked) {
        EXPECT_TRUE(left == Named(first) || left == Named(whole));
        (left == Named(first) ? before : after)++;
        if (ending.exit_code == 0) {
          EXPECT_EQ(left, Named(whole));
        }
      } else {
        ++refused;
        EXPECT_EQ(checked.error().kind, ErrorKind::kData);
        EXPECT_NE(checked.error().message.find("interrupted run"), std::string::npos);
        EXPECT_NE(checked.error().message.find("run the command again"), std::string::npos);
      }
      ASSERT_EQ(RunShimmed(Second(out), {out}, folder_.path()).exit_code, 0);
      EXPECT_EQ(Named(out), Named(whole));
      EXPECT_TRUE(Check(out).has_value());
    }
    EXPECT_GT(before, 0);
    EXPECT_GT(refused, 0);
    EXPECT_GT(after, 0);
  }

  TempFolder folder_;
};

TEST_F(RunFolderFaults, KilledAnywhere) { StrikeEverywhere("kill"); }
TEST_F(RunFolderFaults, AFullDiskAnywhere) { StrikeEverywhere("ENOSPC"); }
TEST_F(RunFolderFaults, ADiskThatTurnsReadOnlyAnywhere) { StrikeEverywhere("EROFS"); }

// A folder of an older version has no run.json; a run over it that is killed must show.
TEST_F(RunFolderFaults, KilledOverAnOlderVersionsResult) {
  const auto older = [&](const fs::path& out) {
    fs::remove_all(out);
    ASSERT_TRUE(WriteFile(out / "summary.json", "{}").has_value());
    ASSERT_TRUE(WriteFile(out / "mesh/both.ply", "old").has_value());
  };
  const fs::path out = folder_ / "out";
  older(out);
  ASSERT_EQ(RunShimmed(Second(out), {out}, folder_.path()).exit_code, 0);
  const int changes = test::Changes(folder_.path());
  for (int k = 1; k <= changes; ++k) {
    SCOPED_TRACE(k);
    older(out);
    EXPECT_EQ(RunShimmed(Second(out), {out, k}, folder_.path()).signal, SIGKILL);
    const bool old_mesh = ReadFile(out / "mesh/both.ply") == "old";
    const bool old_summary = ReadFile(out / "summary.json") == "{}";
    const auto text = ReadFile(out / "summary.json");
    const auto summary = nlohmann::json::parse(text.value_or(""), nullptr, false);
    if (CheckOneRun(out, RunOfSummary(summary), {"mesh/both.ply"})) {
      EXPECT_EQ(old_mesh, old_summary);
    }
  }
}

TEST(RunFolder, OneProcessAtATime) {
  const TempFolder folder;
  const fs::path out = folder / "out";
  {
    auto run = RunFolder::Begin(out, "the first");
    ASSERT_TRUE(run.has_value());
    ASSERT_TRUE(WriteFile(run->path() / "file", "half").has_value());
    const Ending second = RunShimmed(Second(out), {out}, folder.path());
    EXPECT_EQ(second.exit_code, kEnvironmentCode);
    EXPECT_NE(second.err.find("another process is working in this folder"), std::string::npos)
        << second.err;
    EXPECT_EQ(test::Changes(folder.path()), 0);
    EXPECT_TRUE(fs::exists(run->path() / "file"));
  }
  // One that fails leaves nothing.
  EXPECT_EQ(ContentOf(out), Content{});
  EXPECT_EQ(RunShimmed(Second(out), {out}, folder.path()).exit_code, 0);
}

TEST(RunFolder, TheNoteListsWhatThereIs) {
  const TempFolder folder;
  const fs::path out = folder / "out";
  auto run = RunFolder::Begin(out, "a command \xff");
  ASSERT_TRUE(run.has_value());
  ASSERT_TRUE(WriteFile(run->path() / "deep/file", "12345").has_value());
  ASSERT_TRUE(WriteFile(run->path() / "page", "123").has_value());
  ASSERT_TRUE(run->Commit({"page"}).has_value());
  const auto note = ReadRunNote(out);
  ASSERT_TRUE(note.has_value()) << note.error().message;
  ASSERT_TRUE(note->has_value());
  EXPECT_EQ((*note)->run, run->id());
  EXPECT_EQ((*note)->run.size(), 16U);
  EXPECT_EQ((*note)->command, "a command \\xff");
  const std::map<std::string, std::optional<std::uintmax_t>> files{{"deep/file", 5},
                                                                   {"page", std::nullopt}};
  EXPECT_EQ((*note)->files, files);
  // The page may change, the file may not.
  ASSERT_TRUE(WriteFile(out / "page", "another").has_value());
  EXPECT_TRUE(CheckOneRun(out, run->id(), {"deep/file", "page"}).has_value());
  ASSERT_TRUE(WriteFile(out / "deep/file", "1234").has_value());
  const auto cut = CheckOneRun(out, run->id(), {"deep/file"});
  ASSERT_FALSE(cut.has_value());
  EXPECT_NE(cut.error().message.find("deep/file has 4 bytes, expected 5"), std::string::npos)
      << cut.error().message;
  fs::remove(out / "deep/file");
  EXPECT_FALSE(CheckOneRun(out, run->id(), {"deep/file"}).has_value());
  // A file that the run knows nothing of is not taken for its own.
  ASSERT_TRUE(WriteFile(out / "record", "foreign").has_value());
  EXPECT_FALSE(CheckOneRun(out, run->id(), {"record"}).has_value());
  EXPECT_TRUE(CheckOneRun(out, run->id(), {"nothing"}).has_value());
  EXPECT_FALSE(CheckOneRun(out, "0123456789abcdef", {}).has_value());
  EXPECT_FALSE(CheckOneRun(out, std::nullopt, {}).has_value());
}

// A note is data: it must not lead anywhere else.
TEST(RunFolder, ANoteCannotRemoveWhatIsElsewhere) {
  const TempFolder folder;
  const fs::path out = folder / "out";
  ASSERT_TRUE(WriteFile(folder / "kept", "kept").has_value());
  ASSERT_TRUE(WriteFile(folder / "aside/kept", "kept").has_value());
  ASSERT_TRUE(WriteFile(out / "sub/file", "old").has_value());
  fs::create_directory_symlink(folder / "aside", out / "link");
  const auto note = [](const std::string& name) {
    return nlohmann::json{
        {"schema", 1}, {"command", "c"}, {"run", "r"}, {"files", {{{"name", name}, {"bytes", 4}}}}}
        .dump();
  };
  const auto rerun = [&] {
    auto run = RunFolder::Begin(out, "c");
    ASSERT_TRUE(run.has_value());
    ASSERT_TRUE(WriteFile(run->path() / "new", "new").has_value());
    const auto done = run->Commit();
    ASSERT_TRUE(done.has_value()) << done.error().message;
  };
  for (const std::string& name :
       {std::string("../kept"), (folder / "kept").string(), std::string("sub/../../kept"),
        std::string("link/kept"), std::string(""), std::string(".")}) {
    for (const char* place : {"run.json", ".tsdfpp-moving"}) {
      ASSERT_TRUE(WriteFile(out / place, note(name)).has_value());
      rerun();
      EXPECT_EQ(ReadFile(folder / "kept"), "kept") << name;
      EXPECT_EQ(ReadFile(folder / "aside/kept"), "kept") << name;
    }
  }
  for (const std::string& text :
       {std::string("[1"), std::string("7"), std::string("{}"), note("a").substr(0, 20)}) {
    ASSERT_TRUE(WriteFile(out / "run.json", text).has_value());
    EXPECT_FALSE(ReadRunNote(out).has_value()) << text;
    rerun();
  }
  EXPECT_EQ(ReadFile(out / "sub/file"), "old");
  ASSERT_TRUE(WriteFile(out / "run.json", note("sub/file")).has_value());
  rerun();
  EXPECT_FALSE(fs::exists(out / "sub"));
}

// Then all is as it was.
TEST(RunFolder, WhatIsInTheWayIsNamed) {
  const TempFolder folder;
  const fs::path out = folder / "out";
  ASSERT_TRUE(WriteFile(out / "mesh", "mine").has_value());
  ASSERT_TRUE(WriteFile(out / "page/mine", "mine").has_value());
  fs::create_directory(folder / "far");
  fs::create_directory_symlink(folder / "far", out / "linked");
  const Content before = ContentOf(out);
  for (const auto& [file, words] :
       {std::pair{"mesh/a.ply", "mesh: is a file, expected a folder"},
        std::pair{"linked/a.ply", "linked: is a link, expected a folder"},
        std::pair{"page", "page: is a folder with files in it, expected a file"},
        std::pair{"b\xff", "has a name that cannot be printed"}}) {
    auto run = RunFolder::Begin(out, "c");
    ASSERT_TRUE(run.has_value());
    const auto asked = run->CheckPlaces({file});
    EXPECT_EQ(asked.has_value(), file[0] == 'b');  // a name of its own is no place
    if (!asked) {
      EXPECT_NE(asked.error().message.find(words), std::string::npos) << words;
    }
    ASSERT_TRUE(WriteFile(run->path() / file, "new").has_value());
    const auto done = run->Commit();
    ASSERT_FALSE(done.has_value()) << file;
    EXPECT_NE(done.error().message.find(words), std::string::npos) << done.error().message;
  }
  EXPECT_EQ(ContentOf(out), before);
}

// A rename would fail on them when the earlier result is gone already.
TEST(RunFolder, FoldersWithoutFilesMakePlace) {
  const TempFolder folder;
  const fs::path out = folder / "out";
  for (const char* text : {"first", "second"}) {
    fs::create_directories(out / "000002.png/a/b");
    fs::create_directories(out / "run.json.d");
    auto run = RunFolder::Begin(out, "c");
    ASSERT_TRUE(run.has_value());
    ASSERT_TRUE(WriteFile(run->path() / "000001.png", text).has_value());
    ASSERT_TRUE(WriteFile(run->path() / "000002.png", text).has_value());
    const auto done = run->Commit();
    ASSERT_TRUE(done.has_value()) << done.error().message;
    EXPECT_EQ(ReadFile(out / "000002.png").value(), text);
    EXPECT_TRUE(fs::is_directory(out / "run.json.d"));
    fs::remove(out / "000002.png");
  }
}

// A pipe or a device would be replaced by a file. Files that no run wrote stay where somebody asks;
// those of an earlier run give way.
TEST(RunFolder, WhatIsNoFileOrOfNobodyStays) {
  const TempFolder folder;
  const fs::path out = folder / "out";
  fs::create_directories(out);
  ASSERT_EQ(mkfifo((out / "pipe").c_str(), 0600), 0);
  ASSERT_TRUE(WriteFile(out / "1.png", "theirs").has_value());
  auto run = RunFolder::Begin(out, "c");
  ASSERT_TRUE(run.has_value());
  const auto pipe = run->CheckPlaces({"pipe"});
  ASSERT_FALSE(pipe.has_value());
  EXPECT_NE(pipe.error().message.find("pipe: is no regular file"), std::string::npos);
  const auto theirs = run->CheckPlaces({"1.png", "2.png"});
  ASSERT_FALSE(theirs.has_value());
  EXPECT_NE(theirs.error().message.find("1.png: is of no earlier run"), std::string::npos)
      << theirs.error().message;
  ASSERT_TRUE(WriteFile(run->path() / "2.png", "ours").has_value());
  ASSERT_TRUE(run->Commit().has_value());
  EXPECT_TRUE(run->CheckPlaces({"2.png"}).has_value());
}

}  // namespace
}  // namespace tsdfpp
