#include "mapper/fusion_kernels.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "core/types.h"
#include "mapper/cover_kernels.h"

// One pass of this file an instruction set; the machine's best is chosen at run time. On x86-64 all
// give the same bits: only correctly rounded operations, none contracted
// (cmake/TsdfppTarget.cmake).
#ifndef TSDFPP_MAPPER_FUSION_KERNELS_ONCE
#define TSDFPP_MAPPER_FUSION_KERNELS_ONCE
namespace tsdfpp {
namespace {

// One load after the other: from a frame, which no cache holds, gathers took longer, and so did
// what GCC made of the loops by itself.
#if defined(__GNUC__) && !defined(__clang__)
#define TSDFPP_PLAIN_LOADS __attribute__((noinline, optimize("no-tree-slp-vectorize")))
#else
#define TSDFPP_PLAIN_LOADS
#endif

// table[pixel], `kLanes` at a time, where these are to be looked at.
template <std::size_t kLanes, typename From, typename To>
TSDFPP_PLAIN_LOADS void Read(const From* table, const Lanes& pixel, const std::uint8_t* look,
                             To* out) {
  for (std::size_t i = 0; i < kBlockVoxels; i += kLanes) {
    if (look[i] == 0) continue;
    for (std::size_t k = i; k < i + kLanes; ++k) out[k] = table[pixel[k]];
  }
}

// Four bytes that end with the three of a pixel, or begin with them at pixel 0: no byte beyond the
// image is read.
inline std::int32_t BytesOfColour(const KernelFrame& frame, std::int32_t pixel) {
  std::int32_t bytes;
  std::memcpy(&bytes, frame.colour + 3 * static_cast<std::ptrdiff_t>(pixel) - (pixel != 0 ? 1 : 0),
              sizeof(bytes));
  return bytes;
}

}  // namespace
}  // namespace tsdfpp
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/fusion_kernels.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/half_lanes-inl.h"
#include "mapper/mask_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The vectors that the loops work on: rows of a block's slice, never more than two.
using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;
using Shorts = hn::Rebind<std::uint16_t, Floats>;
using Bytes8 = hn::Rebind<std::uint8_t, Floats>;
constexpr std::size_t kSlice = 64;

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

// False where none is to be looked at.
template <bool kAllInView>
bool ProjectWith(const KernelFrame& frame, const BlockPlace& place, Projected& out) {
  const Floats df;
  const Ints di;
  std::array<float, 12> m;
  std::copy(place.T_CL, place.T_CL + 12, m.begin());
  // The terms of x, by place in two rows, and of y, by place in a slice.
  HWY_ALIGN std::array<std::array<float, 16>, 3> x_term;
  HWY_ALIGN std::array<std::array<float, kSlice>, 3> y_term;
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
    const float pz = static_cast<float>(place.first.z + static_cast<int>(z)) * place.voxel;
    const std::array z_term{hn::Set(df, m[2] * pz), hn::Set(df, m[6] * pz),
                            hn::Set(df, m[10] * pz)};
    for (std::size_t k = 0; k < kSlice; k += hn::Lanes(df)) {
      const std::size_t i = kSlice * z + k;
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
      hn::Store(hn::Mul(ray, iz), df, &out.scale[i]);
      auto look = hn::Le(cam_z, behind);
      // Non-negative in view, so truncation is the floor.
      const auto store = [&](auto seen_u, auto seen_v, auto seen_z) {
        const auto line = hn::Mul(hn::ConvertTo(di, seen_v), stride);
        hn::Store(hn::Add(line, hn::ConvertTo(di, seen_u)), di, &out.pixel[i]);
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
        look = hn::And(in_view, look);
      }
      out.look[i] = hn::AllFalse(df, look) ? 0 : 1;
      any = hn::Or(any, look);
    }
  }
  return !hn::AllFalse(df, any);
}

bool Project(const KernelFrame& frame, const BlockPlace& place, Projected& out) {
  return place.all_in_view ? ProjectWith<true>(frame, place, out)
                           : ProjectWith<false>(frame, place, out);
}

// s of the lanes i ... and whether they are observed, labels apart: s >= -back.
template <class V>
struct Measured {
  V s;
  MaskOf<Floats> yes;
};

template <class V>
Measured<V> Measure(const Projected& projected, const float* depth_of, std::size_t i,
                    V minus_back) {
  const Floats df;
  const V depth = hn::Load(df, depth_of + i);
  const V s =
      hn::Mul(hn::Sub(depth, hn::Load(df, &projected.z[i])), hn::Load(df, &projected.scale[i]));
  const auto valid =
      hn::And(hn::Gt(depth, hn::Zero(df)), hn::Le(depth, hn::Set(df, kMaxValidDepth_m)));
  return {s, hn::And(valid, hn::Ge(s, minus_back))};
}

bool Observe(const KernelFrame& frame, const BlockPlace& place, float back, BlockObservation& out) {
  Projected projected;
  if (!Project(frame, place, projected)) return false;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  Read<kLanes>(frame.depth, projected.pixel, projected.look.data(), depth.data());
  Read<kLanes>(frame.label, projected.pixel, projected.look.data(), label.data());
  const Floats df;
  const Ints di;
  const auto minus_back = hn::Set(df, -back);
  auto any = hn::MaskFromVec(hn::Zero(di));
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    if (projected.look[i] == 0) {
      hn::StoreU(hn::Set(di, -1), di, &out.pixel[i]);
      continue;
    }
    const auto measured = Measure(projected, depth.data(), i, minus_back);
    const auto labelled = hn::Ne(hn::Load(di, &label[i]), hn::Set(di, kNoInstance));
    const auto observed = hn::And(hn::RebindMask(di, measured.yes), labelled);
    hn::StoreU(measured.s, df, &out.distance[i]);
    const auto pixel = hn::Load(di, &projected.pixel[i]);
    hn::StoreU(hn::IfThenElse(observed, pixel, hn::Set(di, -1)), di, &out.pixel[i]);
    any = hn::Or(any, observed);
  }
  return !hn::AllFalse(di, any);
}

// docs/map.md: the colours of the voxels that `bits` marks.
void FuseColours(const KernelFrame& frame, const Lanes& pixel, const std::uint8_t* bits,
                 float weight_cap, BlockColours& colours) {
  const Floats df;
  const Ints di;
  const Shorts du;
  const std::size_t lanes = hn::Lanes(df);
  const auto wanted = [&](std::size_t i) {
    const unsigned byte = lanes > 8 ? static_cast<unsigned>(bits[i / 8] | bits[i / 8 + 1])
                                    : static_cast<unsigned>(bits[i / 8]);
    return lanes >= 8 ? byte != 0 : (byte >> (i & 7U) & ((1U << lanes) - 1U)) != 0;
  };
  // All loads before their first use: they are stored singly and read as vectors.
  HWY_ALIGN Lanes colour;
  for (std::size_t i = 0; i < kBlockVoxels; i += lanes) {
    if (!wanted(i)) continue;
    for (std::size_t k = i; k < i + lanes; ++k) colour[k] = BytesOfColour(frame, pixel[k]);
  }
  const auto low_byte = hn::Set(di, 255);
  const auto half = hn::Set(df, 0.5F);
  const auto one = hn::Set(df, 1.0F);
  for (std::size_t i = 0; i < kBlockVoxels; i += lanes) {
    if (!wanted(i)) continue;
    const auto take = MaskAt(df, bits, i);
    const auto bytes = hn::Load(di, &colour[i]);
    const auto at_zero = hn::Eq(hn::Load(di, &pixel[i]), hn::Zero(di));
    const auto seen = hn::IfThenElse(at_zero, bytes, hn::ShiftRight<8>(bytes));
    const Bytes8 d8;
    std::uint8_t* counts = &colours.count[i];
    const auto count = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(d8, counts)));
    const auto more = hn::Add(count, one);
    const auto share = hn::Div(one, more);
    const auto fuse = [&](std::uint16_t* stored, auto level) {
      const auto old = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du, stored)));
      const auto change =
          hn::Mul(hn::Sub(hn::Mul(hn::Set(df, 256.0F), hn::ConvertTo(df, level)), old), share);
      const auto mean = hn::Add(hn::Add(old, change), half);
      hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, hn::IfThenElse(take, mean, old))), du, stored);
    };
    fuse(&colours.channel[0][i], hn::And(seen, low_byte));
    fuse(&colours.channel[1][i], hn::And(hn::ShiftRight<8>(seen), low_byte));
    fuse(&colours.channel[2][i], hn::And(hn::ShiftRight<16>(seen), low_byte));
    const auto capped = hn::Min(more, hn::Set(df, weight_cap));
    hn::StoreU(hn::DemoteTo(d8, hn::ConvertTo(di, hn::IfThenElse(take, capped, count))), d8,
               counts);
  }
}

// One vote each of the lanes `voting` of voxel i ... for the labels that they see; true where a
// label changed.
template <class M, class V>
bool Vote(M voting, V seen, std::size_t i, const LabelVotes& votes) {
  const Ints di;
  const Shorts du;
  const auto one = hn::Set(di, 1);
  const auto id = hn::PromoteTo(di, hn::LoadU(du, votes.id + i));
  const auto confidence = hn::PromoteTo(di, hn::LoadU(du, votes.confidence + i));
  const auto same = hn::Eq(id, seen);
  const auto weak =
      hn::Or(hn::Eq(id, hn::Set(di, kNoInstance)), hn::Lt(confidence, hn::Set(di, 2)));
  const auto replace = hn::And(voting, hn::AndNot(same, weak));
  const auto raised = hn::Min(hn::Add(confidence, one), hn::Set(di, votes.cap));
  const auto lowered = hn::IfThenElse(weak, one, hn::Sub(confidence, one));
  const auto voted = hn::IfThenElse(same, raised, lowered);
  hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(replace, seen, id)), du, votes.id + i);
  hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(voting, voted, confidence)), du, votes.confidence + i);
  return !hn::AllFalse(di, replace);
}

enum class Labels { kOne, kSome, kEvery };

template <Labels kLabels>
FusionResult FuseWith(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                      TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  FusionResult result;
  Projected projected;
  if (!Project(frame, place, projected)) return result;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  Read<kLanes>(frame.depth, projected.pixel, projected.look.data(), depth.data());
  if (kLabels != Labels::kOne && !rule.one_label) {
    Read<kLanes>(frame.label, projected.pixel, projected.look.data(), label.data());
  } else if (kLabels == Labels::kEvery) {
    label.fill(rule.id);
  }

  const Floats df;
  const Ints di;
  const Bytes8 d8;
  const auto zero = hn::Zero(df);
  const auto one = hn::Set(df, 1.0F);
  const auto id = hn::Set(di, rule.id);
  const auto nobody = hn::Set(di, kNoInstance);
  const auto front = hn::Set(df, rule.front);
  const auto minus_back = hn::Set(df, -rule.back);
  const auto colour_band = hn::Set(df, rule.colour_band);
  const auto first_colour_band = hn::Set(df, rule.first_colour_band);
  const auto cap = hn::Set(df, rule.weight_cap);
  const auto full_share = hn::Div(one, hn::Add(cap, one));
  const auto minus_half = hn::Set(df, -0.5F * place.voxel);
  const bool contradiction = kLabels == Labels::kSome && rule.contradiction;

  using Bytes = std::array<std::uint8_t, sizeof(BlockMask)>;
  HWY_ALIGN auto observed = std::bit_cast<Bytes>(block.observed);
  HWY_ALIGN auto negative = std::bit_cast<Bytes>(block.negative);
  HWY_ALIGN auto band = std::bit_cast<Bytes>(block.band);
  HWY_ALIGN auto full = std::bit_cast<Bytes>(block.full);
  HWY_ALIGN Bytes in_band{};
  HWY_ALIGN Bytes to_colour{};
  HWY_ALIGN Bytes cleared{};
  bool any_coloured = false;
  bool any_cleared = false;
  if (next != nullptr) {
    hwy::Prefetch(&next->observed);
    hwy::Prefetch(&next->negative);
    hwy::Prefetch(&next->band);
    hwy::Prefetch(&next->cover);
    hwy::Prefetch(&next->full);
  }
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    // A line at a time: many at once would wait for each other.
    if (next != nullptr) {
      if (i % 32 == 0) hwy::Prefetch(&next->distance[i]);
      if (i % 64 == 32) hwy::Prefetch(&next->weight[i]);
    }
    if (projected.look[i] == 0) continue;
    const auto measured = Measure(projected, depth.data(), i, minus_back);
    const auto s = measured.s;
    auto taken = measured.yes;
    auto against = hn::MaskFromVec(hn::Zero(df));
    const auto old_d = LoadHalves(df, &block.distance[i]);
    // Where all weights are known, they need not be read.
    const auto is_full = MaskAt(df, full.data(), i);
    const bool all_full = hn::AllTrue(df, is_full);
    const auto old_w =
        all_full ? cap : hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(d8, &block.weight[i])));
    hn::VFromD<Ints> seen = id;
    if constexpr (kLabels != Labels::kOne) {
      seen = hn::Load(di, &label[i]);
      const auto labelled = hn::RebindMask(df, hn::Ne(seen, nobody));
      if constexpr (kLabels == Labels::kSome) {
        taken = hn::And(taken, hn::RebindMask(df, hn::Eq(seen, id)));
        if (contradiction) {
          const auto claims = hn::And(hn::Gt(old_w, zero), hn::Lt(old_d, minus_half));
          against = hn::And(hn::AndNot(taken, hn::And(measured.yes, labelled)),
                            hn::And(claims, hn::Ge(s, minus_half)));
        }
      } else {
        taken = hn::And(taken, labelled);
      }
    }
    const auto touched = hn::Or(taken, against);
    if (hn::AllFalse(df, touched)) continue;
    const auto clamped = hn::Min(s, front);
    // Free space seen once more, that no longer counts observations, stays what it is.
    const auto settled = hn::And(hn::Eq(old_d, front), hn::And(is_full, hn::Gt(s, front)));
    if (hn::AllTrue(df, hn::Or(hn::Not(touched), settled))) continue;
    result.changed = true;
    const auto more = hn::Add(old_w, one);
    const auto share = all_full ? full_share : hn::Div(one, more);
    const auto fused = hn::Add(old_d, hn::Mul(hn::Sub(clamped, old_d), share));
    auto d = hn::IfThenElse(taken, RoundLanesToHalf(df, fused), old_d);
    auto w = hn::IfThenElse(taken, hn::Min(more, cap), old_w);
    const auto near = hn::And(taken, hn::Le(s, front));
    PutBits(df, near, i, in_band.data());
    if constexpr (kLabels == Labels::kEvery) {
      if (Vote(hn::RebindMask(di, near), seen, i, *votes)) votes->any_label_changed = true;
    }
    auto may_colour = first_colour_band;
    if (block.colours != nullptr && !hn::AllFalse(df, near)) {
      const auto counts = hn::PromoteTo(di, hn::LoadU(d8, &block.colours->count[i]));
      const auto has_colour = hn::RebindMask(df, hn::Gt(counts, hn::Zero(di)));
      may_colour = hn::IfThenElse(has_colour, colour_band, first_colour_band);
    }
    const auto colours = hn::And(near, hn::Le(hn::Abs(s), may_colour));
    if (!hn::AllFalse(df, colours)) {
      PutBits(df, colours, i, to_colour.data());
      if (block.colours != nullptr) {
        for (const auto& channel : block.colours->channel) hwy::Prefetch(&channel[i]);
        hwy::Prefetch(&block.colours->count[i]);
      }
      // The ends of the rows; what lies between is near.
      for (std::size_t k = i; k < i + hn::Lanes(df); k += std::min<std::size_t>(8, kLanes)) {
        const std::size_t last = k + std::min<std::size_t>(8, kLanes) - 1;
        hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[k]));
        hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[last]));
      }
      any_coloured = true;
    }
    if (contradiction && !hn::AllFalse(df, against)) {
      const auto free = hn::And(against, hn::Gt(s, hn::Set(df, place.voxel)));
      d = hn::IfThenElse(against, hn::IfThenElseZero(free, RoundLanesToHalf(df, clamped)), d);
      w = hn::IfThenElse(against, hn::IfThenElseZero(free, one), w);
      PutBits(df, against, i, cleared.data());
      any_cleared = true;
    }
    // Free space and full weights stay what they are: then the memory need not be written.
    if (!hn::AllTrue(df, hn::Eq(d, old_d))) StoreHalves(df, d, &block.distance[i]);
    if (!hn::AllTrue(df, hn::Eq(w, old_w))) {
      hn::StoreU(hn::DemoteTo(d8, hn::ConvertTo(di, w)), d8, &block.weight[i]);
    }
    if (!all_full || any_cleared) PutBits(df, hn::Eq(w, cap), i, full.data());
    const auto known = hn::Gt(w, zero);
    const auto inside = hn::And(known, hn::Lt(d, zero));
    PutBits(df, known, i, observed.data());
    PutBits(df, inside, i, negative.data());
    PutBits(df, hn::And(inside, hn::Ge(d, minus_back)), i, band.data());
  }
  if (any_coloured) {
    FuseColours(frame, projected.pixel, to_colour.data(), rule.weight_cap, block.MakeColours());
  }
  if (any_cleared) {
    const auto places = std::bit_cast<BlockMask>(cleared);
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (Bit(places, i)) block.SetColour(static_cast<std::size_t>(i), {}, 0);
    }
    block.FreeColoursIfNone();
  }
  if (!result.changed) return result;
  result.in_band = std::bit_cast<BlockMask>(in_band);
  block.full = std::bit_cast<BlockMask>(full);
  const auto new_observed = std::bit_cast<BlockMask>(observed);
  const auto new_negative = std::bit_cast<BlockMask>(negative);
  result.changed_signs = ChangedSigns(block.observed, block.negative, new_observed, new_negative);
  block.observed = new_observed;
  block.negative = new_negative;
  const auto new_band = std::bit_cast<BlockMask>(band);
  result.changed_band = block.band != new_band;
  block.band = new_band;
  return result;
}

FusionResult Fuse(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                  TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  if (votes != nullptr) return FuseWith<Labels::kEvery>(frame, place, rule, block, next, votes);
  if (rule.one_label) return FuseWith<Labels::kOne>(frame, place, rule, block, next, nullptr);
  return FuseWith<Labels::kSome>(frame, place, rule, block, next, nullptr);
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Observe);
HWY_EXPORT(Fuse);

bool ObserveVoxels(const KernelFrame& frame, const BlockPlace& place, float back,
                   BlockObservation& out) {
  return HWY_DYNAMIC_DISPATCH(Observe)(frame, place, back, out);
}

FusionResult FuseVoxels(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                        TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  return HWY_DYNAMIC_DISPATCH(Fuse)(frame, place, rule, block, next, votes);
}

}  // namespace tsdfpp
#endif
