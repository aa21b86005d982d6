// What all tiles of a cast share: the blocks in view, and the rays of the camera in each lattice.
#pragma once

#include <vector>

#include "mapper/rays/ray_kernels.h"
#include "mapper/rays/ray_pass.h"

namespace tsdfpp {

struct RayScene {
  // `pass` and `options` must outlive it.
  RayScene(const RayPass& pass, const Intrinsics& camera, const Pose& T_WC,
           const RayCastOptions& options);

  const RayPass& pass;
  const RayCastOptions& options;
  RayCamera camera;
  RayBlocks blocks;
  std::vector<InstanceId> id_of_block;
  std::vector<LatticeRays> lattices;  // those of volumes; they share that of the world
  std::vector<int> lattice_of;        // of each volume
  LatticeRays world_rays;             // in metres
};

// One tile after the other of a scene's image: where it lies, and its rays.
class TileRaysOf {
 public:
  explicit TileRaysOf(const RayScene& scene)
      : scene_(scene), rays_(scene.lattices.size()), filled_(scene.lattices.size(), 0) {}

  // The tile whose first pixel is (u, v).
  void GoTo(int u, int v);
  int u() const { return u_; }
  int v() const { return v_; }

  // The tile's rays in a lattice of the scene.
  const TileRays& In(int lattice);
  // Pixel i's point at a depth, in the world, metres.
  Eigen::Vector3f PointAt(std::size_t i, float depth) const;

 private:
  const RayScene& scene_;
  int u_ = 0;
  int v_ = 0;
  std::vector<TileRays> rays_;  // by lattice, where filled
  std::vector<std::uint8_t> filled_;
};

}  // namespace tsdfpp
