#include <algorithm>
#include <cstdlib>

#include "mapper/kernels.h"
#include "mapper/volume/pull_back_kernels.h"

// One pass of this file an instruction set (see fusion_kernels_simd.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/volume/pull_back_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/half_lanes-inl.h"
#include "mapper/volume/mask_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::int64_t kFarthestVoxel = 1 << 30;
static_assert(kPatchSide == 16);  // shifts by 4 and 8, rows of 16 bits

void Points(const std::array<double, 12>& T, double voxel_m, const Index3& first,
            PulledPoints& points) {
  const hn::CappedTag<double, kBlockSide> dd;
  const hn::Rebind<std::int32_t, decltype(dd)> di;
  const hn::Rebind<float, decltype(dd)> df;
  const auto h = hn::Set(dd, voxel_m);
  const auto lane = hn::Iota(dd, 0);
  std::array<std::array<std::int32_t, kBlockVoxels>, 3> base;
  auto lowest =
      std::array{hn::Set(di, 0x7FFFFFFF), hn::Set(di, 0x7FFFFFFF), hn::Set(di, 0x7FFFFFFF)};
  auto highest =
      std::array{hn::Set(di, -0x7FFFFFFF), hn::Set(di, -0x7FFFFFFF), hn::Set(di, -0x7FFFFFFF)};
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(dd)) {
    const double y_m = (first.y + static_cast<int>((i >> 3U) & 7U)) * voxel_m;
    const double z_m = (first.z + static_cast<int>(i >> 6U)) * voxel_m;
    const auto x_m = hn::Mul(hn::Add(lane, hn::Set(dd, first.x + static_cast<int>(i & 7U))), h);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double* row = &T[4 * axis];
      const auto moved =
          hn::Add(hn::Add(hn::Add(hn::Mul(hn::Set(dd, row[0]), x_m), hn::Set(dd, row[1] * y_m)),
                          hn::Set(dd, row[2] * z_m)),
                  hn::Set(dd, row[3]));
      const auto q = hn::Div(moved, h);
      const auto floor = hn::Floor(q);
      hn::StoreU(hn::DemoteTo(df, hn::Sub(q, floor)), df, &points.fraction[axis][i]);
      const auto corner = hn::DemoteTo(di, floor);
      hn::StoreU(corner, di, &base[axis][i]);
      lowest[axis] = hn::Min(lowest[axis], corner);
      highest[axis] = hn::Max(highest[axis], corner);
    }
  }
  std::array<int, 3> low{};
  std::array<int, 3> high{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t least = hn::GetLane(hn::MinOfLanes(di, lowest[axis]));
    const std::int64_t most = hn::GetLane(hn::MaxOfLanes(di, highest[axis]));
    // A pose that scales, or is not a number, is its maker's error.
    if (most - least > kPatchSide - 3 || least < -kFarthestVoxel || most > kFarthestVoxel) {
      std::abort();
    }
    low[axis] = static_cast<int>(least) - 1;
    high[axis] = static_cast<int>(most) + 1;
  }
  points.low = {low[0], low[1], low[2]};
  points.high = {high[0], high[1], high[2]};
  const hn::ScalableTag<std::int32_t> dw;
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(dw)) {
    const auto x = hn::Sub(hn::LoadU(dw, &base[0][i]), hn::Set(dw, points.low.x));
    const auto y = hn::Sub(hn::LoadU(dw, &base[1][i]), hn::Set(dw, points.low.y));
    const auto z = hn::Sub(hn::LoadU(dw, &base[2][i]), hn::Set(dw, points.low.z));
    const auto place = hn::Add(hn::Add(x, hn::ShiftLeft<4>(y)), hn::ShiftLeft<8>(z));
    hn::StoreU(place, dw, &points.corner[i]);
  }
}

constexpr std::array<std::int32_t, 8> kCorner{0,   1,   kPatchSide,       kPatchSide + 1,
                                              256, 257, 256 + kPatchSide, 257 + kPatchSide};

template <class D, class V>
V Blend(D d, V low, V high, V fraction) {
  return hn::Add(hn::Mul(low, hn::Sub(hn::Set(d, 1.0F), fraction)), hn::Mul(high, fraction));
}

// docs/map.md, "Resampling".
template <class D, class V>
V Trilinear8(D d, const std::array<V, 8>& c, V fx, V fy, V fz) {
  const V near = Blend(d, Blend(d, c[0], c[1], fx), Blend(d, c[2], c[3], fx), fy);
  const V far = Blend(d, Blend(d, c[4], c[5], fx), Blend(d, c[6], c[7], fx), fy);
  return Blend(d, near, far, fz);
}

template <bool kOnlyCounted>
void Interpolate(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
                 float* out) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  using V = hn::VFromD<decltype(df)>;
  const V zero = hn::Zero(df);
  const V one = hn::Set(df, 1.0F);
  const auto* bits = reinterpret_cast<const std::uint8_t*>(wanted.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    if (hn::AllFalse(df, MaskAt(df, bits, i))) continue;
    const auto at = hn::LoadU(di, &points.corner[i]);
    const V fx = hn::LoadU(df, &points.fraction[0][i]);
    const V fy = hn::LoadU(df, &points.fraction[1][i]);
    const V fz = hn::LoadU(df, &points.fraction[2][i]);
    std::array<V, 8> c;
    for (std::size_t k = 0; k < 8; ++k) {
      c[k] = hn::GatherIndex(df, values.data() + kCorner[k], at);
      if constexpr (kOnlyCounted) {
        const auto counts = [&](V fraction, bool upper) {
          return upper ? hn::Ne(fraction, zero) : hn::Ne(fraction, one);
        };
        c[k] = hn::IfThenElseZero(
            hn::And(counts(fx, (k & 1U) != 0),
                    hn::And(counts(fy, (k & 2U) != 0), counts(fz, (k & 4U) != 0))),
            c[k]);
      }
    }
    hn::StoreU(Trilinear8(df, c, fx, fy, fz), df, out + i);
  }
}

void Counted(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
             float* out) {
  Interpolate<true>(values, points, wanted, out);
}
void All(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
         float* out) {
  Interpolate<false>(values, points, wanted, out);
}

// The product of the distances to the opposite faces of the cube.
template <class D, class V>
V Coefficient(D d, std::size_t corner, const std::array<V, 3>& upper) {
  V coefficient = hn::Set(d, 1.0F);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const bool is_upper = ((corner >> axis) & 1U) != 0;
    coefficient =
        hn::Mul(coefficient, is_upper ? upper[axis] : hn::Sub(hn::Set(d, 1.0F), upper[axis]));
  }
  return coefficient;
}

void Observed(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
              float* out) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  using V = hn::VFromD<decltype(df)>;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(wanted.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    if (hn::AllFalse(df, MaskAt(df, bits, i))) continue;
    const auto at = hn::LoadU(di, &points.corner[i]);
    std::array<V, 3> upper;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      upper[axis] = hn::LoadU(df, &points.fraction[axis][i]);
    }
    std::array<V, 8> c;
    V total = hn::Zero(df);
    V sum = hn::Zero(df);
    for (std::size_t k = 0; k < 8; ++k) {
      c[k] = hn::GatherIndex(df, values.data() + kCorner[k], at);
      const auto observed = hn::Eq(c[k], c[k]);
      const V coefficient = hn::IfThenElseZero(observed, Coefficient(df, k, upper));
      total = hn::Add(total, coefficient);
      sum = hn::Add(sum, hn::Mul(coefficient, hn::IfThenElseZero(observed, c[k])));
    }
    const V all = Trilinear8(df, c, upper[0], upper[1], upper[2]);
    hn::StoreU(hn::IfThenElse(hn::Eq(all, all), all, hn::Div(sum, total)), df, out + i);
  }
}

void Colours(const std::array<PatchValues, 3>& channels, const PatchValues& count,
             const PulledPoints& points, const BlockMask& wanted, const float* points_count,
             TsdfBlock& block) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  const hn::Rebind<std::uint16_t, decltype(df)> du;
  const hn::Rebind<std::uint8_t, decltype(df)> d8;
  using V = hn::VFromD<decltype(df)>;
  const V zero = hn::Zero(df);
  const V half = hn::Set(df, 0.5F);
  const auto* bits = reinterpret_cast<const std::uint8_t*>(wanted.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto take = MaskAt(df, bits, i);
    if (hn::AllFalse(df, take)) continue;
    const auto at = hn::LoadU(di, &points.corner[i]);
    std::array<V, 3> upper;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      upper[axis] = hn::LoadU(df, &points.fraction[axis][i]);
    }
    V total = zero;
    std::array<V, 3> sum{zero, zero, zero};
    for (std::size_t k = 0; k < 8; ++k) {
      // Unobserved corners are NaN, in every channel.
      const auto coloured = hn::Gt(hn::GatherIndex(df, count.data() + kCorner[k], at), zero);
      if (hn::AllFalse(df, coloured)) continue;
      const V coefficient = hn::IfThenElseZero(coloured, Coefficient(df, k, upper));
      total = hn::Add(total, coefficient);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const V level = hn::GatherIndex(df, channels[channel].data() + kCorner[k], at);
        sum[channel] =
            hn::Add(sum[channel], hn::Mul(coefficient, hn::IfThenElseZero(coloured, level)));
      }
    }
    const auto has = hn::And(take, hn::Gt(total, zero));
    const auto counted = hn::IfThenElseZero(has, hn::LoadU(df, points_count + i));
    const auto rounded = hn::ConvertTo(di, hn::Add(counted, half));
    ColourSlice& colours = block.MakeColours(i / kSliceVoxels);
    const std::size_t in_slice = i % kSliceVoxels;
    hn::StoreU(hn::DemoteTo(d8, rounded), d8, &colours.count[in_slice]);
    const auto is_coloured = hn::RebindMask(df, hn::Gt(rounded, hn::Zero(di)));
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const V mean = hn::Add(hn::Div(sum[channel], total), half);
      hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, hn::IfThenElseZero(is_coloured, mean))), du,
                 &colours.channel[channel][in_slice]);
    }
  }
}

BlockMask Cover(const BlockMask& wanted, const BlockMask& in_crossed, const float* distance,
                float back) {
  const hn::ScalableTag<float> df;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(wanted.data());
  const auto* crossed = reinterpret_cast<const std::uint8_t*>(in_crossed.data());
  BlockMask covered{};
  auto* covered_bits = reinterpret_cast<std::uint8_t*>(covered.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto take = MaskAt(df, bits, i);
    if (hn::AllFalse(df, take)) continue;
    const auto d = hn::LoadU(df, distance + i);
    const auto in_band = hn::And(hn::Lt(d, hn::Zero(df)), hn::Ge(d, hn::Set(df, -back)));
    const auto at_surface = hn::And(MaskAt(df, crossed, i), hn::Eq(d, d));
    PutBits(df, hn::And(take, hn::Or(in_band, at_surface)), i, covered_bits);
  }
  return covered;
}

void Put(const BlockMask& wanted, const float* distance, const float* weight, TsdfBlock& block) {
  const hn::CappedTag<float, 16> df;
  const hn::RebindToSigned<decltype(df)> di;
  const hn::Rebind<std::uint8_t, decltype(df)> d8;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(wanted.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto take = MaskAt(df, bits, i);
    const auto d = hn::IfThenElseZero(take, hn::LoadU(df, distance + i));
    StoreHalves(df, RoundLanesToHalf(df, d), &block.distance[i]);
    const auto w = hn::Add(hn::LoadU(df, weight + i), hn::Set(df, 0.5F));
    hn::StoreU(hn::DemoteTo(d8, hn::ConvertTo(di, hn::IfThenElseZero(take, w))), d8,
               &block.weight[i]);
  }
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Points);
HWY_EXPORT(Counted);
HWY_EXPORT(All);
HWY_EXPORT(Observed);
HWY_EXPORT(Colours);
HWY_EXPORT(Cover);
HWY_EXPORT(Put);

void PullBackPoints(const std::array<double, 12>& T, double voxel_m, const Index3& first,
                    PulledPoints& points) {
  const auto run = UsesPlainKernels() ? plain::PullBackPoints : HWY_DYNAMIC_DISPATCH(Points);
  run(T, voxel_m, first, points);
}

void InterpolateCounted(const PatchValues& values, const PulledPoints& points,
                        const BlockMask& wanted, float* out) {
  const auto run = UsesPlainKernels() ? plain::InterpolateCounted : HWY_DYNAMIC_DISPATCH(Counted);
  run(values, points, wanted, out);
}

void InterpolateAll(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
                    float* out) {
  const auto run = UsesPlainKernels() ? plain::InterpolateAll : HWY_DYNAMIC_DISPATCH(All);
  run(values, points, wanted, out);
}

void InterpolateObserved(const PatchValues& values, const PulledPoints& points,
                         const BlockMask& wanted, float* out) {
  const auto run = UsesPlainKernels() ? plain::InterpolateObserved : HWY_DYNAMIC_DISPATCH(Observed);
  run(values, points, wanted, out);
}

BlockMask Covered(const BlockMask& wanted, const BlockMask& in_crossed, const float* distance,
                  float back) {
  const auto run = UsesPlainKernels() ? plain::Covered : HWY_DYNAMIC_DISPATCH(Cover);
  return run(wanted, in_crossed, distance, back);
}

void PutValues(const BlockMask& wanted, const float* distance, const float* weight,
               TsdfBlock& block) {
  const auto run = UsesPlainKernels() ? plain::PutValues : HWY_DYNAMIC_DISPATCH(Put);
  run(wanted, distance, weight, block);
}

void PutColours(const std::array<PatchValues, 3>& channels, const PatchValues& count,
                const PulledPoints& points, const BlockMask& wanted, const float* points_count,
                TsdfBlock& block) {
  const auto run = UsesPlainKernels() ? plain::PutColours : HWY_DYNAMIC_DISPATCH(Colours);
  run(channels, count, points, wanted, points_count, block);
}

}  // namespace tsdfpp
#endif
