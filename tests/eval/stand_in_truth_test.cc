// The paper's experiment on a set of somebody else's: ToyCar3's layout, names and quirks, written
// from our renderer's frames with OpenCV alone, so that the stand-in can be held against the truth.
#include "eval/truth/stand_in_truth.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgproc.hpp>

#include "core/pose_text.h"
#include "eval/compare/compare.h"
#include "eval/run/open_source.h"
#include "metrics/mesh_tools.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"
#include "tests/sequence/foreign_set.h"

namespace tsdfpp {
namespace {

using test::BoxSource;
using test::TempFolder;
namespace fs = std::filesystem;

TEST(PaperPlan, RevealsWhatIsUnderTheCarsAtFrame256) {
  SequenceInfo info;
  info.first_index = 1;
  info.frame_count = 480;
  info.objects = {{0, "background", "background"},
                  {1, "truck", "truck"},
                  {2, "car", "car"},
                  {7, "object7", ""}};
  EXPECT_EQ(PaperPlan(info), (RevealPlan{256, {1, 2}}));
  info.frame_count = 100;
  EXPECT_EQ(PaperPlan(info).frame, 100);
}

// A pixel of the 64x48 images is 25 mm wide on the wall: a surface is known to half of it, times
// its slope, and goes on by half of it (18 mm across) at its edges.
constexpr double kStandInVoxel_m = 0.01;

TEST(StandInTruth, LiesOnTheTrueSurfaces) {
  BoxSource source;
  const auto models = ReconstructTruth(source, kStandInVoxel_m);
  ASSERT_TRUE(models.has_value()) << models.error().message;
  ASSERT_EQ(models->size(), 3U);
  const auto truth = source.Truth();
  for (std::size_t o = 0; o < 3; ++o) {
    const TrueModel& model = (*models)[o];
    EXPECT_EQ(model.info, (*truth)[o].info);
    EXPECT_EQ(model.face_region.size(), model.mesh_O.triangles.size());
    ASSERT_GT(SurfaceArea(model.mesh_O), 0.005);
    // A box moves or is seen from a side, yet in its own frame its faces are where they are.
    const SurfaceIndex index((*truth)[o].mesh_O);
    const NearestSurface nearest = index.Nearest(model.mesh_O.vertices);
    std::vector<float> distances = nearest.distance_m;
    std::sort(distances.begin(), distances.end());
    EXPECT_LT(static_cast<double>(distances[distances.size() * 9 / 10]), kStandInVoxel_m)
        << model.info.name;
    EXPECT_LT(static_cast<double>(distances.back()), 2 * kStandInVoxel_m) << model.info.name;
  }
}

TEST(StandInTruth, FramesWithoutAPoseDoNotCountForTheObject) {
  BoxSource source;
  // The right box has no pose in any frame but the last: it is where that pose says.
  class Gaps : public BoxSource {
   public:
    Expected<Frame> Read(int index) override {
      auto frame = BoxSource::Read(index);
      if (index < 5) frame->T_WO.erase(8);
      return frame;
    }
  } gaps;
  const auto models = ReconstructTruth(gaps, kStandInVoxel_m);
  ASSERT_TRUE(models.has_value());
  ASSERT_EQ(models->size(), 3U);
  const SurfaceIndex index((*source.Truth())[2].mesh_O);
  const NearestSurface nearest = index.Nearest((*models)[2].mesh_O.vertices);
  for (const float distance : nearest.distance_m) {
    EXPECT_LT(static_cast<double>(distance), 2 * kStandInVoxel_m);
  }
}

// A truck and a car cross a table for 258 frames, in small images.
std::string Scene() {
  return R"(name = "toycars"
purpose = "Two toys drive over a table, in small images."
frames = 258
rate_hz = 30
[camera]
width = 120
height = 68
f = 88.0
cx = 59.5
cy = 33.5
target = [0.0, 0.0, 0.74]
azimuth_deg = [-112.0, -92.0, -70.0]
radius_m = [0.95, 0.90, 0.95]
height_m = [0.62, 0.68, 0.62]
[[object]]
name = "truck"
id = 1
class = "truck"
model = "truck"
x = -0.30
y = -0.16
yaw_deg = -10
[object.drive]
start_frame = 10
end_frame = 250
x = [0.02, 0.28]
y = [-0.16, 0.08]
[[object]]
name = "car"
id = 2
class = "car"
model = "car"
x = 0.25
y = -0.20
yaw_deg = 170
[object.drive]
start_frame = 10
end_frame = 250
x = [0.0, -0.25]
y = [0.16, 0.10]
[experiment]
reveal_frame = 256
removed = ["truck", "car"]
)";
}

// As the real set: no sequence.json, no models, no size in the calibration; frames from 1 on; depth
// as EXR with three equal channels; masks as RGB; a trajectory that lacks frames.
void WriteToyCar3(FrameSource& source, const fs::path& set) {
  const Intrinsics& k = source.info().intrinsics;
  ASSERT_TRUE(
      WriteFile(set / "calibration.txt", fmt::format("{} {} {} {}\n", k.fx, k.fy, k.cx, k.cy))
          .has_value());
  std::map<std::string, std::string> trajectories;
  for (int i = 1; i <= source.info().frame_count; ++i) {
    const auto frame = source.Read(i);
    ASSERT_TRUE(frame.has_value()) << frame.error().message;
    const std::string number = fmt::format("{:04d}", i);
    cv::Mat bgr;
    cv::cvtColor(frame->colour, bgr, cv::COLOR_RGB2BGR);
    test::WriteImage(set / ("colour/Color" + number + ".png"), bgr);
    test::WriteImage(set / ("depth_original/Depth" + number + ".exr"),
                     test::ThreeTimes(frame->depth));
    cv::Mat mask;
    frame->mask.convertTo(mask, CV_8UC1);
    test::WriteImage(set / ("mask_id/Mask" + number + ".png"), test::ThreeTimes(mask));
    trajectories["gt-cam-0"] += fmt::format("{} {}\n", i, PoseToText(frame->T_WC));
    if (i < 60 || i > 70) {  // while it is in view, too
      trajectories["gt-truck-1"] += fmt::format("{} {}\n", i, PoseToText(frame->T_WO.at(1)));
    }
    trajectories["gt-car-2"] += fmt::format("{} {}\n", i, PoseToText(frame->T_WO.at(2)));
  }
  for (const auto& [name, text] : trajectories) {
    ASSERT_TRUE(WriteFile(set / "trajectories" / (name + ".txt"), text).has_value());
  }
}

// The stand-in is itself made of voxels; how much that may change the share that is kept.
constexpr double kStandInShare = 0.1;

TEST(CompareDataset, ReproducesTheFigureOnAForeignSet) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "scene.toml", Scene()).has_value());
  auto scene = OpenSource(folder / "scene.toml");
  ASSERT_TRUE(scene.has_value()) << scene.error().message;
  WriteToyCar3(**scene, folder / "car4-full");
  const std::vector<std::string> options{"--methods", "tsdf,tsdf++", "--profiles",
                                         "paper",     "--voxel",     "0.02",
                                         "--every",   "1000",        "--json"};
  const auto compare = [&](const std::string& what, const std::string& out,
                           std::vector<std::string> words) {
    words.insert(words.begin(), {"compare", what, "--out", out});
    words.insert(words.end(), options.begin(), options.end());
    const auto command = test::RunTsdfpp(words, folder.path());
    EXPECT_EQ(command.exit_code, 0) << command.err;
    return nlohmann::json::parse(command.out, nullptr, false);
  };
  const nlohmann::json foreign =
      compare(folder / "car4-full", folder / "foreign", {"--dataset", "cofusion"});
  const nlohmann::json known = compare(folder / "scene.toml", folder / "known", {});
  ASSERT_FALSE(foreign.is_discarded());
  ASSERT_FALSE(known.is_discarded());
  EXPECT_EQ(foreign.at("reveal_frame"), 256);
  EXPECT_EQ(foreign.at("removed"), nlohmann::json({1, 2}));
  EXPECT_NE(foreign.at("truth").get<std::string>().find("no true surfaces"), std::string::npos);
  EXPECT_FALSE(known.contains("truth"));
  const std::string report = ReadFile(folder / "foreign/report.html").value_or("");
  EXPECT_NE(report.find("no true surfaces"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder / "foreign/figure-paper-gt.png"));
  const auto kept = [](const nlohmann::json& summary, std::size_t run) {
    return summary.at("runs")[run]
        .at("examined")
        .at("objects")[0]
        .at("preservation_behind_other")
        .get<double>();
  };
  for (std::size_t run = 0; run < 2; ++run) {
    EXPECT_NEAR(kept(foreign, run), kept(known, run), kStandInShare) << run;
  }
  EXPECT_GT(kept(foreign, 1), kept(foreign, 0));
}

TEST(CompareDataset, AnotherPlanMayBeTyped) {
  const TempFolder folder;
  const std::string mini = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
  auto command =
      test::RunTsdfpp({"compare", mini, "--out", folder / "out", "--methods", "tsdf", "--profiles",
                       "close", "--reveal", "3", "--removed", "house", "--json"},
                      folder.path());
  ASSERT_EQ(command.exit_code, 0) << command.err;
  const auto summary = nlohmann::json::parse(command.out);
  EXPECT_EQ(summary.at("reveal_frame"), 3);
  EXPECT_EQ(summary.at("last_frame"), 3);
  EXPECT_EQ(summary.at("removed"), nlohmann::json({2}));
  command =
      test::RunTsdfpp({"compare", mini, "--out", folder / "out", "--reveal", "99"}, folder.path());
  EXPECT_EQ(command.exit_code, 2);
  EXPECT_NE(command.err.find("--reveal 99 is out of range: mini has frames 1 to 48"),
            std::string::npos)
      << command.err;
  command =
      test::RunTsdfpp({"compare", mini, "--out", folder / "out", "--removed", "0"}, folder.path());
  EXPECT_EQ(command.exit_code, 2);
  EXPECT_NE(command.err.find("cannot be removed"), std::string::npos) << command.err;
}

}  // namespace
}  // namespace tsdfpp
