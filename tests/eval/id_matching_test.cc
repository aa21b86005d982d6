// The map's own ids and the truth's, matched once.
#include "eval/score/id_matching.h"

#include <gtest/gtest.h>

#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

// A row of pairs (label, truth), each so many pixels.
void Observe(IdMatching& matching, const std::vector<std::array<int, 3>>& runs) {
  std::vector<InstanceId> labels;
  std::vector<InstanceId> truth;
  for (const auto& [label, object, count] : runs) {
    labels.insert(labels.end(), static_cast<std::size_t>(count), static_cast<InstanceId>(label));
    truth.insert(truth.end(), static_cast<std::size_t>(count), static_cast<InstanceId>(object));
  }
  const int size = static_cast<int>(labels.size());
  matching.Observe(cv::Mat(1, size, CV_16UC1, labels.data()),
                   cv::Mat(1, size, CV_16UC1, truth.data()));
}

TEST(IdMatching, TakesTheObjectWithMostSharedPixelsOfAllFrames) {
  IdMatching matching;
  Observe(matching, {{5, 1, 10}, {5, 2, 12}, {6, 1, 3}, {0, 1, 50}, {kNoInstance, 1, 50}});
  Observe(matching, {{5, 1, 4}, {6, 0, 2}});
  EXPECT_EQ(matching.TruthOf(5), kNoInstance) << "before it is settled";
  matching.Settle();
  EXPECT_EQ(matching.TruthOf(5), 1);
  EXPECT_EQ(matching.IdOf(1), 5);
  // What the other one would be is taken.
  EXPECT_EQ(matching.TruthOf(6), kNoInstance);
  EXPECT_EQ(matching.IdOf(2), kNoInstance);
  EXPECT_EQ(matching.TruthOf(kBackground), kBackground);
  EXPECT_EQ(matching.IdOf(kBackground), kBackground);
  EXPECT_EQ(matching.IdOf(kNoInstance), kNoInstance);
}

TEST(IdMatching, IsDoneOnce) {
  IdMatching matching;
  Observe(matching, {{5, 1, 10}});
  matching.Settle();
  Observe(matching, {{5, 2, 1000}, {7, 1, 2000}, {8, 2, 5}});
  matching.Settle();
  EXPECT_EQ(matching.TruthOf(5), 1) << "though it has become another";
  EXPECT_EQ(matching.TruthOf(7), kNoInstance);
  EXPECT_EQ(matching.TruthOf(8), 2);
  const nlohmann::json expected = {{{"id", 5}, {"object", 1}, {"share", 10.0 / 1010}},
                                   {{"id", 7}, {"object", nullptr}, {"share", 0.0}},
                                   {{"id", 8}, {"object", 2}, {"share", 1.0}}};
  EXPECT_EQ(matching.ToJson(), expected);
}

TEST(IdMatching, GivesTheBackgroundToNobody) {
  IdMatching matching;
  Observe(matching, {{5, 0, 10}, {5, 3, 9}});
  matching.Settle();
  EXPECT_EQ(matching.TruthOf(5), kNoInstance);
  EXPECT_EQ(matching.IdOf(3), kNoInstance);
}

// The same map with other ids gives the same meshes as with the truth's.
TEST(IdMatching, MeshesHaveTheTruthsIds) {
  auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  auto renamed = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  IdMatching matching;
  const std::map<InstanceId, InstanceId> ids{
      {kBackground, kBackground}, {kBrick, 21}, {kBall, 22}, {kTray, 23}};
  for (int i = 0; i < 4; ++i) {
    const Frame frame = DriveFrame(i);
    SetPosesThenFuse(*map, frame);
    cv::Mat labels = frame.mask.clone();
    for (auto& label : cv::Mat_<InstanceId>(labels)) label = ids.at(label);
    for (const auto& [id, T_WO] : frame.T_WO) renamed->SetObjectPose(ids.at(id), T_WO);
    renamed->Fuse(frame, labels);
    matching.Observe(labels, frame.mask);
  }
  matching.Settle();
  // An object that neither map has can be asked for.
  const std::set<InstanceId> movers{kBrick, kTray, 40};
  SceneMesher mesher;
  const SceneMeshes expected = MeshesOf(*map, movers, mesher);
  const SceneMeshes meshes = MeshesOf(*renamed, movers, matching, mesher);
  EXPECT_FALSE(expected.scene.face_ids.empty());
  EXPECT_EQ(meshes.scene.face_ids, expected.scene.face_ids);
  ASSERT_EQ(meshes.without.size(), expected.without.size());
  for (const auto& [removed, mesh] : expected.without) {
    EXPECT_EQ(meshes.without.at(removed).face_ids, mesh.face_ids);
    EXPECT_EQ(meshes.without.at(removed).triangles, mesh.triangles);
  }
}

}  // namespace
}  // namespace tsdfpp
