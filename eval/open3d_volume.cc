#include "eval/open3d_volume.h"

#include <omp.h>
#include <open3d/geometry/RGBDImage.h>
#include <open3d/geometry/TriangleMesh.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>

#include <cstdlib>
#include <cstring>

namespace tsdfpp {

struct Open3dVolume::Impl {
  open3d::pipelines::integration::ScalableTSDFVolume volume;
};

Open3dVolume::Open3dVolume(double voxel_m, double truncation_m)
    : impl_(new Impl{
          {voxel_m, truncation_m, open3d::pipelines::integration::TSDFVolumeColorType::NoColor}}) {}

Open3dVolume::~Open3dVolume() = default;

void Open3dVolume::Integrate(const Frame& frame) {
  // Several threads spin at OpenMP's barriers on a busy machine, many times as long as they work.
  // Open3D takes one a core, whatever OpenMP is told, unless this variable is set.
  setenv("OMP_NUM_THREADS", "1", 1);
  omp_set_num_threads(1);
  const Intrinsics& k = frame.intrinsics;
  open3d::geometry::RGBDImage image;
  image.depth_.Prepare(k.width, k.height, 1, 4);
  std::memcpy(image.depth_.data_.data(), frame.depth.data, image.depth_.data_.size());
  impl_->volume.Integrate(
      image, open3d::camera::PinholeCameraIntrinsic(k.width, k.height, k.fx, k.fy, k.cx, k.cy),
      frame.T_WC.inverse().matrix());
}

TriangleMesh Open3dVolume::Mesh() const {
  const auto extracted = impl_->volume.ExtractTriangleMesh();
  TriangleMesh mesh;
  for (const Eigen::Vector3d& vertex : extracted->vertices_) {
    mesh.vertices.push_back(vertex.cast<float>());
  }
  for (const Eigen::Vector3i& t : extracted->triangles_) {
    mesh.triangles.push_back({static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
                              static_cast<std::uint32_t>(t[2])});
  }
  return mesh;
}

}  // namespace tsdfpp
