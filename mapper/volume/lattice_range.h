// How far the voxels of a map reach, and the checks that keep out what lies beyond.
//
// Blocks are found by indices of 21 bits an axis (PackIndex). Content is kept to kFurthestBlock,
// which leaves a margin that neighbours, boxes with margins and rounding never use up, so that no
// index wraps and none is dropped:
//  - Pipeline::Process and MapEditing::Add refuse with a sentence what would lie further
//    out, and leave the map as it was; so does the reader of map files. Fuse aborts, as it does for
//    images of wrong sizes, and BlockGrid::Add aborts beyond kFurthestStored.
//  - Therefore out of reach: wrapped keys in BlocksAlongRays, and in GridMesh, where neighbours are
//    packed as they are; casts of coordinates to int in FloorOf, FindRims, MovedBox, NearestAlong,
//    FindLookUps, the look-ups of rays and BlocksTouchedBy, whose points are at most 6 ranges from
//    a lattice's origin, 2^26 voxels; the aborts of PullBackPoints and FrameView.
//  - Right at the edge by themselves, because they are asked about places without content: PartsIn,
//    the directory of blocks, MapQuery and VolumesMap::ListAt.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <string_view>

#include "core/error.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {

// What lies in a lattice, along each axis of it.
struct LatticeRange {
  explicit LatticeRange(double voxel_m);
  double voxel_m;
  double reach_m;  // from the origin to either side

  // Both ends included; false for what is not a number.
  bool Holds(const Eigen::Vector3d& p_m) const;
  // Whether blocks `low` to `high` lie in the range after a motion, or up to `slack_blocks` beyond.
  // They reach half a voxel beyond their voxels' centres, as far as resampling takes their values.
  bool HoldsMoved(const Index3& low, const Index3& high, const Pose& T, int slack_blocks) const;
  // "(1e+06, 0, 0) m, expected at most 83884.8 m from the origin along each axis, which is as far
  // as voxels of 0.01 m reach; ..." and what would help.
  std::string Beyond(const Eigen::Vector3d& p_m) const;
};

// A block of an object's lattice may reach a little further out in the world than the surface in it
// that a frame saw: blocks, less than the margin that kFurthestBlock leaves.
inline constexpr int kPlacementSlack_blocks = 4;

// Poses of files have nine decimals.
inline constexpr double kRigidTolerance = 1e-6;
// What R R^T may be off by is kRigidTolerance. Errors: kData, a fragment that begins with `whose`.
Expected<void> CheckRigid(const Pose& T, std::string_view whose);

// What is nearly rigid, with a rotation again: of products of many, whose rounding would else grow.
Pose MadeRigid(const Pose& T);

// A pose that CheckRigid takes, as rigid as products of it have to be: as it is where it is.
Pose NearestRigid(const Pose& T);

// Whether an object's blocks lie in the range once they are moved. Errors: kData, beginning with
// `what`, which ends as a place can follow.
Expected<void> CheckMoved(const LatticeRange& range, const ObjectMove& move, int slack_blocks,
                          const std::string& what);

}  // namespace tsdfpp
