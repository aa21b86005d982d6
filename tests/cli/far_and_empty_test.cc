// What `map` and `compare` say of sequences that lie too far out, of those that hold nothing, and
// of those whose numbers are too great for a file.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "sequence/cofusion_writer.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kData;
using test::kUsage;
using test::RunTsdfpp;

// The boxes with their frames changed.
class ChangedBoxes : public test::BoxSource {
 public:
  explicit ChangedBoxes(std::function<void(Frame&)> change)
      : BoxSource(2), change_(std::move(change)) {}
  Expected<Frame> Read(int index) override {
    auto frame = BoxSource::Read(index);
    if (frame) change_(*frame);
    return frame;
  }

 private:
  std::function<void(Frame&)> change_;
};

// Three frames, from this number on.
class LateBoxes : public test::BoxSource {
 public:
  explicit LateBoxes(int first) : BoxSource(3) { info_.first_index = first; }
  Expected<Frame> Read(int index) override {
    auto frame = BoxSource::Read(index - info_.first_index);
    if (frame) frame->index = index;
    return frame;
  }
};

class FarAndEmpty : public testing::Test {
 protected:
  fs::path Sequence(const std::function<void(Frame&)>& change) {
    ChangedBoxes source(change);
    fs::path set = folder_ / "boxes";
    const auto written = WriteCofusion(source, {"0.1.0", 1, "boxes", "none", "none"}, set);
    EXPECT_TRUE(written.has_value()) << written.error().message;
    return set;
  }
  CommandOutput Run(const std::string& command, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{command, folder_ / "boxes", "--out", folder_ / command};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTsdfpp(arguments, folder_.path());
  }
  nlohmann::json Json(const std::string& file) {
    return nlohmann::json::parse(std::ifstream(folder_ / file));
  }

  test::TempFolder folder_;
};

TEST_F(FarAndEmpty, BeyondTheRangeIsAnError) {
  Sequence([](Frame& frame) {
    const Eigen::Vector3d shift(1e5, 0, 0);
    frame.T_WC.translation() += shift;
    for (auto& [id, T_WO] : frame.T_WO) T_WO.translation() += shift;
  });
  for (const std::string method :
       {"tsdf", "tsdf/guarded", "tsdf++", "tsdf++/literal", "tsdf++/anchored", "volumes"}) {
    const CommandOutput output = Run("map", {"--method", method});
    EXPECT_EQ(output.exit_code, kData) << method << output.err;
    EXPECT_NE(output.err.find("frame 0: "), std::string::npos) << output.err;
    EXPECT_NE(output.err.find("expected at most 83884.8 m from the origin"), std::string::npos)
        << output.err;
    EXPECT_FALSE(fs::exists(folder_ / "map/stats.json"));
    // As the sentence says.
    const CommandOutput larger = Run("map", {"--method", method, "--voxel", "0.0125"});
    EXPECT_EQ(larger.exit_code, 0) << method << larger.err;
    EXPECT_GT(Json("map/stats.json")["map"]["blocks"].get<int>(), 0);
    EXPECT_NE(larger.err.find("single precision rounds by up to"), std::string::npos) << larger.err;
    fs::remove_all(folder_ / "map");
  }
}

TEST_F(FarAndEmpty, AnEmptyMapIsSaid) {
  Sequence([](Frame& frame) { frame.depth.setTo(0); });
  const std::string remark =
      "the map is empty: of 6144 pixels in 2 frames 0 have a depth, 0 of them within 100 m and 0 "
      "of "
      "those a label";
  const CommandOutput map = Run("map", {"--voxel", "0.02"});
  ASSERT_EQ(map.exit_code, 0) << map.err;
  EXPECT_NE(map.err.find(remark), std::string::npos) << map.err;
  EXPECT_EQ(Json("map/stats.json")["remarks"], nlohmann::json::array({remark}));

  const CommandOutput compare = Run(
      "compare", {"--voxel", "0.02", "--methods", "tsdf,tsdf++/anchored", "--profiles", "close"});
  ASSERT_EQ(compare.exit_code, 0) << compare.err;
  for (const char* title : {"tsdf, close", "tsdf++/anchored, close"}) {
    EXPECT_NE(compare.err.find(std::string(title) + ", given poses: " + remark), std::string::npos)
        << compare.err;
  }
  for (const auto& run : Json("compare/summary.json")["runs"]) {
    EXPECT_EQ(run["remarks"], nlohmann::json::array({remark}));
  }
}

// Before anything is mapped.
TEST_F(FarAndEmpty, FramesThatNoMapFileHasAreNotMappedToBeSaved) {
  LateBoxes source(999'999'999);
  const auto written =
      WriteCofusion(source, {"0.1.0", 1, "boxes", "none", "none"}, folder_ / "boxes");
  ASSERT_TRUE(written.has_value()) << written.error().message;
  const std::string save = folder_ / "late.map";
  const CommandOutput beyond = Run("map", {"--voxel", "0.05", "--save", save});
  EXPECT_EQ(beyond.exit_code, kUsage);
  EXPECT_EQ(beyond.err, "tsdfpp: --save '" + save +
                            "': the last frame to map is 1000000001, expected at most 1000000000 "
                            "(--until)\n");
  EXPECT_FALSE(fs::exists(folder_ / "map"));
  const CommandOutput saved =
      Run("map", {"--voxel", "0.05", "--save", save, "--until", "1000000000"});
  EXPECT_EQ(saved.exit_code, 0) << saved.err;
  EXPECT_TRUE(fs::exists(save));
}

}  // namespace
}  // namespace tsdfpp
