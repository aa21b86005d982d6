// Lanes of half precision. Included once an instruction set, after highway.h.
#if defined(TSDFPP_MAPPER_HALF_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TSDFPP_MAPPER_HALF_LANES_INL_H_
#undef TSDFPP_MAPPER_HALF_LANES_INL_H_
#else
#define TSDFPP_MAPPER_HALF_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include "core/half.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {

// Of one vector of floats; no alignment needed.
template <class D>
hwy::HWY_NAMESPACE::VFromD<D> LoadHalves(D df, const Half* from) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::Rebind<hwy::float16_t, D> dh;
  const hn::Rebind<std::uint16_t, D> du;
  const auto bits = hn::LoadU(du, reinterpret_cast<const std::uint16_t*>(from));
  return hn::PromoteTo(df, hn::BitCast(dh, bits));
}

// As Half(float) rounds, of numbers below 2^15.
template <class D>
hwy::HWY_NAMESPACE::VFromD<D> RoundLanesToHalf(D df, hwy::HWY_NAMESPACE::VFromD<D> v) {
  namespace hn = hwy::HWY_NAMESPACE;
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
  const hn::Rebind<hwy::float16_t, D> dh;
  // What rounds to zero is +0, as it is after this sum.
  return hn::Add(hn::PromoteTo(df, hn::DemoteTo(dh, v)), hn::Zero(df));
#else
  const auto size = hn::Abs(v);
  // What rounds to zero is +0.
  v = hn::IfThenZeroElse(hn::Le(size, hn::Set(df, 0x1p-25F)), v);
  // There Highway cuts off what is too much, so it is rounded first.
  const hn::RebindToUnsigned<D> du;
  const auto bits = hn::BitCast(du, v);
  const auto odd = hn::And(hn::ShiftRight<13>(bits), hn::Set(du, 1U));
  const auto raised = hn::Add(hn::Add(bits, hn::Set(du, 0xFFFU)), odd);
  const auto normal = hn::BitCast(df, hn::And(raised, hn::Set(du, ~0x1FFFU)));
  const auto shifted = hn::Sub(hn::Add(size, hn::Set(df, 0.5F)), hn::Set(df, 0.5F));
  return hn::IfThenElse(hn::Lt(size, hn::Set(df, 0x1p-14F)), hn::CopySign(shifted, v), normal);
#endif
}

// Numbers that RoundLanesToHalf() gave.
template <class D>
void StoreHalves(D df, hwy::HWY_NAMESPACE::VFromD<D> v, Half* to) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::Rebind<hwy::float16_t, D> dh;
  const hn::Rebind<std::uint16_t, D> du;
  static_cast<void>(df);
  hn::StoreU(hn::BitCast(du, hn::DemoteTo(dh, v)), du, reinterpret_cast<std::uint16_t*>(to));
}

}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
