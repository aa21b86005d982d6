// Maps at the end of what their voxels reach: just inside it they are as anywhere, and beyond it is
// refused.
#include "mapper/volume/lattice_range.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "mapper/map_editing.h"
#include "mapper/map_file.h"
#include "mapper/map_query.h"
#include "mapper/map_reach.h"
#include "mapper/mesh/join_parts.h"
#include "mapper/methods/map_objects.h"
#include "mapper/store/byte_stream.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/pull_back.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/dyadic_scene.h"
#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

// The toys and their bands take less than 16 blocks to either side.
constexpr int kEdgeBlocks = kFurthestBlock - 16;
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

const std::vector<Index3>& Directions() {
  static const std::vector<Index3> directions{{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                              {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
  return directions;
}
Index3 Times(const Index3& direction, int blocks) {
  return {direction.x * blocks, direction.y * blocks, direction.z * blocks};
}
Eigen::Vector3d MetresOf(const Index3& blocks, double voxel_m) {
  return Eigen::Vector3d(blocks.x, blocks.y, blocks.z) * (kBlockSide * voxel_m);
}

// A sentence of the frame that says where it is and how far the voxels reach.
void ExpectRefused(const Expected<void>& status, const std::string& what) {
  ASSERT_FALSE(status.has_value()) << what;
  EXPECT_EQ(status.error().kind, ErrorKind::kData);
  const std::string& message = status.error().message;
  EXPECT_NE(message.find(what), std::string::npos) << message;
  EXPECT_LT(message.size(), 500U) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}
void ExpectBeyond(const Expected<void>& status, const std::string& what) {
  ExpectRefused(status, what);
  if (status) return;
  for (const char* part : {" m, expected at most ", "voxels of ", "would help"}) {
    EXPECT_NE(status.error().message.find(part), std::string::npos) << status.error().message;
  }
}

Expected<void> Check(const MapRepresentation& map, const Frame& frame) {
  if (auto form = CheckFrameForm(frame, frame.mask); !form) return form;
  return CheckReach(map, frame, frame.mask, frame.T_WO);
}

class LatticeEdge : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(LatticeEdge);

// Vertices are single precision in metres: as far out as this they are rounded to so much.
void ExpectSameMeshShifted(const TriangleMesh& mesh, const TriangleMesh& shifted,
                           const Eigen::Vector3d& shift_m) {
  const double rounding_m =
      2 * shift_m.cwiseAbs().maxCoeff() * std::numeric_limits<float>::epsilon();
  ASSERT_EQ(shifted.triangles, mesh.triangles);
  ASSERT_EQ(shifted.vertices.size(), mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d expected = mesh.vertices[i].cast<double>() + shift_m;
    ASSERT_LE((shifted.vertices[i].cast<double>() - expected).cwiseAbs().maxCoeff(), rounding_m);
  }
}

TEST_P(LatticeEdge, JustInsideAMapIsTheOneOfTheOrigin) {
  constexpr int kFrames = 3;
  const auto map = DyadicMap(GetParam(), kFrames);
  for (const Index3& direction : Directions()) {
    const Index3 blocks = Times(direction, kEdgeBlocks);
    SCOPED_TRACE(Text({blocks.x, blocks.y, blocks.z}));
    const auto far = MakeMap(GetParam(), DyadicConfig());
    for (int i = 0; i < kFrames; ++i) {
      const Frame frame = Shifted(DyadicFrame(i), blocks);
      const auto status = Check(*far, frame);
      ASSERT_TRUE(status.has_value()) << status.error().message;
      PoseAndFuse(*far, frame);
    }
    EXPECT_TRUE(SameContentShifted(*map, *far, blocks));
    EXPECT_EQ(VoxelsOf(*far).FindFault(), std::nullopt);
    for (const InstanceId id : ToyIds()) {
      if (IsOneField(GetParam())) break;  // whose triangles go by where they are, rounded
      ExpectSameMeshShifted(map->ObjectMesh(id), far->ObjectMesh(id),
                            MetresOf(blocks, kDyadicVoxel_m));
    }
    // What is hidden, and by whom, is looked up at rounded places.
    const double near_triangles = static_cast<double>(map->SceneMesh().triangles.size());
    const double far_triangles = static_cast<double>(far->SceneMesh().triangles.size());
    EXPECT_NEAR(far_triangles, near_triangles, 0.1 * near_triangles);

    const std::string file = MapToBytes(*far).value();
    const auto loaded = MapFromBytes(file, "far.tsdf");
    ASSERT_TRUE(loaded.has_value()) << loaded.error().message;
    EXPECT_TRUE(MapToBytes(*loaded->map).value() == file);
    const Eigen::Vector3d above_table(0.2, 0.2, 0.02);
    const auto near = MapQuery::Of(*map).value().At(above_table);
    const auto answer =
        MapQuery::Of(*far).value().At(above_table + MetresOf(blocks, kDyadicVoxel_m));
    ASSERT_TRUE(near.visible.has_value());
    ASSERT_TRUE(answer.visible.has_value());
    EXPECT_NEAR(answer.visible->distance_m, near.visible->distance_m, 1e-3 * kDyadicVoxel_m);
    far->Remove(kBrick);
    EXPECT_EQ(VoxelsOf(*far).FindFault(), std::nullopt);
    EXPECT_FALSE(far->SceneMesh().triangles.empty());
  }
}

// Nothing of it is exact: voxels of 2 cm are rounded by half a voxel there.
TEST_P(LatticeEdge, AnyWorldJustInsideIsMapped) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 3);
  for (const Index3& direction : {Index3{1, 1, 1}, Index3{-1, -1, -1}}) {
    const Index3 blocks = Times(direction, kEdgeBlocks);
    const auto far = MakeMap(GetParam(), ToyConfig());
    for (int i = 0; i < 3; ++i) {
      const Frame frame = Shifted(DriveFrame(i), blocks, kToyVoxel_m);
      const auto status = Check(*far, frame);
      ASSERT_TRUE(status.has_value()) << status.error().message;
      PoseAndFuse(*far, frame);
    }
    EXPECT_GT(VoxelsOf(*far).ListedVoxels().size(), VoxelsOf(*map).ListedVoxels().size() / 2);
    EXPECT_FALSE(far->SceneMesh().triangles.empty());
    EXPECT_FALSE(far->ObjectMesh(kBackground).triangles.empty());
    EXPECT_EQ(VoxelsOf(*far).FindFault(), std::nullopt);
    const auto rays = far->CastRays(reference::SmallCamera(),
                                    Shifted(DriveFrame(2), blocks, kToyVoxel_m).T_WC, {});
    EXPECT_GT(cv::countNonZero(rays.front().depth), 0);
  }
}

TEST_P(LatticeEdge, JustOutsideIsRefusedAndSaysWhereThatIs) {
  const auto map = MakeMap(GetParam(), DyadicConfig());
  for (const Index3& direction : Directions()) {
    SCOPED_TRACE(Text({direction.x, direction.y, direction.z}));
    // The camera itself.
    ExpectBeyond(Check(*map, Shifted(DyadicFrame(7), Times(direction, kFurthestBlock + 12))),
                 "frame 7: ");
    // The camera is inside, and what it sees lies out: the table below it, or beside it.
    const int inside = direction.z > 0 ? kFurthestBlock - 2 : kFurthestBlock - 6;
    Frame frame = Shifted(DyadicFrame(7), Times(direction, inside));
    frame.T_WO.clear();
    if (direction.z > 0) frame.T_WC.translation().z() -= 0.7;
    frame.T_WC.translation() -= 0.3 * MetresOf(direction, 1.0 / kBlockSide);
    if (direction.z <= 0) frame.depth.setTo(2.5);
    if (direction.z > 0) frame.T_WC.linear() = Eigen::Matrix3d::Identity();  // looks up
    ExpectBeyond(Check(*map, frame), "frame 7: pixel (");
    // Where no pixel has a label nobody asks for what it shows.
    frame.mask.setTo(kNoInstance);
    EXPECT_TRUE(Check(*map, frame).has_value());
  }
  EXPECT_EQ(map->Memory().blocks, 0U);
}

TEST_P(LatticeEdge, FarFarOutIsRefused) {
  const auto map = MakeMap(GetParam(), DyadicConfig());
  PoseAndFuse(*map, DyadicFrame(0));
  const std::string before = MapToBytes(*map).value();
  for (const double metres : {1e5, -1e5, 2147483648.0 * kDyadicVoxel_m, 1e9, -1e300, 1.7e308}) {
    for (int axis = 0; axis < 3; ++axis) {
      Frame camera = DyadicFrame(7);
      camera.T_WC.translation()[axis] = metres;
      ExpectBeyond(Check(*map, camera), "frame 7: the camera is at (");
      Frame object = DyadicFrame(7);
      object.T_WO.at(kBall).translation()[axis] = metres;
      ExpectBeyond(Check(*map, object), "frame 7: object 2 is posed at (");
    }
  }
  for (const double nothing : {kNotANumber, std::numeric_limits<double>::infinity()}) {
    Frame camera = DyadicFrame(7);
    camera.T_WC.translation().y() = nothing;
    ExpectRefused(Check(*map, camera), "frame 7: the camera's pose holds a number that");
    Frame object = DyadicFrame(7);
    object.T_WO.at(kBall).linear()(1, 2) = nothing;
    ExpectRefused(Check(*map, object), "frame 7: object 2's pose holds a number that");
  }
  for (const double scale : {0.0, 0.999, 1.001, -1.0}) {
    Frame frame = DyadicFrame(7);
    frame.T_WO.at(kBall).linear() *= scale;
    ExpectRefused(Check(*map, frame), "frame 7: object 2's pose is no rigid motion");
  }
  EXPECT_TRUE(MapToBytes(*map).value() == before);
}

// A focal length so short that rays leave the range sideways.
TEST_P(LatticeEdge, RaysThatLeaveTheRangeAreRefused) {
  const auto map = MakeMap(GetParam(), DyadicConfig());
  for (const double focal_px : {1e-30, 5e-324, 1e-4}) {
    Frame frame = DyadicFrame(7);
    frame.intrinsics.fx = focal_px;
    ExpectBeyond(Check(*map, frame), "frame 7: pixel (");
  }
}

// The brick is mapped near the origin, and then posed at the end of the range.
TEST_P(LatticeEdge, APoseThatTakesAnObjectOutIsRefused) {
  const bool poses_move = GetParam() != Method::kTsdfStatic;
  for (const Index3& direction : Directions()) {
    SCOPED_TRACE(Text({direction.x, direction.y, direction.z}));
    const auto map = DyadicMap(GetParam(), 2);
    const std::size_t triangles = map->ObjectMesh(kBrick).triangles.size();
    ASSERT_GT(triangles, 50U);
    const Frame frame = DyadicFrame(1);
    const auto at = [&](double blocks) {
      Pose T_WO = frame.T_WO.at(kBrick);
      const Eigen::Vector3d way = MetresOf(direction, kDyadicVoxel_m);
      for (int axis = 0; axis < 3; ++axis) {
        if (way[axis] != 0) T_WO.translation()[axis] = 0;
      }
      T_WO.translation() += blocks * way;
      return std::map<InstanceId, Pose>{{kBrick, T_WO}};
    };
    Frame nothing_seen = frame;
    nothing_seen.mask.setTo(kNoInstance);
    const auto check = [&](double blocks) {
      return CheckReach(*map, nothing_seen, nothing_seen.mask, at(blocks));
    };
    // Its origin is still inside.
    const std::string before = MapToBytes(*map).value();
    if (direction.z < 0) {
      // Seen from above: nothing of it may be below its origin.
    } else if (poses_move) {
      ExpectBeyond(check(kFurthestBlock), "frame 1: object 1's pose takes a part of it to (");
    } else {
      EXPECT_TRUE(check(kFurthestBlock).has_value());
    }
    ExpectBeyond(check(kFurthestBlock + 1), "frame 1: object 1 is posed at (");
    EXPECT_TRUE(MapToBytes(*map).value() == before);
    const auto status = check(kFurthestBlock - 8);
    ASSERT_TRUE(status.has_value()) << status.error().message;
    map->SetObjectPose(kBrick, at(kFurthestBlock - 8).at(kBrick));
    EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
    EXPECT_FALSE(map->SceneMesh().triangles.empty());
    // All of it, or what moved values do not lose at their rims.
    EXPECT_GT(map->ObjectMesh(kBrick).triangles.size(), triangles / 4);
    const std::string file = MapToBytes(*map).value();
    const auto loaded = MapFromBytes(file, "far.tsdf");
    ASSERT_TRUE(loaded.has_value()) << loaded.error().message;
    EXPECT_TRUE(MapToBytes(*loaded->map).value() == file);
    // And home again.
    map->SetObjectPose(kBrick, frame.T_WO.at(kBrick));
    EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
    EXPECT_FALSE(map->ObjectMesh(kBrick).triangles.empty());
  }
}

// Labels that say an object is here while its pose says that it is far away: in its own lattice,
// where values stay, that is out of range.
TEST_P(LatticeEdge, WhatIsOutOfRangeInTheObjectsLatticeIsRefused) {
  const auto map = DyadicMap(GetParam(), 1);
  Frame frame = DyadicFrame(7);
  const double range_m = LatticeRange(kDyadicVoxel_m).reach_m;
  frame.T_WO.at(kBall).translation().x() = range_m - 1;
  const bool own_lattice = GetParam() == Method::kTsdfppAnchored || GetParam() == Method::kVolumes;
  ASSERT_TRUE(Check(*map, frame).has_value());
  // Born at one end of the range, now at the other: seen in the middle it is a range from its
  // birth.
  const auto born_far = MakeMap(GetParam(), DyadicConfig());
  Pose birth = Pose::Identity();
  birth.translation().x() = -range_m + 1;
  born_far->SetObjectPose(kBall, birth);
  const auto status = Check(*born_far, frame);
  if (own_lattice) {
    ExpectBeyond(status, "shows object 2 at a place that in the object's own lattice is (");
  } else {
    EXPECT_TRUE(status.has_value());
  }
}

// A box around both places would hold 10^15 blocks.
TEST_P(LatticeEdge, AnObjectSeenAtPlacesFarApartIsMovedInNoTime) {
  const auto map = MakeMap(GetParam(), DyadicConfig());
  const Frame here = DyadicFrame(0);
  const Index3 blocks{kEdgeBlocks / 5, -kEdgeBlocks / 7, kEdgeBlocks / 6};
  PoseAndFuse(*map, here);
  Frame there = Shifted(here, blocks);
  there.T_WO.clear();
  ASSERT_TRUE(Check(*map, there).has_value());
  map->Fuse(there, there.mask);
  const std::size_t triangles = map->ObjectMesh(kBrick).triangles.size();
  Frame moved = here;
  moved.T_WO.at(kBrick) =
      reference::MakePose(0.2, {0.1, 0.2, 1}, moved.T_WO.at(kBrick).translation());
  ASSERT_TRUE(Check(*map, moved).has_value());
  map->SetObjectPose(kBrick, moved.T_WO.at(kBrick));
  EXPECT_GT(map->ObjectMesh(kBrick).triangles.size(), triangles / 4);
  EXPECT_FALSE(map->SceneMesh().triangles.empty());
  EXPECT_FALSE(VoxelsOf(*map).ListedVoxels().empty());
  map->CastRays(here.intrinsics, here.T_WC, {});
  PoseAndFuse(*map, DyadicFrame(2));
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
}

TEST_P(LatticeEdge, AVolumeIsAddedInTheRangeOnly) {
  constexpr InstanceId kNew = 7;
  const auto from = DyadicMap(GetParam(), 2);
  const TsdfGrid volume = CopyVolume(*from, kBall);
  ASSERT_FALSE(volume.empty());
  const auto map = DyadicMap(GetParam(), 1);
  const std::string before = MapToBytes(*map).value();
  for (const Index3& direction : Directions()) {
    const auto at = [&](int blocks) {
      Pose T = Pose::Identity();
      T.translation() = MetresOf(Times(direction, blocks), kDyadicVoxel_m);
      return T;
    };
    ExpectBeyond(EditingOf(*map).Add(kNew, volume, at(kFurthestBlock + 8), at(kFurthestBlock - 1)),
                 "object 7's lattice takes a part of it to (");
    ExpectBeyond(EditingOf(*map).Add(kNew, volume, Pose::Identity(), at(kFurthestBlock + 1)),
                 "object 7 is posed at (");
    ExpectBeyond(EditingOf(*map).Add(kNew, volume, at(-9), at(kFurthestBlock - 1)),
                 "object 7's pose in its own lattice is at (");
    Pose skew = at(1);
    skew.linear() *= 2;
    ExpectRefused(EditingOf(*map).Add(kNew, volume, skew, at(1)),
                  "object 7's lattice's pose is no rigid");
    EXPECT_TRUE(MapToBytes(*map).value() == before);
    const auto good = map->Clone();
    const auto added = EditingOf(*good).Add(kNew, volume, at(kEdgeBlocks), at(kEdgeBlocks));
    ASSERT_TRUE(added.has_value()) << added.error().message;
    EXPECT_FALSE(good->ObjectMesh(kNew).triangles.empty());
    EXPECT_EQ(VoxelsOf(*good).FindFault(), std::nullopt);
  }
  // A volume that has a block out there itself.
  TsdfGrid far;
  far.Add({kFurthestBlock + 1, 0, 0}, std::make_unique<TsdfBlock>(*volume.entries()[0].block));
  ExpectBeyond(EditingOf(*map).Add(kNew, far, Pose::Identity(), Pose::Identity()),
               "object 7's volume has");
  EXPECT_TRUE(MapToBytes(*map).value() == before);
}

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
