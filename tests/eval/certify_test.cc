// A sequence of ours is sound, and what is wrong with one that was tampered with is found and
// named, also where the hashes were made to fit.
#include "eval/make/certify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>

#include "core/files.h"
#include "core/ply.h"
#include "sequence/cofusion_layout.h"
#include "sequence/image_files.h"
#include "sequence/trajectory_file.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::TempFolder;

constexpr int kFrames = 6;
constexpr int kPixels = 128 * 96;

class Certification : public testing::Test {
 protected:
  // Made once, copied for each test.
  static void SetUpTestSuite() {
    original_ = fs::path(testing::TempDir()) / fmt::format("tsdfpp-certification-{}", getpid());
    fs::create_directories(original_);
    ASSERT_TRUE(WriteFile(original_ / "tiny.toml", test::TinyScene(kFrames)).has_value());
    const auto output = test::RunTsdfpp(
        {"generate", original_ / "tiny.toml", "--out", original_ / "set"}, original_);
    ASSERT_EQ(output.exit_code, 0) << output.err;
  }
  static void TearDownTestSuite() { fs::remove_all(original_); }
  void SetUp() override { fs::copy(original_ / "set", set_, fs::copy_options::recursive); }

  void SetUpAgain() {
    fs::remove_all(set_);
    SetUp();
  }

  std::vector<Finding> Findings(double share = 0) {
    const auto result = Certify(set_, {share, nullptr, {}});
    EXPECT_TRUE(result.has_value()) << result.error().message;
    return result ? result->findings : std::vector<Finding>{};
  }

  // Replaces a file and makes its hash fit.
  void Replace(const std::string& file, const std::string& bytes) {
    ASSERT_TRUE(WriteFile(set_ / file, bytes).has_value());
    auto record = ReadSequenceJson(set_ / cofusion::kSequence);
    ASSERT_TRUE(record.has_value());
    record->hashes[file] = HashText(bytes);
    ASSERT_TRUE(WriteFile(set_ / cofusion::kSequence, SequenceToJson(*record)).has_value());
  }
  std::string Bytes(const std::string& file) { return ReadFile(set_ / file).value(); }

  void MovePose(const std::string& file, int frame, const Eigen::Vector3d& by_m) {
    auto trajectory = ReadTrajectory(set_ / file);
    ASSERT_TRUE(trajectory.has_value());
    trajectory->at(frame).translation() += by_m;
    Replace(file, TrajectoryToText(*trajectory, "object"));
  }

  // (check, file, frame) of the findings, but for those that follow from them: what can be seen of
  // objects that moved.
  static std::set<std::tuple<std::string, std::string, int>> Named(
      const std::vector<Finding>& findings) {
    std::set<std::tuple<std::string, std::string, int>> named;
    for (const Finding& f : findings) {
      if (f.check != "visibility") named.emplace(f.check, f.subject, f.frame);
    }
    return named;
  }
  using Names = std::set<std::tuple<std::string, std::string, int>>;

  static fs::path original_;
  TempFolder folder_;
  fs::path set_ = folder_ / "set";
};
fs::path Certification::original_;

TEST_F(Certification, OurSequenceIsSound) {
  const auto result = Certify(set_, {1.0, nullptr, {}});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_TRUE(result->sound()) << CertifyText(*result);
  EXPECT_TRUE(result->notes.empty()) << CertifyText(*result);
  const Certificate& c = result->certificate;
  EXPECT_EQ(c.frames, kFrames);
  EXPECT_EQ(c.ray_frames, kFrames);
  EXPECT_EQ(c.model.checked + c.model.excluded, kFrames * kPixels);
  EXPECT_EQ(c.ray_depth.checked + c.ray_depth.excluded, kFrames * kPixels);
  EXPECT_GT(c.ray_depth.checked, 0.75 * kFrames * kPixels);
  EXPECT_LE(c.model.max_m, kModelLimit_m);
  EXPECT_LE(c.model.p99_m, c.model.max_m);
  EXPECT_GT(c.model.mean_m, 0);
  EXPECT_LT(c.model.mean_m, c.model.p99_m);
  // And generate wrote what it measured itself.
  const auto record = ReadSequenceJson(set_ / cofusion::kSequence);
  ASSERT_TRUE(record.has_value());
  ASSERT_TRUE(record->certificate.has_value());
  EXPECT_EQ(record->certificate->model, c.model);
  EXPECT_EQ(record->certificate->ray_frames, 2);
}

TEST_F(Certification, FindsSwappedMasks) {
  const std::string a = Bytes(cofusion::MaskFile(2));
  Replace(cofusion::MaskFile(2), Bytes(cofusion::MaskFile(5)));
  Replace(cofusion::MaskFile(5), a);
  const auto findings = Findings();
  EXPECT_EQ(Named(findings),
            (Names{{"mask", cofusion::MaskFile(2), 2}, {"mask", cofusion::MaskFile(5), 5}}));
}

TEST_F(Certification, FindsSwappedIds) {
  cv::Mat mask = ReadMask(set_ / cofusion::MaskFile(4), {}).value();
  for (auto& id : cv::Mat_<InstanceId>(mask)) {
    if (id != 0) id = static_cast<InstanceId>(3 - id);
  }
  Replace(cofusion::MaskFile(4), EncodeMask(mask, "").value());
  EXPECT_EQ(Named(Findings()), (Names{{"mask", cofusion::MaskFile(4), 4}}));
}

// A single pixel, which only the comparison of all of them can see.
TEST_F(Certification, FindsOneWrongMaskPixel) {
  cv::Mat mask = ReadMask(set_ / cofusion::MaskFile(4), {}).value();
  ASSERT_EQ(mask.at<InstanceId>(5, 5), kBackground);
  mask.at<InstanceId>(5, 5) = 1;
  Replace(cofusion::MaskFile(4), EncodeMask(mask, "").value());
  EXPECT_EQ(Named(Findings()), (Names{{"mask", cofusion::MaskFile(4), 4}}));
}

TEST_F(Certification, FindsPosesAMillimetreOff) {
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d::UnitX().eval(), Eigen::Vector3d::UnitY().eval(),
        Eigen::Vector3d::UnitZ().eval()}) {
    SetUpAgain();
    MovePose("trajectories/gt-car-1.txt", 3, 1e-3 * axis);
    EXPECT_EQ(Named(Findings()), (Names{{"pose", "trajectories/gt-car-1.txt", 3}}))
        << axis.transpose();
    SetUpAgain();
    MovePose(cofusion::kCameraTrajectory, 5, 1e-3 * axis);
    EXPECT_EQ(Named(Findings()), (Names{{"pose", cofusion::kCameraTrajectory, 5}}))
        << axis.transpose();
  }
}

TEST_F(Certification, FindsDepthInOtherUnits) {
  const cv::Mat depth = ReadDepth(set_ / cofusion::DepthFile(3), {}).value();
  for (const double factor : {10.0, 0.3048}) {
    Replace(cofusion::DepthFile(3), EncodeDepth(cv::Mat(depth * factor), "").value());
    const auto findings = Findings();
    EXPECT_EQ(Named(findings), (Names{{"depth", cofusion::DepthFile(3), 3}}));
    ASSERT_FALSE(findings.empty());
    EXPECT_NE(findings.front().sentence.find(fmt::format("{:.4g} times", factor)),
              std::string::npos)
        << findings.front().sentence;
  }
  // Millimetres are refused by the reader already.
  Replace(cofusion::DepthFile(3), EncodeDepth(cv::Mat(depth * 1000), "").value());
  const auto findings = Findings();
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].frame, 3);
  EXPECT_NE(findings[0].sentence.find("Depth0003.exr"), std::string::npos);
  EXPECT_NE(findings[0].sentence.find("millimetres"), std::string::npos);
}

TEST_F(Certification, FindsHolesAndNoise) {
  const cv::Mat depth = ReadDepth(set_ / cofusion::DepthFile(3), {}).value();
  cv::Mat changed = depth.clone();
  changed.at<float>(50, 60) = 0;
  Replace(cofusion::DepthFile(3), EncodeDepth(changed, "").value());
  EXPECT_EQ(Named(Findings()), (Names{{"depth", cofusion::DepthFile(3), 3}}));
  changed.at<float>(50, 60) = depth.at<float>(50, 60) + 2e-3F;
  Replace(cofusion::DepthFile(3), EncodeDepth(changed, "").value());
  EXPECT_EQ(Findings().size(), 1U);
  EXPECT_EQ(Findings()[0].frame, 3);
}

TEST_F(Certification, FindsDamagedFiles) {
  std::string bytes = Bytes(cofusion::ColourFile(2));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] + 1);
  ASSERT_TRUE(WriteFile(set_ / cofusion::ColourFile(2), bytes).has_value());
  fs::remove(set_ / cofusion::ModelFile({2, "mug", ""}));
  ASSERT_TRUE(WriteFile(set_ / "colour/notes.txt", "mine").has_value());
  const auto findings = Findings();
  const auto names = Named(findings);
  for (const std::string file : {"colour/Color0002.png", "models/mug-2.ply", "colour/notes.txt"}) {
    EXPECT_TRUE(names.contains({"files", file, -1})) << file;
  }
}

// With hashes that fit, what is in the file must tell.
TEST_F(Certification, FindsDamageThatTheHashesDoNotShow) {
  const std::string depth = Bytes(cofusion::DepthFile(2));
  Replace(cofusion::DepthFile(2), depth.substr(0, depth.size() / 2));
  auto findings = Findings();
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].frame, 2);
  EXPECT_NE(findings[0].sentence.find("Depth0002.exr"), std::string::npos);
  SetUpAgain();

  const std::string file = cofusion::ModelFile({2, "mug", ""});
  TrueModel model = ReadTrueModel(set_ / file, {2, "mug", "mug"}).value();
  for (Eigen::Vector3f& vertex : model.mesh_O.vertices) vertex *= 1.01F;
  ASSERT_TRUE(WriteTrueModel(set_ / file, model).has_value());
  Replace(file, Bytes(file));
  const auto names = Named(Findings());
  EXPECT_TRUE(names.contains({"scene", file, -1}));
  SetUpAgain();

  std::string csv = Bytes(cofusion::kVisibility);
  const std::size_t line = csv.find("\n4,1,");
  ASSERT_NE(line, csv.npos);
  csv = csv.substr(0, line + 5) + "1" + csv.substr(line + 5);
  Replace(cofusion::kVisibility, csv);
  findings = Findings();
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].check, "visibility");
  EXPECT_EQ(findings[0].frame, 4);
  SetUpAgain();

  auto trajectory = ReadTrajectory(set_ / cofusion::kCameraTrajectory);
  trajectory->erase(4);
  Replace(cofusion::kCameraTrajectory, TrajectoryToText(*trajectory, "camera"));
  EXPECT_TRUE(Named(Findings()).contains({"files", cofusion::kCameraTrajectory, 4}));
}

// What a sensor made of the frames is there for each of them, too.
TEST_F(Certification, FindsFramesThatWhatWasSensedLacks) {
  auto trajectory = ReadTrajectory(set_ / cofusion::kCameraTrajectory);
  ASSERT_TRUE(trajectory.has_value());
  const std::string file = cofusion::kSensedCameraTrajectory;
  Replace(file, TrajectoryToText(*trajectory, "camera"));
  EXPECT_EQ(Named(Findings()), Names{});
  const Pose pose = trajectory->at(4);
  trajectory->erase(4);
  trajectory->emplace(99, pose);
  Replace(file, TrajectoryToText(*trajectory, "camera"));
  EXPECT_EQ(Named(Findings()), (Names{{"files", file, 4}, {"files", file, 99}}));
  SetUpAgain();
  for (const int i : {1, 2, 3, 4, 6}) {
    Replace(cofusion::SensedMaskFile(i), Bytes(cofusion::MaskFile(i)));
  }
  EXPECT_EQ(Named(Findings()), (Names{{"files", cofusion::SensedMaskFile(5), 5}}));
}

// What sequence.json says is what its scene says, and its certificate is a sound one's.
TEST_F(Certification, FindsARecordThatIsNotTheScenes) {
  const struct {
    std::function<void(SequenceRecord&)> change;
    std::string check;
    std::string sentence;
  } cases[] = {
      {[](SequenceRecord& r) { r.info.name = "other"; }, "scene",
       "'scene' is other, scene.toml says tiny"},
      {[](SequenceRecord& r) { r.info.rate_hz = 30; }, "scene",
       "'rate_hz' is 30, scene.toml says 10"},
      {[](SequenceRecord& r) {
         r.info.reveal = RevealPlan{4, {1}};
       },
       "scene", "'reveal' is frame 4 without objects 1, scene.toml says none"},
      {[](SequenceRecord& r) { r.info.mask_ids_are_objects = false; }, "scene",
       "'mask_ids' is frame, scene.toml says objects"},
      {[](SequenceRecord& r) { r.generator.seed = 5; }, "scene", "'seed' is 5, scene.toml says 1"},
      {[](SequenceRecord& r) { r.generator.sensor = "kinect"; }, "scene",
       "'sensor' is kinect, scene.toml says exact"},
      {[](SequenceRecord& r) { r.info.objects.back().semantic_class = "bus"; }, "scene",
       "object 2 is 'mug' of class 'bus', scene.toml says 'mug' of class 'mug'"},
      {[](SequenceRecord& r) { r.certificate->wrong_ids = 7; }, "certificate",
       "its certificate says 7 wrong ids, expected none"},
      {[](SequenceRecord& r) { r.certificate->model.violations = 3; }, "certificate",
       "its certificate says 3 pixels beyond the limits, expected none"},
      {[](SequenceRecord& r) { r.certificate->frames = 2; }, "certificate",
       "its certificate says 2 frames, the sequence has 6"},
  };
  const SequenceRecord sound = ReadSequenceJson(set_ / cofusion::kSequence).value();
  for (const auto& [change, check, sentence] : cases) {
    SequenceRecord record = sound;
    change(record);
    ASSERT_TRUE(WriteFile(set_ / cofusion::kSequence, SequenceToJson(record)).has_value());
    const auto findings = Findings();
    ASSERT_EQ(findings.size(), 1U) << sentence;
    EXPECT_EQ(findings[0].check, check);
    EXPECT_EQ(findings[0].subject, cofusion::kSequence);
    EXPECT_EQ(findings[0].sentence, sentence);
  }
}

// A scene that cannot be composed again proves nothing.
TEST_F(Certification, FindsADamagedScene) {
  const std::string scene = Bytes(cofusion::kScene);
  for (const std::string& damaged : {scene.substr(0, scene.size() / 2), std::string("no TOML"),
                                     std::string(), "extra = 1\n" + scene}) {
    Replace(cofusion::kScene, damaged);
    const auto findings = Findings();
    EXPECT_EQ(Named(findings), (Names{{"scene", cofusion::kScene, -1}}));
    ASSERT_FALSE(findings.empty());
    EXPECT_NE(findings[0].sentence.find("cannot be composed again"), std::string::npos);
  }
}

// The scene of a sequence is data: its files are those of the sequence, and no other is opened.
TEST_F(Certification, TheSceneLeadsNowhereElse) {
  const std::string scene = Bytes(cofusion::kScene);
  const std::size_t at = scene.find("model = '");
  ASSERT_NE(at, std::string::npos) << scene;
  const std::size_t end = scene.find('\'', at + 9);
  ASSERT_TRUE(WriteFile(folder_ / "far.obj", "f SECRET\n").has_value());
  ASSERT_TRUE(WriteFile(set_ / "near.obj", "f SECRET\n").has_value());
  for (const std::string& file : {(folder_ / "far.obj").string(), std::string("../far.obj"),
                                  std::string("inputs/0/../../../far.obj"), std::string("near.obj"),
                                  std::string("/etc/none.obj")}) {
    Replace(cofusion::kScene, scene.substr(0, at) + "model = '" + file + scene.substr(end));
    std::string said;
    for (const Finding& finding : Findings()) said += finding.sentence + "\n";
    EXPECT_NE(said.find("expected inputs/<number>/<file> beside the scene"), std::string::npos)
        << said;
    EXPECT_EQ(said.find("SECRET"), std::string::npos) << said;
  }
}

TEST_F(Certification, TheRaysFindItToo) {
  cv::Mat mask = ReadMask(set_ / cofusion::MaskFile(1), {}).value();
  mask.setTo(0, mask == 1);
  Replace(cofusion::MaskFile(1), EncodeMask(mask, "").value());
  cv::Mat depth = ReadDepth(set_ / cofusion::DepthFile(kFrames), {}).value();
  depth += cv::Scalar(kRayLimit_m * 1.5);
  Replace(cofusion::DepthFile(kFrames), EncodeDepth(depth, "").value());
  const auto names = Named(Findings());
  EXPECT_TRUE(names.contains({"rays", cofusion::MaskFile(1), 1}));
  EXPECT_TRUE(names.contains({"rays", cofusion::DepthFile(kFrames), kFrames}));
}

TEST_F(Certification, WhatIsNoSequenceIsRefused) {
  const auto nothing = Certify(folder_ / "none", {});
  ASSERT_FALSE(nothing.has_value());
  EXPECT_EQ(nothing.error().kind, ErrorKind::kUsage);
  fs::remove(set_ / cofusion::kSequence);
  const auto foreign = Certify(set_, {});
  ASSERT_FALSE(foreign.has_value());
  EXPECT_EQ(foreign.error().kind, ErrorKind::kData);
}

TEST_F(Certification, TheCommandSaysWhatItFound) {
  auto output = test::RunTsdfpp({"verify", set_, "--all", "--json"}, folder_.path());
  EXPECT_EQ(output.exit_code, 0) << output.err;
  auto json = nlohmann::json::parse(output.out, nullptr, false);
  ASSERT_TRUE(json.is_object()) << output.out;
  EXPECT_EQ(json["sound"], true);
  EXPECT_EQ(json["ray_frames"].size(), static_cast<std::size_t>(kFrames));
  MovePose("trajectories/gt-car-1.txt", 3, {1e-3, 0, 0});
  output = test::RunTsdfpp({"verify", set_, "--json"}, folder_.path());
  EXPECT_EQ(output.exit_code, 4);
  EXPECT_NE(output.err.find("trajectories/gt-car-1.txt, frame 3"), std::string::npos) << output.err;
  json = nlohmann::json::parse(output.out, nullptr, false);
  ASSERT_TRUE(json.is_object()) << output.out;
  EXPECT_EQ(json["sound"], false);
  EXPECT_EQ(json["findings"][0]["file"], "trajectories/gt-car-1.txt");
}

TEST(SpreadFrames, AreEvenAndHoldBothEnds) {
  EXPECT_EQ(SpreadFrames(1, 480, 0.0), (std::vector<int>{1, 480}));
  EXPECT_EQ(SpreadFrames(0, 1, 0.5), (std::vector<int>{0}));
  EXPECT_EQ(SpreadFrames(1, 5, 0.5), (std::vector<int>{1, 3, 5}));
  const auto all = SpreadFrames(7, 30, 1.0);
  ASSERT_EQ(all.size(), 30U);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(all[static_cast<std::size_t>(i)], 7 + i);
}

TEST(ResidualMeter, CountsLikeASortedList) {
  ResidualMeter a(1.0);
  ResidualMeter b(1.0);
  for (int i = 1; i <= 500; ++i) (i % 2 == 0 ? a : b).Add(i / 1000.0);
  b.Exclude(3);
  a.Merge(b);
  const Residual r = a.Result();
  EXPECT_EQ(r.checked, 500);
  EXPECT_EQ(r.excluded, 3);
  EXPECT_EQ(r.violations, 0);
  EXPECT_NEAR(r.mean_m, 0.2505, 1e-12);
  EXPECT_DOUBLE_EQ(r.max_m, 0.5);
  // The 495th of 500 is 0.495; a two-hundredth of the limit is 0.005.
  EXPECT_GE(r.p99_m, 0.495);
  EXPECT_LE(r.p99_m, 0.5);
  a.Add(7.0);
  EXPECT_EQ(a.Result().violations, 1);
  EXPECT_DOUBLE_EQ(a.Result().max_m, 7.0);
}

}  // namespace
}  // namespace tsdfpp
