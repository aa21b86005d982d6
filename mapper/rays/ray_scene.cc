#include "mapper/rays/ray_scene.h"

#include <algorithm>

namespace tsdfpp {
namespace {

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// Rays through the pixels, in one lattice.
LatticeRays RaysIn(const RayVolume& volume, const RayCamera& camera, double voxel_m) {
  const Pose T_LC =
      volume.lattice_is_world ? camera.T_WC : Pose(volume.T_WL.inverse() * camera.T_WC);
  const Intrinsics& k = camera.intrinsics;
  const Eigen::Matrix3d R = T_LC.linear() / voxel_m;
  const Eigen::Vector3d origin = T_LC.translation() / voxel_m;
  const Eigen::Vector3d at_0 = R * Eigen::Vector3d(-k.cx / k.fx, -k.cy / k.fy, 1);
  const Eigen::Vector3d column = R.col(0) / k.fx;
  const Eigen::Vector3d row = R.col(1) / k.fy;
  LatticeRays rays;
  for (int a = 0; a < 3; ++a) {
    rays.origin[At(a)] = origin[a];
    rays.at_pixel_0[At(a)] = static_cast<float>(at_0[a]);
    rays.per_column[At(a)] = static_cast<float>(column[a]);
    rays.per_row[At(a)] = static_cast<float>(row[a]);
    for (int c = 0; c < 3; ++c) {
      rays.R_WL[At(3 * a + c)] = static_cast<float>(volume.T_WL.linear()(a, c));
    }
  }
  return rays;
}

}  // namespace

RayScene::RayScene(const RayPass& ray_pass, const Intrinsics& intrinsics, const Pose& T_WC,
                   const RayCastOptions& cast_options)
    : pass(ray_pass),
      options(cast_options),
      camera{intrinsics, T_WC},
      blocks(FindRayBlocks(pass.volumes, camera, pass.voxel_m, options.NearestDepth_m(),
                           pass.contested)),
      world_rays(RaysIn({}, camera, 1.0)) {
  // Volumes whose lattice is the world's share their rays.
  int world = -1;
  for (const RayVolume& volume : pass.volumes) {
    const bool share = volume.lattice_is_world && world >= 0;
    if (!share) {
      if (volume.lattice_is_world) world = static_cast<int>(lattices.size());
      lattices.push_back(RaysIn(volume, camera, pass.voxel_m));
    }
    lattice_of.push_back(share ? world : static_cast<int>(lattices.size()) - 1);
  }
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    id_of_block.push_back(pass.volumes[blocks[i].volume].id);
  }
}

void TileRaysOf::GoTo(int u, int v) {
  u_ = u;
  v_ = v;
  std::fill(filled_.begin(), filled_.end(), 0);
}

const TileRays& TileRaysOf::In(int lattice) {
  if (filled_[At(lattice)] == 0) {
    FillTileRays(scene_.lattices[At(lattice)], u_, v_, rays_[At(lattice)]);
    filled_[At(lattice)] = 1;
  }
  return rays_[At(lattice)];
}

Eigen::Vector3f TileRaysOf::PointAt(std::size_t i, float depth) const {
  const TileOrder& order = OrderOfTile();
  const auto u = static_cast<float>(u_ + order.x[i]);
  const auto v = static_cast<float>(v_ + order.y[i]);
  Eigen::Vector3f point;
  for (std::size_t a = 0; a < 3; ++a) {
    const LatticeRays& rays = scene_.world_rays;
    const float direction = (rays.at_pixel_0[a] + rays.per_row[a] * v) + rays.per_column[a] * u;
    point[static_cast<Eigen::Index>(a)] = static_cast<float>(rays.origin[a]) + depth * direction;
  }
  return point;
}

}  // namespace tsdfpp
