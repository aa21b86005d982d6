#include "mapper/fusion_kernels.h"

#include <algorithm>

#include "core/types.h"

// One pass of this file an instruction set; the machine's best is chosen at run time. On x86-64 all
// give the same bits: only correctly rounded operations, none contracted
// (cmake/TsdfppTarget.cmake).
#ifndef TSDFPP_MAPPER_FUSION_KERNELS_ONCE
#define TSDFPP_MAPPER_FUSION_KERNELS_ONCE
namespace tsdfpp {
namespace {

// table[pixel], or table[0] where there is no pixel. Plain loads: from a frame, which no cache
// holds, gathers took longer.
template <typename T>
void Read(const T* table, const std::int32_t* pixel, T* out) {
  for (int i = 0; i < kBlockVoxels; ++i) out[i] = table[pixel[i] < 0 ? 0 : pixel[i]];
}

}  // namespace
}  // namespace tsdfpp
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/fusion_kernels.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

void Project(const KernelFrame& frame, const float* T_CL, float voxel, const Index3& first_voxel,
             float* out_z, float* out_scale, std::int32_t* out_pixel) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  // Local copies: for all that the compiler knows, the stores alias the arguments.
  const Index3 first = first_voxel;
  std::array<float, 12> m;
  std::copy(T_CL, T_CL + 12, m.begin());
  const auto fx = hn::Set(df, frame.intrinsics[0]);
  const auto fy = hn::Set(df, frame.intrinsics[1]);
  const auto cx = hn::Set(df, frame.intrinsics[2]);
  const auto cy = hn::Set(df, frame.intrinsics[3]);
  const auto width = hn::Set(df, frame.width);
  const auto height = hn::Set(df, frame.height);
  const auto stride = hn::Set(di, static_cast<std::int32_t>(frame.width));
  const auto half = hn::Set(df, 0.5F);
  const auto zero = hn::Zero(df);
  const auto lane = hn::Iota(di, 0);
  const auto seven = hn::Set(di, 7);
  const auto metres = [&](auto steps, int from) {
    return hn::Mul(hn::ConvertTo(df, hn::Add(steps, hn::Set(di, from))), hn::Set(df, voxel));
  };
  const auto along = [&](float factor, auto coordinate) {
    return hn::Mul(hn::Set(df, factor), coordinate);
  };
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto place = hn::Add(lane, hn::Set(di, static_cast<std::int32_t>(i)));
    const auto px = metres(hn::And(place, seven), first.x);
    const auto py = metres(hn::And(hn::ShiftRight<3>(place), seven), first.y);
    const auto pz = metres(hn::ShiftRight<6>(place), first.z);
    const auto row = [&](std::size_t r) {
      const auto fixed =
          hn::Add(hn::Add(along(m[r + 1], py), along(m[r + 2], pz)), hn::Set(df, m[r + 3]));
      return hn::Add(fixed, along(m[r], px));
    };
    const auto cam_x = row(0);
    const auto cam_y = row(4);
    const auto cam_z = row(8);
    const auto iz = hn::Div(hn::Set(df, 1.0F), cam_z);
    const auto u = hn::Add(hn::Add(hn::Mul(hn::Mul(fx, cam_x), iz), cx), half);
    const auto v = hn::Add(hn::Add(hn::Mul(hn::Mul(fy, cam_y), iz), cy), half);
    const auto ray = hn::Sqrt(
        hn::Add(hn::Add(hn::Mul(cam_x, cam_x), hn::Mul(cam_y, cam_y)), hn::Mul(cam_z, cam_z)));
    const auto in_view = hn::And(
        hn::And(hn::Ge(cam_z, hn::Set(df, kNearest_m)), hn::And(hn::Ge(u, zero), hn::Lt(u, width))),
        hn::And(hn::Ge(v, zero), hn::Lt(v, height)));
    // Non-negative here, so truncation is the floor.
    const auto column = hn::ConvertTo(di, hn::IfThenElseZero(in_view, u));
    const auto line = hn::ConvertTo(di, hn::IfThenElseZero(in_view, v));
    const auto pixel = hn::Add(hn::Mul(line, stride), column);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, in_view), pixel, hn::Set(di, -1)), di,
               out_pixel + i);
    hn::StoreU(cam_z, df, out_z + i);
    hn::StoreU(hn::Mul(ray, iz), df, out_scale + i);
  }
}

bool Observe(const KernelFrame& frame, const float* T_CL, float voxel, const Index3& first,
             float back, BlockObservation& out) {
  HWY_ALIGN std::array<float, kBlockVoxels> z_of;
  HWY_ALIGN std::array<float, kBlockVoxels> scale_of;
  Project(frame, T_CL, voxel, first, z_of.data(), scale_of.data(), out.pixel.data());
  HWY_ALIGN std::array<DepthAndLabel, kBlockVoxels> seen;
  Read(frame.pixels, out.pixel.data(), seen.data());
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  const auto none = hn::Set(di, -1);
  const auto minus_back = hn::Set(df, -back);
  auto any = hn::Zero(di);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto at = hn::LoadU(di, out.pixel.data() + i);
    hn::VFromD<decltype(di)> depth_bits;
    hn::VFromD<decltype(di)> label;
    hn::LoadInterleaved2(di, reinterpret_cast<const std::int32_t*>(seen.data() + i), depth_bits,
                         label);
    const auto depth = hn::BitCast(df, depth_bits);
    const auto s =
        hn::Mul(hn::Sub(depth, hn::LoadU(df, z_of.data() + i)), hn::LoadU(df, scale_of.data() + i));
    const auto measured = hn::And(hn::Gt(depth, hn::Zero(df)), hn::Ge(s, minus_back));
    const auto observed = hn::And(hn::RebindMask(di, measured), hn::Gt(at, none));
    hn::StoreU(s, df, out.distance.data() + i);
    hn::StoreU(hn::IfThenElse(observed, at, none), di, out.pixel.data() + i);
    hn::StoreU(label, di, out.label.data() + i);
    any = hn::Or(any, hn::VecFromMask(di, observed));
  }
  return !hn::AllTrue(di, hn::Eq(any, hn::Zero(di)));
}

void FuseColours(const KernelFrame& frame, const BlockObservation& observation,
                 const Lanes& in_band, float weight_cap, TsdfBlock& block) {
  HWY_ALIGN Lanes colour;
  Read(frame.colour, observation.pixel.data(), colour.data());
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  const hn::Rebind<std::uint16_t, decltype(df)> du;
  const auto low_byte = hn::Set(di, 255);
  const auto half = hn::Set(df, 0.5F);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto take = hn::Ne(hn::LoadU(di, in_band.data() + i), hn::Zero(di));
    if (hn::AllFalse(di, take)) continue;
    const auto take_f = hn::RebindMask(df, take);
    const auto seen = hn::Load(di, colour.data() + i);
    std::uint16_t* counts = block.colour_count.data() + i;
    const auto count = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du, counts)));
    const auto more = hn::Add(count, hn::Set(df, 1.0F));
    const auto fuse = [&](std::uint16_t* stored, auto level) {
      const auto old = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du, stored)));
      const auto change =
          hn::Div(hn::Sub(hn::Mul(hn::Set(df, 256.0F), hn::ConvertTo(df, level)), old), more);
      const auto mean = hn::Add(hn::Add(old, change), half);
      hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, hn::IfThenElse(take_f, mean, old))), du,
                 stored);
    };
    fuse(block.colour[0].data() + i, hn::And(seen, low_byte));
    fuse(block.colour[1].data() + i, hn::And(hn::ShiftRight<8>(seen), low_byte));
    fuse(block.colour[2].data() + i, hn::And(hn::ShiftRight<16>(seen), low_byte));
    const auto capped = hn::Min(more, hn::Set(df, weight_cap));
    hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, hn::IfThenElse(take_f, capped, count))), du,
               counts);
  }
}

FusionResult Fuse(const KernelFrame& frame, const FusionRule& rule,
                  const BlockObservation& observation, TsdfBlock& block, Lanes& in_band,
                  Lanes& contradicted) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  const auto id = hn::Set(di, rule.id);
  const auto every = hn::Set(di, rule.every_label ? -1 : 0);
  const auto contradiction = hn::Set(di, rule.contradiction ? -1 : 0);
  const auto front = hn::Set(df, rule.front);
  const auto cap = hn::Set(df, rule.weight_cap);
  const auto minus_half = hn::Set(df, -rule.half_voxel);
  auto any_taken = hn::Zero(di);
  auto any_in_band = hn::Zero(di);
  auto any_contradicted = hn::Zero(di);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto at = hn::LoadU(di, observation.pixel.data() + i);
    const auto observed = hn::VecFromMask(di, hn::Gt(at, hn::Set(di, -1)));
    const auto label = hn::LoadU(di, observation.label.data() + i);
    const auto taken = hn::And(observed, hn::Or(every, hn::VecFromMask(di, hn::Eq(label, id))));
    const auto s = hn::LoadU(df, observation.distance.data() + i);
    const auto w = hn::LoadU(df, block.weight.data() + i);
    const auto d = hn::LoadU(df, block.distance.data() + i);
    const auto claims_solid =
        hn::And(hn::And(hn::Gt(w, hn::Zero(df)), hn::Lt(d, minus_half)), hn::Ge(s, minus_half));
    const auto against = hn::And(hn::AndNot(taken, hn::And(observed, contradiction)),
                                 hn::VecFromMask(di, hn::RebindMask(di, claims_solid)));
    const auto more = hn::Add(w, hn::Set(df, 1.0F));
    const auto fused = hn::Div(hn::Add(hn::Mul(w, d), hn::Min(s, front)), more);
    const auto take_f = hn::RebindMask(df, hn::MaskFromVec(taken));
    hn::StoreU(hn::IfThenElse(take_f, fused, d), df, block.distance.data() + i);
    hn::StoreU(hn::IfThenElse(take_f, hn::Min(more, cap), w), df, block.weight.data() + i);
    const auto near = hn::And(taken, hn::VecFromMask(di, hn::RebindMask(di, hn::Le(s, front))));
    hn::StoreU(near, di, in_band.data() + i);
    hn::StoreU(against, di, contradicted.data() + i);
    any_taken = hn::Or(any_taken, taken);
    any_in_band = hn::Or(any_in_band, near);
    any_contradicted = hn::Or(any_contradicted, against);
  }
  const auto any = [&](auto lanes) { return !hn::AllTrue(di, hn::Eq(lanes, hn::Zero(di))); };
  const FusionResult result{any(any_taken), any(any_in_band), any(any_contradicted)};
  if (result.any_in_band) FuseColours(frame, observation, in_band, rule.weight_cap, block);
  return result;
}

bool Vote(const BlockObservation& observation, const Lanes& in_band, std::int32_t confidence_cap,
          std::uint16_t* ids, std::uint16_t* confidences) {
  const hn::ScalableTag<std::int32_t> di;
  const hn::Rebind<std::uint16_t, decltype(di)> du;
  const auto one = hn::Set(di, 1);
  const auto cap = hn::Set(di, confidence_cap);
  auto any = hn::Zero(di);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(di)) {
    const auto votes = hn::Ne(hn::LoadU(di, in_band.data() + i), hn::Zero(di));
    if (hn::AllFalse(di, votes)) continue;
    const auto seen = hn::LoadU(di, observation.label.data() + i);
    const auto id = hn::PromoteTo(di, hn::LoadU(du, ids + i));
    const auto confidence = hn::PromoteTo(di, hn::LoadU(du, confidences + i));
    const auto same = hn::Eq(id, seen);
    const auto weak =
        hn::Or(hn::Eq(id, hn::Set(di, kNoInstance)), hn::Lt(confidence, hn::Set(di, 2)));
    const auto replace = hn::And(votes, hn::AndNot(same, weak));
    const auto raised =
        hn::IfThenElse(hn::Lt(confidence, cap), hn::Add(confidence, one), confidence);
    const auto lowered = hn::IfThenElse(weak, one, hn::Sub(confidence, one));
    const auto voted = hn::IfThenElse(same, raised, lowered);
    hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(replace, seen, id)), du, ids + i);
    hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(votes, voted, confidence)), du, confidences + i);
    any = hn::Or(any, hn::VecFromMask(di, replace));
  }
  return !hn::AllTrue(di, hn::Eq(any, hn::Zero(di)));
}

void RayBlocks(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
               const RayRanges& ranges, std::size_t count, BlocksOfPoints& blocks) {
  const hn::CappedTag<double, 8> dd;
  const hn::Rebind<std::int32_t, decltype(dd)> di;
  const std::array<std::int32_t*, 3> out{blocks.x.data(), blocks.y.data(), blocks.z.data()};
  const auto half = hn::Set(dd, 0.5);
  auto number = hn::Iota(dd, 0);
  for (std::size_t i = 0; i < count; i += hn::Lanes(dd)) {
    const auto range =
        hn::Min(hn::Add(hn::Set(dd, ranges.first), hn::Mul(hn::Set(dd, ranges.step), number)),
                hn::Set(dd, ranges.last));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto point =
          hn::Add(hn::Set(dd, origin[axis]), hn::Mul(hn::Set(dd, direction[axis]), range));
      const auto voxel = hn::DemoteTo(di, hn::Floor(hn::Add(point, half)));
      hn::StoreU(hn::ShiftRight<3>(voxel), di, out[axis] + i);
    }
    number = hn::Add(number, hn::Set(dd, static_cast<double>(hn::Lanes(dd))));
  }
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Observe);
HWY_EXPORT(Fuse);
HWY_EXPORT(Vote);
HWY_EXPORT(RayBlocks);

bool ObserveVoxels(const KernelFrame& frame, const float* T_CL, float voxel, const Index3& first,
                   float back, BlockObservation& out) {
  return HWY_DYNAMIC_DISPATCH(Observe)(frame, T_CL, voxel, first, back, out);
}

FusionResult FuseVoxels(const KernelFrame& frame, const FusionRule& rule,
                        const BlockObservation& observation, TsdfBlock& block, Lanes& in_band,
                        Lanes& contradicted) {
  return HWY_DYNAMIC_DISPATCH(Fuse)(frame, rule, observation, block, in_band, contradicted);
}

bool VoteLabels(const BlockObservation& observation, const Lanes& in_band,
                std::int32_t confidence_cap, std::uint16_t* id, std::uint16_t* confidence) {
  return HWY_DYNAMIC_DISPATCH(Vote)(observation, in_band, confidence_cap, id, confidence);
}

void BlocksAtPoints(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
                    const RayRanges& ranges, std::size_t count, BlocksOfPoints& out) {
  HWY_DYNAMIC_DISPATCH(RayBlocks)(origin, direction, ranges, count, out);
}

BlockMask MaskOf(const Lanes& lanes) {
  BlockMask mask{};
  for (std::size_t i = 0; i < kBlockVoxels; i += 8) {
    std::uint64_t bytes = 0;
    for (std::size_t k = 0; k < 8; ++k) {
      bytes |= static_cast<std::uint64_t>(lanes[i + k] & 1) << k;
    }
    mask[i >> 6U] |= bytes << (i & 63U);
  }
  return mask;
}

}  // namespace tsdfpp
#endif
