// The hidden folder in which a sequence grows: whose it is, and what is left of it.
#include "sequence/staging_folder.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "core/files.h"
#include "sequence/export.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::TempFolder;
using Kind = StagingFolder::Kind;

// The number of a process that has ended.
pid_t DeadProcess() {
  const pid_t process = fork();
  if (process == 0) _exit(0);
  waitpid(process, nullptr, 0);
  return process;
}

std::vector<std::string> Hidden(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(".")) names.push_back(name);
  }
  return names;
}

TEST(StagingFolder, WhatKilledProcessesLeftGoes) {
  const TempFolder folder;
  const pid_t dead = DeadProcess();
  const auto make = [&](const std::string& name) {
    EXPECT_TRUE(WriteFile(folder / name / "colour/1.png", "half").has_value());
    return folder / name;
  };
  const fs::path abandoned = make(fmt::format(".out.{}.part", dead));
  const fs::path living = make(fmt::format(".out.{}.part", getppid()));
  const fs::path others = make(fmt::format(".other.{}.part", dead));
  const fs::path unnumbered = make(".out.mine.part");
  const fs::path moved_aside = make(fmt::format(".out.{}.old", dead));
  {
    StagingFolder staging(folder / "out");
    ASSERT_TRUE(staging.Make().has_value());
    EXPECT_FALSE(fs::exists(abandoned));
    for (const fs::path& kept : {living, others, unnumbered, moved_aside, staging.path()}) {
      EXPECT_TRUE(fs::exists(kept)) << kept;
    }
    ASSERT_TRUE(staging.TakeThePlace().has_value());
  }
  // An earlier sequence that was moved aside goes once another is in its place.
  StagingFolder again(folder / "out");
  ASSERT_TRUE(again.Make().has_value());
  EXPECT_FALSE(fs::exists(moved_aside));
}

// A process of another machine or container has a number that says nothing here.
TEST(StagingFolder, ALockedFolderIsNotAbandoned) {
  const TempFolder folder;
  const fs::path used = folder / fmt::format(".out.{}.part", DeadProcess());
  fs::create_directories(used);
  const int descriptor = open(used.c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(flock(descriptor, LOCK_EX), 0);
  ASSERT_TRUE(StagingFolder(folder / "out").Make().has_value());
  EXPECT_TRUE(fs::exists(used));
  close(descriptor);
  ASSERT_TRUE(StagingFolder(folder / "out").Make().has_value());
  EXPECT_FALSE(fs::exists(used));
}

TEST(StagingFolder, ASharedOneIsForOneProcessAtATime) {
  const TempFolder folder;
  {
    StagingFolder first(folder / "out", Kind::kShared);
    ASSERT_TRUE(first.Make().has_value());
    // Also where its folder has another name by now.
    fs::rename(folder / ".out.part", folder / "elsewhere");
    StagingFolder second(folder / "out", Kind::kShared);
    const auto made = second.Make();
    ASSERT_FALSE(made.has_value());
    EXPECT_EQ(made.error().kind, ErrorKind::kEnvironment);
    EXPECT_EQ(made.error().message,
              (folder / "out").string() + ": another process is making this sequence");
  }
  EXPECT_EQ(Hidden(folder.path()), std::vector<std::string>{});
  EXPECT_TRUE(StagingFolder(folder / "out", Kind::kShared).Make().has_value());
  EXPECT_EQ(Hidden(folder.path()), std::vector<std::string>{});
}

// Who waited must not end up with a lock on a file that is gone.
TEST(StagingFolder, TheLockPassesOn) {
  const TempFolder folder;
  auto first = std::make_unique<StagingFolder>(folder / "out", Kind::kShared);
  ASSERT_TRUE(first->Make().has_value());
  StagingFolder second(folder / "out", Kind::kShared);
  std::atomic<bool> made{false};
  std::thread waiting([&] { made = second.Make().has_value(); });
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_FALSE(made);
  ASSERT_TRUE(first->TakeThePlace().has_value());
  first.reset();
  waiting.join();
  ASSERT_TRUE(made);
  EXPECT_TRUE(fs::exists(second.path()));
  StagingFolder third(folder / "out", Kind::kShared);
  EXPECT_FALSE(third.Make().has_value());
  EXPECT_TRUE(fs::exists(second.path()));
}

// At no moment is there no sequence, and the earlier one leaves nothing.
TEST(StagingFolder, TheEarlierOneIsReplacedInOneStroke) {
  for (const Kind kind : {Kind::kOwn, Kind::kShared}) {
    const TempFolder folder;
    const fs::path out = folder / "out";
    ASSERT_TRUE(WriteFile(out / "file", "old").has_value());
    ASSERT_TRUE(WriteFile(out / "older", "old").has_value());
    std::atomic<bool> stop{false};
    std::atomic<bool> missed{false};
    std::thread looking([&] {
      while (!stop) missed = missed || access((out / "file").c_str(), F_OK) != 0;
    });
    for (int i = 0; i < 50; ++i) {
      StagingFolder staging(out, kind);
      ASSERT_TRUE(staging.Make().has_value());
      ASSERT_TRUE(WriteFile(staging.path() / "file", "new").has_value());
      if (kind == Kind::kShared) {
        ASSERT_TRUE(WriteFile(staging.notes() / "1.json", "noted").has_value());
      }
      ASSERT_TRUE(staging.TakeThePlace().has_value());
    }
    stop = true;
    looking.join();
    EXPECT_FALSE(missed);
    EXPECT_EQ(ReadFile(out / "file"), "new");
    EXPECT_FALSE(fs::exists(out / "older"));
    EXPECT_EQ(Hidden(folder.path()), std::vector<std::string>{});
  }
}

TEST(StagingFolder, ALinkStaysAndWhereItLeadsIsReplaced) {
  for (const Kind kind : {Kind::kOwn, Kind::kShared}) {
    const TempFolder folder;
    fs::create_directories(folder / "elsewhere/real");
    fs::create_directory_symlink(folder / "elsewhere/real", folder / "out");
    ASSERT_TRUE(CheckReplaceable(folder / "out", false).has_value());
    {
      StagingFolder staging(folder / "out", kind);
      ASSERT_TRUE(staging.Make().has_value());
      ASSERT_TRUE(WriteFile(staging.path() / "file", "new").has_value());
      ASSERT_TRUE(staging.TakeThePlace().has_value());
    }
    EXPECT_TRUE(fs::is_symlink(folder / "out"));
    EXPECT_EQ(ReadFile(folder / "elsewhere/real/file"), "new");
    EXPECT_EQ(Hidden(folder.path()), std::vector<std::string>{});
    EXPECT_EQ(Hidden(folder / "elsewhere"), std::vector<std::string>{});
    // What stands there is what the link leads to.
    EXPECT_FALSE(CheckReplaceable(folder / "out", true).has_value());
    fs::remove_all(folder / "elsewhere/real");
    const auto nowhere = CheckReplaceable(folder / "out", true);
    ASSERT_FALSE(nowhere.has_value());
    EXPECT_NE(nowhere.error().message.find("is a link that leads nowhere"), std::string::npos)
        << nowhere.error().message;
  }
}

TEST(StagingFolder, TheWorkingFolderIsNotReplaced) {
  const TempFolder folder;
  fs::create_directories(folder / "out");
  fs::create_directories(folder / "other");
  const fs::path before = fs::current_path();
  fs::current_path(folder / "out");
  for (const fs::path& path : {fs::path("."), folder / "out", fs::path("../out/")}) {
    const auto refused = CheckReplaceable(path, true);
    ASSERT_FALSE(refused.has_value()) << path;
    EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
    EXPECT_NE(refused.error().message.find("is or holds the working folder"), std::string::npos)
        << refused.error().message;
  }
  EXPECT_TRUE(CheckReplaceable("../other", false).has_value());
  EXPECT_TRUE(CheckReplaceable("new", false).has_value());
  fs::current_path(before);
}

TEST(StagingFolder, AStoppedExportLeavesNothing) {
  const TempFolder folder;
  test::BoxSource source(5);
  std::atomic<bool> stop{false};
  const auto report = ExportSequence(
      source, DatasetFormat::kTum, folder / "out", [&](int done, int) { stop = done == 2; }, &stop);
  ASSERT_FALSE(report.has_value());
  EXPECT_EQ(report.error().kind, ErrorKind::kEnvironment);
  EXPECT_EQ(report.error().message,
            (folder / "out").string() + ": stopped after 2 of 5 frames; nothing is kept");
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

// What came to stand there while it was made is kept.
TEST(StagingFolder, AnExportReplacesNothing) {
  const TempFolder folder;
  test::BoxSource source(3);
  const auto report =
      ExportSequence(source, DatasetFormat::kTum, folder / "out", [&](int done, int) {
        if (done == 2) {
          ASSERT_TRUE(WriteFile(folder / "out/letter.txt", "kept").has_value());
        }
      });
  ASSERT_FALSE(report.has_value());
  EXPECT_EQ(report.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(ReadFile(folder / "out/letter.txt"), "kept");
}

}  // namespace
}  // namespace tsdfpp
