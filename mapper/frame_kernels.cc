#include "mapper/frame_kernels.h"

#include <algorithm>

#include "mapper/fusion_kernels.h"

// One pass of this file an instruction set (see fusion_kernels.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/frame_kernels.cc"
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

HWY_EXPORT(Summarise);
HWY_EXPORT(RayBlocks);

void SummariseTiles(const KernelFrame& frame, int row, Tile* tiles) {
  HWY_DYNAMIC_DISPATCH(Summarise)(frame, row, tiles);
}

void BlocksAtPoints(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
                    const RayRanges& ranges, std::size_t count, std::uint64_t* keys) {
  HWY_DYNAMIC_DISPATCH(RayBlocks)(origin, direction, ranges, count, keys);
}

}  // namespace tsdfpp
#endif
