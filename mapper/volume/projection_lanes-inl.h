// The voxels of a block projected into a frame (docs/map.md, "Observation of a voxel"). Included
// once an instruction set, after highway.h.
#if defined(TSDFPP_MAPPER_PROJECTION_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TSDFPP_MAPPER_PROJECTION_LANES_INL_H_
#undef TSDFPP_MAPPER_PROJECTION_LANES_INL_H_
#else
#define TSDFPP_MAPPER_PROJECTION_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "mapper/volume/fusion_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The vectors that the loops work on: rows of a block's slice, never more than two.
using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;

// Towards zero, of numbers that fit; hn::ConvertTo() also looks after those that do not.
inline hn::VFromD<Ints> Truncated(hn::VFromD<Floats> v) {
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
  return hn::VFromD<Ints>{_mm512_cvttps_epi32(v.raw)};
#elif HWY_TARGET == HWY_AVX2
  return hn::VFromD<Ints>{_mm256_cvttps_epi32(v.raw)};
#else
  return hn::ConvertTo(Ints(), v);
#endif
}

// The voxels of a block as the camera sees them; what is out of view is infinitely far away, at
// pixel 0.
struct Projected {
  HWY_ALIGN std::array<float, kBlockVoxels> z;      // p_C.z
  HWY_ALIGN std::array<float, kBlockVoxels> scale;  // ray * iz
  HWY_ALIGN Lanes pixel;
  // At the first voxel of a vector: whether one of its voxels is in view and not behind all.
  std::array<std::uint8_t, kBlockVoxels> look;
};
constexpr std::size_t kLanes = hn::MaxLanes(Floats());

// False where none is to be looked at. Calls each_slice(z) before each slice.
template <bool kAllInView, class EachSlice>
bool ProjectWith(const KernelFrame& frame, const BlockPlace& place, const EachSlice& each_slice,
                 Projected& out) {
  const Floats df;
  const Ints di;
  std::array<float, 12> m;
  std::copy(place.T_CL, place.T_CL + 12, m.begin());
  // The terms of x, by place in two rows, and of y, by place in a slice.
  HWY_ALIGN std::array<std::array<float, 16>, 3> x_term;
  HWY_ALIGN std::array<std::array<float, kSliceVoxels>, 3> y_term;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t k = 0; k < kBlockSide; ++k) {
      const auto step = static_cast<int>(k);
      const float x = m[4 * r] * (static_cast<float>(place.first.x + step) * place.voxel);
      const float y = m[4 * r + 1] * (static_cast<float>(place.first.y + step) * place.voxel);
      x_term[r][k] = x_term[r][k + kBlockSide] = x;
      std::fill_n(y_term[r].begin() + 8 * step, 8, y);
    }
  }
  const auto fx = hn::Set(df, frame.intrinsics[0]);
  const auto fy = hn::Set(df, frame.intrinsics[1]);
  const auto cx = hn::Set(df, frame.intrinsics[2]);
  const auto cy = hn::Set(df, frame.intrinsics[3]);
  const auto width = hn::Set(df, frame.width);
  const auto height = hn::Set(df, frame.height);
  const auto stride = hn::Set(di, static_cast<std::int32_t>(frame.width));
  const auto half = hn::Set(df, 0.5F);
  const auto zero = hn::Zero(df);
  const auto far_away = hn::Set(df, std::numeric_limits<float>::infinity());
  const auto behind = hn::Set(df, place.behind_m);
  auto any = hn::MaskFromVec(hn::Zero(df));
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    each_slice(z);
    const float pz = static_cast<float>(place.first.z + static_cast<int>(z)) * place.voxel;
    const std::array z_term{hn::Set(df, m[2] * pz), hn::Set(df, m[6] * pz),
                            hn::Set(df, m[10] * pz)};
    for (std::size_t k = 0; k < kSliceVoxels; k += hn::Lanes(df)) {
      const std::size_t i = kSliceVoxels * z + k;
      const auto row = [&](std::size_t r) {
        const auto fixed =
            hn::Add(hn::Add(hn::Load(df, &y_term[r][k]), z_term[r]), hn::Set(df, m[4 * r + 3]));
        return hn::Add(fixed, hn::Load(df, &x_term[r][k & 7U]));
      };
      const auto cam_x = row(0);
      const auto cam_y = row(1);
      const auto cam_z = row(2);
      const auto iz = hn::Div(hn::Set(df, 1.0F), cam_z);
      const auto u = hn::Add(hn::Add(hn::Mul(hn::Mul(fx, cam_x), iz), cx), half);
      const auto v = hn::Add(hn::Add(hn::Mul(hn::Mul(fy, cam_y), iz), cy), half);
      const auto ray = hn::Sqrt(
          hn::Add(hn::Add(hn::Mul(cam_x, cam_x), hn::Mul(cam_y, cam_y)), hn::Mul(cam_z, cam_z)));
      auto scale = hn::Mul(ray, iz);
      auto look = hn::Le(cam_z, behind);
      // Non-negative in view, so truncation is the floor.
      const auto store = [&](auto seen_u, auto seen_v, auto seen_z) {
        const auto line = hn::Mul(Truncated(seen_v), stride);
        hn::Store(hn::Add(line, Truncated(seen_u)), di, &out.pixel[i]);
        hn::Store(seen_z, df, &out.z[i]);
      };
      if constexpr (kAllInView) {
        store(u, v, cam_z);
      } else {
        const auto in_view = hn::And(hn::And(hn::Ge(cam_z, hn::Set(df, kNearest_m)),
                                             hn::And(hn::Ge(u, zero), hn::Lt(u, width))),
                                     hn::And(hn::Ge(v, zero), hn::Lt(v, height)));
        store(hn::IfThenElseZero(in_view, u), hn::IfThenElseZero(in_view, v),
              hn::IfThenElse(in_view, cam_z, far_away));
        // Behind the camera it would make the nearest of what is farthest.
        scale = hn::IfThenElse(in_view, scale, hn::Set(df, 1.0F));
        look = hn::And(in_view, look);
      }
      hn::Store(scale, df, &out.scale[i]);
      out.look[i] = hn::AllFalse(df, look) ? 0 : 1;
      any = hn::Or(any, look);
    }
  }
  return !hn::AllFalse(df, any);
}

template <class EachSlice>
bool Project(const KernelFrame& frame, const BlockPlace& place, const EachSlice& each_slice,
             Projected& out) {
  return place.all_in_view ? ProjectWith<true>(frame, place, each_slice, out)
                           : ProjectWith<false>(frame, place, each_slice, out);
}

// s of the lanes i ...; less than -back where nothing is observed.
hn::VFromD<Floats> Measure(const Projected& projected, const float* depth_of, std::size_t i) {
  const Floats df;
  return hn::Mul(hn::Sub(hn::Load(df, depth_of + i), hn::Load(df, &projected.z[i])),
                 hn::Load(df, &projected.scale[i]));
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
