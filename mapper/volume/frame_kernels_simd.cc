#include <algorithm>

#include "mapper/kernels.h"
#include "mapper/volume/frame_kernels.h"
#include "mapper/volume/fusion_kernels.h"

// One pass of this file an instruction set (see fusion_kernels_simd.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/volume/frame_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kTile_px>;
using Ints = hn::RebindToSigned<Floats>;
using Shorts = hn::Rebind<std::uint16_t, Floats>;

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
          if (!IsValidDepth(depth)) {
            tile.has_invalid = true;
            continue;
          }
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
    auto all_valid = hn::Eq(zero, zero);
    for (int line = first_line; line < last_line; ++line) {
      const auto pixel = static_cast<std::size_t>(line) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(left);
      for (std::size_t k = pixel; k < pixel + kTile_px; k += hn::Lanes(df)) {
        const auto depth = hn::LoadU(df, frame.depth + k);
        const auto valid = hn::And(hn::Gt(depth, zero), hn::Le(depth, farthest_valid));
        all_valid = hn::And(all_valid, valid);
        nearest = hn::IfThenElse(valid, hn::Min(nearest, depth), nearest);
        farthest = hn::IfThenElse(valid, hn::Max(farthest, depth), farthest);
        const auto label = hn::PromoteTo(di, hn::LoadU(du, frame.label + k));
        least = hn::Min(least, label);
        greatest = hn::Max(greatest, label);
      }
    }
    tile.nearest = hn::GetLane(hn::MinOfLanes(df, nearest));
    tile.farthest = hn::GetLane(hn::MaxOfLanes(df, farthest));
    tile.has_invalid = !hn::AllTrue(df, all_valid);
    tile.least_label = static_cast<std::uint16_t>(hn::GetLane(hn::MinOfLanes(di, least)));
    tile.greatest_label = static_cast<std::uint16_t>(hn::GetLane(hn::MaxOfLanes(di, greatest)));
    *tiles = tile;
  }
}

using Keys = hn::CappedTag<std::int64_t, kKeysPerStep>;

// Writes the lanes that the mask names, in order, and of whole vectors something behind them;
// returns how many there are. Highway's own goes by a table that GCC copies each time, or stores by
// an instruction that some processors take a hundred cycles for.
template <class V, class M>
std::size_t StoreSome(V v, M mask, std::int64_t* to) {
  const Keys d;
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
  hn::StoreU(V{_mm512_maskz_compress_epi64(mask.raw, v.raw)}, d, to);
  return hn::CountTrue(d, mask);
#else
  return hn::CompressStore(v, mask, d, to);
#endif
}

std::size_t RayBlocks(const CameraInLattice& camera, const RayPoints& where, const RayBatch& rays,
                      std::uint64_t* keys) {
  const hn::CappedTag<double, kKeysPerStep> dd;
  const Keys dl;
  const hn::Rebind<std::int32_t, decltype(dd)> di;
  const auto zero = hn::Zero(dd);
  const auto one = hn::Set(dd, 1.0);
  const auto half = hn::Set(dd, 0.5);
  // As PackIndex().
  const auto offset = hn::Set(di, 1 << 20);
  const auto in_range = hn::Set(di, (1 << 21) - 1);
  const auto nothing = hn::Set(dl, -1);
  auto* out = reinterpret_cast<std::int64_t*>(keys);
  for (std::size_t ray = 0; ray < rays.count; ray += hn::Lanes(dd)) {
    const auto is_ray = hn::RebindMask(dd, hn::FirstN(dl, rays.count - ray));
    const auto x = hn::Load(dd, &rays.x[ray]);
    const auto y = hn::Load(dd, &rays.y[ray]);
    const auto length = hn::Sqrt(hn::Add(hn::Mul(x, x), hn::Add(hn::Mul(y, y), one)));
    const auto range = hn::Mul(hn::Load(dd, &rays.depth[ray]), length);
    const std::array unit{hn::Div(x, length), hn::Div(y, length), hn::Div(one, length)};
    const auto along = [&](std::size_t axis) {
      const auto& row = camera.R_LC[axis];
      const auto sum = hn::Add(
          hn::Add(hn::Mul(hn::Set(dd, row[0]), unit[0]), hn::Mul(hn::Set(dd, row[1]), unit[1])),
          hn::Mul(hn::Set(dd, row[2]), unit[2]));
      return hn::Mul(sum, hn::Set(dd, camera.inverse_voxel));
    };
    const std::array direction{along(0), along(1), along(2)};
    const auto first = hn::Sub(range, hn::Set(dd, where.front));
    const auto last = hn::Add(range, hn::Set(dd, where.back));
    auto last_key = nothing;
    for (std::size_t i = 0; i < where.points; ++i) {
      const auto at =
          hn::Min(hn::Add(first, hn::Set(dd, where.step * static_cast<double>(i))), last);
      const auto block = [&](std::size_t axis) {
        const auto point = hn::Add(hn::Set(dd, camera.origin[axis]), hn::Mul(direction[axis], at));
        const auto voxel = hn::DemoteTo(di, hn::Floor(hn::Add(point, half)));
        return hn::PromoteTo(dl, hn::And(hn::Add(hn::ShiftRight<3>(voxel), offset), in_range));
      };
      const auto packed =
          hn::Or(block(0), hn::Or(hn::ShiftLeft<21>(block(1)), hn::ShiftLeft<42>(block(2))));
      const auto before_camera = hn::RebindMask(dl, hn::And(is_ray, hn::Ge(at, zero)));
      const auto key = hn::IfThenElse(before_camera, packed, nothing);
      // What its last point, or the ray beside it, has is there already.
      const auto beside = hn::OddEven(hn::DupEven(key), nothing);
      const auto is_new =
          hn::And(hn::And(hn::Ne(key, last_key), hn::Ne(key, beside)), hn::Ne(key, nothing));
      out += StoreSome(key, is_new, out);
      last_key = key;
    }
  }
  return static_cast<std::size_t>(out - reinterpret_cast<std::int64_t*>(keys));
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Summarise);
HWY_EXPORT(RayBlocks);

void SummariseTiles(const KernelFrame& frame, int row, Tile* tiles) {
  const auto run = UsesPlainKernels() ? plain::SummariseTiles : HWY_DYNAMIC_DISPATCH(Summarise);
  run(frame, row, tiles);
}

std::size_t BlocksAtPoints(const CameraInLattice& camera, const RayPoints& where,
                           const RayBatch& rays, std::uint64_t* keys) {
  const auto run = UsesPlainKernels() ? plain::BlocksAtPoints : HWY_DYNAMIC_DISPATCH(RayBlocks);
  return run(camera, where, rays, keys);
}

}  // namespace tsdfpp
#endif
