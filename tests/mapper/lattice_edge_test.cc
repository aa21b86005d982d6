// Maps at the end of what their voxels reach: just inside it they are as anywhere, and beyond it is
// refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "mapper/map_editing.h"
#include "mapper/map_file.h"
#include "mapper/map_query.h"
#include "mapper/map_reach.h"
#include "mapper/methods/map_objects.h"
#include "mapper/volume/lattice_range.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/dyadic_scene.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/range_checks.h"

namespace tsdfpp {
namespace {

using test::Directions;
using test::ExpectRefused;
using test::kNotANumber;
using test::Times;

// The toys and their bands take less than 16 blocks to either side.
constexpr int kEdgeBlocks = kFurthestBlock - 16;

Eigen::Vector3d MetresOf(const Index3& blocks, double voxel_m) {
  return Eigen::Vector3d(blocks.x, blocks.y, blocks.z) * (kBlockSide * voxel_m);
}

// A sentence of the frame that says where it is and how far the voxels reach.
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
  const bool own_lattice = MovesLattices(GetParam());
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

// The keys of cells of blocks wrap at multiples of 2^26 voxels.
TEST_P(LatticeEdge, VoxelsThatNoGridCanStoreAreNotThere) {
  const auto map = DyadicMap(GetParam(), 1);
  const VoxelInspection& voxels = VoxelsOf(*map);
  const auto observed = voxels.ObservedVoxels(kBackground);
  const auto listed = voxels.ListedVoxels();
  ASSERT_FALSE(observed.empty());
  for (const int shift : {1 << 26, -(1 << 26), 1 << 27, 1 << 30}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3i far = shift * Eigen::Vector3i::Unit(axis);
      for (const Eigen::Vector3i& v : observed) {
        ASSERT_FALSE(voxels.ValueAt(kBackground, v + far)) << Text(v + far);
      }
      for (const Eigen::Vector3i& v : listed) {
        ASSERT_TRUE(voxels.ListAt(v + far).empty()) << Text(v + far);
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
