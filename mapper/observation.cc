#include "mapper/observation.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdlib>

namespace tsdfpp {
namespace {

constexpr float kNearest_m = 0.05F;  // voxels closer to the camera's plane are not in view

// The arithmetic of all voxels of a block. Every instruction set gives the same bits: only
// correctly rounded operations, and no contraction.
__attribute__((target_clones("avx512f", "avx2", "default"))) void ProjectBlock(
    const float* m, const float* intrinsics, float width, float height, float voxel, int x0, int y0,
    int z0, float* out_z, float* out_scale, std::int32_t* out_pixel) {
  const float fx = intrinsics[0];
  const float fy = intrinsics[1];
  const float cx = intrinsics[2];
  const float cy = intrinsics[3];
  const auto stride = static_cast<std::int32_t>(width);
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y) {
      const float py = static_cast<float>(y0 + y) * voxel;
      const float pz = static_cast<float>(z0 + z) * voxel;
      const float bx = (m[1] * py + m[2] * pz) + m[3];
      const float by = (m[5] * py + m[6] * pz) + m[7];
      const float bz = (m[9] * py + m[10] * pz) + m[11];
      const int row = 64 * z + 8 * y;
      for (int x = 0; x < kBlockSide; ++x) {
        const float px = static_cast<float>(x0 + x) * voxel;
        const float cam_x = bx + m[0] * px;
        const float cam_y = by + m[4] * px;
        const float cam_z = bz + m[8] * px;
        const float iz = 1.0F / cam_z;
        const float u = ((fx * cam_x) * iz + cx) + 0.5F;
        const float v = ((fy * cam_y) * iz + cy) + 0.5F;
        const float ray = std::sqrt((cam_x * cam_x + cam_y * cam_y) + cam_z * cam_z);
        const bool in_view =
            (cam_z >= kNearest_m) & (u >= 0.0F) & (u < width) & (v >= 0.0F) & (v < height);
        // Non-negative here, so truncation is the floor.
        const float safe_u = in_view ? u : 0.0F;
        const float safe_v = in_view ? v : 0.0F;
        const std::int32_t pixel =
            static_cast<std::int32_t>(safe_v) * stride + static_cast<std::int32_t>(safe_u);
        out_pixel[row + x] = in_view ? pixel : -1;
        out_z[row + x] = cam_z;
        out_scale[row + x] = ray * iz;
      }
    }
  }
}

// Whether a sphere around the block lies wholly outside one of the planes of the view.
bool CertainlyOutOfView(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
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
  if (c.z() + radius < kNearest_m) return true;
  const float slack = 1.0F;  // pixels, for rounding to the nearest one
  const auto outside = [&](float normal_xy, float normal_z, float offset) {
    // normal_xy * x + normal_z * z >= 0 inside, up to the normal's length
    return normal_xy * offset + normal_z * c.z() < -radius * std::hypot(normal_xy, normal_z);
  };
  const float left = (-slack - frame.cx) / frame.fx;
  const float right = (static_cast<float>(frame.width) + slack - frame.cx) / frame.fx;
  const float top = (-slack - frame.cy) / frame.fy;
  const float bottom = (static_cast<float>(frame.height) + slack - frame.cy) / frame.fy;
  return outside(1, -left, c.x()) || outside(-1, right, c.x()) || outside(1, -top, c.y()) ||
         outside(-1, bottom, c.y());
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
  Require(frame.depth.type() == CV_32FC1 && frame.depth.size() == size);
  Require(labels.type() == CV_16UC1 && labels.size() == size);
  Require(frame.colour.type() == CV_8UC3 && frame.colour.size() == size);
  depth_.create(size, CV_32FC1);
  label_ = labels.isContinuous() ? labels : labels.clone();
  colour_ = frame.colour.isContinuous() ? frame.colour : frame.colour.clone();
  depth = depth_.ptr<float>();
  label = label_.ptr<std::uint16_t>();
  colour = colour_.ptr<std::uint8_t>();
  tbb::parallel_for(0, height, [&](int v) {
    const auto* from = frame.depth.ptr<float>(v);
    auto* to = depth_.ptr<float>(v);
    const std::uint16_t* ids = label + static_cast<std::ptrdiff_t>(v) * width;
    for (int u = 0; u < width; ++u) {
      to[u] = IsValidDepth(from[u]) && ids[u] != kNoInstance ? from[u] : 0;
    }
  });
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

bool ObserveBlock(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
                  float voxel, float back, BlockObservation& out) {
  if (CertainlyOutOfView(frame, T_CL, block, voxel)) return false;
  const std::array<float, 4> intrinsics{frame.fx, frame.fy, frame.cx, frame.cy};
  std::array<float, kBlockVoxels> z;
  std::array<float, kBlockVoxels> scale;
  ProjectBlock(T_CL.rows[0].data(), intrinsics.data(), static_cast<float>(frame.width),
               static_cast<float>(frame.height), voxel, block.x * kBlockSide, block.y * kBlockSide,
               block.z * kBlockSide, z.data(), scale.data(), out.pixel.data());
  bool any = false;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    if (out.pixel[i] < 0) continue;
    const float depth = frame.depth[out.pixel[i]];
    const float s = (depth - z[i]) * scale[i];
    if (depth <= 0 || s < -back) {
      out.pixel[i] = -1;
    } else {
      out.distance[i] = s;
      any = true;
    }
  }
  return any;
}

}  // namespace tsdfpp
