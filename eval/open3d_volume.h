// Open3D's own TSDF volume as a peer, in a file of its own: its headers are large.
#pragma once

#include <memory>

#include "core/types.h"

namespace tsdfpp {

// open3d::pipelines::integration::ScalableTSDFVolume, without colour. Lengths in metres; Open3D has
// one truncation for both sides.
class Open3dVolume {
 public:
  Open3dVolume(double voxel_m, double truncation_m);
  ~Open3dVolume();

  void Integrate(const Frame& frame);
  TriangleMesh Mesh() const;  // in the world, without colours or ids

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tsdfpp
