// The corpora, and the inputs that were finds once, through every target: nothing ends the process.
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <set>
#include <string>

#include "core/files.h"
#include "core/folders.h"
#include "core/limits.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/file_set.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> InputsIn(const char* kind, std::string_view target) {
  return EntriesOf(fs::path(TSDFPP_SOURCE_DIR) / "tests" / "fuzz" / kind / target);
}

class FuzzReplay : public testing::TestWithParam<std::string_view> {
 protected:
  void SetUp() override {
    before_ = CurrentLimits();
    level_ = spdlog::get_level();
    PrepareTargets();
  }
  void TearDown() override {
    SetLimits(before_);
    spdlog::set_level(level_);
  }

  // Says which input it is before that ends the process.
  static bool Read(const Target& target, const fs::path& file) {
    const auto bytes = ReadFile(file);
    EXPECT_TRUE(bytes.has_value()) << file;
    RecordProperty("input", file.filename().string());
    return bytes && target.read(*bytes);
  }

 private:
  Limits before_;
  spdlog::level::level_enum level_ = spdlog::level::info;
};

// Seeds whose names begin with "good" are sound: what is behind the checks is reached from them.
TEST_P(FuzzReplay, Corpus) {
  const Target& target = *FindTarget(GetParam());
  int good = 0;
  for (const fs::path& file : InputsIn("corpus", target.name)) {
    SCOPED_TRACE(file.filename());
    const bool accepted = Read(target, file);
    if (!file.filename().string().starts_with("good")) continue;
    EXPECT_TRUE(accepted) << "a sound input is refused; where what it should hold has changed, as "
                             "by a new metric, python3 tests/fuzz/make_seeds.py makes it anew";
    ++good;
  }
  EXPECT_GT(good, 0) << "no sound input for the fuzzer to begin with";
}

TEST_P(FuzzReplay, FormerFinds) {
  const Target& target = *FindTarget(GetParam());
  for (const fs::path& file : InputsIn("crashes", target.name)) {
    SCOPED_TRACE(file.filename());
    Read(target, file);
  }
}

std::vector<std::string_view> Names() {
  std::vector<std::string_view> names;
  for (const Target& target : AllTargets()) names.push_back(target.name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(Targets, FuzzReplay, testing::ValuesIn(Names()),
                         [](const auto& target) { return std::string(target.param); });

TEST(FuzzTargets, EveryCorpusAndEverySourceIsThere) {
  const fs::path root = TSDFPP_SOURCE_DIR;
  for (const Target& target : AllTargets()) {
    EXPECT_FALSE(target.sources.empty()) << target.name;
    for (const std::string_view source : target.sources) {
      EXPECT_TRUE(fs::is_regular_file(root / source)) << target.name << ": " << source;
    }
  }
#ifndef TSDFPP_FUZZ_MAPS
  for (const char* kind : {"corpus", "crashes"}) {
    for (const fs::path& folder : EntriesOf(root / "tests" / "fuzz" / kind)) {
      EXPECT_NE(FindTarget(folder.filename().string()), nullptr) << folder;
    }
  }
#endif
}

TEST(FuzzTargets, ThePageHasThemAll) {
  const fs::path root = TSDFPP_SOURCE_DIR;
  const std::string page = ReadFile(root / "docs" / "fuzzing.md").value();
  for (const Target& target : AllTargets()) {
    EXPECT_NE(page.find("`" + std::string(target.name) + "`"), std::string::npos) << target.name;
  }
}

TEST(FuzzTargets, EveryReaderOfASequenceIsFuzzed) {
  const fs::path root = TSDFPP_SOURCE_DIR;
  std::set<std::string> fuzzed;
  for (const Target& target : AllTargets()) {
    fuzzed.insert(target.sources.begin(), target.sources.end());
  }
  const std::string built = ReadFile(root / "tests" / "fuzz" / "readers.cmake").value();
  for (const fs::path& file : EntriesOf(root / "sequence")) {
    const std::string name = file.filename().string();
    if (!name.ends_with("_reader.cc")) continue;
    EXPECT_TRUE(fuzzed.contains("sequence/" + name))
        << name << " has no target in tests/fuzz/targets_sequences.cc";
    EXPECT_NE(built.find(" " + name), std::string::npos)
        << name << " is not in tests/fuzz/readers.cmake";
  }
}

TEST(FuzzComplaint, IsMadeOfWhatUsersMustNotSee) {
  EXPECT_EQ(FaultOf({ErrorKind::kData, "a.ply: is cut short"}, "a.ply"), std::nullopt);
  EXPECT_NE(FaultOf({ErrorKind::kInternal, "a.ply: what?"}, "a.ply"), std::nullopt);
  EXPECT_NE(FaultOf({ErrorKind::kData, ""}, ""), std::nullopt);
  EXPECT_NE(FaultOf({ErrorKind::kData, "is cut short"}, "a.ply"), std::nullopt);
  // Printed, it is shortened and its control characters are written out.
  EXPECT_EQ(FaultOf({ErrorKind::kData, "a.ply: \x01" + std::string(9000, 'x')}, "a.ply"),
            std::nullopt);
  EXPECT_DEATH(Require(false, "a plain fault"), "complaint: a plain fault");
}

TEST(FuzzFileSet, StaysInItsFolder) {
  const std::vector<Entry> entries{{EntryKind::kFile, "a/b c\n\xff.txt", std::string("1\n\0", 3)},
                                   {EntryKind::kLink, "l", "a"},
                                   {EntryKind::kPipe, "p", ""},
                                   {EntryKind::kFolder, "d/e", ""}};
  EXPECT_EQ(UnpackSet(PackSet(entries)), entries);
  const std::string good = PackSet(entries);
  EXPECT_EQ(UnpackSet("file ../x 1\nx\nfile /x 1\nx\nfile a/../../x 1\nx\n" + good), entries);
  EXPECT_EQ(UnpackSet(good + "no header"), entries);
  const fs::path& folder = WriteSet(good + "link out 2\n..\n" + "link out/tsdfpp-x 1\ny\n" +
                                    "file both/below 1\nx\n" + "link both 2\n..\n");
  EXPECT_TRUE(fs::is_symlink(folder / "l"));
  EXPECT_TRUE(fs::is_symlink(folder / "out"));
  EXPECT_FALSE(fs::is_symlink(folder / ".." / "tsdfpp-x"));
  EXPECT_FALSE(fs::is_symlink(folder / "both"));
  EXPECT_TRUE(fs::exists(folder / "both" / "below"));
  EXPECT_TRUE(fs::is_fifo(folder / "p"));
}

}  // namespace
}  // namespace tsdfpp::fuzz
