// One pass of rays over the volumes of a map, all objects together (docs/map.md, "Ray casting").
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mapper/index/voxel_labels.h"
#include "mapper/rays/ray_blocks.h"
#include "mapper/rays/ray_cast.h"

namespace tsdfpp {

// Whether a surface of `id` is hidden, by its look-up point (world, metres).
struct HiddenQuery {
  InstanceId id = kNoInstance;
  std::uint32_t pixel = 0;  // the asker's
  Eigen::Vector3f look_up_W = Eigen::Vector3f::Zero();
  bool hidden = false;  // the answer
};

// What the pass reads of a map. Functions are called from several threads.
struct RayPass {
  std::vector<RayVolume> volumes;
  double voxel_m = 0;
  // Where a surface may be hidden at all; empty: nowhere.
  ContestedBox contested;
  // Makes what a worker asks which of some surfaces are hidden in the map without the objects
  // `without`. Each is called from one thread.
  using Hidden =
      std::function<void(std::span<HiddenQuery> queries, std::span<const InstanceId> without)>;
  std::function<Hidden()> make_hidden;
  // Makes what a worker asks for the objects at the voxels nearest to surface points (in the
  // world's lattice); empty: the volume's id.
  std::function<VoxelLabels()> make_labels;
  // Each volume by rays of its own, which know nothing of the others; the nearest of all wins.
  bool each_alone = false;
};

std::vector<RaySurface> RunRayPass(const RayPass& pass, const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options);

}  // namespace tsdfpp
