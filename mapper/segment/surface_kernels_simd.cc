#include <numbers>

#include "mapper/kernels.h"
#include "mapper/segment/surface_kernels.h"

// One pass of this file an instruction set, as mapper/volume/fusion_kernels_simd.cc.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/segment/surface_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using OneFloat = hn::CappedTag<float, 1>;

// What is known is asked by Eq: some instruction sets' Ne is false of what is not a number.

// Calls lanes(d, u) for whole vectors, then for single pixels.
template <class Lanes>
void ForEachLane(std::size_t pixels, const Lanes& lanes) {
  const Floats d;
  std::size_t u = 0;
  for (; u + hn::Lanes(d) <= pixels; u += hn::Lanes(d)) lanes(d, u);
  for (; u < pixels; ++u) lanes(OneFloat(), u);
}

// A byte a lane: `value` where the mask is, else 0.
template <class D, class M>
void StoreBytes(D d, M mask, std::int32_t value, std::uint8_t* to) {
  const hn::RebindToSigned<D> di;
  const hn::Rebind<std::uint8_t, D> d8;
  const auto words = hn::IfThenElseZero(hn::RebindMask(di, mask), hn::Set(di, value));
  hn::StoreU(hn::DemoteTo(d8, words), d8, to);
  (void)d;
}

// NoiseModel::HeadOnInverse.
template <class D, class V>
V HeadOnInverse(D d, V q, float scale) {
  const auto near = hn::Mul(hn::Set(d, 0.0012F), hn::Mul(q, q));
  const auto beyond = hn::Sub(hn::Set(d, 1.0F), hn::Mul(hn::Set(d, 0.4F), q));
  const auto far = hn::Mul(hn::Set(d, 0.0019F), hn::Mul(beyond, beyond));
  return hn::Mul(hn::Set(d, scale), hn::Add(near, far));
}

// th / (pi/2 - th) of the angle th with this cosine, at most 85 deg. pi/2 - th is the arc sine of
// the cosine, by its series: exact to 2e-5 rad above 60 deg. At 0 deg the ratio is 0.2 too large,
// which makes the lateral noise one in a hundred larger.
template <class D, class V>
V AngleRatio(D d, V cosine) {
  const auto c = hn::Max(cosine, hn::Set(d, 0.08715574F));
  const auto c2 = hn::Mul(c, c);
  auto series = hn::Set(d, 105.0F / 3456);
  for (const float factor : {15.0F / 336, 3.0F / 40, 1.0F / 6, 1.0F}) {
    series = hn::Add(hn::Set(d, factor), hn::Mul(c2, series));
  }
  series = hn::Mul(c, series);
  return hn::Div(hn::Sub(hn::Set(d, std::numbers::pi_v<float> / 2), series), series);
}

void Pairs(const float* before, const float* q, const float* behind, std::size_t pixels,
           const PairScale& scale, float* sum, float* count) {
  ForEachLane(pixels, [&](auto d, std::size_t u) HWY_ATTR {
    const auto zero = hn::Zero(d);
    const auto middle = hn::LoadU(d, q + u);
    const auto first = hn::LoadU(d, before + u);
    const auto last = hn::LoadU(d, behind + u);
    const auto slope = hn::Mul(hn::Abs(hn::Sub(last, first)), hn::Set(d, scale.shift));
    const auto shift = hn::Min(slope, hn::Mul(hn::Set(d, scale.steepest), middle));
    const auto tolerance =
        hn::Mul(hn::Set(d, scale.sigmas), hn::Add(HeadOnInverse(d, middle, scale.noise), shift));
    const auto both = hn::Add(first, last);
    const auto off = hn::Abs(hn::Sub(both, hn::Add(middle, middle)));
    const auto unknown =
        hn::Or(hn::Or(hn::Eq(first, zero), hn::Eq(middle, zero)), hn::Eq(last, zero));
    const auto taken = hn::AndNot(unknown, hn::Le(off, tolerance));
    hn::StoreU(hn::Add(hn::LoadU(d, sum + u), hn::IfThenElseZero(taken, both)), d, sum + u);
    hn::StoreU(hn::Add(hn::LoadU(d, count + u), hn::IfThenElseZero(taken, hn::Set(d, 2.0F))), d,
               count + u);
  });
}

// The slope at q from the values s pixels before and after it; 0 where there are none.
template <class D, class V>
V SlopeAt(D d, V before, V q, V after, V per_step, V tolerance) {
  const auto zero = hn::Zero(d);
  const auto lacks0 = hn::Eq(before, zero);
  const auto lacks1 = hn::Eq(after, zero);
  const auto back = hn::Mul(hn::Sub(q, before), per_step);
  const auto ahead = hn::Mul(hn::Sub(after, q), per_step);
  const auto nearer = hn::IfThenElse(hn::Lt(hn::Abs(back), hn::Abs(ahead)), back, ahead);
  const auto mean = hn::Mul(hn::Add(back, ahead), hn::Set(d, 0.5F));
  const auto agree = hn::Le(hn::Abs(hn::Sub(back, ahead)), tolerance);
  const auto both = hn::IfThenElse(agree, mean, nearer);
  const auto one = hn::IfThenElse(lacks0, hn::IfThenZeroElse(lacks1, ahead), back);
  return hn::IfThenElse(hn::Or(lacks0, lacks1), one, both);
}

void Normals(const NormalRow& row, std::size_t pixels, const NormalScale& scale, float* normal,
             float* sigma) {
  ForEachLane(pixels, [&](auto d, std::size_t u) HWY_ATTR {
    const auto zero = hn::Zero(d);
    const auto one = hn::Set(d, 1.0F);
    const auto noise = hn::Set(d, scale.noise);
    const auto q = hn::LoadU(d, row.q + u);
    const auto unknown = hn::Eq(q, zero);
    const auto per_step = hn::Set(d, scale.per_step);
    const auto head_on = HeadOnInverse(d, q, scale.noise);
    const auto width = hn::Mul(hn::Set(d, scale.pixel_width), q);
    const auto tolerance =
        hn::Mul(hn::Add(hn::Mul(hn::Set(d, scale.sigmas), head_on), width), per_step);
    const auto slope_x = SlopeAt(d, hn::LoadU(d, row.before + u), q, hn::LoadU(d, row.after + u),
                                 per_step, tolerance);
    const auto slope_y = SlopeAt(d, hn::LoadU(d, row.above + u), q, hn::LoadU(d, row.below + u),
                                 per_step, tolerance);
    const auto ray_x = hn::LoadU(d, row.ray_x + u);
    const auto ray_y = hn::Set(d, row.ray_y);
    const auto a = hn::Mul(slope_x, hn::Set(d, scale.per_x));
    const auto b = hn::Mul(slope_y, hn::Set(d, scale.per_y));
    const auto c = hn::Sub(hn::Sub(q, hn::Mul(a, ray_x)), hn::Mul(b, ray_y));
    // q is the plane's inverse distance times ray * normal, and positive.
    const auto square = hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Mul(c, c));
    const auto length = hn::Sqrt(hn::IfThenElse(unknown, one, square));
    const auto per_length = hn::Div(hn::Set(d, -1.0F), length);
    const auto part = [&](auto along) HWY_ATTR {
      return hn::IfThenZeroElse(unknown, hn::Mul(along, per_length));
    };
    hn::StoreInterleaved3(part(a), part(b), part(c), d, normal + 3 * u);
    const auto ray = hn::Sqrt(hn::Add(hn::Add(hn::Mul(ray_x, ray_x), hn::Mul(ray_y, ray_y)), one));
    const auto cosine = hn::Div(hn::Neg(hn::Mul(q, per_length)), ray);
    const auto z = hn::Div(one, hn::IfThenElse(unknown, one, q));
    const auto ratio = AngleRatio(d, cosine);
    // Along the ray and across it (depth_noise.h).
    const auto beyond = hn::Sub(z, hn::Set(d, 0.4F));
    const auto frontal =
        hn::Add(hn::Set(d, 0.0012F), hn::Mul(hn::Set(d, 0.0019F), hn::Mul(beyond, beyond)));
    const auto grazing = hn::Div(hn::Mul(hn::Set(d, 0.0001F), hn::Mul(ratio, ratio)), hn::Sqrt(z));
    const auto is_grazing = hn::Lt(cosine, hn::Set(d, 0.5F));
    const auto along = hn::Mul(noise, hn::Add(frontal, hn::IfThenElseZero(is_grazing, grazing)));
    const auto pixels_across =
        hn::Mul(noise, hn::Add(hn::Set(d, 0.8F), hn::Mul(hn::Set(d, 0.035F), ratio)));
    const auto steep = hn::Sqrt(hn::Add(hn::Mul(slope_x, slope_x), hn::Mul(slope_y, slope_y)));
    const auto across = hn::Mul(pixels_across, hn::Mul(steep, hn::Mul(z, z)));
    const auto all = hn::Sqrt(hn::Add(hn::Mul(along, along), hn::Mul(across, across)));
    hn::StoreU(hn::IfThenZeroElse(unknown, all), d, sigma + u);
  });
}

void Links(const JumpRow& row, std::size_t pixels, const JumpScale& scale, std::uint8_t* linked) {
  ForEachLane(pixels, [&](auto d, std::size_t u) HWY_ATTR {
    const auto zero = hn::Zero(d);
    const auto per_step = hn::Set(d, scale.per_step);
    const auto before = hn::LoadU(d, row.before + u);
    const auto q0 = hn::LoadU(d, row.q0 + u);
    const auto q1 = hn::LoadU(d, row.q1 + u);
    const auto behind = hn::LoadU(d, row.behind + u);
    const auto first = hn::Gt(q0, q1);
    const auto q = hn::Max(q0, q1);
    const auto sigma =
        hn::IfThenElse(first, hn::LoadU(d, row.sigma0 + u), hn::LoadU(d, row.sigma1 + u));
    // A pixel's width: w z / z^2.
    const auto tolerance = hn::Add(hn::Mul(hn::Mul(hn::Mul(hn::Set(d, scale.noise), sigma), q), q),
                                   hn::Mul(hn::Set(d, scale.width), q));
    const auto step = hn::Sub(q1, q0);
    const auto lacks0 = hn::Eq(before, zero);
    const auto lacks1 = hn::Eq(behind, zero);
    const auto off0 = hn::Abs(hn::Sub(step, hn::Mul(hn::Sub(q0, before), per_step)));
    const auto off1 = hn::Abs(hn::Sub(step, hn::Mul(hn::Sub(behind, q1), per_step)));
    const auto alone = hn::Sub(hn::Abs(step), hn::Mul(hn::Set(d, scale.steepest), q));
    const auto best0 = hn::IfThenElse(lacks0, hn::IfThenElse(lacks1, alone, off1), off0);
    const auto best1 = hn::IfThenElse(lacks1, best0, off1);
    const auto goes_on = hn::Or(hn::Le(best0, tolerance), hn::Le(best1, tolerance));
    const auto unknown = hn::Or(hn::Eq(q0, zero), hn::Eq(q1, zero));
    const auto is_linked = hn::AndNot(unknown, goes_on);
    StoreBytes(d, is_linked, 1, linked + u);
  });
}

void Turns(const ChordRow& row, std::size_t pixels, const ChordScale& scale, std::uint8_t* turns) {
  ForEachLane(pixels, [&](auto d, std::size_t u) HWY_ATTR {
    const auto zero = hn::Zero(d);
    const auto of_ray = [&](const float* from) HWY_ATTR {
      return row.stride == 0 ? hn::Set(d, *from) : hn::LoadU(d, from + u);
    };
    const auto z0 = hn::LoadU(d, row.z0 + u);
    const auto z = hn::LoadU(d, row.z + u);
    const auto z1 = hn::LoadU(d, row.z1 + u);
    const auto slant = row.stride == 0 ? hn::LoadU(d, row.slant + u) : hn::Set(d, *row.slant);
    const auto here = hn::Mul(of_ray(row.along), z);
    const auto xa = hn::Sub(here, hn::Mul(of_ray(row.along0), z0));
    const auto xb = hn::Sub(hn::Mul(of_ray(row.along1), z1), here);
    const auto da = hn::Mul(slant, hn::Sub(z, z0));
    const auto db = hn::Mul(slant, hn::Sub(z1, z));
    // |A| |B| sin of the turn, positive where the middle lies behind the chord, and cos.
    const auto turn = hn::Sub(hn::Mul(da, xb), hn::Mul(xa, db));
    const auto ahead = hn::Max(hn::Add(hn::Mul(xa, xb), hn::Mul(da, db)), zero);
    const auto half0 = hn::Add(hn::Mul(xa, xa), hn::Mul(da, da));
    const auto half1 = hn::Add(hn::Mul(xb, xb), hn::Mul(db, db));
    const auto h2 = hn::Min(half0, half1);
    const auto noise = hn::Mul(hn::Mul(hn::Set(d, scale.noise), hn::LoadU(d, row.sigma + u)), z);
    // Both sides times h^2, which may be 0.
    const auto limit = hn::Mul(hn::Add(hn::Mul(hn::Set(d, scale.tangent), h2), noise), ahead);
    const auto is_in = hn::And(hn::Gt(hn::Mul(turn, h2), limit), hn::Gt(turn, zero));
    StoreBytes(d, is_in, 255, turns + u);
  });
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Pairs);
HWY_EXPORT(Normals);
HWY_EXPORT(Links);
HWY_EXPORT(Turns);

void AddPairs(const float* before, const float* q, const float* behind, std::size_t pixels,
              const PairScale& scale, float* sum, float* count) {
  const auto run = UsesPlainKernels() ? plain::AddPairs : HWY_DYNAMIC_DISPATCH(Pairs);
  run(before, q, behind, pixels, scale, sum, count);
}

void NormalsOfRow(const NormalRow& row, std::size_t pixels, const NormalScale& scale, float* normal,
                  float* sigma) {
  const auto run = UsesPlainKernels() ? plain::NormalsOfRow : HWY_DYNAMIC_DISPATCH(Normals);
  run(row, pixels, scale, normal, sigma);
}

void LinksOfRow(const JumpRow& row, std::size_t pixels, const JumpScale& scale,
                std::uint8_t* linked) {
  const auto run = UsesPlainKernels() ? plain::LinksOfRow : HWY_DYNAMIC_DISPATCH(Links);
  run(row, pixels, scale, linked);
}

void TurnsOfRow(const ChordRow& row, std::size_t pixels, const ChordScale& scale,
                std::uint8_t* turns) {
  const auto run = UsesPlainKernels() ? plain::TurnsOfRow : HWY_DYNAMIC_DISPATCH(Turns);
  run(row, pixels, scale, turns);
}

}  // namespace tsdfpp
#endif
