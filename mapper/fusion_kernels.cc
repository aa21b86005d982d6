#include "mapper/fusion_kernels.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "core/types.h"

// One pass of this file an instruction set; the machine's best is chosen at run time. On x86-64 all
// give the same bits: only correctly rounded operations, none contracted
// (cmake/TsdfppTarget.cmake).
#ifndef TSDFPP_MAPPER_FUSION_KERNELS_ONCE
#define TSDFPP_MAPPER_FUSION_KERNELS_ONCE
namespace tsdfpp {
namespace {

// table[pixel]. Plain loads: from a frame, which no cache holds, gathers took longer.
template <typename From, typename To>
void Read(const From* table, const Lanes& pixel, To* out) {
  for (std::size_t i = 0; i < kBlockVoxels; ++i) out[i] = table[pixel[i]];
}

// The voxels and their neighbours in the block.
inline BlockMask Widened(const BlockMask& mask) {
  constexpr std::uint64_t kFirstColumn = 0x0101010101010101ULL;
  BlockMask flat;
  for (std::size_t z = 0; z < mask.size(); ++z) {
    const std::uint64_t x =
        mask[z] | (mask[z] & ~(kFirstColumn << 7U)) << 1U | (mask[z] & ~kFirstColumn) >> 1U;
    flat[z] = x | x << 8U | x >> 8U;
  }
  BlockMask wide;
  for (std::size_t z = 0; z < mask.size(); ++z) {
    wide[z] = flat[z] | (z > 0 ? flat[z - 1] : 0) | (z + 1 < mask.size() ? flat[z + 1] : 0);
  }
  return wide;
}

// See FusionResult. What is beyond the block may have either sign.
inline BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                              const BlockMask& observed, const BlockMask& negative) {
  BlockMask changed;
  BlockMask inside;
  BlockMask outside;
  for (std::size_t z = 0; z < changed.size(); ++z) {
    changed[z] = (old_observed[z] ^ observed[z]) | (old_negative[z] ^ negative[z]);
    inside[z] = old_negative[z] | negative[z];
    outside[z] = (old_observed[z] & ~old_negative[z]) | (observed[z] & ~negative[z]);
  }
  if (!Any(changed)) return changed;
  constexpr std::uint64_t kRim = 0xFF818181818181FFULL;
  const BlockMask near_inside = Widened(inside);
  const BlockMask near_outside = Widened(outside);
  for (std::size_t z = 0; z < changed.size(); ++z) {
    const std::uint64_t rim = z == 0 || z + 1 == changed.size() ? ~0ULL : kRim;
    changed[z] &= rim | (near_inside[z] & near_outside[z]);
  }
  return changed;
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

#include "mapper/mask_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The vectors that the loops work on: rows of a block's slice, never more than two.
using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;
using Shorts = hn::Rebind<std::uint16_t, Floats>;
constexpr std::size_t kSlice = 64;

// The voxels of a block as the camera sees them; what is out of view is infinitely far away, at
// pixel 0.
struct Projected {
  HWY_ALIGN std::array<float, kBlockVoxels> z;      // p_C.z
  HWY_ALIGN std::array<float, kBlockVoxels> scale;  // ray * iz
  HWY_ALIGN Lanes pixel;
};

// False where no voxel is in view.
bool Project(const KernelFrame& frame, const BlockPlace& place, const TsdfBlock* next,
             Projected& out) {
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
  auto any = hn::MaskFromVec(hn::Zero(df));
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const float pz = static_cast<float>(place.first.z + static_cast<int>(z)) * place.voxel;
    const std::array z_term{hn::Set(df, m[2] * pz), hn::Set(df, m[6] * pz),
                            hn::Set(df, m[10] * pz)};
    for (std::size_t k = 0; k < kSlice; k += hn::Lanes(df)) {
      const std::size_t i = kSlice * z + k;
      if (next != nullptr) {
        hwy::Prefetch(&next->distance[i]);
        if (next->full[z] != ~0ULL) hwy::Prefetch(&next->weight[i]);
      }
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
      const auto in_view = hn::And(hn::And(hn::Ge(cam_z, hn::Set(df, kNearest_m)),
                                           hn::And(hn::Ge(u, zero), hn::Lt(u, width))),
                                   hn::And(hn::Ge(v, zero), hn::Lt(v, height)));
      // Non-negative here, so truncation is the floor.
      const auto column = hn::ConvertTo(di, hn::IfThenElseZero(in_view, u));
      const auto line = hn::ConvertTo(di, hn::IfThenElseZero(in_view, v));
      hn::Store(hn::Add(hn::Mul(line, stride), column), di, &out.pixel[i]);
      hn::Store(hn::IfThenElse(in_view, cam_z, far_away), df, &out.z[i]);
      hn::Store(hn::Mul(ray, iz), df, &out.scale[i]);
      any = hn::Or(any, in_view);
    }
  }
  return !hn::AllFalse(df, any);
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
  if (!Project(frame, place, nullptr, projected)) return false;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  Read(frame.depth, projected.pixel, depth.data());
  Read(frame.label, projected.pixel, label.data());
  const Floats df;
  const Ints di;
  const auto minus_back = hn::Set(df, -back);
  auto any = hn::MaskFromVec(hn::Zero(di));
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
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
                 float weight_cap, TsdfBlock& block) {
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
    std::uint16_t* counts = &block.colour_count[i];
    const auto count = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du, counts)));
    const auto more = hn::Add(count, one);
    const auto share = hn::Div(one, more);
    const auto fuse = [&](std::uint16_t* stored, auto level) {
      const auto old = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du, stored)));
      const auto change =
          hn::Mul(hn::Sub(hn::Mul(hn::Set(df, 256.0F), hn::ConvertTo(df, level)), old), share);
      const auto mean = hn::Add(hn::Add(old, change), half);
      hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, hn::IfThenElse(take, mean, old))), du, stored);
    };
    fuse(&block.colour[0][i], hn::And(seen, low_byte));
    fuse(&block.colour[1][i], hn::And(hn::ShiftRight<8>(seen), low_byte));
    fuse(&block.colour[2][i], hn::And(hn::ShiftRight<16>(seen), low_byte));
    const auto capped = hn::Min(more, hn::Set(df, weight_cap));
    hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, hn::IfThenElse(take, capped, count))), du,
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
  if (!Project(frame, place, next, projected)) return result;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  Read(frame.depth, projected.pixel, depth.data());
  if (kLabels != Labels::kOne && !rule.one_label) {
    Read(frame.label, projected.pixel, label.data());
  } else if (kLabels == Labels::kEvery) {
    label.fill(rule.id);
  }

  const Floats df;
  const Ints di;
  const auto zero = hn::Zero(df);
  const auto one = hn::Set(df, 1.0F);
  const auto id = hn::Set(di, rule.id);
  const auto nobody = hn::Set(di, kNoInstance);
  const auto front = hn::Set(df, rule.front);
  const auto minus_back = hn::Set(df, -rule.back);
  const auto colour_band = hn::Set(df, rule.colour_band);
  const auto cap = hn::Set(df, rule.weight_cap);
  const auto minus_half = hn::Set(df, -0.5F * place.voxel);
  const bool contradiction = kLabels == Labels::kSome && rule.contradiction;

  using Bytes = std::array<std::uint8_t, sizeof(BlockMask)>;
  HWY_ALIGN auto observed = std::bit_cast<Bytes>(block.observed);
  HWY_ALIGN auto negative = std::bit_cast<Bytes>(block.negative);
  HWY_ALIGN auto band = std::bit_cast<Bytes>(block.band);
  HWY_ALIGN auto coloured = std::bit_cast<Bytes>(block.coloured);
  HWY_ALIGN auto full = std::bit_cast<Bytes>(block.full);
  HWY_ALIGN Bytes in_band{};
  HWY_ALIGN Bytes to_colour{};
  HWY_ALIGN Bytes cleared{};
  bool any_coloured = false;
  bool any_cleared = false;
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    const auto measured = Measure(projected, depth.data(), i, minus_back);
    const auto s = measured.s;
    auto taken = measured.yes;
    auto against = hn::MaskFromVec(hn::Zero(df));
    const auto old_d = hn::Load(df, &block.distance[i]);
    // Where all weights are known, they need not be read.
    const auto is_full = MaskAt(df, full.data(), i);
    const bool all_full = hn::AllTrue(df, is_full);
    const auto old_w = all_full ? cap : hn::Load(df, &block.weight[i]);
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
    result.changed = true;
    const auto more = hn::Add(old_w, one);
    const auto clamped = hn::Min(s, front);
    const auto fused = hn::Add(old_d, hn::Div(hn::Sub(clamped, old_d), more));
    auto d = hn::IfThenElse(taken, fused, old_d);
    auto w = hn::IfThenElse(taken, hn::Min(more, cap), old_w);
    const auto near = hn::And(taken, hn::Le(s, front));
    PutBits(df, near, i, in_band.data());
    if constexpr (kLabels == Labels::kEvery) {
      if (Vote(hn::RebindMask(di, near), seen, i, *votes)) votes->any_label_changed = true;
    }
    const auto has_colour = MaskAt(df, coloured.data(), i);
    const auto colours =
        hn::And(near, hn::Or(hn::Not(has_colour), hn::Le(hn::Abs(s), colour_band)));
    if (!hn::AllFalse(df, colours)) {
      PutBits(df, colours, i, to_colour.data());
      PutBits(df, hn::Or(has_colour, colours), i, coloured.data());
      for (const auto& channel : block.colour) hwy::Prefetch(&channel[i]);
      hwy::Prefetch(&block.colour_count[i]);
      hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[i]));
      any_coloured = true;
    }
    if (contradiction && !hn::AllFalse(df, against)) {
      const auto free = hn::And(against, hn::Gt(s, hn::Set(df, place.voxel)));
      d = hn::IfThenElse(against, hn::IfThenElseZero(free, clamped), d);
      w = hn::IfThenElse(against, hn::IfThenElseZero(free, one), w);
      PutBits(df, against, i, cleared.data());
      any_cleared = true;
    }
    // Free space and full weights stay what they are: then the memory need not be written.
    if (!hn::AllTrue(df, hn::Eq(d, old_d))) hn::Store(d, df, &block.distance[i]);
    if (!hn::AllTrue(df, hn::Eq(w, old_w))) hn::Store(w, df, &block.weight[i]);
    if (!all_full || any_cleared) PutBits(df, hn::Eq(w, cap), i, full.data());
    const auto known = hn::Gt(w, zero);
    const auto inside = hn::And(known, hn::Lt(d, zero));
    PutBits(df, known, i, observed.data());
    PutBits(df, inside, i, negative.data());
    PutBits(df, hn::And(inside, hn::Ge(d, minus_back)), i, band.data());
  }
  if (any_coloured) {
    FuseColours(frame, projected.pixel, to_colour.data(), rule.weight_cap, block);
  }
  if (any_cleared) {
    const auto places = std::bit_cast<BlockMask>(cleared);
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (Bit(places, i)) block.SetColour(static_cast<std::size_t>(i), {}, 0);
    }
    for (std::size_t k = 0; k < cleared.size(); ++k) {
      coloured[k] = static_cast<std::uint8_t>(coloured[k] & ~cleared[k]);
    }
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
  block.coloured = std::bit_cast<BlockMask>(coloured);
  return result;
}

FusionResult Fuse(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                  TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  if (votes != nullptr) return FuseWith<Labels::kEvery>(frame, place, rule, block, next, votes);
  if (rule.one_label) return FuseWith<Labels::kOne>(frame, place, rule, block, next, nullptr);
  return FuseWith<Labels::kSome>(frame, place, rule, block, next, nullptr);
}

// The tiles of one row of tiles.
void Summarise(const KernelFrame& frame, int tile_row, Tile* tiles) {
  const Floats df;
  const Ints di;
  const Shorts du;
  const auto width = static_cast<int>(frame.width);
  const int first_line = tile_row * kTile_px;
  const int last_line = std::min(first_line + kTile_px, static_cast<int>(frame.height));
  const auto farthest_valid = hn::Set(df, kMaxValidDepth_m);
  const auto zero = hn::Zero(df);
  for (int left = 0; left < width; left += kTile_px, ++tiles) {
    Tile tile;
    if (left + kTile_px > width) {
      for (int line = first_line; line < last_line; ++line) {
        for (int column = left; column < width; ++column) {
          const auto pixel = static_cast<std::size_t>(line) * static_cast<std::size_t>(width) +
                             static_cast<std::size_t>(column);
          const float depth = frame.depth[pixel];
          tile.least_label = std::min(tile.least_label, frame.label[pixel]);
          tile.greatest_label = std::max(tile.greatest_label, frame.label[pixel]);
          if (!IsValidDepth(depth)) continue;
          tile.nearest = std::min(tile.nearest, depth);
          tile.farthest = std::max(tile.farthest, depth);
        }
      }
      *tiles = tile;
      continue;
    }
    auto nearest = hn::Set(df, tile.nearest);
    auto farthest = zero;
    auto least = hn::Set(di, kNoInstance);
    auto greatest = hn::Zero(di);
    for (int line = first_line; line < last_line; ++line) {
      const auto pixel = static_cast<std::size_t>(line) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(left);
      for (std::size_t k = pixel; k < pixel + kTile_px; k += hn::Lanes(df)) {
        const auto depth = hn::LoadU(df, frame.depth + k);
        const auto valid = hn::And(hn::Gt(depth, zero), hn::Le(depth, farthest_valid));
        nearest = hn::IfThenElse(valid, hn::Min(nearest, depth), nearest);
        farthest = hn::IfThenElse(valid, hn::Max(farthest, depth), farthest);
        const auto label = hn::PromoteTo(di, hn::LoadU(du, frame.label + k));
        least = hn::Min(least, label);
        greatest = hn::Max(greatest, label);
      }
    }
    tile.nearest = hn::GetLane(hn::MinOfLanes(df, nearest));
    tile.farthest = hn::GetLane(hn::MaxOfLanes(df, farthest));
    tile.least_label = static_cast<std::uint16_t>(hn::GetLane(hn::MinOfLanes(di, least)));
    tile.greatest_label = static_cast<std::uint16_t>(hn::GetLane(hn::MaxOfLanes(di, greatest)));
    *tiles = tile;
  }
}

void RayBlocks(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
               const RayRanges& ranges, std::size_t count, std::uint64_t* keys) {
  const hn::CappedTag<double, kKeysPerStep> dd;
  const hn::Rebind<std::int64_t, decltype(dd)> dl;
  const hn::Rebind<std::int32_t, decltype(dd)> di;
  const auto half = hn::Set(dd, 0.5);
  // As PackIndex().
  const auto offset = hn::Set(di, 1 << 20);
  const auto in_range = hn::Set(di, (1 << 21) - 1);
  auto number = hn::Iota(dd, 0);
  for (std::size_t i = 0; i < count; i += hn::Lanes(dd)) {
    const auto range =
        hn::Min(hn::Add(hn::Set(dd, ranges.first), hn::Mul(hn::Set(dd, ranges.step), number)),
                hn::Set(dd, ranges.last));
    const auto block = [&](std::size_t axis) {
      const auto point =
          hn::Add(hn::Set(dd, origin[axis]), hn::Mul(hn::Set(dd, direction[axis]), range));
      const auto voxel = hn::DemoteTo(di, hn::Floor(hn::Add(point, half)));
      return hn::PromoteTo(dl, hn::And(hn::Add(hn::ShiftRight<3>(voxel), offset), in_range));
    };
    const auto key =
        hn::Or(block(0), hn::Or(hn::ShiftLeft<21>(block(1)), hn::ShiftLeft<42>(block(2))));
    hn::StoreU(key, dl, reinterpret_cast<std::int64_t*>(keys + i));
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
HWY_EXPORT(Summarise);
HWY_EXPORT(RayBlocks);

bool ObserveVoxels(const KernelFrame& frame, const BlockPlace& place, float back,
                   BlockObservation& out) {
  return HWY_DYNAMIC_DISPATCH(Observe)(frame, place, back, out);
}

FusionResult FuseVoxels(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                        TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  return HWY_DYNAMIC_DISPATCH(Fuse)(frame, place, rule, block, next, votes);
}

void SummariseTiles(const KernelFrame& frame, int row, Tile* tiles) {
  HWY_DYNAMIC_DISPATCH(Summarise)(frame, row, tiles);
}

void BlocksAtPoints(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
                    const RayRanges& ranges, std::size_t count, std::uint64_t* keys) {
  HWY_DYNAMIC_DISPATCH(RayBlocks)(origin, direction, ranges, count, keys);
}

}  // namespace tsdfpp
#endif
