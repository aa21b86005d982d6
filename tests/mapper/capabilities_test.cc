// A map that can do nothing but what every map does: whoever needs more says so in a sentence, and
// whoever does not gets along.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <utility>

#include "mapper/index/change_log.h"
#include "mapper/map_editing.h"
#include "mapper/map_file.h"
#include "mapper/map_query.h"
#include "mapper/map_reach.h"
#include "mapper/scene_mesher.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/from_scratch.h"

namespace tsdfpp {
namespace {

constexpr double kFar_m = 1e6;  // further than blocks are numbered

TriangleMesh Triangle(float z_m) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, z_m}, {1, 0, z_m}, {0, 1, z_m}};
  mesh.colours.assign(3, Colour{1, 2, 3});
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

// Neither voxels nor blocks nor files: a triangle an object.
class BareMap final : public MapRepresentation {
 public:
  Method method() const override { return Method::kVolumes; }
  const MapConfig& config() const override { return config_; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    heights_m_[id] = static_cast<float>(T_WO.translation().z());
  }
  void Fuse(const Frame& /*frame*/, const cv::Mat& /*labels*/) override {}
  void Remove(InstanceId id) override { heights_m_.erase(id); }
  std::unique_ptr<MapRepresentation> Clone() const override {
    return std::make_unique<BareMap>(*this);
  }
  std::vector<InstanceId> Objects() const override {
    std::vector<InstanceId> ids;
    for (const auto& [id, height_m] : heights_m_) ids.push_back(id);
    return ids;
  }
  Pose ObjectLattice(InstanceId /*id*/) const override { return Pose::Identity(); }
  TriangleMesh ObjectMesh(InstanceId id) const override {
    const auto of = heights_m_.find(id);
    return of == heights_m_.end() ? TriangleMesh{} : Triangle(of->second);
  }
  TriangleMesh SceneMesh() const override { return AllObjectsMesh(*this); }
  std::vector<RaySurface> CastRays(const Intrinsics& /*camera*/, const Pose& /*T_WC*/,
                                   const RayCastOptions& /*options*/) const override {
    return {};
  }
  MapMemory Memory() const override { return {}; }

 private:
  MapConfig config_;
  std::map<InstanceId, float> heights_m_;
};

Pose AtHeight(double z_m) { return Pose(Eigen::Translation3d(0, 0, z_m)); }

TEST(BareMaps, LackWhatOthersHave) {
  BareMap map;
  EXPECT_EQ(map.inspection(), nullptr);
  EXPECT_EQ(map.editing(), nullptr);
  EXPECT_EQ(map.persistence(), nullptr);
  EXPECT_EQ(std::as_const(map).persistence(), nullptr);
  EXPECT_EQ(map.block_moves(), nullptr);
  EXPECT_EQ(map.block_surfaces(), nullptr);
  EXPECT_DEATH(VoxelsOf(map), "");
  EXPECT_DEATH(EditingOf(map), "");
}

TEST(BareMaps, AreRefusedInASentence) {
  const BareMap map;
  const auto query = MapQuery::Of(map);
  ASSERT_FALSE(query.has_value());
  EXPECT_EQ(query.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(query.error().message,
            "a map of method 'volumes' has no voxels, which a question about a point needs");
  const auto bytes = MapToBytes(map);
  ASSERT_FALSE(bytes.has_value());
  EXPECT_EQ(bytes.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(bytes.error().message, "a map of method 'volumes' cannot be saved");
  EXPECT_EQ(CheckCanBeSaved(map).error().message, bytes.error().message);
}

TEST(BareMaps, HaveNoRangeButThatOfTheirNumbers) {
  const BareMap map;
  Frame frame = DriveFrame(0);
  EXPECT_TRUE(CheckReach(map, frame, frame.mask, {{kBrick, AtHeight(kFar_m)}}).has_value());
  EXPECT_FALSE(CheckReach(map, frame, frame.mask, {{kBrick, AtHeight(1e9)}}).has_value());
  Pose skew = Pose::Identity();
  skew.matrix()(0, 0) = 2;
  EXPECT_FALSE(CheckReach(map, frame, frame.mask, {{kBrick, skew}}).has_value());
  const auto with_blocks = MakeMap(Method::kTsdfpp, ToyConfig());
  EXPECT_FALSE(
      CheckReach(*with_blocks, frame, frame.mask, {{kBrick, AtHeight(kFar_m)}}).has_value());
}

TEST(BareMaps, AreMeshedAndFollowedObjectByObject) {
  BareMap map;
  map.SetObjectPose(1, AtHeight(0.1));
  map.SetObjectPose(2, AtHeight(0.2));
  SceneMesher mesher;
  EXPECT_TRUE(BytesOf(mesher.SceneMesh(map)) == BytesOf(map.SceneMesh()));
  EXPECT_TRUE(BytesOf(mesher.ObjectMesh(map, 2)) == BytesOf(Triangle(0.2F)));
  EXPECT_EQ(mesher.Update(map).blocks, 0U);

  std::vector<ScenePiece> parts = mesher.TakeSceneChanges(map).parts;
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].id, 1U);
  EXPECT_EQ(parts[1].id, 2U);
  EXPECT_EQ(parts[1].mesh.vertices, Triangle(0.2F).vertices);
  EXPECT_EQ(parts[1].mesh.face_ids, std::vector<InstanceId>{2});
  EXPECT_TRUE(mesher.TakeSceneChanges(map).parts.empty()) << "nothing has happened";
  EXPECT_GT(mesher.Bytes(), 0U);

  map.SetObjectPose(1, AtHeight(0.3));
  map.Remove(2);
  parts = mesher.TakeSceneChanges(map).parts;
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].mesh.vertices, Triangle(0.3F).vertices);
  EXPECT_EQ(parts[1].id, 2U);
  EXPECT_TRUE(parts[1].mesh.triangles.empty());
  EXPECT_TRUE(mesher.TakeSceneChanges(map).parts.empty());
}

// One mesher may be given a map and copies of it in turn.
class MesherOfCopies : public EveryMethodTest {};
TSDFPP_FOR_EVERY_METHOD(MesherOfCopies);

TEST_P(MesherOfCopies, GivesWhatEachGives) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 2);
  SceneMesher mesher;
  ASSERT_TRUE(SameAsFromScratch(*map, mesher));
  {
    const auto without = map->Clone();
    without->Remove(kBrick);
    ASSERT_TRUE(SameAsFromScratch(*without, mesher));
    EXPECT_FALSE(BytesOf(without->SceneMesh()) == BytesOf(map->SceneMesh()));
  }
  ASSERT_TRUE(SameAsFromScratch(*map, mesher));
  SetPosesThenFuse(*map, DriveFrame(2));
  ASSERT_TRUE(SameAsFromScratch(*map, mesher));
}

class MesherOfVoxels : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(MesherOfVoxels);

// A label is part of the scene: kept triangles have the new one.
TEST_P(MesherOfVoxels, SeesARenaming) {
  constexpr InstanceId kNew = 9;
  const auto map = DrivenMap(GetParam(), ToyConfig(), 2);
  SceneMesher mesher;
  mesher.SceneMesh(*map);
  ASSERT_TRUE(EditingOf(*map).Rename(kBrick, kNew).has_value());
  const TriangleMesh scene = mesher.SceneMesh(*map);
  EXPECT_GT(std::count(scene.face_ids.begin(), scene.face_ids.end(), kNew), 20);
  EXPECT_EQ(std::count(scene.face_ids.begin(), scene.face_ids.end(), kBrick), 0);
  EXPECT_TRUE(BytesOf(scene) == BytesOf(map->SceneMesh()));
}

TEST(ChangeLogs, TellEachReaderWhatCameSince) {
  using Blocks = std::vector<Index3>;
  ChangeLog log;
  log.Note({1, 0, 0});
  ChangeLog::Mark early;
  EXPECT_FALSE(log.ReadFrom(early).has_value()) << "it has read nothing";
  EXPECT_EQ(log.ReadFrom(early), Blocks{});
  log.Note({2, 0, 0});
  log.Note({3, 0, 0});
  ChangeLog::Mark late;
  log.ReadFrom(late);
  log.Note({4, 0, 0});
  EXPECT_EQ(log.ReadFrom(early), (Blocks{{2, 0, 0}, {3, 0, 0}, {4, 0, 0}}));
  EXPECT_EQ(log.ReadFrom(late), (Blocks{{4, 0, 0}}));

  // More than it keeps.
  constexpr int kMany = 10000;
  for (int i = 0; i < kMany; ++i) log.Note({i, 0, 0});
  EXPECT_FALSE(log.ReadFrom(early).has_value());
  log.Note({5, 0, 0});
  EXPECT_EQ(log.ReadFrom(early), (Blocks{{5, 0, 0}}));

  log.NoteAll();
  EXPECT_FALSE(log.ReadFrom(early).has_value());
  const ChangeLog copy = log;
  EXPECT_FALSE(copy.ReadFrom(early).has_value()) << "a copy is another log";
  EXPECT_FALSE(log.ReadFrom(early).has_value()) << "and the first is another than its copy";
}

}  // namespace
}  // namespace tsdfpp
