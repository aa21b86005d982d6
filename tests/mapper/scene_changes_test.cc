// Who follows the visible scene by the parts that change has the triangles of the whole mesh.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <utility>

#include "mapper/map_editing.h"
#include "mapper/mesh/join_parts.h"
#include "mapper/scene_mesher.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/from_scratch.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

// What a viewer keeps.
class Follower {
 public:
  // False where what it is told is not in order, or tells of nothing.
  ::testing::AssertionResult Take(const MapRepresentation& map) {
    last_.clear();
    std::vector<ScenePiece> changes = mesher_.TakeSceneChanges(map).parts;
    for (ScenePiece& part : changes) {
      const auto key = std::make_pair(part.id, part.block);
      if (!last_.empty() && !(*last_.rbegin() < key)) {
        return ::testing::AssertionFailure() << "not in order, or told twice";
      }
      last_.insert(key);
      std::set<std::uint32_t> used;
      for (const auto& triangle : part.mesh.triangles)
        used.insert(triangle.begin(), triangle.end());
      if (used.size() != part.mesh.vertices.size()) {
        return ::testing::AssertionFailure() << "vertices that no triangle names";
      }
      if (part.mesh.triangles.empty()) {
        if (parts_.erase(key) == 0) return ::testing::AssertionFailure() << "gone, never there";
      } else {
        parts_[key] = std::move(part.mesh);
      }
    }
    return ::testing::AssertionSuccess();
  }

  // Three corners with their colours and an id each, in order.
  std::string Triangles() const {
    std::string bytes;
    for (const auto& [key, mesh] : parts_) Append(mesh, bytes);
    return bytes;
  }
  static std::string TrianglesOf(const TriangleMesh& mesh) {
    std::string bytes;
    Append(mesh, bytes);
    return bytes;
  }
  std::size_t told() const { return last_.size(); }
  std::size_t size() const { return parts_.size(); }

  SceneMesher& mesher() { return mesher_; }

 private:
  static void Append(const TriangleMesh& mesh, std::string& bytes) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (const std::uint32_t corner : mesh.triangles[t]) {
        bytes.append(reinterpret_cast<const char*>(mesh.vertices[corner].data()),
                     3 * sizeof(float));
        for (const std::uint8_t level : mesh.colours[corner]) {
          bytes.push_back(static_cast<char>(level));
        }
      }
      bytes.append(reinterpret_cast<const char*>(&mesh.face_ids[t]), sizeof(InstanceId));
    }
  }

  SceneMesher mesher_;
  std::map<std::pair<InstanceId, Index3>, TriangleMesh> parts_;
  std::set<std::pair<InstanceId, Index3>> last_;
};

MapConfig FineConfig(int layers) {
  MapConfig config = ToyConfig();
  config.voxel_m = 0.5 * kToyVoxel_m;
  config.layers = layers;
  return config;
}

// The frame's labels in a window, none elsewhere.
cv::Mat LabelsIn(const Frame& frame, const cv::Rect& window) {
  cv::Mat labels(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
  frame.mask(window).copyTo(labels(window));
  return labels;
}

class SceneChanges : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(SceneChanges);

TEST_P(SceneChanges, LeadToTheWholeMesh) {
  int small = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    Dice dice(seed);
    auto map = MakeMap(GetParam(), FineConfig(seed == 1 ? 2 : 4));
    Scene scene = TableWithToys();
    Follower follower;
    for (int i = 0; i < 3; ++i) SetPosesThenFuse(*map, RenderToys(scene, 2.0 * i, i));
    for (int event = 0; event < 30; ++event) {
      const auto id = static_cast<InstanceId>(1 + dice.Whole(3));
      const int what = dice.Whole(8);
      if (what <= 2) {
        scene.T_WO[id] = MakePose(dice.Uniform(-1, 1), {0.1, dice.Uniform(-0.2, 0.2), 1},
                                  {dice.Uniform(-0.2, 0.2), dice.Uniform(-0.2, 0.2),
                                   kTableTop_m + dice.Uniform(0.01, 0.06)});
        map->SetObjectPose(id, scene.T_WO[id]);
      } else if (what == 3) {
        map->Remove(id);
      } else if (what == 4) {
        // And back, so that the same id is another volume, or the same one in other hands.
        constexpr InstanceId kOther = 9;
        if (EditingOf(*map).Rename(id, kOther)) {
          const int told = dice.Whole(3);
          if (told == 0) {
            ASSERT_TRUE(follower.Take(*map)) << "seed " << seed << ", event " << event;
          } else if (told == 1) {
            follower.mesher().Update(*map);  // has seen that the id is gone when it is back
          }
        }
        static_cast<void>(EditingOf(*map).Rename(kOther, id));
      } else if (what == 5) {
        // Brings a part of what is kept up to date, behind the follower's back.
        follower.mesher().ObjectMesh(*map, id);
      }
      if (what >= 2) {
        const Frame frame = RenderToys(scene, dice.Uniform(0, 6), event);
        const int side = frame.mask.rows / 4;
        const cv::Rect window(dice.Whole(frame.mask.cols - side),
                              dice.Whole(frame.mask.rows - side), side, side);
        map->Fuse(frame, LabelsIn(frame, window));
      }
      if (dice.Whole(3) == 0) continue;  // changes add up
      ASSERT_TRUE(follower.Take(*map)) << "seed " << seed << ", event " << event;
      if (follower.told() > 0 && 4 * follower.told() < follower.size()) ++small;
      ASSERT_TRUE(follower.Triangles() == Follower::TrianglesOf(map->SceneMesh()))
          << "seed " << seed << ", event " << event;
      ASSERT_TRUE(follower.Take(*map));
      ASSERT_EQ(follower.told(), 0U) << "nothing has happened";
    }
    EXPECT_GT(map->SceneMesh().triangles.size(), 1000U);
    // Another one is told everything.
    Follower other;
    const auto copy = map->Clone();
    ASSERT_TRUE(other.Take(*copy));
    EXPECT_TRUE(other.Triangles() == Follower::TrianglesOf(map->SceneMesh()));
  }
  EXPECT_GT(small, 5);
}

TEST(ScenePieces, TellOfABlockThatIsBackWithoutASurface) {
  constexpr float kVoxel_m = 0.1F;
  const auto fill = [](TsdfBlock& block, float behind_m) {
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      block.distance[i] = i < kBlockVoxels / 2 ? kVoxel_m : behind_m;
      block.weight[i] = 1;
    }
    block.UpdateMasks(kVoxel_m);
  };
  TsdfGrid grid;
  GridMesh mesh;
  const auto take = [&] { return TakeScenePieces(mesh, {&mesh, 1}); };
  fill(grid.FindOrAdd({0, 0, 0}), -kVoxel_m);
  mesh.Update(grid, kVoxel_m);
  std::vector<ScenePiece> pieces = take();
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_FALSE(pieces[0].mesh.triangles.empty());

  grid.Erase({{0, 0, 0}});
  mesh.Update(grid, kVoxel_m);
  fill(grid.FindOrAdd({0, 0, 0}), kVoxel_m);
  mesh.Update(grid, kVoxel_m);
  pieces = take();
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_EQ(pieces[0].block, (Index3{0, 0, 0}));
  EXPECT_TRUE(pieces[0].mesh.triangles.empty());
  EXPECT_TRUE(take().empty());
}

}  // namespace
}  // namespace tsdfpp
