#include "mapper/volume/lattice_range.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "mapper/map_config.h"
#include "mapper/volume/block_set.h"

namespace tsdfpp {
namespace {

// Of products of some that are off by no more CheckRigid still takes the least rigid.
constexpr double kRigidInProducts = kRigidTolerance / 100;

std::string TextOfPoint(const Eigen::Vector3d& p) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g}) m", p.x(), p.y(), p.z());
}

}  // namespace

LatticeRange::LatticeRange(double voxel)
    : voxel_m(voxel), reach_m(double{kFurthestBlock} * kBlockSide * voxel) {}

bool LatticeRange::Holds(const Eigen::Vector3d& p_m) const {
  return (p_m.array().abs() <= reach_m).all();
}

bool LatticeRange::HoldsMoved(const Index3& low, const Index3& high, const Pose& T,
                              int slack_blocks) const {
  constexpr double kBeside = 0.5;
  const double most = double{kBlockSide} * (kFurthestBlock + slack_blocks);
  for (int i = 0; i < 8; ++i) {
    const auto along = [](bool upper, int from, int to) {
      return upper ? double{kBlockSide} * to + (kBlockSide - 1) + kBeside
                   : double{kBlockSide} * from - kBeside;
    };
    const Eigen::Vector3d corner(along((i & 1) != 0, low.x, high.x),
                                 along((i & 2) != 0, low.y, high.y),
                                 along((i & 4) != 0, low.z, high.z));
    const Eigen::Array3d moved = (T * (corner * voxel_m) / voxel_m).array();
    // The voxels in between, of which the outermost are those of the outermost blocks.
    if (!((moved > -most - 1).all() && (moved < most + kBlockSide).all())) return false;
  }
  return true;
}

std::string LatticeRange::Beyond(const Eigen::Vector3d& p_m) const {
  std::string help = "poses nearer to the origin";
  const double voxel_wanted_m = voxel_m * p_m.cwiseAbs().maxCoeff() / reach_m;
  if (voxel_wanted_m <= 0.99 * kLargestVoxel_m) {
    help += fmt::format(", or voxels of {:.3g} m,", 1.01 * voxel_wanted_m);
  }
  return fmt::format(
      "{}, expected at most {:.6g} m from the origin along each axis, which is as far as voxels of "
      "{:g} m reach; {} would help",
      TextOfPoint(p_m), reach_m, voxel_m, help);
}

Expected<void> CheckRigid(const Pose& T, std::string_view whose) {
  if (!T.matrix().allFinite()) {
    return DataError("{} pose holds a number that is not finite", whose);
  }
  const Eigen::Matrix3d R = T.linear();
  const double off = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off < kRigidTolerance && R.determinant() > 0)) {
    return DataError(
        "{} pose is no rigid motion: R R^T is off by {:.3g}, expected less than {:g}, and R's "
        "determinant is {:.3g}, expected 1",
        whose, off, kRigidTolerance, R.determinant());
  }
  return {};
}

Pose MadeRigid(const Pose& T) {
  Pose rigid = T;
  rigid.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
  return rigid;
}

Pose NearestRigid(const Pose& T) {
  const Eigen::Matrix3d R = T.linear();
  if ((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRigidInProducts) {
    return T;
  }
  return MadeRigid(T);
}

Expected<void> CheckMoved(const LatticeRange& range, const ObjectMove& move, int slack_blocks,
                          const std::string& what) {
  if (move.blocks == nullptr || move.blocks->empty()) return {};
  BlockBox box;
  for (const auto& entry : move.blocks->entries()) box.Extend(entry.index);
  if (range.HoldsMoved(box.low, box.high, move.T, slack_blocks)) return {};
  for (const auto& entry : move.blocks->entries()) {
    if (move.is_moved && !move.is_moved(entry.index)) continue;
    if (range.HoldsMoved(entry.index, entry.index, move.T, slack_blocks)) continue;
    constexpr double kMiddle = (kBlockSide - 1) / 2.0;
    const Eigen::Vector3d first(entry.index.x, entry.index.y, entry.index.z);
    const Eigen::Vector3d middle_m =
        (kBlockSide * first + Eigen::Vector3d::Constant(kMiddle)) * range.voxel_m;
    return DataError("{} {}", what, range.Beyond(move.T * middle_m));
  }
  return {};
}

}  // namespace tsdfpp
