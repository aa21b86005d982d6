// Sequences made by several processes, stopped and killed on the way.
#include "eval/make/generate.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <thread>

#include "core/files.h"
#include "eval/run/workers.h"
#include "sequence/open_sequence.h"
#include "sequence/sequence_json.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::RunTsdfpp;
using test::TempFolder;

// The bytes of every file below a folder.
std::map<std::string, std::string> Contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[entry.path().lexically_relative(folder)] = ReadFile(entry.path()).value();
    }
  }
  return files;
}

void ExpectSameFiles(const fs::path& a, const fs::path& b) {
  const auto first = Contents(a);
  const auto second = Contents(b);
  EXPECT_GT(first.size(), 10U);
  std::vector<std::string> differing;
  for (const auto& [file, bytes] : first) {
    if (!second.contains(file) || second.at(file) != bytes) differing.push_back(file);
  }
  for (const auto& [file, bytes] : second) {
    if (!first.contains(file)) differing.push_back(file);
  }
  EXPECT_EQ(differing, std::vector<std::string>{});
}

class Generation : public testing::Test {
 protected:
  // Enough frames to be in the middle of them when the signal comes.
  static constexpr int kFrames = 40;

  void SetUp() override { ASSERT_TRUE(WriteFile(scene_, test::TinyScene(kFrames)).has_value()); }
  test::CommandOutput Generate(const fs::path& out, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"generate", scene_, "--out", out, "--share", "0"};
    words.insert(words.end(), more.begin(), more.end());
    return RunTsdfpp(words, folder_.path());
  }
  // Starts the command in a process group of its own.
  pid_t Start(const fs::path& out) {
    const pid_t process = fork();
    if (process == 0) {
      setpgid(0, 0);
      const int nowhere = open("/dev/null", O_WRONLY);
      dup2(nowhere, STDERR_FILENO);
      dup2(nowhere, STDOUT_FILENO);
      execl(TSDFPP_COMMAND, TSDFPP_COMMAND, "generate", scene_.c_str(), "--out", out.c_str(),
            "--share", "0", "--jobs", "2", nullptr);
      _exit(127);
    }
    setpgid(process, process);
    return process;
  }
  // Waits until some frames are noted; false where the process ended before.
  static bool WaitForFrames(pid_t process, const fs::path& notes, int frames) {
    while (waitpid(process, nullptr, WNOHANG) == 0) {
      std::error_code code;
      int found = 0;
      for (const auto& entry : fs::directory_iterator(notes, code)) {
        const std::string name = entry.path().filename();
        found += entry.path().extension() == ".json" && std::isdigit(name[0]) != 0 ? 1 : 0;
      }
      if (found >= frames) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return false;
  }

  TempFolder folder_;
  fs::path scene_ = folder_ / "tiny.toml";
  fs::path whole_ = folder_ / "whole";
  fs::path out_ = folder_ / "out";
  fs::path hidden_ = folder_ / ".out.part";
};

TEST_F(Generation, TheBytesDoNotDependOnTheJobs) {
  ASSERT_TRUE(WriteFile(scene_, test::TinyScene(5)).has_value());
  ASSERT_EQ(Generate(whole_, {"--jobs", "1"}).exit_code, 0);
  ASSERT_EQ(Generate(out_, {"--jobs", "2"}).exit_code, 0);
  ExpectSameFiles(whole_, out_);
  ASSERT_EQ(Generate(out_, {"--jobs", "3", "--overwrite"}).exit_code, 0);
  ExpectSameFiles(whole_, out_);
  // Nothing hidden is left beside them.
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
  }
}

TEST_F(Generation, AKilledRunGoesOnWhereItWas) {
  ASSERT_EQ(Generate(whole_).exit_code, 0);
  const pid_t process = Start(out_);
  ASSERT_TRUE(WaitForFrames(process, hidden_ / "notes", 4));
  kill(-process, SIGKILL);
  waitpid(process, nullptr, 0);
  EXPECT_FALSE(fs::exists(out_));
  ASSERT_TRUE(fs::exists(hidden_ / "set"));
  // A frame that was damaged since is made again, and so is one whose notes are.
  ASSERT_TRUE(WriteFile(hidden_ / "set/depth_original/Depth0001.exr", "damaged").has_value());
  ASSERT_TRUE(WriteFile(hidden_ / "notes/0002.json", "{}").has_value());
  const auto output = Generate(out_, {"--json"});
  ASSERT_EQ(output.exit_code, 0) << output.err;
  const auto json = nlohmann::json::parse(output.out, nullptr, false);
  ASSERT_TRUE(json.is_object()) << output.out;
  EXPECT_GE(json["resumed_frames"].get<int>(), 2);
  EXPECT_LT(json["resumed_frames"].get<int>(), kFrames);
  ExpectSameFiles(whole_, out_);
  EXPECT_FALSE(fs::exists(hidden_));
}

TEST_F(Generation, AStoppedRunGoesOnWhereItWas) {
  ASSERT_EQ(Generate(whole_).exit_code, 0);
  const pid_t process = Start(out_);
  ASSERT_TRUE(WaitForFrames(process, hidden_ / "notes", 3));
  // As a terminal does: to all of the group.
  kill(-process, SIGINT);
  int status = 0;
  ASSERT_EQ(waitpid(process, &status, 0), process);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGINT);
  EXPECT_FALSE(fs::exists(out_));
  ASSERT_EQ(Generate(out_, {"--jobs", "1"}).exit_code, 0);
  ExpectSameFiles(whole_, out_);
}

// Neither to one that could not begin, nor to one that failed on the way.
TEST_F(Generation, FramesAreNotLostToALaterRun) {
  const pid_t process = Start(out_);
  ASSERT_TRUE(WaitForFrames(process, hidden_ / "notes", 3));
  kill(-process, SIGKILL);
  waitpid(process, nullptr, 0);
  const auto output = RunTsdfpp({"generate", scene_, "--out", out_, "--share", "0"}, folder_.path(),
                                {{"MUJOCO_GL", "nonsense"}});
  EXPECT_NE(output.exit_code, 0);
  EXPECT_NE(output.err.find("; the frames that an earlier run made are kept"), std::string::npos)
      << output.err;
  // In the place of the last frame's colour.
  const fs::path in_the_way = hidden_ / fmt::format("set/colour/Color{:04d}.png/full", kFrames);
  ASSERT_TRUE(WriteFile(in_the_way, "full").has_value());
  const auto failed = Generate(out_);
  EXPECT_EQ(failed.exit_code, 3) << failed.err;
  EXPECT_NE(failed.err.find(fmt::format(" of {} frames are kept, from which the same", kFrames)),
            std::string::npos)
      << failed.err;
  EXPECT_FALSE(fs::exists(out_));
  fs::remove_all(in_the_way.parent_path());
  const auto again = Generate(out_, {"--json"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_GE(nlohmann::json::parse(again.out)["resumed_frames"].get<int>(), 3);
  EXPECT_FALSE(fs::exists(hidden_));
}

// As systemd and timeout send it: the workers end of it, which is no fault of theirs.
TEST_F(Generation, ASignalToTheWholeGroupIsAStop) {
  const pid_t process = fork();
  if (process == 0) {
    setpgid(0, 0);
    signal(SIGTERM, SIG_IGN);
    std::atomic<bool> stop = false;
    GenerateOptions options;
    options.out = out_;
    options.ray_share = 0;
    options.stop = &stop;
    options.progress = [&](const std::string&, int, int, int) {
      stop = true;
      kill(0, SIGTERM);
    };
    const auto made = GenerateSequence(LoadSceneConfig(scene_).value(), "0", options);
    const bool said = !made && made.error().message.starts_with(out_.string() + ": stopped");
    _exit(said ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(process, &status, 0), process);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(Generation, AnotherSceneBeginsAnew) {
  const pid_t process = Start(out_);
  ASSERT_TRUE(WaitForFrames(process, hidden_ / "notes", 3));
  kill(-process, SIGKILL);
  waitpid(process, nullptr, 0);
  ASSERT_TRUE(WriteFile(scene_, test::TinyScene(5)).has_value());
  const auto output = Generate(out_, {"--json"});
  ASSERT_EQ(output.exit_code, 0) << output.err;
  EXPECT_EQ(nlohmann::json::parse(output.out)["resumed_frames"], 0);
  ASSERT_EQ(Generate(whole_).exit_code, 0);
  ExpectSameFiles(whole_, out_);
}

// Nearer than the near clipping plane the renderer shows what is behind, and rays do not.
TEST_F(Generation, WhatDoesNotVerifyIsNotPublished) {
  ASSERT_TRUE(WriteFile(scene_, test::TinyScene(4, 0.24)).has_value());
  const auto output = Generate(out_);
  EXPECT_EQ(output.exit_code, 4) << output.out;
  EXPECT_NE(output.err.find("does not verify"), std::string::npos) << output.err;
  EXPECT_FALSE(fs::exists(out_));
  EXPECT_FALSE(fs::exists(hidden_));
}

// Rendering takes a while; what somebody has put there since is theirs.
TEST_F(Generation, WhatCameMeanwhileIsNotReplaced) {
  const SceneConfig scene = LoadSceneConfig(scene_).value();
  GenerateOptions options;
  options.out = out_;
  options.ray_share = 0;
  options.progress = [&](const std::string& phase, int, int, int) {
    if (phase == "verify") {
      EXPECT_TRUE(WriteFile(out_ / "theirs.txt", "kept").has_value());
    }
  };
  const auto made = GenerateSequence(scene, "0", options);
  ASSERT_FALSE(made.has_value());
  EXPECT_EQ(made.error().kind, ErrorKind::kUsage);
  EXPECT_NE(made.error().message.find("holds something other than a sequence"), std::string::npos)
      << made.error().message;
  EXPECT_EQ(ReadFile(out_ / "theirs.txt").value(), "kept");
  // Once it is away nothing has to be rendered again.
  fs::remove_all(out_);
  options.progress = nullptr;
  const auto again = GenerateSequence(scene, "0", options);
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(again->resumed_frames, kFrames);
}

TEST_F(Generation, WritesWhatItMeasured) {
  ASSERT_TRUE(WriteFile(scene_, test::TinyScene(4)).has_value());
  ASSERT_EQ(Generate(out_, {"--seed", "77"}).exit_code, 0);
  const auto record = ReadSequenceJson(out_ / "sequence.json");
  ASSERT_TRUE(record.has_value()) << record.error().message;
  EXPECT_EQ(record->generator.seed, 77U);
  ASSERT_TRUE(record->certificate.has_value());
  EXPECT_EQ(record->certificate->frames, 4);
  EXPECT_EQ(record->certificate->model.violations, 0);
  for (const char* file : {"scene.toml", "truth/visibility.csv", "models/car-1.ply"}) {
    EXPECT_TRUE(record->hashes.contains(file)) << file;
  }
}

// What the sensor gave is what is mapped, from memory as from the disk; the truth stays beside it.
TEST_F(Generation, WhatTheSensorGaveComesBackFromDisk) {
  const fs::path out = folder_ / "sensed";
  ASSERT_EQ(Generate(out, {"--sensor", "kinect+masks_severe+pose_drift_strong"}).exit_code, 0);
  SceneConfig scene = LoadSceneConfig(scene_).value();
  scene.sensor = SensorPresetNamed("kinect+masks_severe+pose_drift_strong").value();
  const auto streamed = SimulatedSource::Open(scene, {}).value();
  const auto stored = OpenSequence(out).value();
  ASSERT_TRUE(streamed->IsSensed());
  ASSERT_TRUE(stored->IsSensed());
  const auto same = [](const cv::Mat& a, const cv::Mat& b) {
    return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
  };
  int other_depth = 0;
  int other_mask = 0;
  int other_pose = 0;
  for (const int index : {1, 7, 20, kFrames}) {
    const Frame a = streamed->Read(index).value();
    const Frame b = stored->Read(index).value();
    EXPECT_TRUE(same(a.depth, b.depth) && same(a.mask, b.mask) && same(a.colour, b.colour));
    EXPECT_EQ(a.T_WC.matrix(), b.T_WC.matrix());
    const Frame true_a = streamed->ReadTrue(index).value();
    const Frame true_b = stored->ReadTrue(index).value();
    EXPECT_TRUE(same(true_a.depth, true_b.depth) && same(true_a.mask, true_b.mask));
    EXPECT_EQ(true_a.T_WC.matrix(), true_b.T_WC.matrix());
    other_depth += same(a.depth, true_a.depth) ? 0 : 1;
    other_mask += same(a.mask, true_a.mask) ? 0 : 1;
    other_pose += a.T_WC.matrix() == true_a.T_WC.matrix() ? 0 : 1;
  }
  EXPECT_EQ(other_depth, 4);
  EXPECT_GE(other_mask, 1);
  EXPECT_GE(other_pose, 3);  // drift begins at the first frame
  EXPECT_EQ(RunTsdfpp({"verify", out, "--share", "0"}, folder_.path()).exit_code, 0);
}

TEST_F(Generation, ListsTheScenes) {
  const std::string scenes = TSDFPP_SOURCE_DIR "/scenes";
  const auto output =
      RunTsdfpp({"generate", "--list", "--scenes", scenes, "--json"}, folder_.path());
  ASSERT_EQ(output.exit_code, 0) << output.err;
  const auto json = nlohmann::json::parse(output.out, nullptr, false);
  ASSERT_TRUE(json.is_array());
  const auto toycar3 = std::find_if(json.begin(), json.end(),
                                    [](const auto& scene) { return scene["name"] == "toycar3"; });
  ASSERT_NE(toycar3, json.end());
  EXPECT_EQ((*toycar3)["frames"], 480);
}

TEST(Workers, LinesComeAndGo) {
  auto workers = Workers::Start(3, [](Channel& parent) -> Expected<void> {
    while (const auto line = parent.Receive()) parent.Send(*line + "!");
    return {};
  });
  ASSERT_TRUE(workers.has_value());
  for (int i = 0; i < 3; ++i) {
    workers->Send(i, "a");
    workers->Send(i, "b");
    workers->Close(i);
  }
  std::map<int, std::string> heard;
  while (true) {
    const auto next = workers->Next();
    ASSERT_TRUE(next.has_value()) << next.error().message;
    if (!*next) break;
    heard[(*next)->worker] += (*next)->line;
  }
  EXPECT_EQ(heard, (std::map<int, std::string>{{0, "a!b!"}, {1, "a!b!"}, {2, "a!b!"}}));
}

TEST(Workers, ErrorsAndDeathsAreTheParents) {
  auto failing = Workers::Start(
      1, [](Channel&) -> Expected<void> { return DataError("frame {} is torn", 7); });
  auto next = failing->Next();
  ASSERT_FALSE(next.has_value());
  EXPECT_EQ(next.error().kind, ErrorKind::kData);
  EXPECT_EQ(next.error().message, "frame 7 is torn");
  auto dying = Workers::Start(1, [](Channel&) -> Expected<void> {
    raise(SIGKILL);
    return {};
  });
  next = dying->Next();
  ASSERT_FALSE(next.has_value());
  EXPECT_EQ(next.error().kind, ErrorKind::kEnvironment);
  EXPECT_NE(next.error().message.find("signal 9"), std::string::npos) << next.error().message;
}

}  // namespace
}  // namespace tsdfpp
