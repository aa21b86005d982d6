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
using VF = hn::VFromD<Floats>;
using VI = hn::VFromD<Ints>;
using MF = decltype(hn::MaskFromVec(VF()));

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

// The sums by which a block's voxels are found before the camera, as far as rows and slices share
// them.
struct LatticeTerms {
  explicit LatticeTerms(const BlockPlace& place) {
    std::copy(place.T_CL, place.T_CL + 12, m.begin());
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t k = 0; k < kBlockSide; ++k) {
        const auto step = static_cast<int>(k);
        x[r][k] = x[r][k + kBlockSide] =
            m[4 * r] * (static_cast<float>(place.first.x + step) * place.voxel);
        const float of_y = m[4 * r + 1] * (static_cast<float>(place.first.y + step) * place.voxel);
        std::fill_n(y[r].begin() + 8 * step, 8, of_y);
      }
    }
  }

  // Component r of p_C at the voxels k ... of a slice, whose term of z is given.
  HWY_INLINE VF InCamera(std::size_t r, std::size_t k, VF z_term) const {
    const Floats df;
    const auto fixed = hn::Add(hn::Add(hn::Load(df, &y[r][k]), z_term), hn::Set(df, m[4 * r + 3]));
    return hn::Add(fixed, hn::Load(df, &x[r][k & 7U]));
  }

  std::array<float, 12> m;                                     // T_CL
  HWY_ALIGN std::array<std::array<float, 16>, 3> x;            // by place in two rows
  HWY_ALIGN std::array<std::array<float, kSliceVoxels>, 3> y;  // by place in a slice
};

// The camera, in each lane.
struct CameraLanes {
  explicit CameraLanes(const KernelFrame& frame)
      : fx(hn::Set(Floats(), frame.intrinsics[0])),
        fy(hn::Set(Floats(), frame.intrinsics[1])),
        cx(hn::Set(Floats(), frame.intrinsics[2])),
        cy(hn::Set(Floats(), frame.intrinsics[3])),
        width(hn::Set(Floats(), frame.width)),
        height(hn::Set(Floats(), frame.height)),
        stride(hn::Set(Ints(), static_cast<std::int32_t>(frame.width))) {}

  VF fx;
  VF fy;
  VF cx;
  VF cy;
  VF width;
  VF height;
  VI stride;
};

// Projects the points of voxels i ...; returns those to be looked at.
template <bool kAllInView>
HWY_INLINE MF ProjectPoints(const CameraLanes& camera, VF cam_x, VF cam_y, VF cam_z, VF behind,
                            std::size_t i, Projected& out) {
  const Floats df;
  const Ints di;
  const auto half = hn::Set(df, 0.5F);
  const auto zero = hn::Zero(df);
  const auto iz = hn::Div(hn::Set(df, 1.0F), cam_z);
  const auto u = hn::Add(hn::Add(hn::Mul(hn::Mul(camera.fx, cam_x), iz), camera.cx), half);
  const auto v = hn::Add(hn::Add(hn::Mul(hn::Mul(camera.fy, cam_y), iz), camera.cy), half);
  const auto ray = hn::Sqrt(
      hn::Add(hn::Add(hn::Mul(cam_x, cam_x), hn::Mul(cam_y, cam_y)), hn::Mul(cam_z, cam_z)));
  auto scale = hn::Mul(ray, iz);
  auto look = hn::Le(cam_z, behind);
  // Non-negative in view, so truncation is the floor.
  const auto store = [&](auto seen_u, auto seen_v, auto seen_z) {
    const auto line = hn::Mul(Truncated(seen_v), camera.stride);
    hn::Store(hn::Add(line, Truncated(seen_u)), di, &out.pixel[i]);
    hn::Store(seen_z, df, &out.z[i]);
  };
  if constexpr (kAllInView) {
    store(u, v, cam_z);
  } else {
    const auto in_view = hn::And(hn::And(hn::Ge(cam_z, hn::Set(df, kNearest_m)),
                                         hn::And(hn::Ge(u, zero), hn::Lt(u, camera.width))),
                                 hn::And(hn::Ge(v, zero), hn::Lt(v, camera.height)));
    const auto far_away = hn::Set(df, std::numeric_limits<float>::infinity());
    store(hn::IfThenElseZero(in_view, u), hn::IfThenElseZero(in_view, v),
          hn::IfThenElse(in_view, cam_z, far_away));
    // Behind the camera it would make the nearest of what is farthest.
    scale = hn::IfThenElse(in_view, scale, hn::Set(df, 1.0F));
    look = hn::And(in_view, look);
  }
  hn::Store(scale, df, &out.scale[i]);
  return look;
}

// False where none is to be looked at. Calls each_slice(z) before each slice.
template <bool kAllInView, class EachSlice>
bool ProjectWith(const KernelFrame& frame, const BlockPlace& place, const EachSlice& each_slice,
                 Projected& out) {
  const Floats df;
  const LatticeTerms terms(place);
  const CameraLanes camera(frame);
  const auto behind = hn::Set(df, place.behind_m);
  auto any = hn::MaskFromVec(hn::Zero(df));
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    each_slice(z);
    const float pz = static_cast<float>(place.first.z + static_cast<int>(z)) * place.voxel;
    const auto z_of_x = hn::Set(df, terms.m[2] * pz);
    const auto z_of_y = hn::Set(df, terms.m[6] * pz);
    const auto z_of_z = hn::Set(df, terms.m[10] * pz);
    for (std::size_t k = 0; k < kSliceVoxels; k += hn::Lanes(df)) {
      const std::size_t i = kSliceVoxels * z + k;
      const auto look = ProjectPoints<kAllInView>(camera, terms.InCamera(0, k, z_of_x),
                                                  terms.InCamera(1, k, z_of_y),
                                                  terms.InCamera(2, k, z_of_z), behind, i, out);
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
