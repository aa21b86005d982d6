#include "mapper/observation.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace tsdfpp {
namespace {

constexpr int kTile_px = 32;  // about the size of a block in the image
constexpr std::uint32_t kOutOfView = 0xFFFFFFFFU;
constexpr std::size_t kBlocksPerTask = 512;

// The tile of the image that the middle of a block falls into (the nearest one, where the middle is
// out of the image), or kOutOfView where a sphere around the block lies wholly outside one of the
// planes of the view.
std::uint32_t TileOf(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
                     float voxel) {
  const Eigen::Vector3f centre_L = Eigen::Vector3f(static_cast<float>(block.x * 8) + 3.5F,
                                                   static_cast<float>(block.y * 8) + 3.5F,
                                                   static_cast<float>(block.z * 8) + 3.5F) *
                                   voxel;
  Eigen::Vector3f c;
  for (int r = 0; r < 3; ++r) {
    const auto& m = T_CL.rows[static_cast<std::size_t>(r)];
    c[r] = m[0] * centre_L.x() + m[1] * centre_L.y() + m[2] * centre_L.z() + m[3];
  }
  const float radius = 3.5F * 1.7321F * voxel * 1.01F;
  // Written so that a camera pose that is not a number sees nothing.
  if (!(c.z() + radius >= kNearest_m)) return kOutOfView;
  const float slack = 1.0F;  // pixels, for rounding to the nearest one
  const auto outside = [&](float normal_xy, float normal_z, float offset) {
    // normal_xy * x + normal_z * z >= 0 inside, up to the normal's length
    return !(normal_xy * offset + normal_z * c.z() >=
             -radius * std::sqrt(normal_xy * normal_xy + normal_z * normal_z));
  };
  const float left = (-slack - frame.cx) / frame.fx;
  const float right = (static_cast<float>(frame.width) + slack - frame.cx) / frame.fx;
  const float top = (-slack - frame.cy) / frame.fy;
  const float bottom = (static_cast<float>(frame.height) + slack - frame.cy) / frame.fy;
  if (outside(1, -left, c.x()) || outside(-1, right, c.x()) || outside(1, -top, c.y()) ||
      outside(-1, bottom, c.y())) {
    return kOutOfView;
  }
  const float z = std::max(c.z(), kNearest_m);
  const auto tile = [](float pixel, int size) {
    const float last = static_cast<float>(size - 1);
    return static_cast<std::uint32_t>(std::min(std::max(0.0F, pixel), last)) / kTile_px;
  };
  const auto per_row = static_cast<std::uint32_t>((frame.width + kTile_px - 1) / kTile_px);
  return tile(frame.fy * c.y() / z + frame.cy, frame.height) * per_row +
         tile(frame.fx * c.x() / z + frame.cx, frame.width);
}

void Require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

FrameView::FrameView(const Frame& frame, const cv::Mat& labels)
    : width(frame.intrinsics.width),
      height(frame.intrinsics.height),
      fx(static_cast<float>(frame.intrinsics.fx)),
      fy(static_cast<float>(frame.intrinsics.fy)),
      cx(static_cast<float>(frame.intrinsics.cx)),
      cy(static_cast<float>(frame.intrinsics.cy)),
      intrinsics(frame.intrinsics),
      T_WC(frame.T_WC) {
  const cv::Size size(width, height);
  Require(width > 0 && height > 0);
  Require(frame.depth.type() == CV_32FC1 && frame.depth.size() == size);
  Require(labels.type() == CV_16UC1 && labels.size() == size);
  Require(frame.colour.type() == CV_8UC3 && frame.colour.size() == size);
  depth_.create(size, CV_32FC1);
  label_ = labels.isContinuous() ? labels : labels.clone();
  depth = depth_.ptr<float>();
  label = label_.ptr<std::uint16_t>();
  const auto stride = static_cast<std::size_t>(width);
  pixels_.resize(stride * static_cast<std::size_t>(height));
  packed_colour_.resize(pixels_.size());
  tbb::parallel_for(0, height, [&](int v) {
    const auto* from = frame.depth.ptr<float>(v);
    const auto* ids = label_.ptr<std::uint16_t>(v);
    const auto* colour = frame.colour.ptr<std::uint8_t>(v);
    auto* cleaned = depth_.ptr<float>(v);
    DepthAndLabel* pixel = &pixels_[stride * static_cast<std::size_t>(v)];
    std::int32_t* packed = &packed_colour_[stride * static_cast<std::size_t>(v)];
    for (int u = 0; u < width; ++u) {
      cleaned[u] = IsValidDepth(from[u]) && ids[u] != kNoInstance ? from[u] : 0;
      pixel[u] = {cleaned[u], ids[u]};
      packed[u] = colour[3 * u] | (colour[3 * u + 1] << 8) | (colour[3 * u + 2] << 16);
    }
  });
  kernel.pixels = pixels_.data();
  kernel.colour = packed_colour_.data();
  kernel.width = static_cast<float>(width);
  kernel.height = static_cast<float>(height);
  kernel.intrinsics = {fx, fy, cx, cy};
}

CameraFromLattice::CameraFromLattice(const Pose& T_WC, const Pose& T_WL, bool lattice_is_world) {
  const Pose T_CL = lattice_is_world ? T_WC.inverse() : Pose(T_WC.inverse() * T_WL);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] =
          static_cast<float>(T_CL.matrix()(r, c));
    }
  }
}

std::vector<std::uint32_t> BlocksInView(const FrameView& frame, std::size_t count, float voxel,
                                        const std::function<BlockInView(std::size_t)>& block_at) {
  std::vector<std::uint32_t> tile_of(count);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const BlockInView at = block_at(i);
          tile_of[i] = TileOf(frame, *at.T_CL, at.block, voxel);
        }
      },
      tbb::simple_partitioner());
  // Sorted by counting.
  const int columns = (frame.width + kTile_px - 1) / kTile_px;
  const int rows = (frame.height + kTile_px - 1) / kTile_px;
  std::vector<std::uint32_t> first(static_cast<std::size_t>(columns * rows) + 1, 0);
  for (const std::uint32_t tile : tile_of) {
    if (tile != kOutOfView) ++first[tile + 1];
  }
  for (std::size_t tile = 1; tile < first.size(); ++tile) first[tile] += first[tile - 1];
  std::vector<std::uint32_t> order(first.back());
  for (std::size_t i = 0; i < count; ++i) {
    if (tile_of[i] != kOutOfView) order[first[tile_of[i]]++] = static_cast<std::uint32_t>(i);
  }
  return order;
}

bool ObserveBlock(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
                  float voxel, float back, BlockObservation& out) {
  const Index3 first{block.x * kBlockSide, block.y * kBlockSide, block.z * kBlockSide};
  return ObserveVoxels(frame.kernel, T_CL.rows[0].data(), voxel, first, back, out);
}

}  // namespace tsdfpp
