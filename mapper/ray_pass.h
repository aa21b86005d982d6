// One pass of rays over the volumes of a map, all objects together (docs/map.md, "Ray casting").
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mapper/ray_blocks.h"
#include "mapper/ray_cast.h"

namespace tsdfpp {

// What the pass reads of a map. Functions are called from several threads.
struct RayPass {
  std::vector<RayVolume> volumes;
  double voxel_m = 0;
  // Where a surface may be hidden at all; empty: nowhere.
  ContestedBox contested;
  // Makes what a worker asks whether the surface of `id` whose look-up point (world, metres) this
  // is, is hidden in the map without the objects `without`. Each is called from one thread.
  using Hidden = std::function<bool(InstanceId id, const Eigen::Vector3f& look_up_W,
                                    std::span<const InstanceId> without)>;
  std::function<Hidden()> make_hidden;
  // The object at a surface point (world, metres); empty: the volume's id.
  std::function<InstanceId(const Eigen::Vector3f& point_W)> label;
  // Each volume by rays of its own, which know nothing of the others; the nearest of all wins.
  bool each_alone = false;
};

std::vector<RaySurface> RunRayPass(const RayPass& pass, const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options);

}  // namespace tsdfpp
