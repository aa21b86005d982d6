// What a comparison keeps when a map, or the frames, fail on the way.
#include <gtest/gtest.h>

#include <new>

#include "core/files.h"
#include "core/json_text.h"
#include "eval/compare/compare.h"
#include "eval/compare/compare_report.h"
#include "eval/compare/compare_tables.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

using test::BoxSource;
using test::TempFolder;

// Its frames 0 to 6, of which the one with this number cannot be had.
class BreakingSource : public FrameSource {
 public:
  enum class Way { kError, kException };
  BreakingSource(int at, Way way) : at_(at), way_(way) {}
  const SequenceInfo& info() const override { return source_.info(); }
  Expected<Frame> Read(int index) override {
    if (index != at_) return source_.Read(index);
    if (way_ == Way::kException) throw std::bad_alloc();
    return DataError("frame {} is gone", index);
  }
  Expected<std::vector<TrueModel>> Truth() override { return source_.Truth(); }

 private:
  BoxSource source_{7};
  int at_;
  Way way_;
};

// Puts files where maps' folders are to go while the run writes, in its hidden folder.
class PlantingSource : public FrameSource {
 public:
  PlantingSource(std::filesystem::path out, std::vector<std::string> names)
      : out_(std::move(out)), names_(std::move(names)) {}
  const SequenceInfo& info() const override { return source_.info(); }
  Expected<Frame> Read(int index) override {
    if (index == kPlanted) {
      for (const auto& entry : std::filesystem::directory_iterator(out_)) {
        if (!entry.is_directory() || entry.path().filename().string().front() != '.') continue;
        for (const std::string& name : names_) {
          EXPECT_TRUE(WriteFile(entry.path() / name, "in the way").has_value());
          ++planted_;
        }
      }
    }
    return source_.Read(index);
  }
  Expected<std::vector<TrueModel>> Truth() override { return source_.Truth(); }
  std::size_t planted() const { return planted_; }

 private:
  static constexpr int kPlanted = 5;
  std::filesystem::path out_;
  std::vector<std::string> names_;
  BoxSource source_{7};
  std::size_t planted_ = 0;
};

CompareConfig TwoMaps() {
  CompareConfig config;
  config.methods = {Method::kTsdf, Method::kTsdfpp};
  config.profiles = {"close"};
  config.map.voxel_m = 0.03;
  config.every = 4;  // frames 3 and 6
  return config;
}

nlohmann::json SummaryOf(const std::filesystem::path& out) {
  auto summary = ReadJsonObject(out / "summary.json");
  EXPECT_TRUE(summary.has_value()) << summary.error().message;
  return summary ? *summary : nlohmann::json();
}

TEST(CompareFailure, AMapThatFailsIsSaidAndTheOthersAreKept) {
  const TempFolder folder;
  for (const bool record : {false, true}) {
    const std::filesystem::path out = folder / (record ? "recorded" : "out");
    // Where the first map's meshes are to go there is a file.
    PlantingSource source(out, {"tsdf_close_gt"});
    CompareConfig config = TwoMaps();
    config.record = record;
    const auto result = RunCompare(source, config, out, "the command", {});
    ASSERT_EQ(source.planted(), 1U);
    ASSERT_TRUE(result.has_value()) << result.error().message;
    ASSERT_EQ(result->failed.size(), 1U);
    EXPECT_EQ(result->failed[0].folder, "tsdf_close_gt");
    EXPECT_EQ(result->failed[0].frame, 6);
    EXPECT_EQ(result->failed[0].error.kind, ErrorKind::kEnvironment);
    ASSERT_EQ(result->runs.size(), 1U);
    EXPECT_EQ(result->runs[0]->evaluations.size(), 2U);
    EXPECT_NE(SummaryTable(*result).find("failed: tsdf, close, given poses at frame 6: "),
              std::string::npos)
        << SummaryTable(*result);
    const nlohmann::json summary = SummaryOf(out);
    ASSERT_EQ(summary.at("runs").size(), 1U);
    EXPECT_EQ(summary.at("runs")[0].at("folder"), "tsdf++_close_gt");
    EXPECT_EQ(summary.at("failed")[0].at("folder"), "tsdf_close_gt");
    EXPECT_TRUE(ReadFile(out / "figure-close-gt.png").has_value());
    EXPECT_TRUE(ReadFile(out / "table-gt.png").has_value());
    if (!record) continue;
    const auto recorded = ReadJsonObject(out / "record/record.json");
    ASSERT_TRUE(recorded.has_value()) << recorded.error().message;
    ASSERT_EQ(recorded->at("runs").size(), 1U);
    EXPECT_EQ(recorded->at("runs")[0].at("folder"), "tsdf++_close_gt");
  }
}

TEST(CompareFailure, WhereNothingIsLeftThereIsNoResult) {
  const TempFolder folder;
  PlantingSource source(folder.path(), {"tsdf_close_gt", "tsdf++_close_gt"});
  const auto result = RunCompare(source, TwoMaps(), folder.path(), "the command", {});
  ASSERT_EQ(source.planted(), 2U);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kEnvironment);
  EXPECT_TRUE(result.error().message.starts_with("tsdf, close, given poses, at frame 6: "))
      << result.error().message;
}

TEST(CompareFailure, FramesThatEndEarlyLeaveWhatWasEvaluated) {
  for (const auto way : {BreakingSource::Way::kError, BreakingSource::Way::kException}) {
    const TempFolder folder;
    BreakingSource source(5, way);
    const auto result = RunCompare(source, TwoMaps(), folder / "out", "the command", {});
    ASSERT_TRUE(result.has_value()) << result.error().message;
    ASSERT_TRUE(result->stopped.has_value());
    EXPECT_EQ(result->stopped->kind,
              way == BreakingSource::Way::kError ? ErrorKind::kData : ErrorKind::kEnvironment);
    EXPECT_EQ(result->last_frame, 3);
    ASSERT_EQ(result->runs.size(), 2U);
    for (const auto& run : result->runs) EXPECT_EQ(run->evaluations.size(), 1U);
    const nlohmann::json summary = SummaryOf(folder / "out");
    EXPECT_EQ(summary.at("stopped"), result->stopped->message);
    EXPECT_EQ(summary.at("last_frame"), 3);
    EXPECT_NE(SummaryTable(*result).find("stopped after frame 3: "), std::string::npos);
  }
}

// Frames 4 and 5 were mapped before frame 6 was found to be gone, and count nowhere.
TEST(CompareFailure, FramesThatEndEarlyLeaveNothingOfLaterOnes) {
  const TempFolder folder;
  CompareConfig config = TwoMaps();
  config.record = true;
  config.camera = CameraSource::kRefine;
  BreakingSource broken(6, BreakingSource::Way::kError);
  const auto stopped = RunCompare(broken, config, folder / "stopped", "the command", {});
  ASSERT_TRUE(stopped.has_value()) << stopped.error().message;
  ASSERT_TRUE(stopped->stopped.has_value());
  EXPECT_FALSE(std::filesystem::exists(folder / "stopped" / "record"));

  config.until = "3";
  BoxSource whole(7);
  const auto planned = RunCompare(whole, config, folder / "planned", "the command", {});
  ASSERT_TRUE(planned.has_value()) << planned.error().message;
  const nlohmann::json ended = SummaryOf(folder / "stopped").at("runs");
  const nlohmann::json expected = SummaryOf(folder / "planned").at("runs");
  ASSERT_EQ(ended.size(), expected.size());
  for (std::size_t r = 0; r < expected.size(); ++r) {
    for (const char* key : {"trajectories", "camera", "map"}) {
      EXPECT_EQ(ended[r].at(key), expected[r].at(key)) << key;
    }
    EXPECT_EQ(ended[r].at("trajectories").at("8").at("frames"), 4);
    EXPECT_EQ(stopped->runs[r]->notes.times.fuse_s.size(), 4U);
  }
}

// Where the comparison goes on after the reveal, the map's size is that of the reveal, as all other
// figures of the table are.
TEST(CompareMemory, IsOfTheExaminedFrame) {
  const TempFolder folder;
  std::vector<nlohmann::json> sizes;
  for (const char* until : {"reveal", "end"}) {
    BoxSource source(7);
    source.info_.reveal = RevealPlan{3, {8}};
    CompareConfig config = TwoMaps();
    config.until = until;
    const auto result = RunCompare(source, config, folder / until, "the command", {});
    ASSERT_TRUE(result.has_value()) << result.error().message;
    const CompareRun& run = *result->runs.front();
    ASSERT_EQ(run.memory.size(), run.evaluations.size());
    sizes.push_back(SummaryOf(folder / until).at("runs")[0].at("map"));
    EXPECT_EQ(sizes.back().at("bytes"), run.memory.front().bytes);
    const std::string megabytes =
        fmt::format("{:.0f}", static_cast<double>(run.memory.front().bytes) / 1e6);
    EXPECT_EQ(TableRows(*result, Times::kLeftOut)[1].back(), megabytes);
    // The camera goes on and sees more.
    if (run.memory.size() > 1) {
      EXPECT_GT(run.memory.back().bytes, run.memory.front().bytes);
    }
  }
  EXPECT_EQ(sizes[0], sizes[1]);
}

TEST(CompareFailure, FramesThatEndBeforeAnythingWasEvaluatedAreAnError) {
  const TempFolder folder;
  BreakingSource source(2, BreakingSource::Way::kError);
  const auto result = RunCompare(source, TwoMaps(), folder / "out", "the command", {});
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().message, "frame 2 is gone");
}

}  // namespace
}  // namespace tsdfpp
