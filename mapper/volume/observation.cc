#include "mapper/volume/observation.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "mapper/volume/facing.h"

namespace tsdfpp {
namespace {

constexpr int kBin_px = 32;  // about the size of a block in the image
constexpr std::uint32_t kNotSeen = 0xFFFFFFFFU;
constexpr std::size_t kBlocksPerTask = 256;
constexpr int kTileRowsPerTask = 4;
// A block that fills more of the image than this many tiles is looked at without asking them.
constexpr int kMostTiles = 64;
// Rounding in single precision is far less near the origin; see Extent::rounding_m for elsewhere.
constexpr float kSlack_px = 1;
constexpr float kRelativeSlack = 1e-4F;
// Of the sums by which this plan and the kernels find a voxel before the camera: nine roundings
// here and five there, of half a last place each.
constexpr float kRounding = 7 * std::numeric_limits<float>::epsilon();

void Require(bool condition) {
  if (!condition) std::abort();
}

cv::Mat Continuous(const cv::Mat& image) { return image.isContinuous() ? image : image.clone(); }

struct Interval {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
  void Extend(float x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

// A block's voxels, all of them inside.
struct Extent {
  Interval z;  // metres
  Interval u;  // pixels, where it lies before the camera
  Interval v;
  float middle_u = 0;
  float middle_v = 0;
  float rounding_m = 0;  // how far off the kernels may find a voxel, along each axis
  float slack_px = kSlack_px;
  bool before_camera = false;
};

Extent ExtentOf(const FrameView& frame, const CameraFromLattice& T_CL, const Index3& block,
                float voxel) {
  const auto [fx, fy, cx, cy] = frame.kernel.intrinsics;
  const float half = 3.5F * voxel;
  const float x = static_cast<float>(block.x * kBlockSide) * voxel + half;
  const float y = static_cast<float>(block.y * kBlockSide) * voxel + half;
  const float z = static_cast<float>(block.z * kBlockSide) * voxel + half;
  std::array<float, 3> middle;
  float summed = 0;
  for (std::size_t r = 0; r < 3; ++r) {
    const auto& m = T_CL.rows[r];
    middle[r] = m[0] * x + m[1] * y + m[2] * z + m[3];
    summed = std::max(summed, std::abs(m[3]));
  }
  Extent extent;
  // A row of a rotation is at most 1 in each place.
  extent.rounding_m = kRounding * (summed + std::abs(x) + std::abs(y) + std::abs(z) + 3 * half);
  const float safe_z = std::max(middle[2], kNearest_m);
  extent.middle_u = fx * middle[0] / safe_z + cx;
  extent.middle_v = fy * middle[1] / safe_z + cy;
  std::array<std::array<float, 8>, 3> corner;
  for (std::size_t r = 0; r < 3; ++r) {
    const auto& m = T_CL.rows[r];
    for (std::size_t i = 0; i < 8; ++i) {
      corner[r][i] = middle[r] + ((i & 1U) != 0 ? half : -half) * m[0] +
                     ((i & 2U) != 0 ? half : -half) * m[1] + ((i & 4U) != 0 ? half : -half) * m[2];
    }
  }
  for (const float corner_z : corner[2]) extent.z.Extend(corner_z);
  extent.before_camera = extent.z.low >= kNearest_m;
  if (!extent.before_camera) return extent;
  // A pixel in the image moves by at most this when its point does.
  const float px_per_m = (std::max(fx, fy) + static_cast<float>(frame.width + frame.height)) /
                         std::max(extent.z.low - extent.rounding_m, kNearest_m);
  extent.slack_px = std::max(kSlack_px, extent.rounding_m * px_per_m);
  for (std::size_t i = 0; i < 8; ++i) {
    const float inverse = 1 / corner[2][i];
    extent.u.Extend(fx * corner[0][i] * inverse + cx);
    extent.v.Extend(fy * corner[1][i] * inverse + cy);
  }
  return extent;
}

// What a block's pixels hold, from the tiles that it touches.
Tile TilesUnder(const FrameView& frame, const Extent& extent) {
  const auto tile_at = [](float pixel, int size) {
    const float last = static_cast<float>(size - 1);
    return static_cast<int>(std::min(std::max(0.0F, pixel), last)) / kTile_px;
  };
  const int left = tile_at(extent.u.low - extent.slack_px, frame.width);
  const int right = tile_at(extent.u.high + extent.slack_px, frame.width);
  const int top = tile_at(extent.v.low - extent.slack_px, frame.height);
  const int bottom = tile_at(extent.v.high + extent.slack_px, frame.height);
  Tile all;
  if ((right - left + 1) * (bottom - top + 1) > kMostTiles) {
    all.nearest = 0;
    all.farthest = kMaxValidDepth_m;
    all.least_label = 0;
    all.greatest_label = kNoInstance;
    return all;
  }
  for (int row = top; row <= bottom; ++row) {
    for (int column = left; column <= right; ++column) {
      const Tile& tile = frame.tiles[static_cast<std::size_t>(row * frame.tiles_per_row + column)];
      all.farthest = std::max(all.farthest, tile.farthest);
      all.least_label = std::min(all.least_label, tile.least_label);
      all.greatest_label = std::max(all.greatest_label, tile.greatest_label);
    }
  }
  return all;
}

struct Verdict {
  std::uint32_t bin = kNotSeen;
  InstanceId label = kNoInstance;
  float behind_m = std::numeric_limits<float>::infinity();
  bool all_in_view = false;
};

Verdict Judge(const FrameView& frame, const BlockCandidate& block, float voxel, float back) {
  const Extent extent = ExtentOf(frame, *block.T_CL, block.index, voxel);
  const float slack_m = kRelativeSlack * (std::abs(extent.z.high) + back) + extent.rounding_m;
  Verdict verdict;
  // Written so that a camera pose that is not a number sees nothing.
  if (!(extent.z.high + slack_m >= kNearest_m)) return verdict;
  if (extent.before_camera) {
    if (extent.u.high < -extent.slack_px || extent.v.high < -extent.slack_px ||
        extent.u.low > static_cast<float>(frame.width) + extent.slack_px ||
        extent.v.low > static_cast<float>(frame.height) + extent.slack_px) {
      return verdict;
    }
    verdict.all_in_view = extent.z.low - slack_m >= kNearest_m && extent.u.low >= extent.slack_px &&
                          extent.v.low >= extent.slack_px &&
                          extent.u.high <= static_cast<float>(frame.width - 1) - extent.slack_px &&
                          extent.v.high <= static_cast<float>(frame.height - 1) - extent.slack_px;
    const Tile seen = TilesUnder(frame, extent);
    // Along the ray what is behind is at least as far behind as along the axis.
    verdict.behind_m = seen.farthest + back + slack_m;
    if (seen.farthest <= 0 || verdict.behind_m < extent.z.low) return verdict;
    const bool has_label = seen.least_label <= block.id && block.id <= seen.greatest_label;
    const auto any_label = [&] {
      const TsdfBlock* values = block.of_any_label_if_negative;
      return block.of_any_label || (values != nullptr && values->AnyNegative());
    };
    if (!has_label && !any_label()) return verdict;
    if (seen.least_label == seen.greatest_label) verdict.label = seen.least_label;
  }
  const auto bin = [](float pixel, int size) {
    const float last = static_cast<float>(size - 1);
    return static_cast<std::uint32_t>(std::min(std::max(0.0F, pixel), last)) / kBin_px;
  };
  const auto per_row = static_cast<std::uint32_t>((frame.width + kBin_px - 1) / kBin_px);
  verdict.bin = bin(extent.middle_v, frame.height) * per_row + bin(extent.middle_u, frame.width);
  return verdict;
}

}  // namespace

FrameView::FrameView(const Frame& frame, const cv::Mat& labels, Distances distances)
    : width(frame.intrinsics.width),
      height(frame.intrinsics.height),
      intrinsics(frame.intrinsics),
      T_WC(frame.T_WC) {
  const cv::Size size(width, height);
  Require(width > 0 && height > 0);
  Require(frame.depth.type() == CV_32FC1 && frame.depth.size() == size);
  Require(frame.colour.type() == CV_8UC3 && frame.colour.size() == size);
  Require(labels.type() == CV_16UC1 && labels.size() == size);
  depth_ = Continuous(frame.depth);
  label_ = Continuous(labels);
  colour_ = Continuous(frame.colour);
  if (colour_.total() == 1) cv::repeat(colour_, 1, 2, colour_);  // the kernels read four bytes
  kernel.depth = depth_.ptr<float>();
  kernel.label = label_.ptr<std::uint16_t>();
  kernel.colour = colour_.ptr<std::uint8_t>();
  if (distances == Distances::kSurface) {
    facing_ = FacingOf(frame, labels);
    kernel.facing = facing_.ptr<float>();
  }
  kernel.width = static_cast<float>(width);
  kernel.height = static_cast<float>(height);
  kernel.intrinsics = {static_cast<float>(intrinsics.fx), static_cast<float>(intrinsics.fy),
                       static_cast<float>(intrinsics.cx), static_cast<float>(intrinsics.cy)};
  tiles_per_row = (width + kTile_px - 1) / kTile_px;
  const int rows = (height + kTile_px - 1) / kTile_px;
  tiles.resize(static_cast<std::size_t>(tiles_per_row * rows));
  tbb::parallel_for(
      tbb::blocked_range<int>(0, rows, kTileRowsPerTask),
      [&](const tbb::blocked_range<int>& range) {
        for (int row = range.begin(); row != range.end(); ++row) {
          SummariseTiles(kernel, row, &tiles[static_cast<std::size_t>(row * tiles_per_row)]);
        }
      },
      tbb::simple_partitioner());
  if (std::none_of(tiles.begin(), tiles.end(), [](const Tile& t) { return t.has_invalid; })) return;
  depth_ = depth_.clone();
  for (float& depth : cv::Mat_<float>(depth_)) {
    if (!IsValidDepth(depth)) depth = -std::numeric_limits<float>::infinity();
  }
  kernel.depth = depth_.ptr<float>();
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

std::vector<PlannedBlock> PlanBlocks(
    const FrameView& frame, std::size_t count, float voxel, float back,
    const std::function<BlockCandidate(std::size_t)>& candidate_at) {
  std::vector<Verdict> verdicts(count);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          verdicts[i] = Judge(frame, candidate_at(i), voxel, back);
        }
      },
      tbb::simple_partitioner());
  // Sorted by counting.
  const int columns = (frame.width + kBin_px - 1) / kBin_px;
  const int rows = (frame.height + kBin_px - 1) / kBin_px;
  std::vector<std::uint32_t> first(static_cast<std::size_t>(columns * rows) + 1, 0);
  for (const Verdict& verdict : verdicts) {
    if (verdict.bin != kNotSeen) ++first[verdict.bin + 1];
  }
  for (std::size_t bin = 1; bin < first.size(); ++bin) first[bin] += first[bin - 1];
  std::vector<PlannedBlock> planned(first.back());
  for (std::size_t i = 0; i < count; ++i) {
    const Verdict& verdict = verdicts[i];
    if (verdict.bin == kNotSeen) continue;
    planned[first[verdict.bin]++] = {static_cast<std::uint32_t>(i), verdict.label, verdict.behind_m,
                                     verdict.all_in_view};
  }
  return planned;
}

BlockPlace PlaceOf(const CameraFromLattice& T_CL, const Index3& block, float voxel,
                   const PlannedBlock& planned) {
  return {T_CL.rows[0].data(),
          voxel,
          {block.x * kBlockSide, block.y * kBlockSide, block.z * kBlockSide},
          planned.behind_m,
          planned.all_in_view};
}

}  // namespace tsdfpp
