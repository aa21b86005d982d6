// One lattice read at the voxels of another, point by point (docs/map.md, "Resampling" and
// "Cover").
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "mapper/volume/pull_back_kernels.h"

namespace tsdfpp::plain {
namespace {

constexpr double kFarthestVoxel = 1 << 30;

std::size_t Number(int i) { return static_cast<std::size_t>(i); }

// (T * (h v)) / h along an axis.
double PointAlong(const std::array<double, 12>& T, double voxel_m, const Index3& v, int axis) {
  const double* row = &T[Number(4 * axis)];
  const double moved =
      ((row[0] * (v.x * voxel_m) + row[1] * (v.y * voxel_m)) + row[2] * (v.z * voxel_m)) + row[3];
  return moved / voxel_m;
}

// The eight neighbours of a point, the lowest first, x fastest, and where the point lies among
// them: 0 at the lower, 1 at the upper along an axis.
struct Neighbours {
  std::array<float, 8> value;
  std::array<float, 3> fraction;
};

std::array<float, 8> CornersAt(const PatchValues& values, const PulledPoints& points, int i) {
  std::array<float, 8> corners{};
  for (int k = 0; k < 8; ++k) {
    const int step = (k & 1) + kPatchSide * ((k >> 1) & 1) + kPatchSide * kPatchSide * (k >> 2);
    corners[Number(k)] = values[Number(points.corner[Number(i)] + step)];
  }
  return corners;
}

Neighbours NeighboursOf(const PatchValues& values, const PulledPoints& points, int i) {
  Neighbours of;
  of.value = CornersAt(values, points, i);
  for (std::size_t axis = 0; axis < 3; ++axis) of.fraction[axis] = points.fraction[axis][Number(i)];
  return of;
}

// docs/map.md, "Resampling".
float Trilinear(const Neighbours& of) {
  const auto& c = of.value;
  const auto [fx, fy, fz] = of.fraction;
  const auto blend = [](float low, float high, float f) { return low * (1 - f) + high * f; };
  const float c_00 = blend(c[0], c[1], fx);
  const float c_10 = blend(c[2], c[3], fx);
  const float c_01 = blend(c[4], c[5], fx);
  const float c_11 = blend(c[6], c[7], fx);
  const float c_0 = blend(c_00, c_10, fy);
  const float c_1 = blend(c_01, c_11, fy);
  return blend(c_0, c_1, fz);
}

// A corner's part in the trilinear mean: the product of the distances to the opposite faces.
float Coefficient(const std::array<float, 3>& fraction, int corner) {
  float coefficient = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const bool is_upper = ((corner >> axis) & 1) != 0;
    const float f = fraction[Number(axis)];
    coefficient *= is_upper ? f : 1 - f;
  }
  return coefficient;
}

// Whether the coefficient is not zero.
bool Counts(const std::array<float, 3>& fraction, int corner) {
  for (int axis = 0; axis < 3; ++axis) {
    const bool is_upper = ((corner >> axis) & 1) != 0;
    if (fraction[Number(axis)] == (is_upper ? 0.0F : 1.0F)) return false;
  }
  return true;
}

// Over the corners with a number.
float MeanOfObserved(const Neighbours& of) {
  float total = 0;
  float sum = 0;
  for (int k = 0; k < 8; ++k) {
    const float value = of.value[Number(k)];
    if (std::isnan(value)) continue;
    const float coefficient = Coefficient(of.fraction, k);
    total += coefficient;
    sum += coefficient * value;
  }
  return sum / total;
}

}  // namespace

void PullBackPoints(const std::array<double, 12>& T, double voxel_m, const Index3& first,
                    PulledPoints& points) {
  std::array<std::array<int, 3>, kBlockVoxels> corner{};
  std::array<int, 3> low{};
  std::array<int, 3> high{};
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t a = Number(axis);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 v = first + VoxelAt({0, 0, 0}, i);
      const double q = PointAlong(T, voxel_m, v, axis);
      const double floor = std::floor(q);
      // A pose that scales, or is not a number, is its maker's error.
      if (!(std::abs(floor) <= kFarthestVoxel)) std::abort();
      points.fraction[a][Number(i)] = static_cast<float>(q - floor);
      const int lowest = static_cast<int>(floor);
      corner[Number(i)][a] = lowest;
      low[a] = i == 0 ? lowest - 1 : std::min(low[a], lowest - 1);
      high[a] = i == 0 ? lowest + 1 : std::max(high[a], lowest + 1);
    }
    if (high[a] - low[a] + 1 > kPatchSide) std::abort();
  }
  points.low = {low[0], low[1], low[2]};
  points.high = {high[0], high[1], high[2]};
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const auto& c = corner[i];
    points.corner[i] =
        kPatchSide * (kPatchSide * (c[2] - low[2]) + (c[1] - low[1])) + (c[0] - low[0]);
  }
}

void InterpolateCounted(const PatchValues& values, const PulledPoints& points,
                        const BlockMask& wanted, float* out) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!Bit(wanted, i)) continue;
    Neighbours of = NeighboursOf(values, points, i);
    for (int k = 0; k < 8; ++k) {
      if (!Counts(of.fraction, k)) of.value[Number(k)] = 0;
    }
    out[i] = Trilinear(of);
  }
}

void InterpolateAll(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
                    float* out) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (Bit(wanted, i)) out[i] = Trilinear(NeighboursOf(values, points, i));
  }
}

void InterpolateObserved(const PatchValues& values, const PulledPoints& points,
                         const BlockMask& wanted, float* out) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!Bit(wanted, i)) continue;
    const Neighbours of = NeighboursOf(values, points, i);
    const float all = Trilinear(of);
    out[i] = std::isnan(all) ? MeanOfObserved(of) : all;
  }
}

BlockMask Covered(const BlockMask& wanted, const BlockMask& in_crossed, const float* distance,
                  float back) {
  BlockMask covered{};
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!Bit(wanted, i) || std::isnan(distance[i])) continue;
    const bool in_band = distance[i] < 0 && distance[i] >= -back;
    if (in_band || Bit(in_crossed, i)) SetBit(covered, i);
  }
  return covered;
}

void PutValues(const BlockMask& wanted, const float* distance, const float* weight,
               TsdfBlock& block) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    const bool take = Bit(wanted, i);
    block.distance[Number(i)] = take ? distance[i] : 0.0F;
    block.weight[Number(i)] = take ? static_cast<std::uint8_t>(weight[i] + 0.5F) : std::uint8_t{0};
  }
}

void PutColours(const std::array<PatchValues, 3>& channels, const PatchValues& count,
                const PulledPoints& points, const BlockMask& wanted, const float* points_count,
                TsdfBlock& block) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!Bit(wanted, i)) continue;
    block.MakeColours(Number(i) / kSliceVoxels);
    const Neighbours counts = NeighboursOf(count, points, i);
    float total = 0;
    std::array<float, 3> sum{};
    for (int k = 0; k < 8; ++k) {
      // Unobserved corners are NaN, in every channel.
      if (!(counts.value[Number(k)] > 0)) continue;
      const float coefficient = Coefficient(counts.fraction, k);
      total += coefficient;
      for (std::size_t channel = 0; channel < 3; ++channel) {
        sum[channel] += coefficient * CornersAt(channels[channel], points, i)[Number(k)];
      }
    }
    const int rounded = total > 0 ? static_cast<int>(points_count[i] + 0.5F) : 0;
    FixedColour mean{};
    if (rounded > 0) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        mean[channel] = static_cast<std::uint16_t>(sum[channel] / total + 0.5F);
      }
    }
    block.SetColour(Number(i), mean, rounded);
  }
}

}  // namespace tsdfpp::plain
