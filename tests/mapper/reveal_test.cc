// What is left of the table where an object hid it and was taken out of the map.
#include <gtest/gtest.h>

#include <set>

#include "tests/mapper/compare_maps.h"
#include "tests/mapper/mesh_checks.h"
#include "tests/mapper/methods_of_tests.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

// The table is mapped bare, then the tray, flat enough for its band to reach through to the table,
// slides over it and is taken out of the map.
struct Reveal {
  std::set<VoxelKey> bare;      // cubes of the table's surface under the tray, before it came
  std::set<VoxelKey> revealed;  // the same after its removal, from the visible scene
};

Reveal RunReveal(Method method) {
  const MapConfig config = ToyConfig();
  SideBySide maps(method, config, ToyBox(), ToyIds());
  Scene scene = TableOnly();
  AddTray(scene, 0.3, {-0.18, -0.12, kTableTop_m + 0.016});
  const auto under_tray = [&](const TriangleMesh& mesh) {
    TriangleMesh part = mesh;
    part.triangles.clear();
    const Eigen::Vector3d place = scene.ObjectPose(kTray).translation();
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Eigen::Vector3d p = CentroidOf(mesh, t);
      const bool under = (p - place).head<2>().norm() < 0.04;  // well inside its footprint
      if (under && std::abs(p.z() - kTableTop_m) < kToyVoxel_m) {
        part.triangles.push_back(mesh.triangles[t]);
      }
    }
    return CubesOf(part, kToyVoxel_m);
  };
  Reveal reveal;
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  maps.SetPosesAndFuse(RenderToys(scene, 0.4));
  const TriangleMesh bare = maps.map().SceneMesh();
  for (int i = 1; i <= 5; ++i) {
    scene.T_WO[kTray] = MakePose(0.3 + 0.15 * i, Eigen::Vector3d::UnitZ(),
                                 {-0.18 + 0.05 * i, -0.12 + 0.03 * i, kTableTop_m + 0.016});
    maps.SetPosesAndFuse(RenderToys(scene, 0.4 + 0.05 * i));
  }
  reveal.bare = under_tray(bare);
  maps.Remove(kTray);
  const TriangleMesh revealed = maps.map().SceneMesh();
  reveal.revealed = under_tray(revealed);
  // The hole is the reference's: the same cubes cross the surface of the table, or of the field.
  std::set<VoxelKey> expected;
  const std::set<VoxelKey> crossed = Keys(maps.dense().CrossedCubesOf(kBackground));
  for (const VoxelKey& cube : reveal.bare) {
    if (crossed.contains(cube)) expected.insert(cube);
  }
  std::set<VoxelKey> kept;
  for (const VoxelKey& cube : CubesOf(revealed, kToyVoxel_m)) {
    if (reveal.bare.contains(cube)) kept.insert(cube);
  }
  EXPECT_EQ(kept, expected);
  return reveal;
}

TEST(Reveal, TsdfppAndAnchoredKeepTheTableUnderATray) {
  for (const Method method : {Method::kTsdfpp, Method::kTsdfppAnchored}) {
    const Reveal reveal = RunReveal(method);
    EXPECT_GE(reveal.bare.size(), 9U);
    for (const VoxelKey& cube : reveal.bare) {
      EXPECT_TRUE(reveal.revealed.contains(cube)) << MethodName(method);
    }
  }
}

// How much that is, is for the evaluation to say; RunReveal compares it with the reference.
TEST(Reveal, OneFieldKeepsOfTheTableWhatItsReferenceKeeps) {
  for (const Method method : AllMethods()) {
    if (!IsOneField(method)) continue;
    EXPECT_FALSE(RunReveal(method).bare.empty()) << MethodName(method);
  }
}

}  // namespace
}  // namespace tsdfpp
