#include "eval/adapters/open3d_peer.h"

#include <omp.h>
#include <open3d/geometry/RGBDImage.h>
#include <open3d/geometry/TriangleMesh.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>
#include <open3d/pipelines/integration/UniformTSDFVolume.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <string>

namespace tsdfpp {

namespace {

using open3d::pipelines::integration::TSDFVolumeColorType;

std::shared_ptr<open3d::geometry::RGBDImage> ImageOf(const Frame& frame, Open3dColour kind) {
  const Intrinsics& k = frame.intrinsics;
  open3d::geometry::Image depth;
  depth.Prepare(k.width, k.height, 1, 4);
  std::memcpy(depth.data_.data(), frame.depth.data, depth.data_.size());
  open3d::geometry::Image colour;
  if (kind == Open3dColour::kNone) {
    return std::make_shared<open3d::geometry::RGBDImage>(colour, depth);
  }
  colour.Prepare(k.width, k.height, 3, 1);
  std::memcpy(colour.data_.data(), frame.colour.data, colour.data_.size());
  return open3d::geometry::RGBDImage::CreateFromColorAndDepth(colour, depth, 1.0, kMaxValidDepth_m,
                                                              false);
}

}  // namespace

struct Open3dVolume::Impl {
  open3d::pipelines::integration::ScalableTSDFVolume volume;
  Open3dColour colour;
};

Open3dVolume::Open3dVolume(double voxel_m, double truncation_m, Open3dColour colour)
    : impl_(new Impl{
          {voxel_m, truncation_m,
           colour == Open3dColour::kRgb ? TSDFVolumeColorType::RGB8 : TSDFVolumeColorType::NoColor},
          colour}) {}

Open3dVolume::~Open3dVolume() = default;

double Open3dVolume::Integrate(const Frame& frame) {
  const Intrinsics& k = frame.intrinsics;
  const auto image = ImageOf(frame, impl_->colour);
  const open3d::camera::PinholeCameraIntrinsic intrinsic(k.width, k.height, k.fx, k.fy, k.cx, k.cy);
  const Eigen::Matrix4d T_CW = frame.T_WC.inverse().matrix();
  const auto start = std::chrono::steady_clock::now();
  impl_->volume.Integrate(*image, intrinsic, T_CW);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Open3dVolume::Mesh Open3dVolume::ExtractMesh() const {
  const auto start = std::chrono::steady_clock::now();
  const auto mesh = impl_->volume.ExtractTriangleMesh();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          mesh->triangles_.size()};
}

TriangleMesh Open3dVolume::Triangles() const {
  const auto extracted = impl_->volume.ExtractTriangleMesh();
  TriangleMesh mesh;
  for (const Eigen::Vector3d& vertex : extracted->vertices_) {
    mesh.vertices.push_back(vertex.cast<float>());
  }
  for (const Eigen::Vector3d& colour : extracted->vertex_colors_) {
    constexpr double kFull = 255;
    mesh.colours.push_back({static_cast<std::uint8_t>(kFull * colour.x() + 0.5),
                            static_cast<std::uint8_t>(kFull * colour.y() + 0.5),
                            static_cast<std::uint8_t>(kFull * colour.z() + 0.5)});
  }
  for (const Eigen::Vector3i& t : extracted->triangles_) {
    mesh.triangles.push_back({static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
                              static_cast<std::uint32_t>(t[2])});
  }
  return mesh;
}

std::size_t Open3dVolume::OccupiedBytes() const {
  std::size_t bytes = 0;
  for (const auto& [index, unit] : impl_->volume.volume_units_) {
    if (unit.volume_ != nullptr)
      bytes += unit.volume_->voxels_.size() * sizeof(unit.volume_->voxels_[0]);
  }
  return bytes;
}

void SetOpen3dThreads(int threads) {
  // Open3D takes one a core, whatever OpenMP is told, unless this variable is set.
  setenv("OMP_NUM_THREADS", std::to_string(threads).c_str(), 1);
  omp_set_num_threads(threads);
}

}  // namespace tsdfpp
