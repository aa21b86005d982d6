// Meshes that are kept and brought up to date are those made from scratch, byte for byte; those are
// the surface that the plain code traces.
#include "mapper/mesh/mesh_cache.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <set>
#include <span>

#include "mapper/mesh/join_parts.h"
#include "mapper/mesh/marching_cubes.h"
#include "tests/mapper/from_scratch.h"
#include "tests/mapper/mesh_checks.h"
#include "tests/mapper/methods_of_tests.h"
#include "tests/mapper/toy_scene.h"
#include "tests/mapper/visible_triangles.h"
#include "tests/reference/plain_mesh.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

constexpr float kMeshVoxel_m = 0.02F;
constexpr float kBack_m = 0.08F;

// Values at random, so that every set of inside corners turns up; where `rough`, unobserved voxels
// and voxels without colour as well.
void FillAtRandom(TsdfBlock& block, Dice& dice, bool rough) {
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    block.distance[i] = static_cast<float>(dice.Uniform(-0.1, 0.1));
    block.weight[i] = rough && dice.Uniform(0, 1) < 0.1 ? 0.0F : 1.0F;
    FixedColour colour;
    for (auto& channel : colour) channel = static_cast<std::uint16_t>(dice.Whole(65281));
    block.SetColour(i, colour, static_cast<std::uint16_t>(dice.Whole(3)));
  }
  block.UpdateMasks(kBack_m);
}

Index3 RandomBlock(Dice& dice) { return {dice.Whole(4) - 2, dice.Whole(4) - 2, dice.Whole(4) - 2}; }

TsdfGrid RandomGrid(Dice& dice, int blocks, bool rough) {
  TsdfGrid grid;
  for (int i = 0; i < blocks; ++i) {
    FillAtRandom(grid.FindOrAdd(RandomBlock(dice)), dice, rough);
  }
  return grid;
}

// Whether the triangles are the polygons, each cut along diagonals of its own: n - 2 triangles of
// its n corners, whose edges but for the polygon's cancel out.
template <typename Corner>
bool CutUp(std::span<const std::array<Corner, 3>> triangles,
           const std::vector<std::vector<Corner>>& polygons) {
  std::size_t used = 0;
  for (const std::vector<Corner>& polygon : polygons) {
    const std::set<Corner> corners(polygon.begin(), polygon.end());
    std::multiset<std::pair<Corner, Corner>> open;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      open.emplace(polygon[(i + 1) % polygon.size()], polygon[i]);
    }
    std::size_t own = 0;
    for (const auto& triangle : triangles) {
      if (!std::all_of(triangle.begin(), triangle.end(),
                       [&](Corner corner) { return corners.contains(corner); })) {
        continue;
      }
      ++own;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::pair edge(triangle[i], triangle[(i + 1) % 3]);
        const auto against = open.find({edge.second, edge.first});
        if (against == open.end()) {
          open.insert(edge);
        } else {
          open.erase(against);
        }
      }
    }
    if (!open.empty() || corners.size() != polygon.size() || own + 2 != polygon.size()) {
      return false;
    }
    used += own;
  }
  return used == triangles.size();
}

// The same vertices and colours, bit for bit and in the same order, and in each cube the same
// polygons, however they are cut.
::testing::AssertionResult IsThePlainSurface(const TriangleMesh& mesh,
                                             const reference::PlainSurface& plain) {
  if (mesh.vertices != plain.vertices) return ::testing::AssertionFailure() << "vertices differ";
  if (mesh.colours != plain.colours) return ::testing::AssertionFailure() << "colours differ";
  std::span<const std::array<std::uint32_t, 3>> left(mesh.triangles);
  for (std::size_t cube = 0; cube < plain.polygons_of_cubes.size(); ++cube) {
    std::size_t count = 0;
    for (const auto& polygon : plain.polygons_of_cubes[cube]) count += polygon.size() - 2;
    if (count > left.size() || !CutUp(left.first(count), plain.polygons_of_cubes[cube])) {
      return ::testing::AssertionFailure() << "the surface in observed cube " << cube << " differs";
    }
    left = left.subspan(count);
  }
  if (!left.empty()) return ::testing::AssertionFailure() << left.size() << " triangles too many";
  return ::testing::AssertionSuccess();
}

TEST(CubeTable, HasThePolygonsOfEveryCube) {
  for (unsigned inside = 0; inside < 256; ++inside) {
    std::vector<std::vector<CubeEdge>> polygons;
    for (const reference::CubePolygon& traced : reference::CubePolygons(inside)) {
      auto& polygon = polygons.emplace_back();
      for (const auto& [corner, axis] : traced) {
        polygon.push_back(static_cast<CubeEdge>(3 * corner + axis));
      }
    }
    EXPECT_TRUE(CutUp<CubeEdge>(CubeTriangles(inside), polygons)) << inside;
  }
}

TEST(WholeMesh, IsThatOfThePlainCode) {
  Dice dice(1);
  for (int i = 0; i < 6; ++i) {
    const TsdfGrid grid = RandomGrid(dice, 5 + 10 * i, i % 2 == 1);
    const TriangleMesh mesh = ExtractMesh(grid, kMeshVoxel_m);
    EXPECT_GT(mesh.triangles.size(), 1000U);
    EXPECT_TRUE(IsThePlainSurface(mesh, reference::PlainMesh(grid, kMeshVoxel_m))) << i;
  }
  EXPECT_TRUE(ExtractMesh(TsdfGrid(), kMeshVoxel_m).triangles.empty());
}

TEST(WholeMesh, IsTheSameForAnyNumberOfThreadsAndOrderOfBlocks) {
  Dice dice(2);
  const TsdfGrid grid = RandomGrid(dice, 60, true);
  TsdfGrid backwards;
  for (auto entry = grid.entries().rbegin(); entry != grid.entries().rend(); ++entry) {
    backwards.FindOrAdd(entry->index) = *entry->block;
  }
  const std::string bytes = BytesOf(ExtractMesh(grid, kMeshVoxel_m));
  EXPECT_TRUE(BytesOf(ExtractMesh(backwards, kMeshVoxel_m)) == bytes);
  for (const std::size_t threads : {1U, 2U, 4U}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_TRUE(BytesOf(ExtractMesh(grid, kMeshVoxel_m)) == bytes) << threads;
  }
}

// A ball about the origin, so that it lies in eight blocks around it and more, on both sides of
// every axis.
TEST(WholeMesh, OfABallAcrossBlocksHasNoOpenEdge) {
  constexpr double kRadius_voxels = 10.3;
  TsdfGrid grid;
  for (int z = -2; z < 2; ++z) {
    for (int y = -2; y < 2; ++y) {
      for (int x = -2; x < 2; ++x) {
        TsdfBlock& block = grid.FindOrAdd({x, y, z});
        for (int place = 0; place < kBlockVoxels; ++place) {
          const Index3 v = VoxelAt({x, y, z}, place);
          const double range = Eigen::Vector3d(v.x + 0.1, v.y - 0.2, v.z + 0.3).norm();
          block.distance[static_cast<std::size_t>(place)] =
              static_cast<float>((range - kRadius_voxels) * kMeshVoxel_m);
          block.weight[static_cast<std::size_t>(place)] = 1;
        }
        block.UpdateMasks(kBack_m);
      }
    }
  }
  const TriangleMesh mesh = ExtractMesh(grid, kMeshVoxel_m);
  const Topology topology(mesh);
  EXPECT_EQ(topology.positions.size(), mesh.vertices.size()) << "a vertex is not shared";
  for (const auto& [edge, use] : topology.edges) {
    ASSERT_EQ(use.forward, 1);
    ASSERT_EQ(use.backward, 1);
  }
  EXPECT_EQ(topology.Euler(), 2);
  // The faceting of a ball of ten voxels loses well below 1 % of its volume.
  const double ball = 4.0 / 3.0 * M_PI * std::pow(kRadius_voxels * kMeshVoxel_m, 3);
  EXPECT_NEAR(VolumeOf(mesh) / ball, 1, 0.01);
}

TEST(MeshCache, FollowsAnyChangeOfAGrid) {
  Dice dice(3);
  TsdfGrid grid = RandomGrid(dice, 20, true);
  GridMesh cache;
  for (int step = 0; step < 300; ++step) {
    const int changes = 1 + dice.Whole(3);
    for (int i = 0; i < changes; ++i) {
      const int what = dice.Whole(5);
      const auto& entries = grid.entries();
      TsdfBlock& some =
          *entries[static_cast<std::size_t>(dice.Whole(static_cast<int>(entries.size())))].block;
      if (what == 0) {
        for (int k = 0; k < 3; ++k) {
          FillAtRandom(grid.FindOrAdd(RandomBlock(dice)), dice, dice.Whole(2) == 0);
        }
      } else if (what == 1) {  // values, but no sign
        for (Half& distance : some.distance) distance = distance * 0.9F;
        some.UpdateMasks(kBack_m);
      } else if (what == 2) {  // a single voxel
        // Most of them at a corner of the block, which seven others read.
        const bool corner = dice.Whole(3) > 0;
        const int place = corner ? 7 * dice.Whole(2) + 56 * dice.Whole(2) + 448 * dice.Whole(2)
                                 : dice.Whole(kBlockVoxels);
        if (dice.Whole(2) == 0) {
          some.Clear(place);
        } else {
          Half& turned = some.distance[static_cast<std::size_t>(place)];
          turned = -turned;
        }
        some.UpdateMasks(kBack_m);
      } else if (what == 3) {  // one block less, and the others in another order
        const auto gone = static_cast<std::size_t>(dice.Whole(static_cast<int>(entries.size())));
        TsdfGrid less;
        for (std::size_t k = entries.size(); k-- > 0;) {
          if (k != gone) less.FindOrAdd(entries[k].index) = *entries[k].block;
        }
        grid = std::move(less);
      } else {  // the same blocks elsewhere in memory
        grid = TsdfGrid(grid);
      }
    }
    cache.Update(grid, kMeshVoxel_m);
    ASSERT_TRUE(BytesOf(Join({{&cache}})) == BytesOf(ExtractMesh(grid, kMeshVoxel_m))) << step;
  }
  EXPECT_GT(ExtractMesh(grid, kMeshVoxel_m).triangles.size(), 1000U);
}

TEST(MeshCache, MakesAgainOnlyWhatChangedAndWhatReadsIt) {
  Dice dice(4);
  TsdfGrid grid;
  for (int i = 0; i < 125; ++i) {
    FillAtRandom(grid.FindOrAdd({i % 5 - 2, i / 5 % 5 - 2, i / 25 - 2}), dice, false);
  }
  GridMesh cache;
  EXPECT_EQ(cache.Update(grid, kMeshVoxel_m).changed, 125U);
  const MeshWork nothing = cache.Update(grid, kMeshVoxel_m);
  EXPECT_EQ(nothing.blocks, 125U);
  EXPECT_EQ(nothing.changed, 0U);
  EXPECT_EQ(nothing.remade, 0U);

  TsdfBlock& middle = *grid.Find({0, 0, 0});
  for (Half& distance : middle.distance) distance = distance * 0.9F;
  middle.UpdateMasks(kBack_m);
  const MeshWork values = cache.Update(grid, kMeshVoxel_m);
  EXPECT_EQ(values.changed, 1U);
  EXPECT_EQ(values.remade, 4U) << "vertices on edges that end in the block lie in three others";

  middle.distance[0] = -middle.distance[0];
  middle.UpdateMasks(kBack_m);
  const MeshWork sign = cache.Update(grid, kMeshVoxel_m);
  EXPECT_EQ(sign.changed, 1U);
  EXPECT_LE(sign.remade, 27U);
  EXPECT_GE(sign.remade, 8U);
  EXPECT_TRUE(BytesOf(Join({{&cache}})) == BytesOf(ExtractMesh(grid, kMeshVoxel_m)));

  middle.Clear(0);
  middle.UpdateMasks(kBack_m);
  cache.Update(grid, kMeshVoxel_m);
  EXPECT_TRUE(BytesOf(Join({{&cache}})) == BytesOf(ExtractMesh(grid, kMeshVoxel_m)));
}

class KeptMeshes : public ::testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Methods, KeptMeshes, ::testing::ValuesIn(VoxelMethods()),
                         [](const auto& parameters) {
                           std::string name(MethodName(parameters.param));
                           for (char& c : name) {
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           }
                           return name;
                         });

TEST_P(KeptMeshes, AreThoseFromScratchAfterAnyEvents) {
  for (const std::uint64_t seed : {11U, 12U, 13U}) {
    Dice dice(seed);
    const auto map = MakeMap(GetParam(), ToyConfig(dice.Whole(2) == 0 ? 2 : 4));
    SceneMesher mesher;
    Scene scene = TableWithToys();
    const auto some_pose = [&](double reach_m) {
      return MakePose(dice.Uniform(-1, 1), {0.1, dice.Uniform(-0.3, 0.3), 1},
                      {dice.Uniform(-reach_m, reach_m), dice.Uniform(-reach_m, reach_m),
                       kTableTop_m + dice.Uniform(0.02, 0.06)});
    };
    for (int event = 0; event < 14; ++event) {
      const auto id = static_cast<InstanceId>(1 + dice.Whole(3));
      const int what = dice.Whole(6);
      if (what == 0) {
        map->Remove(id);
      } else if (what == 1) {
        map->SetObjectPose(id, some_pose(0.2));
      } else {
        if (what == 2) scene.T_WO[id] = some_pose(0.15);
        const Frame frame = RenderToys(scene, dice.Uniform(0, 6), event);
        for (const auto& [object, T_WO] : frame.T_WO) map->SetObjectPose(object, T_WO);
        map->Fuse(frame, frame.mask);
      }
      // Not after every event, so that changes add up; sometimes one object alone was asked for.
      if (dice.Whole(3) == 0) mesher.ObjectMesh(*map, id);
      if (dice.Whole(2) == 0) {
        ASSERT_TRUE(SameAsFromScratch(*map, mesher)) << "seed " << seed << ", event " << event;
      }
    }
    ASSERT_TRUE(SameAsFromScratch(*map, mesher)) << "seed " << seed;
    if (GetParam() == Method::kTsdfpp || GetParam() == Method::kTsdfppAnchored) {
      EXPECT_TRUE(TrianglesOf(mesher.SceneMesh(*map)) == VisibleTriangles(*map)) << "seed " << seed;
    }
    EXPECT_GT(mesher.SceneMesh(*map).triangles.size(), 100U);
  }
}

// The ball is born far from the table and moved into it, where half of it is hidden.
TEST(HiddenTriangles, AreThoseOfWhereAnObjectStandsNow) {
  Scene scene = TableOnly();
  const Eigen::Vector3d birthplace(3.1, -2.2, 1.3);
  AddBall(scene, birthplace);
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  for (const Eigen::Vector3d& target : {Eigen::Vector3d::Zero().eval(), birthplace}) {
    const Frame frame = reference::Render(
        scene, reference::LookAt(target + Eigen::Vector3d(0.3, 0.1, 0.45), target));
    for (const auto& [id, T_WO] : frame.T_WO) map->SetObjectPose(id, T_WO);
    map->Fuse(frame, frame.mask);
  }
  map->SetObjectPose(kBall, MakePose(0.4, {0, 0.3, 1}, {0.02, 0.01, kTableTop_m - 0.03}));
  SceneMesher mesher;
  const std::size_t shown = mesher.SceneMesh(*map).triangles.size();
  EXPECT_LT(shown, AllObjectsMesh(*map).triangles.size()) << "nothing is hidden";
  EXPECT_TRUE(TrianglesOf(mesher.SceneMesh(*map)) == VisibleTriangles(*map));
  map->SetObjectPose(kBall, scene.T_WO.at(kBall));
  EXPECT_GT(mesher.SceneMesh(*map).triangles.size(), shown);
  EXPECT_TRUE(TrianglesOf(mesher.SceneMesh(*map)) == VisibleTriangles(*map));
}

TEST_P(KeptMeshes, AreCounted) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  const Frame frame = RenderToys(TableWithToys(), 0.2);
  map->Fuse(frame, frame.mask);
  SceneMesher mesher;
  EXPECT_EQ(mesher.Bytes(), 0U);
  const std::size_t bytes = map->Memory().bytes;
  const MeshWork all = mesher.Update(*map);
  EXPECT_GT(all.blocks, 20U);
  EXPECT_EQ(all.changed, all.blocks);
  EXPECT_EQ(mesher.Update(*map).changed, 0U);
  EXPECT_GT(mesher.Bytes(), 10000U);
  EXPECT_EQ(map->Memory().bytes, bytes) << "the map is as it was";
}

TEST(AllObjects, AreTheirMeshesOneAfterTheOther) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  const Frame frame = RenderToys(TableWithToys(), 0.2);
  map->Fuse(frame, frame.mask);
  const TriangleMesh all = AllObjectsMesh(*map);
  std::size_t triangles = 0;
  for (const InstanceId id : ToyIds()) {
    const std::size_t own = map->ObjectMesh(id).triangles.size();
    EXPECT_GT(own, 10U);
    for (std::size_t t = triangles; t < triangles + own; ++t) ASSERT_EQ(all.face_ids[t], id);
    triangles += own;
  }
  EXPECT_EQ(all.triangles.size(), triangles);
  EXPECT_EQ(all.face_ids.size(), triangles);
}

}  // namespace
}  // namespace tsdfpp
