// Files of any mapper against the truth: closed forms on a wall with two boxes, what is said of
// meshes that fit badly, and the same numbers as `compare`. Longer than most files: each file that
// fits badly has a case.
#include "eval/score/evaluate_meshes.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "core/files.h"
#include "core/pose_text.h"
#include "eval/compare/compare.h"
#include "eval/run/open_source.h"
#include "eval/score/surface_file.h"
#include "metrics/mesh_tools.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/box_meshes.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::At;
using test::BoxSource;
using test::ErrorOf;
using test::Evaluated;
using test::kLast;
using test::kLeft;
using test::kRight;
using test::kRounding_m;
using test::Moved;
using test::Of;
using test::Put;
using test::PutNamed;
using test::Says;
using test::SceneOf;
using test::Scores;
using test::TempFolder;
using test::TruthMeshes;

TEST(EvaluateMeshes, TheTruthScoresFull) {
  const TempFolder folder;
  BoxSource source;
  PutNamed(folder / "m", TruthMeshes(source));
  const EvaluateResult result = Evaluated(At(folder / "m"));
  ASSERT_EQ(result.frames.size(), 1U);
  EXPECT_TRUE(result.frames[0].remarks.empty()) << result.frames[0].remarks.front();
  ASSERT_EQ(result.frames[0].matches.size(), 3U);
  for (const PartMatch& match : result.frames[0].matches) {
    EXPECT_EQ(match.how, "name") << match.part.source;
    EXPECT_EQ(match.object, match.part.id);
  }
  for (const InstanceId id : {kBackground, kLeft, kRight}) {
    const ObjectScores& scores = Of(result, id);
    EXPECT_EQ(scores.preserved.completion.value, 1.0) << id;
    EXPECT_EQ(scores.label_purity.value, 1.0) << id;
    EXPECT_LT(*scores.accuracy.distance.mean_m.value, kRounding_m) << id;
  }
  EXPECT_EQ(result.frames[0].evaluation.visible_completion.value, 1.0);
  EXPECT_EQ(result.frames[0].evaluation.ghost_area_m2, 0);
}

TEST(EvaluateMeshes, AnOffsetIsMeasuredAsItIs) {
  const TempFolder folder;
  BoxSource source;
  auto meshes = TruthMeshes(source);
  constexpr float kOffset_m = 0.007F;  // between half a voxel and a voxel
  meshes[kBackground] = Moved(meshes[kBackground], {0, 0, -kOffset_m});
  PutNamed(folder / "m", meshes);
  const EvaluateResult result = Evaluated(At(folder / "m"));
  const ObjectScores& wall = Of(result, kBackground);
  EXPECT_EQ(wall.recall[0].value, 0.0);
  EXPECT_EQ(wall.recall[1].value, 1.0);
  EXPECT_NEAR(*wall.accuracy.distance.mean_m.value, kOffset_m, kRounding_m);
  EXPECT_NEAR(*wall.completion.mean_m.value, kOffset_m, kRounding_m);
  EXPECT_EQ(Of(result, kLeft).recall[0].value, 1.0);
}

TEST(EvaluateMeshes, HalfOfAnObjectIsHalfSeen) {
  const TempFolder folder;
  BoxSource source;
  auto meshes = TruthMeshes(source);
  // The wall's left half, world x < 0.
  meshes[kBackground].vertices = {{-3, -3, 1.5F}, {0, -3, 1.5F}, {0, 3, 1.5F}, {-3, 3, 1.5F}};
  PutNamed(folder / "m", meshes);
  const EvaluateResult result = Evaluated(At(folder / "m"));
  // The share of what was seen is counted independently, on the tracker's own samples.
  auto truth = SceneTruth::Create(source, result.config.truth);
  ASSERT_TRUE(truth.has_value());
  for (int i = 0; i <= kLast; ++i) ASSERT_TRUE(truth->Observe(*source.Read(i)).has_value());
  const SeenTracker& wall = truth->trackers().front();
  int seen = 0;
  int in_half = 0;
  for (std::size_t i = 0; i < wall.samples_O().size(); ++i) {
    if (!wall.Seen(i)) continue;
    ++seen;
    // A voxel beyond its edge counts as there.
    if (wall.samples_O().points[i].x() <= 0.01F) ++in_half;
  }
  ASSERT_GT(in_half, 0);
  ASSERT_LT(in_half, seen);
  EXPECT_NEAR(*Of(result, kBackground).preserved.completion.value,
              static_cast<double>(in_half) / seen, 1e-6);
}

TEST(EvaluateMeshes, PartsWithoutNamesAreMatchedByOverlap) {
  const TempFolder folder;
  BoxSource source;
  const auto meshes = TruthMeshes(source);
  PutNamed(folder / "named", meshes);
  const EvaluateResult named = Evaluated(At(folder / "named"));
  Put(folder / "m/a.ply", meshes.at(kRight));
  Put(folder / "m/b.ply", meshes.at(kLeft));
  Put(folder / "m/wall.ply", meshes.at(kBackground));
  // A part that is on nothing is no object, and counts as a ghost alone.
  Put(folder / "m/z.ply", Moved(meshes.at(kLeft), {0, 0, -0.5F}));
  const EvaluateResult result = Evaluated(At(folder / "m"));
  ASSERT_EQ(result.frames[0].matches.size(), 4U);
  const std::vector<InstanceId> objects{kRight, kLeft, kBackground, kNoInstance};
  for (std::size_t p = 0; p < 4; ++p) {
    EXPECT_EQ(result.frames[0].matches[p].object, objects[p]);
    EXPECT_EQ(result.frames[0].matches[p].how, p < 3 ? "overlap" : "nothing");
  }
  EXPECT_EQ(result.frames[0].matches[0].share.value, 1.0);
  EXPECT_EQ(Of(result, kRight).preserved.completion.value, 1.0);
  EXPECT_EQ(Of(result, kRight).accuracy.distance.mean_m.value,
            Of(named, kRight).accuracy.distance.mean_m.value);
  EXPECT_GT(result.frames[0].evaluation.ghost_area_m2, 0.01);
  EXPECT_NE(EvaluateTable(result).find("a.ply is right (8) (by overlap"), std::string::npos)
      << EvaluateTable(result);
}

TEST(EvaluateMeshes, SwappedNamesAreSaidAndCanBeOverruled) {
  const TempFolder folder;
  BoxSource source;
  auto meshes = TruthMeshes(source);
  std::swap(meshes[kLeft], meshes[kRight]);
  PutNamed(folder / "m", meshes);
  EvaluateConfig config = At(folder / "m");
  const EvaluateResult swapped = Evaluated(config);
  EXPECT_EQ(Of(swapped, kLeft).preserved.completion.value, 0.0);
  EXPECT_TRUE(Says(swapped.frames[0].remarks, "left-3.ply counts as left (3), but 100 % of it"));
  EXPECT_TRUE(Says(swapped.frames[0].remarks, "--match overlap"));
  config.match = MatchMode::kOverlap;
  const EvaluateResult overruled = Evaluated(config);
  EXPECT_EQ(Of(overruled, kLeft).preserved.completion.value, 1.0);
  EXPECT_TRUE(overruled.frames[0].remarks.empty());
}

TEST(EvaluateMeshes, WithoutLabelsEveryScoreTakesFacesOfAnyLabel) {
  const TempFolder folder;
  BoxSource source;
  const auto meshes = TruthMeshes(source);
  Put(folder / "m/mesh.ply", SceneOf(meshes, false));
  EvaluateConfig config = At(folder / "m");
  config.removed = {kRight};
  const EvaluateResult result = Evaluated(config);
  const Evaluation& evaluation = result.frames[0].evaluation;
  EXPECT_FALSE(evaluation.labelled);
  EXPECT_TRUE(result.frames[0].matches.empty());
  EXPECT_TRUE(Says(result.frames[0].remarks, "tells no objects apart"));
  for (const InstanceId id : {kBackground, kLeft, kRight}) {
    EXPECT_EQ(Of(result, id).preserved.completion.value, 1.0) << id;
    EXPECT_LT(*Of(result, id).accuracy.distance.mean_m.value, kRounding_m) << id;
    EXPECT_FALSE(Of(result, id).label_purity.value.has_value());
    EXPECT_EQ(Of(result, id).label_purity.why_not, "the mesh has no labels");
  }
  EXPECT_FALSE(evaluation.revealed_ghost_area_m2.value.has_value());
  EXPECT_FALSE(evaluation.revealed_unseen_area_m2.value.has_value());
  EXPECT_EQ(evaluation.sanity.all.value, 1.0);
  EXPECT_NE(EvaluateTable(result).find("(any label)"), std::string::npos);

  // Without the boxes the wall is as good as before, and the boxes are lost.
  Put(folder / "wall/mesh.ply", meshes.at(kBackground));
  const EvaluateResult wall = Evaluated(At(folder / "wall"));
  EXPECT_EQ(Of(wall, kBackground).preserved.completion.value, 1.0);
  EXPECT_EQ(Of(wall, kLeft).preserved.completion.value, 0.0);
}

TEST(EvaluateMeshes, RemovalDropsFacesUnlessTheMapperRemoved) {
  const TempFolder folder;
  BoxSource source;
  auto meshes = TruthMeshes(source);
  // A ghost of the right box, named after it: the removal takes it away.
  TriangleMesh with_ghost = meshes.at(kRight);
  AppendMesh(Moved(meshes.at(kRight), {0, 0, -0.4F}), with_ghost);
  auto haunted = meshes;
  haunted[kRight] = with_ghost;
  Put(folder / "m/scene.ply", SceneOf(haunted, true));
  EvaluateConfig config = At(folder / "m");
  config.removed = {kRight};
  const EvaluateResult dropped = Evaluated(config);
  EXPECT_GT(dropped.frames[0].evaluation.ghost_area_m2, 0.01);
  EXPECT_EQ(dropped.frames[0].evaluation.revealed_ghost_area_m2.value, 0.0);
  const Measured kept = Of(dropped, kBackground).preserved.preservation_behind_other;
  EXPECT_EQ(kept.value, 1.0) << kept.why_not;

  // What the mapper itself has left after its removal counts in place of that: here no wall.
  Put(folder / "m/scene-without-8.ply", SceneOf({{kLeft, meshes.at(kLeft)}}, true));
  const EvaluateResult removed = Evaluated(config);
  EXPECT_EQ(Of(removed, kBackground).preserved.preservation_behind_other.value, 0.0);
  EXPECT_EQ(Of(removed, kLeft).preserved.completion.value, 1.0);
  EXPECT_EQ(removed.frames[0].evaluation.visible_completion.value, 1.0);
}

// After a removal the wall comes to light under another label than it had.
TEST(EvaluateMeshes, WhatARemovalBringsToLightIsMatchedToo) {
  const TempFolder folder;
  BoxSource source;
  auto meshes = TruthMeshes(source);
  Put(folder / "m/scene.ply", SceneOf(meshes, true));
  constexpr InstanceId kNewLabel = 77;
  meshes[kNewLabel] = meshes.at(kBackground);
  meshes.erase(kBackground);
  meshes.erase(kRight);
  Put(folder / "m/scene-without-8.ply", SceneOf(meshes, true));
  EvaluateConfig config = At(folder / "m");
  config.removed = {kRight};
  EXPECT_EQ(Of(Evaluated(config), kBackground).preserved.preservation_behind_other.value, 1.0);
  // Nothing at all may be left.
  Put(folder / "m/scene-without-8.ply", TriangleMesh{});
  EXPECT_EQ(Of(Evaluated(config), kBackground).preserved.preservation_behind_other.value, 0.0);
  // Without labels nobody knows what is left of whom.
  Put(folder / "m/scene-without-8.ply", SceneOf(meshes, false));
  EXPECT_NE(ErrorOf(config).message.find(
                "scene-without-8.ply: tells no objects apart, expected the labels"),
            std::string::npos)
      << ErrorOf(config).message;
}

TEST(EvaluateMeshes, WhatIsLeftAfterTheRemovalByWhatIsKnownOfItsPlace) {
  const TempFolder folder;
  BoxSource source;
  const auto meshes = TruthMeshes(source);
  const TriangleMesh& box = meshes.at(kRight);
  Put(folder / "m/scene.ply", SceneOf(meshes, true));
  // The map has left the box where it was under another's name, and has one behind the wall.
  auto left = meshes;
  left.erase(kRight);
  AppendMesh(box, left[kBackground]);
  AppendMesh(Moved(box, {0, 0, 2}), left[kBackground]);
  Put(folder / "m/scene-without-8.ply", SceneOf(left, true));
  EvaluateConfig config = At(folder / "m");
  config.removed = {kRight};
  const EvaluateResult result = Evaluated(config);
  const Evaluation& evaluation = result.frames[0].evaluation;
  // All of either is far from what remains, so that sampling adds no error.
  EXPECT_EQ(evaluation.ghost_area_m2, 0);
  EXPECT_NEAR(*evaluation.revealed_ghost_area_m2.value, SurfaceArea(box), kRounding_m);
  EXPECT_NEAR(*evaluation.revealed_unseen_area_m2.value, SurfaceArea(box), kRounding_m);
  EXPECT_EQ(evaluation.revealed_ghost_error_m2.value, 0.0);
  EXPECT_EQ(evaluation.revealed_unseen_error_m2.value, 0.0);
  const std::string table = EvaluateTable(result);
  EXPECT_NE(table.find("ghost after  unseen after"), std::string::npos) << table;
  EXPECT_NE(table.find(fmt::format("{:.0f} ±0.0", 1e4 * SurfaceArea(box))), std::string::npos)
      << table;
}

TEST(EvaluateMeshes, AnotherFrameScoresNothingAndSaysSo) {
  const TempFolder folder;
  BoxSource source;
  Put(folder / "m/scene.ply", Moved(SceneOf(TruthMeshes(source), true), {0, 0, 5}));
  const EvaluateResult result = Evaluated(At(folder / "m"));
  EXPECT_EQ(Of(result, kBackground).preserved.completion.value, 0.0);
  EXPECT_TRUE(Says(result.frames[0].remarks,
                   "no part of it is within 0.02 m of a true surface, the nearest is"));
  EXPECT_TRUE(Says(result.frames[0].remarks, "world frame"));
}

TEST(EvaluateMeshes, FlippedFacesAreSaid) {
  const TempFolder folder;
  BoxSource source;
  TriangleMesh mesh = SceneOf(TruthMeshes(source), true);
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  Put(folder / "m/scene.ply", mesh);
  const EvaluateResult result = Evaluated(At(folder / "m"));
  EXPECT_EQ(Of(result, kLeft).preserved.completion.value, 0.0);
  EXPECT_TRUE(Says(result.frames[0].remarks, "faces the other way"));
}

TEST(EvaluateMeshes, AnObjectThatIsMissingIsNamed) {
  const TempFolder folder;
  BoxSource source;
  auto meshes = TruthMeshes(source);
  meshes.erase(kRight);
  Put(folder / "m/scene.ply", SceneOf(meshes, true));
  EXPECT_TRUE(Says(Evaluated(At(folder / "m")).frames[0].remarks, "nothing of it is right (8)"));
}

TEST(EvaluateMeshes, TrajectoriesAreAnchoredOnce) {
  const TempFolder folder;
  BoxSource source;
  PutNamed(folder / "m", TruthMeshes(source));
  std::string right;
  std::string camera;
  constexpr double kShift_m = 0.03;
  for (int i = 0; i <= kLast; ++i) {
    const auto frame = source.Read(i);
    // An object's frame is the mapper's choice: turned and moved, it is the same trajectory.
    Pose own = Pose::Identity();
    own.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX()).matrix();
    own.translation() = Eigen::Vector3d(0.1, 0.2, 0.3);
    right += fmt::format("{} {}\n", i, PoseToText(frame->T_WO.at(kRight) * own));
    Pose moved = frame->T_WC;
    moved.translation().x() += kShift_m;
    camera += fmt::format("{} {}\n", i, PoseToText(moved));
  }
  ASSERT_TRUE(WriteFile(folder / "t/right-8.txt", right).has_value());
  EvaluateConfig config = At(folder / "m");
  config.trajectories = folder / "t";
  EvaluateResult result = Evaluated(config);
  ASSERT_TRUE(result.trajectories.has_value());
  ASSERT_TRUE(result.trajectories->objects.contains(kRight));
  EXPECT_EQ(result.trajectories->objects.at(kRight).frames, 6U);
  // Nine decimals of text.
  EXPECT_LT(*result.trajectories->objects.at(kRight).ate_rmse_m.value, 1e-8);
  EXPECT_FALSE(result.trajectories->camera_m.has_value());

  ASSERT_TRUE(WriteFile(folder / "t/camera.txt", camera).has_value());
  result = Evaluated(config);
  EXPECT_NEAR(result.trajectories->camera_m->rmse, kShift_m, 1e-8);
  EXPECT_NEAR(result.trajectories->camera_deg->rmse, 0, 1e-6);
  EXPECT_NE(EvaluateTable(result).find("of the camera: 6 frames, ATE 0.0300 m"), std::string::npos);

  ASSERT_TRUE(WriteFile(folder / "t/poses-8.txt", right).has_value());
  EXPECT_NE(ErrorOf(config).message.find("is of object 8, as is"), std::string::npos);
}

TEST(EvaluateMeshes, MasksAreComparedUnderTheirOwnIds) {
  const TempFolder folder;
  BoxSource source;
  PutNamed(folder / "m", TruthMeshes(source));
  fs::create_directories(folder / "own");
  fs::create_directories(folder / "others");
  for (int i = 2; i <= kLast; ++i) {
    const auto frame = source.Read(i);
    cv::imwrite(folder / "own" / fmt::format("Mask{:04d}.png", i), frame->mask);
    cv::Mat swapped = frame->mask.clone();  // 3 is called 8, and 8 is called 5
    swapped.setTo(8, frame->mask == 3);
    swapped.setTo(5, frame->mask == 8);
    cv::imwrite(folder / "others" / fmt::format("{}.png", i), swapped);
  }
  EvaluateConfig config = At(folder / "m");
  config.masks = folder / "own";
  EvaluateResult result = Evaluated(config);
  ASSERT_TRUE(result.masks.has_value());
  EXPECT_EQ(result.masks->images, 4);
  EXPECT_EQ(result.masks->mean_iou.value, 1.0);
  EXPECT_EQ(result.masks->quality.pq.value, 1.0);
  EXPECT_TRUE(result.masks->remarks.empty());
  fs::copy(folder / "own/Mask0002.png", folder / "own/Mask0017.PNG");
  EXPECT_TRUE(Evaluated(config).masks->remarks.at(0).ends_with(
      "1 images are of no frame of the sequence, which has 0 to 5: left out"));
  fs::copy(folder / "own/Mask0002.png", folder / "own/first.png");
  EXPECT_TRUE(Evaluated(config).masks->remarks.at(1).ends_with(
      "1 images, 'first.png' among them, end in no frame's number: left out"));
  config.masks = folder / "others";
  result = Evaluated(config);
  EXPECT_EQ(result.masks->iou.at(kLeft).value, 0.0);
  EXPECT_EQ(result.masks->quality.pq.value, 1.0);  // segments are right, only their ids are not
  config.match = MatchMode::kOverlap;
  result = Evaluated(config);
  EXPECT_EQ(result.masks->mean_iou.value, 1.0);
  EXPECT_EQ(result.masks->object_of.at(8), kLeft);
}

// The key: what `compare` says of its own meshes is what the files say.
TEST(EvaluateMeshes, OurOwnMeshesScoreAsInTheComparison) {
  const TempFolder folder;
  auto source = OpenSource(TSDFPP_SOURCE_DIR "/scenes/mini.toml");
  ASSERT_TRUE(source.has_value()) << source.error().message;
  CompareConfig compare;
  compare.methods = {Method::kTsdf, Method::kTsdfpp};
  compare.profiles = {"close"};
  compare.every = 8;
  compare.until = "16";
  compare.keep_meshes = true;
  const auto compared = RunCompare(**source, compare, folder / "out", "the command", {});
  ASSERT_TRUE(compared.has_value()) << compared.error().message;
  for (const auto& run : compared->runs) {
    EvaluateConfig config;
    config.meshes = folder / "out" / run->FolderName() / "frames";
    config.trajectories = folder / "out" / run->FolderName() / "trajectories";
    config.frames = {8, 16};
    config.removed = compared->movers;
    const auto result = RunEvaluate(**source, config, {});
    ASSERT_TRUE(result.has_value()) << result.error().message;
    ASSERT_EQ(result->frames.size(), run->evaluations.size());
    for (std::size_t i = 0; i < result->frames.size(); ++i) {
      nlohmann::json expected = ToJson(run->evaluations[i]);
      expected.erase("mesh_s");
      expected.erase("evaluate_s");
      EXPECT_EQ(Scores(result->frames[i]).dump(1), expected.dump(1)) << run->Title();
    }
    const auto& car = result->trajectories->objects.at(1);
    EXPECT_EQ(car.frames, 16U);
    EXPECT_LT(*car.ate_rmse_m.value, 1e-8);  // given poses
  }
}

}  // namespace
}  // namespace tsdfpp
