#include "core/files.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using test::TempFolder;

TEST(Files, ReadsWhatWasWritten) {
  const TempFolder folder;
  // Longer than any buffer, with every byte value.
  std::string bytes;
  for (int i = 0; i < 300000; ++i) bytes.push_back(static_cast<char>(i * 7 % 256));
  ASSERT_TRUE(WriteFile(folder / "a/b/c.bin", bytes).has_value());
  EXPECT_EQ(ReadFile(folder / "a/b/c.bin").value(), bytes);
}

TEST(Files, EmptyFileIsReadable) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "empty", "").has_value());
  const auto bytes = ReadFile(folder / "empty");
  ASSERT_TRUE(bytes.has_value()) << bytes.error().message;
  EXPECT_EQ(*bytes, "");
}

TEST(Files, WriteReplacesAndLeavesNothingBeside) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "x", "a long first version").has_value());
  ASSERT_TRUE(WriteFile(folder / "x", "short").has_value());
  EXPECT_EQ(ReadFile(folder / "x").value(), "short");
  EXPECT_EQ(folder.Entries(), 1);
}

TEST(Files, FailedWriteLeavesTheOldAndNothingBeside) {
  const TempFolder folder;
  // A folder that is not empty cannot be replaced by a file.
  ASSERT_TRUE(WriteFile(folder / "taken/inside", "kept").has_value());
  const auto result = WriteFile(folder / "taken", "new");
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kEnvironment);
  EXPECT_EQ(result.error().message,
            (folder / "taken").string() + ": is a folder, expected a regular file or nothing");
  EXPECT_EQ(ReadFile(folder / "taken/inside").value(), "kept");
  EXPECT_EQ(folder.Entries(), 1);
}

// What a process was writing when it was killed.
TEST(Files, WhatAKilledWriterLeftIsWrittenOver) {
  const TempFolder folder;
  std::ofstream(folder / ".x.writing.part") << "a longer half of a file";
  ASSERT_TRUE(WriteFile(folder / "x", "whole").has_value());
  EXPECT_EQ(ReadFile(folder / "x").value(), "whole");
  EXPECT_EQ(folder.Entries(), 1);
}

TEST(Files, SeveralWritersOfOneFileDoNotMeet) {
  const TempFolder folder;
  constexpr std::size_t kBytes = 200000;
  constexpr int kWrites = 40;
  std::vector<std::thread> writers;
  std::atomic<int> failed{0};
  for (const char letter : {'a', 'b', 'c'}) {
    writers.emplace_back([&, letter] {
      for (int i = 0; i < kWrites; ++i) {
        failed += WriteFile(folder / "x", std::string(kBytes, letter)).has_value() ? 0 : 1;
      }
    });
  }
  std::atomic<bool> stop{false};
  int mixed = 0;
  std::thread reader([&] {
    while (!stop) {
      const auto bytes = ReadFile(folder / "x");
      mixed +=
          bytes && *bytes != std::string(kBytes, bytes->empty() ? ' ' : bytes->front()) ? 1 : 0;
    }
  });
  for (std::thread& writer : writers) writer.join();
  stop = true;
  reader.join();
  EXPECT_EQ(failed, 0);
  EXPECT_EQ(mixed, 0);
  EXPECT_EQ(folder.Entries(), 1);
}

// Of the name that is taken while a file is written somebody else's things may be.
TEST(Files, NothingElseIsWrittenInto) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "other", "kept").has_value());
  std::filesystem::create_symlink(folder / "other", folder / ".x.writing.part");
  std::filesystem::create_hard_link(folder / "other", folder / ".y.writing.part");
  ASSERT_EQ(mkfifo((folder / ".z.writing.part").c_str(), 0600), 0);
  for (const char* name : {"x", "y", "z"}) {
    ASSERT_TRUE(WriteFile(folder / name, "bytes").has_value());
    EXPECT_EQ(ReadFile(folder / name).value(), "bytes");
  }
  EXPECT_EQ(ReadFile(folder / "other").value(), "kept");
  EXPECT_EQ(folder.Entries(), 7);
}

// A device or a pipe is nobody's old result.
TEST(Files, OnlyRegularFilesAreReplaced) {
  const TempFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  std::filesystem::create_symlink(folder / "pipe", folder / "link");
  std::filesystem::create_directory(folder / "folder");
  for (const auto& [name, kind] : {std::pair{"pipe", "a pipe"}, std::pair{"link", "a pipe"},
                                   std::pair{"folder", "a folder"}}) {
    const auto written = WriteFile(folder / name, "bytes");
    ASSERT_FALSE(written.has_value()) << name;
    EXPECT_EQ(written.error().kind, ErrorKind::kEnvironment);
    EXPECT_EQ(written.error().message, fmt::format("{}: is {}, expected a regular file or nothing",
                                                   (folder / name).string(), kind));
  }
  EXPECT_TRUE(std::filesystem::is_fifo(folder / "pipe"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(folder.Entries(), 3);
}

TEST(Files, MissingFileAndFolderAreNamed) {
  const TempFolder folder;
  const auto missing = ReadFile(folder / "none");
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().kind, ErrorKind::kData);
  EXPECT_EQ(missing.error().message, (folder / "none").string() + ": no such file");
  const auto is_folder = ReadFile(folder.path());
  ASSERT_FALSE(is_folder.has_value());
  EXPECT_EQ(is_folder.error().message, folder.path().string() + ": is a folder, not a file");
}

TEST(Files, OnlyRegularFilesAreRead) {
  const TempFolder folder;
  // Opened, it would wait for somebody to write.
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  const auto pipe = ReadFile(folder / "pipe");
  ASSERT_FALSE(pipe.has_value());
  EXPECT_EQ(pipe.error().kind, ErrorKind::kData);
  EXPECT_EQ(pipe.error().message,
            (folder / "pipe").string() + ": is a pipe, expected a regular file");
  const auto zero = ReadFile("/dev/zero");
  ASSERT_FALSE(zero.has_value());
  EXPECT_EQ(zero.error().message, "/dev/zero: is a device, expected a regular file");
  EXPECT_FALSE(CheckRegularFile("/dev/null").has_value());
  EXPECT_FALSE(CheckRegularFile(folder.path()).has_value());
  // A file that says it is empty and is not.
  EXPECT_FALSE(ReadFile("/proc/self/status").value().empty());
}

TEST(Files, TheLimitIsLookedAtBeforeTheBytes) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "x", "12345").has_value());
  Limits limits;
  limits.json_bytes = 4;
  SetLimits(limits);
  EXPECT_TRUE(ReadFile(folder / "x").has_value());
  const auto large = ReadFile(folder / "x", &Limits::json_bytes);
  limits.json_bytes = 5;
  SetLimits(limits);
  EXPECT_TRUE(ReadFile(folder / "x", &Limits::json_bytes).has_value());
  SetLimits({});
  ASSERT_FALSE(large.has_value());
  EXPECT_EQ(large.error().message,
            (folder / "x").string() +
                ": 5 bytes, over the limit of 4 (TSDFPP_LIMITS=json_bytes=... raises it)");
  // A terabyte that is not on the disk.
  std::filesystem::resize_file(folder / "x", std::uintmax_t{1} << 40U);
  EXPECT_FALSE(ReadFile(folder / "x").has_value());
}

TEST(Files, NamesUpToTheSystemsLengthAndInAnyBytes) {
  const TempFolder folder;
  for (const std::string& name :
       {std::string(255, 'n'), std::string("\xff\xfe\n"), std::string(201, '\xe9')}) {
    ASSERT_TRUE(WriteFile(folder / name, "bytes").has_value());
    EXPECT_EQ(ReadFile(folder / name).value(), "bytes");
  }
  EXPECT_EQ(folder.Entries(), 3);
  const std::string longer(256, 'n');
  const auto read = ReadFile(folder / longer);
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().message,
            (folder / longer).string() + ": cannot be read (File name too long)");
  const auto write = WriteFile(folder / longer, "bytes");
  ASSERT_FALSE(write.has_value());
  EXPECT_EQ(write.error().kind, ErrorKind::kEnvironment);
  EXPECT_EQ(folder.Entries(), 3);
}

TEST(Files, UnwritablePlaceIsTheEnvironmentsFault) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "file", "").has_value());
  // Nobody, not even root, can make a folder below a file.
  const auto write = WriteFile(folder / "file/sub/x", "");
  ASSERT_FALSE(write.has_value());
  EXPECT_EQ(write.error().kind, ErrorKind::kEnvironment);
  EXPECT_NE(write.error().message.find("file/sub: the folder cannot be made ("), std::string::npos)
      << write.error().message;
  const auto make = MakeWritableFolder(folder / "file/sub");
  ASSERT_FALSE(make.has_value());
  EXPECT_EQ(make.error().kind, ErrorKind::kEnvironment);
  // /proc can be entered but not written to.
  const auto probe = MakeWritableFolder("/proc");
  ASSERT_FALSE(probe.has_value());
  EXPECT_EQ(probe.error().message, "/proc: the folder cannot be written to");
}

TEST(Files, WritableFolderIsMadeAndLeftEmpty) {
  const TempFolder folder;
  ASSERT_TRUE(MakeWritableFolder(folder / "p/q").has_value());
  EXPECT_TRUE(std::filesystem::is_empty(folder / "p/q"));
}

}  // namespace
}  // namespace tsdfpp
