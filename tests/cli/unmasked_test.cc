// What the commands make of a recording without masks.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "core/files.h"
#include "sequence/export.h"
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

class Unmasked : public testing::Test {
 protected:
  // A TUM set called "boxes", without masks.
  fs::path Recording() {
    test::BoxSource source(4);
    EXPECT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder_ / "boxes").has_value());
    fs::remove_all(folder_ / "boxes/mask");
    return folder_ / "boxes";
  }
  CommandOutput Run(const std::vector<std::string>& arguments) {
    return RunTsdfpp(arguments, folder_.path());
  }
  CommandOutput Map(const fs::path& sequence, const std::string& out,
                    const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"map", sequence, "--out", folder_ / out, "--voxel", "0.02"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }
  nlohmann::json Stats(const std::string& out) {
    return nlohmann::json::parse(std::ifstream(folder_ / out / "stats.json"));
  }

  test::TempFolder folder_;
};

const std::string kRemark = "boxes: has no masks, so all of it is taken for background";

// The same bytes as with masks on disk that are background throughout.
TEST_F(Unmasked, AreMappedAsBackground) {
  const fs::path recording = Recording();
  const fs::path masked = folder_ / "masked/boxes";
  fs::create_directories(masked.parent_path());
  fs::copy(recording, masked, fs::copy_options::recursive);
  fs::create_directories(masked / "mask");
  for (const auto& image : fs::directory_iterator(masked / "rgb")) {
    cv::imwrite((masked / "mask" / image.path().filename()).string(),
                cv::Mat(48, 64, CV_8UC1, cv::Scalar(0)));
  }
  for (const std::string method : {"tsdf", "tsdf++", "tsdf++/anchored", "volumes"}) {
    SCOPED_TRACE(method);
    const CommandOutput output = Map(recording, "out", {"--method", method});
    ASSERT_EQ(output.exit_code, 0) << output.err;
    const std::size_t at = output.err.find(kRemark);
    ASSERT_NE(at, std::string::npos) << output.err;
    EXPECT_EQ(output.err.find("taken for background", at + kRemark.size()), std::string::npos)
        << "said once: " << output.err;
    const nlohmann::json stats = Stats("out");
    EXPECT_EQ(stats["segmentation"], "none");
    EXPECT_EQ(stats["remarks"], nlohmann::json::array({kRemark}));
    EXPECT_GT(stats["map"]["blocks"].get<int>(), 0);

    const CommandOutput other = Map(masked, "zeros", {"--method", method});
    ASSERT_EQ(other.exit_code, 0) << other.err;
    EXPECT_EQ(other.err.find("taken for background"), std::string::npos) << other.err;
    EXPECT_EQ(Stats("zeros")["segmentation"], "gt");
    EXPECT_FALSE(Stats("zeros").contains("remarks"));
    const std::string mesh = ReadFile(folder_ / "out/mesh/scene.ply").value();
    EXPECT_GT(mesh.size(), 10000U);
    EXPECT_EQ(mesh, ReadFile(folder_ / "zeros/mesh/scene.ply").value());
  }
}

// With masks on disk, --segmentation none makes the same bytes of it as of a recording without.
TEST_F(Unmasked, IsWhatSegmentationNoneMakesOfMasks) {
  const fs::path recording = Recording();
  ASSERT_EQ(Map(recording, "out").exit_code, 0);
  test::BoxSource source(4);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder_ / "set/boxes").has_value());
  const CommandOutput output = Map(folder_ / "set/boxes", "none", {"--segmentation", "none"});
  ASSERT_EQ(output.exit_code, 0) << output.err;
  const std::string remark =
      "boxes: its masks are not read (--segmentation none), so all of it is taken for background";
  EXPECT_NE(output.err.find(remark), std::string::npos) << output.err;
  EXPECT_EQ(Stats("none")["segmentation"], "none");
  EXPECT_EQ(Stats("none")["remarks"], nlohmann::json::array({remark}));
  EXPECT_EQ(ReadFile(folder_ / "out/mesh/scene.ply").value(),
            ReadFile(folder_ / "none/mesh/scene.ply").value());

  const CommandOutput refused = Map(recording, "gt", {"--segmentation", "gt"});
  EXPECT_EQ(refused.exit_code, kData);
  EXPECT_NE(refused.err.find("has no masks, expected one for each frame, for --segmentation gt"),
            std::string::npos)
      << refused.err;
}

// Segments of depth are the same with masks on disk and without, and their ids are votes'.
TEST_F(Unmasked, AreSegmentedByDepth) {
  const fs::path recording = Recording();
  test::BoxSource source(4);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder_ / "set/boxes").has_value());
  const std::string config = folder_ / "segments.toml";
  ASSERT_TRUE(WriteFile(config, "noise = \"exact\"\n").has_value());
  const std::vector<std::string> options{"--segmentation", "depth", "--segmentation-config",
                                         config};
  using Mapped = std::pair<fs::path, std::string>;
  for (const auto& [from, out] :
       {Mapped{recording, "without"}, Mapped{folder_ / "set/boxes", "with"}}) {
    const CommandOutput output = Map(from, out, options);
    ASSERT_EQ(output.exit_code, 0) << output.err;
    EXPECT_EQ(output.err.find("taken for background"), std::string::npos) << output.err;
    EXPECT_EQ(Stats(out)["segmentation"], "depth");
    EXPECT_EQ(Stats(out)["associate"], "votes");
    EXPECT_EQ(Stats(out)["poses"], "track");
  }
  EXPECT_EQ(ReadFile(folder_ / "without/mesh/scene.ply").value(),
            ReadFile(folder_ / "with/mesh/scene.ply").value());
  // The config is read: all that is seen is large enough to be a plane of the background.
  ASSERT_TRUE(WriteFile(config, "noise = \"exact\"\nplane_m2 = 0.001\n").has_value());
  ASSERT_EQ(Map(recording, "planes", options).exit_code, 0);
  EXPECT_NE(ReadFile(folder_ / "without/mesh/scene.ply").value(),
            ReadFile(folder_ / "planes/mesh/scene.ply").value());
}

TEST_F(Unmasked, SegmentsOfDepthHaveNoGivenIds) {
  const fs::path recording = Recording();
  const auto refuses = [&](const std::vector<std::string>& options, const std::string& sentence) {
    const CommandOutput output = Map(recording, "out", options);
    EXPECT_EQ(output.exit_code, kUsage);
    EXPECT_NE(output.err.find(sentence), std::string::npos) << output.err;
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  };
  refuses({"--segmentation", "depth", "--associate", "given"},
          "--associate given: the ids of --segmentation depth are drawn anew in every frame, "
          "expected --associate votes");
  refuses({"--segmentation", "depth", "--poses", "gt"},
          "--poses gt are the poses of given ids, and --associate votes gives ids of its own");
  refuses({"--segmentation", "depth", "--method", "surfels"}, "which method 'surfels' has not");
  refuses({"--segmentation-config", "x.toml"},
          "--segmentation-config needs --segmentation depth or full");
  ASSERT_TRUE(WriteFile(folder_ / "segments.toml", "sigmas = -1\n").has_value());
  refuses({"--segmentation", "depth", "--segmentation-config", folder_ / "segments.toml"},
          "sigmas");
}

TEST_F(Unmasked, HaveNothingToRemove) {
  const fs::path recording = Recording();
  const CommandOutput output = Map(recording, "out", {"--remove", "background"});
  EXPECT_EQ(output.exit_code, kUsage);
  EXPECT_NE(output.err.find("--remove background has nothing to remove: " + kRemark),
            std::string::npos)
      << output.err;
}

TEST_F(Unmasked, AFewMissingMasksAreAnError) {
  test::BoxSource source(4);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder_ / "boxes").has_value());
  fs::remove(folder_ / "boxes/mask/0.033333.png");
  fs::remove(folder_ / "boxes/mask/0.066667.png");
  const CommandOutput output = Map(folder_ / "boxes", "out");
  EXPECT_EQ(output.exit_code, kData);
  EXPECT_NE(output.err.find("mask/0.033333.png: no such mask, though mask/ is there; expected one "
                            "for every frame"),
            std::string::npos)
      << output.err;
}

// Scores of objects ask which pixel shows which: models without masks give none.
TEST_F(Unmasked, ObjectsAreNotScored) {
  test::BoxSource source(4);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kBop, folder_ / "bop").has_value());
  fs::remove_all(folder_ / "bop/test/000000/mask");
  fs::remove_all(folder_ / "bop/test/000000/mask_visib");
  fs::create_directories(folder_ / "meshes");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"compare", folder_ / "bop", "--out", folder_ / "out"},
        std::vector<std::string>{"evaluate", folder_ / "bop", "--meshes", folder_ / "meshes",
                                 "--at", "2"}}) {
    const CommandOutput output = Run(command);
    EXPECT_EQ(output.exit_code, kData) << output.err;
    EXPECT_NE(output.err.find("bop: has no masks, expected one for each frame: scores of its 2 "
                              "objects need them; `tsdfpp map` maps it as background"),
              std::string::npos)
        << output.err;
  }
  const CommandOutput mapped = Map(folder_ / "bop", "mapped");
  EXPECT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_EQ(Stats("mapped")["segmentation"], "none");
}

}  // namespace
}  // namespace tsdfpp
