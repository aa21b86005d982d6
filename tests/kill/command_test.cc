// map, compare, replay and report --video, killed or on a full disk while they write.
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <set>

#include "core/files.h"
#include "eval/run/folder_lock.h"
#include "eval/run/run_folder.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"
#include "tests/kill/shimmed.h"
#include "tests/thorough.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::ContentOf;
using test::Ending;
using test::Fault;
using test::RunShimmed;
using test::TempFolder;
using Content = std::map<std::string, std::string>;

constexpr int kFrames = 4;

// Without what holds times or a run's name.
Content Lasting(const fs::path& folder) {
  Content content = ContentOf(folder);
  for (const char* file : {"run.json", "stats.json", "summary.json", "frames.csv", "report.html"}) {
    if (content.contains(file)) content[file] = "with times";
  }
  return content;
}

class KilledCommands : public testing::Test {
 protected:
  void SetUp() override {
    // On disk, so that nothing has to be rendered anew each time.
    ASSERT_TRUE(WriteFile(folder_ / "tiny.toml", test::TinyScene(kFrames)).has_value());
    const auto made = test::RunTsdfpp(
        {"generate", folder_ / "tiny.toml", "--out", sequence_, "--share", "0"}, folder_.path());
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  Ending Command(std::vector<std::string> words, const Fault& fault) {
    words.insert(words.begin(), TSDFPP_COMMAND);
    return RunShimmed(words, fault, folder_.path());
  }

  // Of so many changes those that are tried: some on the way, and all of the end, where the new
  // files take the old ones' places.
  static std::set<int> Chosen(int changes, int some, int last) {
    std::set<int> chosen;
    for (int i = 0; i < some; ++i) chosen.insert(1 + i * changes / some);
    for (int k = std::max(1, changes - last + 1); k <= changes; ++k) chosen.insert(k);
    return chosen;
  }

  // `before` leaves a result, `words` another one over it. Both write to out_. Where there is time,
  // thrice as many changes are tried.
  void Strike(const std::vector<std::string>& before, const std::vector<std::string>& words,
              const std::string& how, int some, int last) {
    if (test::Thorough()) {
      some *= 3;
      last *= 3;
    }
    ASSERT_EQ(Command(before, {out_}).exit_code, 0);
    fs::rename(out_, folder_ / "before");
    const Content earlier = Lasting(folder_ / "before");
    ASSERT_EQ(Command(words, {out_}).exit_code, 0);
    const Content whole = Lasting(out_);
    fs::remove_all(out_);
    fs::copy(folder_ / "before", out_, fs::copy_options::recursive);
    ASSERT_EQ(Command(words, {out_}).exit_code, 0);
    // Nothing of the earlier result is among it.
    ASSERT_EQ(Lasting(out_), whole);
    const int changes = test::Changes(folder_.path());
    ASSERT_GT(changes, 20);
    for (const int k : Chosen(changes, some, last)) {
      SCOPED_TRACE(k);
      fs::remove_all(out_);
      fs::copy(folder_ / "before", out_, fs::copy_options::recursive);
      const Ending ending = Command(words, {out_, k, how});
      if (how == "kill") {
        EXPECT_EQ(ending.signal, SIGKILL);
      } else if (ending.exit_code != 0) {
        EXPECT_EQ(ending.exit_code, test::kEnvironment) << ending.err;
        EXPECT_NE(ending.err.find("tsdfpp: "), std::string::npos) << ending.err;
      }
      Content left = Lasting(out_);
      std::erase_if(left, [](const auto& file) { return file.first.starts_with(".tsdfpp-"); });
      // A run.json stands beside one whole result or not at all.
      if (fs::exists(out_ / "run.json")) {
        EXPECT_TRUE(left == earlier || left == whole);
      } else {
        EXPECT_NE(ending.exit_code, 0);
      }
      const Ending again = Command(words, {out_});
      EXPECT_EQ(again.exit_code, 0) << again.err;
      EXPECT_EQ(Lasting(out_), whole);
    }
  }

  TempFolder folder_;
  fs::path sequence_ = folder_ / "sequence";
  fs::path out_ = folder_ / "out";
  std::vector<std::string> map_{"map", sequence_, "--remove", "car", "--out", out_};
  std::vector<std::string> compare_{"compare", sequence_, "--methods",  "tsdf++",
                                    "--every", "3",       "--until",    "end",
                                    "--out",   out_,      "--profiles", "close"};
};

std::vector<std::string> With(std::vector<std::string> words,
                              const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST_F(KilledCommands, Map) {
  Strike(With(map_, {"--mesh-format", "glb", "--views", "1", "--until", "2"}), map_, "kill", 2, 6);
}

TEST_F(KilledCommands, MapOnAFullDisk) {
  Strike(With(map_, {"--mesh-format", "glb"}), map_, "ENOSPC", 2, 1);
}

TEST_F(KilledCommands, Compare) {
  Strike(With(compare_, {"--keep-meshes", "--record"}), compare_, "kill", 1, 2);
}

TEST_F(KilledCommands, CompareOnAFullDisk) {
  Strike(With(compare_, {"--keep-meshes"}), compare_, "ENOSPC", 1, 1);
}

// Two frames of two cells: which file is of which would not be seen.
TEST_F(KilledCommands, Replay) {
  ASSERT_TRUE(WriteFile(folder_ / "experiment.toml", R"(name = "tiny"
question = "Which frame is it?"
metrics = ["visible_completion"]
baseline = "tsdf"
replicates = ["seed"]
[[grid]]
scene = "tiny.toml"
seed = 1
method = ["tsdf", "tsdf++"]
)")
                  .has_value());
  const fs::path swept = folder_ / "swept";
  const auto sweep = test::RunTsdfpp(
      {"sweep", folder_ / "experiment.toml", "--out", swept, "--scale", "1", "--stride", "1"},
      folder_.path());
  ASSERT_EQ(sweep.exit_code, 0) << sweep.err;
  std::vector<std::string> cells;
  for (const auto& entry : fs::directory_iterator(swept / "cells")) {
    cells.push_back(entry.path().stem());
  }
  ASSERT_EQ(cells.size(), 2U);
  const auto replay = [&](const std::string& cell, const char* frame) -> std::vector<std::string> {
    return {"replay", swept, "--cell", cell, "--frame", frame, "--out", out_};
  };
  Strike(replay(cells[0], "2"), replay(cells[1], "1"), "kill", 1, 5);
}

// One that was killed while its files moved is refused, and says what to do.
TEST_F(KilledCommands, AReportOfAnInterruptedComparison) {
  ASSERT_EQ(Command(compare_, {out_}).exit_code, 0);
  // Over a result there are others to make than in an empty folder.
  ASSERT_EQ(Command(compare_, {out_}).exit_code, 0);
  const int changes = test::Changes(folder_.path());
  int refused = 0;
  for (int k = changes; k > std::max(0, changes - 30) && refused == 0; k -= 5) {
    ASSERT_EQ(Command(compare_, {out_, k}).signal, SIGKILL);
    if (fs::exists(out_ / "run.json")) continue;
    ++refused;
    for (const char* video : {"", "--video"}) {
      std::vector<std::string> words{"report", out_};
      if (*video != 0) words.emplace_back(video);
      const auto report = test::RunTsdfpp(words, folder_.path());
      EXPECT_EQ(report.exit_code, test::kData);
      EXPECT_NE(report.err.find("holds an interrupted run"), std::string::npos) << report.err;
      EXPECT_NE(report.err.find("run the command again"), std::string::npos) << report.err;
    }
  }
  EXPECT_GT(refused, 0);
}

TEST_F(KilledCommands, OneProcessAFolder) {
  fs::create_directories(out_);
  const auto lock = FolderLock::Take(out_);
  ASSERT_TRUE(lock.has_value());
  for (const auto& words : {map_, compare_}) {
    const Ending ending = Command(words, {out_});
    EXPECT_EQ(ending.exit_code, test::kEnvironment);
    EXPECT_NE(ending.err.find("out: another process is working in this folder"), std::string::npos)
        << ending.err;
    EXPECT_EQ(ContentOf(out_), Content{});
  }
}

TEST_F(KilledCommands, AFilmOnAFullDisk) {
  const auto recorded = Command(With(compare_, {"--record"}), {out_});
  ASSERT_EQ(recorded.exit_code, 0) << recorded.err;
  const Content before = ContentOf(out_);
  const std::vector<std::string> words{"report", out_, "--video"};
  const auto whole = Command(words, {out_});
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  const int changes = test::Changes(folder_.path());
  ASSERT_GT(changes, 5);
  const std::string film = ContentOf(out_).at("report.mp4");
  const int step = test::Thorough() ? 1 : 2;
  for (int k = 1 + (changes - 1) % step; k <= changes; k += step) {
    SCOPED_TRACE(k);
    fs::remove(out_ / "report.mp4");
    const Ending ending = Command(words, {out_, k, "ENOSPC"});
    Content left = ContentOf(out_);
    if (ending.exit_code == 0) {
      // What failed was tidying.
      EXPECT_EQ(left.at("report.mp4"), film);
      continue;
    }
    EXPECT_EQ(ending.exit_code, test::kEnvironment) << ending.err;
    EXPECT_NE(ending.err.find("tsdfpp: "), std::string::npos);
    EXPECT_FALSE(left.contains("report.mp4"));
  }
  // What is left over goes with the next one.
  ASSERT_EQ(Command(words, {out_}).exit_code, 0);
  Content after = ContentOf(out_);
  EXPECT_EQ(after.at("report.mp4"), film);
  after.erase("report.mp4");
  // The shim lets nobody remove anything either, which a full disk would.
  std::erase_if(after, [](const auto& file) {
    return file.first.ends_with(".part") || file.first.starts_with(".tsdfpp-probe");
  });
  EXPECT_EQ(after, before);
}

}  // namespace
}  // namespace tsdfpp
