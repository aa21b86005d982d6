#include "eval/adapters/voxel_block_grid.h"

#include <open3d/core/EigenConverter.h>
#include <open3d/t/geometry/TriangleMesh.h>
#include <open3d/t/geometry/VoxelBlockGrid.h>

#include <chrono>

namespace tsdfpp {
namespace {

namespace o3d = open3d::core;

// float distance, 16-bit weight, three 16-bit colours
constexpr std::size_t kVoxelBytes = 4 + 2 + 3 * 2;
// Enough for what the benches map, so that the table never grows while it is timed.
std::int64_t ReservedBlocks(int side) { return side < 16 ? 100000 : 40000; }
constexpr float kAnyWeight = 0.5F;   // observed at all
constexpr float kDepthScale = 5000;  // TUM's: 0.2 mm
constexpr float kFar_m = 65535 / kDepthScale;

o3d::Tensor MatrixOf(const Eigen::MatrixXd& matrix) {
  return o3d::eigen_converter::EigenMatrixToTensor(matrix);
}

}  // namespace

struct VoxelBlockGridPeer::Impl {
  open3d::t::geometry::VoxelBlockGrid grid;
  float truncation_voxels;
  std::size_t side;
};

VoxelBlockGridPeer::VoxelBlockGridPeer(double voxel_m, double truncation_m, int side)
    : impl_(new Impl{{{"tsdf", "weight", "color"},
                      {o3d::Float32, o3d::UInt16, o3d::UInt16},
                      {{1}, {1}, {3}},
                      static_cast<float>(voxel_m),
                      side,
                      ReservedBlocks(side)},
                     static_cast<float>(truncation_m / voxel_m),
                     static_cast<std::size_t>(side)}) {
  // ExtractTriangleMesh aborts where the block in slot 0 has a surface: it gets one far away.
  o3d::Tensor slots;
  o3d::Tensor masks;
  impl_->grid.GetHashMap().Activate(
      o3d::Tensor(std::vector<std::int32_t>{100000, 100000, 100000}, {1, 3}, o3d::Int32), slots,
      masks);
}

VoxelBlockGridPeer::~VoxelBlockGridPeer() = default;

double VoxelBlockGridPeer::Integrate(const Frame& frame) {
  const Intrinsics& k = frame.intrinsics;
  cv::Mat raw;
  frame.depth.convertTo(raw, CV_16U, kDepthScale);
  const open3d::t::geometry::Image depth(
      o3d::Tensor(raw.ptr<std::uint16_t>(), {k.height, k.width, 1}, o3d::UInt16));
  const cv::Mat packed = frame.colour.isContinuous() ? frame.colour : frame.colour.clone();
  const open3d::t::geometry::Image colour(
      o3d::Tensor(packed.ptr<std::uint8_t>(), {k.height, k.width, 3}, o3d::UInt8));
  Eigen::Matrix3d intrinsic;
  intrinsic << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1;
  const o3d::Tensor K = MatrixOf(intrinsic);
  const o3d::Tensor T_CW = MatrixOf(frame.T_WC.inverse().matrix());
  const auto start = std::chrono::steady_clock::now();
  const auto blocks = impl_->grid.GetUniqueBlockCoordinates(depth, K, T_CW, kDepthScale, kFar_m,
                                                            impl_->truncation_voxels);
  impl_->grid.Integrate(blocks, depth, colour, K, T_CW, kDepthScale, kFar_m,
                        impl_->truncation_voxels);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

VoxelBlockGridPeer::Mesh VoxelBlockGridPeer::ExtractMesh() const {
  const auto start = std::chrono::steady_clock::now();
  const auto mesh = impl_->grid.ExtractTriangleMesh(kAnyWeight);
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          static_cast<std::size_t>(mesh.GetTriangleIndices().GetLength())};
}

TriangleMesh VoxelBlockGridPeer::Triangles() const {
  const auto extracted = impl_->grid.ExtractTriangleMesh(kAnyWeight);
  const o3d::Tensor positions = extracted.GetVertexPositions().To(o3d::Float32).Contiguous();
  const o3d::Tensor indices = extracted.GetTriangleIndices().To(o3d::Int32).Contiguous();
  const auto* position = static_cast<const float*>(positions.GetDataPtr());
  const auto* index = static_cast<const std::int32_t*>(indices.GetDataPtr());
  TriangleMesh mesh;
  for (std::int64_t i = 0; i < positions.GetLength(); ++i) {
    mesh.vertices.emplace_back(position[3 * i], position[3 * i + 1], position[3 * i + 2]);
  }
  for (std::int64_t i = 0; i < indices.GetLength(); ++i) {
    mesh.triangles.push_back({static_cast<std::uint32_t>(index[3 * i]),
                              static_cast<std::uint32_t>(index[3 * i + 1]),
                              static_cast<std::uint32_t>(index[3 * i + 2])});
  }
  return mesh;
}

std::size_t VoxelBlockGridPeer::OccupiedBytes() const {
  const auto blocks = static_cast<std::size_t>(impl_->grid.GetHashMap().Size() - 1);
  return blocks * impl_->side * impl_->side * impl_->side * kVoxelBytes;
}

}  // namespace tsdfpp
