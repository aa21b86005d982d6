// The end of what voxels reach: of poses, volumes, grids, files and frames.
#include "mapper/volume/lattice_range.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>

#include "mapper/map_reach.h"
#include "mapper/mesh/join_parts.h"
#include "mapper/store/byte_stream.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/pull_back.h"
#include "tests/mapper/dyadic_scene.h"
#include "tests/mapper/range_checks.h"

namespace tsdfpp {
namespace {

using test::Directions;
using test::ExpectRefused;
using test::kNotANumber;
using test::Times;

std::unique_ptr<TsdfBlock> BlockWithSurface() {
  auto block = std::make_unique<TsdfBlock>();
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const auto along = [&](unsigned shift) { return static_cast<double>((i >> shift) & 7U); };
    // No multiple of what half precision resolves.
    const double voxels = along(0) - 3.3 + 0.31 * along(3) - 0.17 * along(6);
    block->distance[i] = static_cast<float>(kDyadicVoxel_m * std::clamp(voxels, -3.9, 3.9));
    block->weight[i] = 1;
  }
  block->UpdateMasks(DyadicConfig().back());
  return block;
}

ObjectVolumes OneVolume(const Index3& block, const Pose& T_WO_birth, const Pose& T_WO) {
  ObjectVolumes volumes;
  ObjectVolume& volume = volumes[kBrick];
  volume.grid.Add(block, BlockWithSurface());
  volume.T_WO_birth = T_WO_birth;
  volume.T_WO = T_WO;
  return volumes;
}

Expected<ObjectVolumes> SavedAndLoaded(const ObjectVolumes& volumes) {
  std::string bytes;
  SaveVolumes(volumes, bytes);
  ByteReader reader(bytes);
  return LoadVolumes(reader, DyadicConfig());
}

TEST(LatticeRange, FilesWithBlocksOrPosesBeyondAreRefused) {
  const double reach_m = LatticeRange(kDyadicVoxel_m).reach_m;
  const auto at = [](double x_m) { return Pose(Eigen::Translation3d(x_m, 0, 0)); };
  const Pose home = Pose::Identity();
  EXPECT_TRUE(SavedAndLoaded(OneVolume({kFurthestBlock, 0, 0}, home, home)).has_value());
  EXPECT_FALSE(SavedAndLoaded(OneVolume({kFurthestBlock + 1, 0, 0}, home, home)).has_value());
  EXPECT_FALSE(SavedAndLoaded(OneVolume({0, 0, -kFurthestBlock - 1}, home, home)).has_value());
  EXPECT_TRUE(SavedAndLoaded(OneVolume({0, 0, 0}, home, at(reach_m))).has_value());
  const auto pose = SavedAndLoaded(OneVolume({0, 0, 0}, home, at(1.001 * reach_m)));
  ASSERT_FALSE(pose.has_value());
  EXPECT_NE(pose.error().message.find("expected at most"), std::string::npos)
      << pose.error().message;
  const auto placed = SavedAndLoaded(OneVolume({100, 0, 0}, home, at(reach_m)));
  ASSERT_FALSE(placed.has_value());
  EXPECT_NE(placed.error().message.find("object 1's poses take a part of it to"), std::string::npos)
      << placed.error().message;
  EXPECT_TRUE(SavedAndLoaded(OneVolume({-100, 0, 0}, home, at(reach_m))).has_value());
  // Far from its birth and back: what counts is where blocks are.
  EXPECT_TRUE(SavedAndLoaded(OneVolume({-100, 0, 0}, at(-reach_m), at(0))).has_value());
}

TEST(LatticeRange, KnowsItsEnds) {
  const LatticeRange range(0.01);
  EXPECT_NEAR(range.reach_m, 83884.8, 0.1);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {1.0, -1.0}) {
      Eigen::Vector3d p = Eigen::Vector3d::Zero();
      p[axis] = side * range.reach_m;
      EXPECT_TRUE(range.Holds(p));
      p[axis] *= 1 + 1e-12;
      EXPECT_FALSE(range.Holds(p));
      p[axis] = kNotANumber;
      EXPECT_FALSE(range.Holds(p));
    }
  }
  const Pose home = Pose::Identity();
  const Index3 low{-kFurthestBlock, 0, 0};
  const Index3 high{kFurthestBlock, kFurthestBlock, 0};
  EXPECT_TRUE(range.HoldsMoved(low, high, home, 0));
  EXPECT_FALSE(range.HoldsMoved(low, high + Index3{1, 0, 0}, home, 0));
  EXPECT_TRUE(range.HoldsMoved(low, high + Index3{1, 0, 0}, home, 1));
  EXPECT_FALSE(range.HoldsMoved(low + Index3{-1, 0, 0}, high, home, 0));
  Pose broken = home;
  broken.translation().x() = kNotANumber;
  EXPECT_FALSE(range.HoldsMoved(low, high, broken, 0));
  // Larger voxels help only where there are any.
  EXPECT_NE(range.Beyond({1e5, 0, 0}).find("voxels of 0.012 m"), std::string::npos)
      << range.Beyond({1e5, 0, 0});
  EXPECT_EQ(range.Beyond({1e9, 0, 0}).find("or voxels of"), std::string::npos);
}

// Which blocks are neighbours of which, at the last indices that a grid takes.
TEST(LatticeRange, AMeshAtTheLastIndicesIsThatOfTheOrigin) {
  for (const Index3& direction : Directions()) {
    const Index3 corner = Times(direction, kFurthestStored);
    TsdfGrid near;
    TsdfGrid far;
    for (int i = 0; i < 8; ++i) {
      // Away from the end, and the same to either side of it.
      const auto step = [&](int along, int bit) {
        return along > 0 ? -((i >> bit) & 1) : (i >> bit) & 1;
      };
      const Index3 index{step(direction.x, 0), step(direction.y, 1), step(direction.z, 2)};
      near.Add(index, BlockWithSurface());
      far.Add(corner + index, BlockWithSurface());
    }
    GridMesh near_mesh;
    GridMesh far_mesh;
    const auto voxel = static_cast<float>(kDyadicVoxel_m);
    near_mesh.Update(near, voxel);
    far_mesh.Update(far, voxel);
    const TriangleMesh expected = Join({{&near_mesh}});
    EXPECT_GT(expected.triangles.size(), 500U);
    EXPECT_EQ(Join({{&far_mesh}}).triangles, expected.triangles);
    EXPECT_EQ(far_mesh.parts().size(), 8U);
    far.Erase({corner});
    near.Erase({Index3{}});
    near_mesh.Update(near, voxel);
    far_mesh.Update(far, voxel);
    EXPECT_EQ(Join({{&far_mesh}}).triangles, Join({{&near_mesh}}).triangles);
  }
}

// Blocks that touch a moved grid, found by the box around it and by what is near each block.
TEST(LatticeRange, AGridInTwoPartsIsMovedAsEachAlone) {
  Dice dice(31);
  const MapConfig config = DyadicConfig();
  const auto same = [](const TsdfBlock& a, const TsdfBlock& b) {
    return a.distance == b.distance && a.weight == b.weight && a.observed == b.observed;
  };
  for (int round = 0; round < 5; ++round) {
    TsdfGrid here;
    TsdfGrid there;
    TsdfGrid both;
    const Index3 far{30000, -20000 + 3 * round, 10000};
    for (int i = 0; i < 40; ++i) {
      const Index3 index{dice.Whole(5), dice.Whole(5), dice.Whole(5)};
      if (here.Find(index) != nullptr) continue;
      here.Add(index, BlockWithSurface());
      both.Add(index, BlockWithSurface());
      there.Add(far + index, BlockWithSurface());
      both.Add(far + index, BlockWithSurface());
    }
    const Pose T = reference::MakePose(dice.Uniform(-3, 3), {dice.Uniform(-1, 1), 0.4, 0.8},
                                       {dice.Uniform(-9, 9), 2, dice.Uniform(-1, 1)});
    const auto moved = [&](const TsdfGrid& grid) {
      return ResampleGrid(grid, T, config.voxel_m, config.back(), Resampling::kObserved);
    };
    const TsdfGrid all = moved(both);
    std::size_t blocks = 0;
    for (const TsdfGrid& part : {moved(here), moved(there)}) {
      for (const auto& entry : part.entries()) {
        const TsdfBlock* block = all.Find(entry.index);
        ASSERT_NE(block, nullptr);
        EXPECT_TRUE(same(*block, *entry.block));
        ++blocks;
      }
    }
    EXPECT_GT(blocks, 50U);
    EXPECT_EQ(all.size(), blocks);
    EXPECT_TRUE(std::is_sorted(all.entries().begin(), all.entries().end(),
                               [](const auto& a, const auto& b) { return a.index < b.index; }));
  }
}

// The forms that a frame may not have, which the kernels would not survive.
TEST(FrameForm, IsSaidWhereItIsWrong) {
  const auto check = [](const std::function<void(Frame&)>& change) {
    Frame frame = DyadicFrame(7);
    change(frame);
    return CheckFrameForm(frame, frame.mask);
  };
  EXPECT_TRUE(check([](Frame&) {}).has_value());
  for (const auto& change : std::vector<std::function<void(Frame&)>>{
           [](Frame& f) { f.intrinsics.width = f.intrinsics.height = 0; },
           [](Frame& f) { f.intrinsics.width = -1; }, [](Frame& f) { f.intrinsics.fx = 0; },
           [](Frame& f) { f.intrinsics.fy = -80; }, [](Frame& f) { f.intrinsics.cx = kNotANumber; },
           [](Frame& f) { f.intrinsics.fx = std::numeric_limits<double>::infinity(); }}) {
    ExpectRefused(check(change), "frame 7: its camera has ");
  }
  ExpectRefused(check([](Frame& f) { f.mask = cv::Mat(); }), "frame 7: its mask image is 0x0 ");
  ExpectRefused(check([](Frame& f) { f.depth = cv::Mat(); }), "frame 7: its depth image is 0x0 ");
  ExpectRefused(check([](Frame& f) { f.colour = f.depth; }), "frame 7: its colour image is 96x72 ");
  ExpectRefused(check([](Frame& f) { f.intrinsics.height = 71; }), "expected 96x71 of ");
  ExpectRefused(check([](Frame& f) { f.depth.convertTo(f.depth, CV_64F); }), "32-bit depths");
  ExpectRefused(check([](Frame& f) { f.T_WC.linear().setZero(); }),
                "the camera's pose is no rigid");
}

}  // namespace
}  // namespace tsdfpp
