#include "mapper/track/surface_reader.h"

#include <algorithm>
#include <cstdint>

namespace tsdfpp {
namespace {

// Of a distance's gradient, which is at least 1 beside a surface in sight and 0 where the distance
// is truncated. Around a sharp edge the interpolated one falls to some 0.6.
constexpr float kLeastSlope = 0.3F;

// The 4x4x4 voxels around a point, of which the middle eight are its corners.
class Neighbourhood {
 public:
  Neighbourhood(const VoxelReader& voxels, const Index3& base) {
    const Index3 first = base + Index3{-1, -1, -1};
    const Index3 block = BlockOf(first);
    const std::array<int, 3> start{first.x & 7, first.y & 7, first.z & 7};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 4; ++i) {
        const int at = start[axis] + i;
        const auto shift = static_cast<unsigned>(axis);
        which_[axis][static_cast<std::size_t>(i)] = at >= kBlockSide ? 1 << shift : 0;
        place_[axis][static_cast<std::size_t>(i)] = (at & 7) << (3 * shift);
      }
    }
    const int reach = which_[0][3] | which_[1][3] | which_[2][3];
    for (int i = 0; i < 8; ++i) {
      if ((i & reach) != i) continue;
      blocks_[static_cast<std::size_t>(i)] =
          voxels.BlockAt(block + Index3{i & 1, (i >> 1) & 1, i >> 2});
    }
  }

  // `base` is that of the cube.
  BentCube Bends(const Index3& base) const {
    BentCube bends;
    bends.cube.base = base;
    // What the lines need: the corners (1 and 2 along each axis), and one voxel more on each side
    // of one axis.
    std::array<float, 64> distance;
    std::array<std::uint8_t, 64> weight;
    const auto read = [&](int x, int y, int z) {
      const auto i = static_cast<std::size_t>(x);
      const auto j = static_cast<std::size_t>(y);
      const auto k = static_cast<std::size_t>(z);
      const TsdfBlock* block =
          blocks_[static_cast<std::size_t>(which_[0][i] | which_[1][j] | which_[2][k])];
      const std::size_t to = i + 4 * j + 16 * k;
      distance[to] = 0;
      weight[to] = 0;
      if (block == nullptr) return false;
      const auto place = static_cast<std::size_t>(place_[0][i] | place_[1][j] | place_[2][k]);
      distance[to] = block->distance[place];
      weight[to] = block->weight[place];
      return weight[to] != 0;
    };
    int least = 255;
    for (int i = 0; i < 8; ++i) {
      const int x = 1 + (i & 1);
      const int y = 1 + ((i >> 1) & 1);
      const int z = 1 + (i >> 2);
      if (!read(x, y, z)) return bends;
      const auto at = static_cast<std::size_t>(x + 4 * y + 16 * z);
      bends.cube.distance[static_cast<std::size_t>(i)] = distance[at];
      least = std::min<int>(least, weight[at]);
    }
    bends.cube.least_weight = least;
    for (int line = 0; line < 4; ++line) {
      const int second = 1 + (line & 1);
      const int third = 1 + (line >> 1);
      for (const int end : {0, 3}) {
        read(end, second, third);
        read(third, end, second);
        read(second, third, end);
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t second = (axis + 1) % 3;
      const std::size_t third = (axis + 2) % 3;
      for (std::size_t line = 0; line < 4; ++line) {
        const std::size_t at = (1 + (line & 1)) * kStep[second] + (1 + (line >> 1)) * kStep[third];
        const std::size_t step = kStep[axis];
        const float inner = distance[at + step];
        const float outer = distance[at + 2 * step];
        float low = distance[at] - 2 * inner + outer;
        float high = inner - 2 * outer + distance[at + 3 * step];
        const bool goes_on_up = weight[at + 3 * step] != 0;
        if (weight[at] == 0) low = goes_on_up ? high : 0;
        if (!goes_on_up) high = low;
        bends.low[4 * axis + line] = low;
        bends.high[4 * axis + line] = high;
      }
    }
    return bends;
  }

 private:
  static constexpr std::array<std::size_t, 3> kStep{1, 4, 16};

  std::array<std::array<int, 4>, 3> which_{};  // bit of the block along each axis
  std::array<std::array<int, 4>, 3> place_{};  // its part of the place in a block
  std::array<const TsdfBlock*, 8> blocks_{};
};

// SurfaceReader::SagAt() of a point that lies so far between a cube's corners.
float SagOf(const BentCube& bends, const std::array<float, 3>& fraction) {
  if (bends.cube.least_weight == 0) return 0;
  float sag = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float second = fraction[(axis + 1) % 3];
    const float third = fraction[(axis + 2) % 3];
    const float f = fraction[axis];
    for (std::size_t line = 0; line < 4; ++line) {
      // The second difference at the point, of one of the four lines along an axis, times the
      // line's share.
      const float share =
          ((line & 1) != 0 ? second : 1 - second) * ((line >> 1) != 0 ? third : 1 - third);
      sag += f * (1 - f) / 2 *
             (share * (bends.low[4 * axis + line] * (1 - f) + bends.high[4 * axis + line] * f));
    }
  }
  return sag;
}

}  // namespace

SurfaceReader::SurfaceReader(const TsdfGrid& grid, double voxel_m)
    : voxels_(grid), per_voxel_(1 / voxel_m), gradient_per_step_(static_cast<float>(1 / voxel_m)) {}

void SurfaceReader::Read(const Index3& base, VoxelCube& cube) const {
  cube.base = base;
  cube.least_weight = 0;
  if (voxels_.empty()) return;
  const Corners corners = FindCorners(voxels_, base);
  int least = 255;
  for (std::size_t i = 0; i < 8; ++i) {
    const TsdfBlock* block = corners.block[i];
    if (block == nullptr) return;
    const auto place = static_cast<std::size_t>(corners.place[i]);
    cube.distance[i] = block->distance[place];
    least = std::min<int>(least, block->weight[place]);
  }
  cube.least_weight = least;
}

SurfaceSample SurfaceReader::At(const Eigen::Vector3d& p_L, float sag_m, VoxelCube& cube) const {
  SurfaceSample sample;
  Linear linear;
  if (!LinearAt(p_L, sag_m, cube, linear)) return sample;
  sample.is_observed = true;
  sample.weight = static_cast<float>(cube.least_weight);
  sample.value_m = linear.value_m;
  sample.gradient_L = {linear.slope_x, linear.slope_y, linear.slope_z};
  sample.slope = sample.gradient_L.norm();
  sample.has_slope = sample.slope >= kLeastSlope;
  return sample;
}

SurfaceSample SurfaceReader::At(const Eigen::Vector3d& p_L, float sag_m) const {
  VoxelCube cube;
  return At(p_L, sag_m, cube);
}

float SurfaceReader::SagAt(const Eigen::Vector3d& p_L, SagCache& cache, VoxelCube& cube) const {
  const Eigen::Vector3d q = p_L * per_voxel_;
  if (voxels_.empty() || !(q.cwiseAbs().maxCoeff() < kFurthestVoxel)) return 0;
  const Index3 base = FloorOf(q);
  BentCube& bends = cache.Of(base);
  if (bends.cube.base != base) bends = Neighbourhood(voxels_, base).Bends(base);
  if (cube.base != base) cube = bends.cube;
  return SagOf(bends, {static_cast<float>(q.x() - base.x), static_cast<float>(q.y() - base.y),
                       static_cast<float>(q.z() - base.z)});
}

}  // namespace tsdfpp
