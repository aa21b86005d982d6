// `--camera` of map and compare: what it finds, what it leaves behind, and what it refuses.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "core/files.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kUsage;

constexpr const char* kFrames = "4";
// Of the camera's true path, which scenes have: a third of a voxel.
constexpr double kMost_m = 0.003;

class CameraCommand : public testing::Test {
 protected:
  // scenes/mini.toml, small; rendered once for all tests.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TempFolder>();
    const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
    const CommandOutput made = test::RunTsdfpp(
        {"generate", scene, "--no-antialias", "--out", Sequence()}, folder_->path());
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static fs::path Sequence() { return *folder_ / "mini"; }
  static CommandOutput Run(const std::vector<std::string>& arguments) {
    return test::RunTsdfpp(arguments, folder_->path());
  }
  // The set in another dataset's format.
  static fs::path Exported(const std::string& format) {
    fs::path folder = *folder_ / (format + "-set");
    if (fs::exists(folder)) return folder;
    const CommandOutput made = Run({"export", Sequence(), "--to", format, "--out", folder});
    EXPECT_EQ(made.exit_code, 0) << made.err;
    return folder;
  }
  static std::unique_ptr<test::TempFolder> folder_;
};

std::unique_ptr<test::TempFolder> CameraCommand::folder_;

TEST_F(CameraCommand, MapWritesWhereTheCameraWas) {
  const fs::path out = *folder_ / "map";
  const CommandOutput run =
      Run({"map", Sequence(), "--camera", "track", "--until", kFrames, "--out", out});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto stats = nlohmann::json::parse(std::ifstream(out / "stats.json"));
  EXPECT_EQ(stats["camera"], "track");
  EXPECT_EQ(stats["camera_frames"]["located"], 3);
  EXPECT_EQ(stats["camera_frames"]["lost"], 0);
  EXPECT_TRUE(stats["times"].contains("locate"));
  EXPECT_TRUE(fs::exists(out / "trajectories/camera.txt"));
  const CommandOutput again = Run({"map", Sequence(), "--until", kFrames, "--out", out});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_FALSE(fs::exists(out / "trajectories/camera.txt"));
}

TEST_F(CameraCommand, CompareScoresIt) {
  const fs::path out = *folder_ / "compared";
  const CommandOutput run =
      Run({"compare", Sequence(), "--camera", "track", "--methods", "tsdf++/anchored", "--profiles",
           "close", "--until", kFrames, "--out", out});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto summary = nlohmann::json::parse(std::ifstream(out / "summary.json"));
  const auto& camera = summary["runs"][0]["camera"];
  EXPECT_EQ(camera["source"], "track");
  EXPECT_EQ(camera["located"], 3);
  EXPECT_LT(camera["translation_rmse_m"].get<double>(), kMost_m);
  EXPECT_TRUE(camera.contains("rotation_rmse_deg"));
  EXPECT_NE(summary["command"].get<std::string>().find("--camera track"), std::string::npos);
}

TEST_F(CameraCommand, RefusesWhatDoesNotGoTogether) {
  const fs::path out = *folder_ / "out";
  const auto refuses = [&](std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.end(), {"--out", out});
    const CommandOutput run = Run(arguments);
    EXPECT_EQ(run.exit_code, kUsage) << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(out));
  };
  refuses({"map", Sequence(), "--camera", "vicon"}, "--camera");
  refuses({"map", Sequence(), "--camera", "refine", "--method", "surfels"}, "'surfels'");
  refuses({"compare", Sequence(), "--camera", "track", "--methods", "tsdf,surfels"}, "'surfels'");
  const fs::path saved = *folder_ / "saved.map";
  ASSERT_EQ(Run({"map", Sequence(), "--until", "2", "--out", *folder_ / "two", "--save", saved})
                .exit_code,
            0);
  refuses({"map", "--load", saved, "--camera", "track"}, "--camera track needs a sequence");
}

// A loaded map has a background from the first frame on.
TEST_F(CameraCommand, GoesOnWithALoadedMap) {
  const fs::path saved = *folder_ / "half.map";
  ASSERT_EQ(Run({"map", Sequence(), "--until", "3", "--out", *folder_ / "half", "--save", saved})
                .exit_code,
            0);
  const fs::path out = *folder_ / "rest";
  const CommandOutput run =
      Run({"map", Sequence(), "--load", saved, "--camera", "refine", "--until", "6", "--out", out});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto stats = nlohmann::json::parse(std::ifstream(out / "stats.json"));
  EXPECT_EQ(stats["camera_frames"]["located"], 3);
}

// Where the camera was in the last frame of a trajectory's file.
Eigen::Vector3d LastPlace(const fs::path& file) {
  std::ifstream lines(file);
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (std::string line; std::getline(lines, line);) {
    std::istringstream numbers(line);
    double frame = 0;
    Eigen::Vector3d read;
    if (numbers >> frame >> read.x() >> read.y() >> read.z()) place = read;
  }
  return place;
}

// A recording without poses: after 23 frames the camera is far from where it began.
TEST_F(CameraCommand, GoesOnWhereTheCameraWasFound) {
  const fs::path fixed = *folder_ / "fixed";
  fs::copy(Exported("tum"), fixed, fs::copy_options::recursive);
  fs::remove(fixed / "groundtruth.txt");
  const fs::path saved = *folder_ / "found.map";
  const auto map = [&](const std::string& out, std::vector<std::string> more) {
    more.insert(more.begin(), {"map", fixed, "--fixed-camera", "--out", *folder_ / out});
    const CommandOutput run = Run(more);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.err;
  };
  map("one", {"--camera", "track", "--until", "26"});
  map("begun", {"--camera", "track", "--until", "24", "--save", saved});
  map("gone-on", {"--camera", "track", "--load", saved, "--until", "26"});
  const Eigen::Vector3d one = LastPlace(*folder_ / "one/trajectories/camera.txt");
  EXPECT_GT(one.norm(), 0.1);
  EXPECT_LT((LastPlace(*folder_ / "gone-on/trajectories/camera.txt") - one).norm(), kMost_m);
  EXPECT_NE(map("given", {"--load", saved, "--until", "25"})
                .find("its camera was found by the map; from frame 25 on it is where it is given"),
            std::string::npos);
}

// Sequences of one name with other images.
TEST_F(CameraCommand, AnotherRecordingIsNotTheMaps) {
  const fs::path saved = *folder_ / "two.map";
  const auto go_on = [&](const fs::path& sequence, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"map",     sequence, "--load", saved,
                                       "--until", "4",      "--out",  *folder_ / "other-out"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  };
  ASSERT_EQ(Run({"map", Sequence(), "--until", "2", "--out", *folder_ / "two", "--save", saved})
                .exit_code,
            0);
  const std::string words = "frame 2 of mini has another depth image than the map was made of";
  const CommandOutput same = go_on(Sequence());
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_EQ(same.err.find(words), std::string::npos) << same.err;
  const fs::path other = *folder_ / "other/mini";
  fs::create_directories(other.parent_path());
  fs::copy(Sequence(), other, fs::copy_options::recursive);
  fs::copy_file(other / "depth_original/Depth0007.exr", other / "depth_original/Depth0002.exr",
                fs::copy_options::overwrite_existing);
  const CommandOutput shifted = go_on(other);
  EXPECT_EQ(shifted.exit_code, 0) << shifted.err;
  EXPECT_NE(shifted.err.find(words), std::string::npos) << shifted.err;
}

// Images of one name by another lens.
TEST_F(CameraCommand, AnotherLensIsNotTheMaps) {
  const fs::path set = Exported("tum");
  const fs::path saved = *folder_ / "lens.map";
  ASSERT_EQ(
      Run({"map", set, "--until", "2", "--out", *folder_ / "lens", "--save", saved}).exit_code, 0);
  const auto go_on = [&](const std::string& lens) {
    std::ofstream(*folder_ / "lens.txt") << lens;
    return Run({"map", set, "--load", saved, "--calibration", *folder_ / "lens.txt", "--until", "4",
                "--out", *folder_ / "lens-out"});
  };
  const CommandOutput other = go_on("188.2 188.1 160 90");
  EXPECT_EQ(other.exit_code, kUsage);
  EXPECT_NE(other.err.find("is a map of images of 320x180 (fx 188.1, fy 188.1, cx 160, cy 90), "
                           "expected one of " +
                           set.string() + ", whose are 320x180 (fx 188.2,"),
            std::string::npos)
      << other.err;
  const CommandOutput rounded = go_on("188.101 188.1 160 90");
  EXPECT_EQ(rounded.exit_code, 0) << rounded.err;
}

// The pictures of --views have the lens of the last frame, where each has its own: here its image
// is that of the first one's, moved.
TEST_F(CameraCommand, ViewsHaveTheLensOfTheLastFrame) {
  constexpr int kShift_px = 40;
  const fs::path set = *folder_ / "lenses";
  fs::copy(Exported("bop"), set, fs::copy_options::recursive);
  const fs::path scene = set / "test/000000";
  // It adds nothing to the map.
  const fs::path depth = scene / "depth/000002.png";
  cv::Mat nothing = cv::imread(depth.string(), cv::IMREAD_UNCHANGED);
  nothing.setTo(0);
  ASSERT_TRUE(cv::imwrite(depth.string(), nothing));
  const auto view = [&](const std::string& out) {
    const CommandOutput run =
        Run({"map", set, "--unchecked", "--until", "2", "--views", "1", "--out", *folder_ / out});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return cv::imread((*folder_ / out / "views/id-1.png").string(), cv::IMREAD_UNCHANGED);
  };
  const cv::Mat before = view("one-lens");
  auto cameras = nlohmann::json::parse(std::ifstream(scene / "scene_camera.json"));
  auto& centre = cameras["2"]["cam_K"][2];
  centre = centre.get<double>() + kShift_px;
  std::ofstream(scene / "scene_camera.json") << cameras;
  const cv::Mat after = view("two-lenses");
  ASSERT_EQ(before.size(), after.size());
  ASSERT_FALSE(before.empty());
  const cv::Mat moved = after.colRange(kShift_px, after.cols);
  const int other = cv::countNonZero(before.colRange(0, after.cols - kShift_px) != moved);
  EXPECT_LT(other, static_cast<int>(moved.total()) / 100);
  EXPECT_GT(cv::countNonZero(before != after), static_cast<int>(moved.total()) / 100);
}

// Where no frame shows the room, the camera is where it was found last, and not where it is given.
TEST_F(CameraCommand, ViewsAreOfACameraThatWasFound) {
  const fs::path set = Exported("tum");
  const fs::path roomless = *folder_ / "roomless" / set.filename();
  fs::create_directories(roomless.parent_path());
  fs::copy(set, roomless, fs::copy_options::recursive);
  for (const auto& image : fs::directory_iterator(roomless / "mask")) {
    cv::Mat mask = cv::imread(image.path().string(), cv::IMREAD_UNCHANGED);
    mask.setTo(1);
    ASSERT_TRUE(cv::imwrite(image.path().string(), mask));
  }
  const auto map = [&](const fs::path& sequence, const std::string& out,
                       std::vector<std::string> more) {
    more.insert(more.begin(),
                {"map", sequence, "--camera", "track", "--views", "1", "--out", *folder_ / out});
    const CommandOutput run = Run(more);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.err;
  };
  const std::string remark = "--views 1: writes none, as the camera was found in no frame";
  EXPECT_NE(map(roomless, "nowhere", {"--until", "2"}).find(remark), std::string::npos);
  EXPECT_FALSE(fs::exists(*folder_ / "nowhere/views"));
  const fs::path saved = *folder_ / "seen.map";
  map(set, "seen", {"--until", "2", "--save", saved});
  map(roomless, "seen-last", {"--load", saved, "--until", "9"});
  for (const char* view : {"views/id-1.png", "views/colour-1.png"}) {
    const auto bytes = ReadFile(*folder_ / "seen" / view);
    ASSERT_TRUE(bytes.has_value());
    EXPECT_TRUE(*bytes == ReadFile(*folder_ / "seen-last" / view)) << view;
  }
}

}  // namespace
}  // namespace tsdfpp
