#include <hwy/cache_control.h>

#include "mapper/kernels.h"
#include "mapper/rays/ray_kernels.h"

// One pass of this file an instruction set, as fusion_kernels_simd.cc.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/rays/ray_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/half_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Registers of at most this many rays: with more, neighbours have less in common.
using DF = hn::CappedTag<float, 16>;
using DI = hn::RebindToSigned<DF>;
using VF = hn::VFromD<DF>;
using VI = hn::VFromD<DI>;
using MF = decltype(hn::Lt(VF(), VF()));

void FillRays(const LatticeRays& lattice, int u0, int v0, TileRays& rays) {
  constexpr float kLeast = 1e-4F;  // voxels per metre
  const DF df;
  const DI di;
  const TileOrder& order = OrderOfTile();
  const hn::Rebind<std::uint8_t, DF> du;
  for (std::size_t i = 0; i < kTilePixels; i += hn::Lanes(df)) {
    const VF u = hn::ConvertTo(
        df, hn::Add(hn::PromoteTo(di, hn::LoadU(du, order.x.data() + i)), hn::Set(di, u0)));
    const VF v = hn::ConvertTo(
        df, hn::Add(hn::PromoteTo(di, hn::LoadU(du, order.y.data() + i)), hn::Set(di, v0)));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const VF d = hn::Add(hn::Add(hn::Set(df, lattice.at_pixel_0[axis]),
                                   hn::Mul(hn::Set(df, lattice.per_row[axis]), v)),
                           hn::Mul(hn::Set(df, lattice.per_column[axis]), u));
      const VF least = hn::Set(df, kLeast);
      const VF off_zero =
          hn::IfThenElse(hn::Ge(hn::Abs(d), least), d,
                         hn::IfThenElse(hn::Lt(d, hn::Zero(df)), hn::Neg(least), least));
      hn::StoreU(off_zero, df, rays.direction[axis].data() + i);
      hn::StoreU(hn::Div(hn::Set(df, 1.0F), off_zero), df, rays.inverse[axis].data() + i);
    }
  }
}

void FillCorners(const std::array<const Half*, 8>& from, RayBlock& block) {
  const hn::CappedTag<float, kBlockSide> d8;
  float* to = block.distance.data();
  for (std::size_t z = 0; z < kCorners; ++z) {
    for (std::size_t y = 0; y < kCorners; ++y) {
      const std::size_t place = (y >> 3U) * 2 + (z >> 3U) * 4;
      const std::size_t row = 64 * (z & 7U) + 8 * (y & 7U);
      for (std::size_t x = 0; x < kBlockSide; x += hn::Lanes(d8)) {
        hn::StoreU(LoadHalves(d8, from[place] + row + x), d8, to + x);
      }
      to[kBlockSide] = from[place + 1][row];
      to += kCorners;
    }
  }
}

// One ray a lane along one axis.
struct Axis {
  VF origin;     // of the ray, voxels from the block's first
  VF direction;  // voxels per metre
  VF inverse;
  VF cell;   // the cube that the ray is in, a whole number
  VF step;   // +1 or -1
  VI pace;   // what a step adds to the cube's place in the block
  VF ahead;  // 1 where the next plane is the cube's upper one, 0 where its lower one
  VF low;    // of the crossed cubes
  VF last;
};

// Of a block's sixteen words the one that each lane names: they fit into the widest registers.
VI WordsAt(const std::int32_t* words, VI index) {
  const DI di;
#if HWY_MAX_BYTES >= 64 && HWY_TARGET != HWY_SCALAR
  if (hn::Lanes(di) == 16) {
    return hn::TableLookupLanes(hn::LoadU(di, words), hn::IndicesFromVec(di, index));
  }
#endif
  return hn::GatherIndex(di, words, index);
}

float Cast(const RayBlock& block, std::int32_t number, const LatticeRays& lattice,
           const TileRays& rays, float voxel, const TileValues& from, TileHits& hits) {
  const DF df;
  const DI di;
  const VF zero = hn::Zero(df);
  const VF one = hn::Set(df, 1.0F);
  // A face between two cubes is reached from both with other roundings: what is hardly negative
  // counts as outside where a cube is entered.
  const VF outside = hn::Set(df, -5e-4F * voxel);
  std::array<float, 3> origin;
  const std::array<int, 3> first{block.index.x * kBlockSide, block.index.y * kBlockSide,
                                 block.index.z * kBlockSide};
  for (std::size_t a = 0; a < 3; ++a) origin[a] = static_cast<float>(lattice.origin[a] - first[a]);
  const auto* words = reinterpret_cast<const std::int32_t*>(block.cubes.bits.data());
  const float* distance = block.distance.data();
  HWY_ALIGN std::array<std::int32_t, HWY_MAX_BYTES / sizeof(std::int32_t)> place_of_lane;
  std::int32_t* places = place_of_lane.data();
  VF farthest = zero;

  for (std::size_t i = 0; i < kTilePixels; i += hn::Lanes(df)) {
    const VF best = hn::LoadU(df, hits.depth.data() + i);
    VF t = hn::LoadU(df, from.data() + i);
    VF end = best;
    Axis x;
    Axis y;
    Axis z;
    const auto enter = [&](Axis& axis, std::size_t a) {
      axis.origin = hn::Set(df, origin[a]);
      axis.direction = hn::LoadU(df, rays.direction[a].data() + i);
      axis.inverse = hn::LoadU(df, rays.inverse[a].data() + i);
      const VF low = hn::Mul(hn::Sub(hn::Set(df, block.cubes.low[a]), axis.origin), axis.inverse);
      const VF high = hn::Mul(hn::Sub(hn::Set(df, block.cubes.high[a]), axis.origin), axis.inverse);
      t = hn::Max(t, hn::Min(low, high));
      end = hn::Min(end, hn::Max(low, high));
    };
    enter(x, 0);
    enter(y, 1);
    enter(z, 2);
    MF active = hn::Lt(t, end);
    if (hn::AllFalse(df, active)) {
      farthest = hn::Max(farthest, best);
      continue;
    }
    VI place = hn::Zero(di);  // of the cube in the block
    const auto begin = [&](Axis& axis, std::size_t a) {
      axis.low = hn::Set(df, block.cubes.low[a]);
      axis.last = hn::Set(df, static_cast<float>(block.cubes.high[a]) - 1.0F);
      const VF at = hn::Add(axis.origin, hn::Mul(axis.direction, hn::IfThenElse(active, t, zero)));
      const VF inside = hn::Min(hn::Max(at, axis.low), axis.last);
      const VI cell = hn::ConvertTo(di, inside);
      axis.cell = hn::ConvertTo(df, cell);
      place = hn::Add(place, hn::ShiftLeftSame(cell, static_cast<int>(3 * a)));
      const MF up = hn::Gt(axis.direction, zero);
      axis.step = hn::IfThenElse(up, one, hn::Neg(one));
      axis.ahead = hn::IfThenElse(up, one, zero);
      const VI pace = hn::Set(di, 1 << (3 * a));
      axis.pace = hn::IfThenElse(hn::RebindMask(di, up), pace, hn::Neg(pace));
    };
    begin(x, 0);
    begin(y, 1);
    begin(z, 2);
    while (true) {
      const auto to_plane = [&](const Axis& axis) {
        return hn::Mul(hn::Sub(hn::Add(axis.cell, axis.ahead), axis.origin), axis.inverse);
      };
      const VF plane_x = to_plane(x);
      const VF plane_y = to_plane(y);
      const VF plane_z = to_plane(z);
      const VF leave = hn::Min(hn::Min(plane_x, plane_y), plane_z);
      const VI word = WordsAt(words, hn::ShiftRight<5>(place));
      const VI bit = hn::And(hn::Shr(word, hn::And(place, hn::Set(di, 31))), hn::Set(di, 1));
      const MF crossed = hn::And(active, hn::RebindMask(df, hn::Ne(bit, hn::Zero(di))));
      const MF moving = hn::AndNot(crossed, active);
      MF stepping = moving;
      if (hn::AllFalse(df, moving)) {
        if (hn::AllFalse(df, crossed)) break;
        // The distance along the ray inside the cube, a cubic of s = 0 ... 1.
        const VF length = hn::Max(hn::Sub(leave, t), zero);
        const auto local = [&](const Axis& axis) {
          return hn::Sub(hn::Add(axis.origin, hn::Mul(axis.direction, t)), axis.cell);
        };
        const VF x0 = local(x);
        const VF y0 = local(y);
        const VF z0 = local(z);
        const VF dx = hn::Mul(x.direction, length);
        const VF dy = hn::Mul(y.direction, length);
        const VF dz = hn::Mul(z.direction, length);
        VF c000 = zero;
        VF c100 = zero;
        VF c010 = zero;
        VF c110 = zero;
        VF c001 = zero;
        VF c101 = zero;
        VF c011 = zero;
        VF c111 = zero;
        // Neighbours are mostly in the same few cubes, so that the corners of one cube after the
        // other are read: far less than a gather for each lane.
        hn::Store(place, di, places);
        for (MF left = crossed;;) {
          const intptr_t lane = hn::FindFirstTrue(df, left);
          if (lane < 0) break;
          const std::int32_t cube = places[lane];
          const MF same = hn::And(left, hn::RebindMask(df, hn::Eq(place, hn::Set(di, cube))));
          left = hn::AndNot(same, left);
          const float* first_corner = distance + kCorners * kCorners * (cube >> 6) +
                                      kCorners * ((cube >> 3) & 7) + (cube & 7);
          const auto read = [&](int offset, VF& corner) {
            corner = hn::IfThenElse(same, hn::Set(df, first_corner[offset]), corner);
          };
          read(0, c000);
          read(1, c100);
          read(kCorners, c010);
          read(kCorners + 1, c110);
          read(kCorners * kCorners, c001);
          read(kCorners * kCorners + 1, c101);
          read(kCorners * kCorners + kCorners, c011);
          read(kCorners * kCorners + kCorners + 1, c111);
        }
        const VF kx = hn::Sub(c100, c000);
        const VF ky = hn::Sub(c010, c000);
        const VF kz = hn::Sub(c001, c000);
        const VF kxy = hn::Sub(hn::Sub(c110, c010), kx);
        const VF kxz = hn::Sub(hn::Sub(c101, c001), kx);
        const VF kyz = hn::Sub(hn::Sub(c011, c001), ky);
        const VF kxyz = hn::Sub(hn::Sub(hn::Sub(c111, c011), hn::Sub(c101, c001)), kxy);
        // The gradient at a place, and the terms that are shared.
        const auto slope_x = [&](VF py, VF pz) {
          return hn::Add(hn::Add(kx, hn::Mul(kxy, py)),
                         hn::Mul(hn::Add(kxz, hn::Mul(kxyz, py)), pz));
        };
        const auto slope_y = [&](VF px, VF pz) {
          return hn::Add(hn::Add(ky, hn::Mul(kxy, px)),
                         hn::Mul(hn::Add(kyz, hn::Mul(kxyz, px)), pz));
        };
        const auto slope_z = [&](VF px, VF py) {
          return hn::Add(hn::Add(kz, hn::Mul(kxz, px)),
                         hn::Mul(hn::Add(kyz, hn::Mul(kxyz, px)), py));
        };
        const VF a0 = hn::Add(
            hn::Add(hn::Add(c000, hn::Mul(kx, x0)), hn::Mul(hn::Add(ky, hn::Mul(kxy, x0)), y0)),
            hn::Mul(slope_z(x0, y0), z0));
        const VF a1 = hn::Add(hn::Add(hn::Mul(slope_x(y0, z0), dx), hn::Mul(slope_y(x0, z0), dy)),
                              hn::Mul(slope_z(x0, y0), dz));
        const VF dxy = hn::Mul(dx, dy);
        const VF dxz = hn::Mul(dx, dz);
        const VF dyz = hn::Mul(dy, dz);
        const VF a2 = hn::Add(hn::Add(hn::Mul(hn::Add(kxy, hn::Mul(kxyz, z0)), dxy),
                                      hn::Mul(hn::Add(kxz, hn::Mul(kxyz, y0)), dxz)),
                              hn::Mul(hn::Add(kyz, hn::Mul(kxyz, x0)), dyz));
        const VF a3 = hn::Mul(hn::Mul(dxy, dz), kxyz);
        const auto value = [&](VF s) {
          return hn::Add(a0, hn::Mul(s, hn::Add(a1, hn::Mul(s, hn::Add(a2, hn::Mul(s, a3))))));
        };
        // The first of the cube's thirds at whose ends the distance changes from outside to inside.
        const VF third = hn::Set(df, 1.0F / 3.0F);
        const VF two_thirds = hn::Set(df, 2.0F / 3.0F);
        const VF g1 = value(third);
        const VF g2 = value(two_thirds);
        const VF g3 = value(one);
        const MF in_1 = hn::Lt(g1, zero);
        const MF in_2 = hn::Lt(g2, zero);
        const MF in_3 = hn::Lt(g3, zero);
        const MF at_1 = hn::And(hn::Ge(a0, outside), in_1);
        const MF at_2 = hn::AndNot(at_1, hn::AndNot(in_1, in_2));
        const MF at_3 = hn::AndNot(hn::Or(at_1, at_2), hn::AndNot(in_2, in_3));
        MF hit = hn::And(crossed, hn::Or(hn::Or(at_1, at_2), at_3));
        if (!hn::AllFalse(df, hit)) {
          VF low = hn::IfThenElse(at_1, zero, hn::IfThenElse(at_2, third, two_thirds));
          VF high = hn::IfThenElse(at_1, third, hn::IfThenElse(at_2, two_thirds, one));
          VF g_low = hn::Max(hn::IfThenElse(at_1, a0, hn::IfThenElse(at_2, g1, g2)), zero);
          VF g_high = hn::IfThenElse(at_1, g1, hn::IfThenElse(at_2, g2, g3));
          g_high = hn::IfThenElse(hit, g_high, hn::Neg(one));
          const auto chord = [&]() {
            return hn::Add(low,
                           hn::Mul(hn::Sub(high, low), hn::Div(g_low, hn::Sub(g_low, g_high))));
          };
          // Newton's steps where they stay between what is known to be outside and inside.
          VF s = chord();
          for (int round = 0; round < 1; ++round) {
            const VF g = value(s);
            const MF in = hn::Lt(g, zero);
            high = hn::IfThenElse(in, s, high);
            g_high = hn::IfThenElse(in, g, g_high);
            low = hn::IfThenElse(in, low, s);
            g_low = hn::IfThenElse(in, g_low, g);
            const VF slope = hn::Add(
                a1,
                hn::Mul(s, hn::Add(hn::Add(a2, a2), hn::Mul(s, hn::Mul(hn::Set(df, 3.0F), a3)))));
            const VF newton = hn::Sub(s, hn::Div(g, hn::Min(slope, hn::Set(df, -1e-9F))));
            const MF between = hn::And(hn::Gt(newton, low), hn::Lt(newton, high));
            s = hn::IfThenElse(between, newton, chord());
          }
          const VF depth = hn::Add(t, hn::Mul(s, length));
          const VF px = hn::Add(x0, hn::Mul(s, dx));
          const VF py = hn::Add(y0, hn::Mul(s, dy));
          const VF pz = hn::Add(z0, hn::Mul(s, dz));
          const VF nx = slope_x(py, pz);
          const VF ny = slope_y(px, pz);
          const VF nz = slope_z(px, py);
          const VF norm =
              hn::Sqrt(hn::Add(hn::Add(hn::Mul(nx, nx), hn::Mul(ny, ny)), hn::Mul(nz, nz)));
          const VF scale = hn::Div(one, hn::Max(norm, hn::Set(df, 1e-20F)));
          const MF taken = hn::And(hit, hn::Lt(depth, hn::LoadU(df, hits.depth.data() + i)));
          const auto keep = [&](VF now, float* stored) {
            hn::StoreU(hn::IfThenElse(taken, now, hn::LoadU(df, stored)), df, stored);
          };
          keep(depth, hits.depth.data() + i);
          for (std::size_t r = 0; r < 3; ++r) {
            const VF component = hn::Add(hn::Add(hn::Mul(hn::Set(df, lattice.R_WL[3 * r]), nx),
                                                 hn::Mul(hn::Set(df, lattice.R_WL[3 * r + 1]), ny)),
                                         hn::Mul(hn::Set(df, lattice.R_WL[3 * r + 2]), nz));
            keep(hn::Mul(component, scale), hits.normal[r].data() + i);
          }
          hn::StoreU(hn::IfThenElse(hn::RebindMask(di, taken), hn::Set(di, number),
                                    hn::LoadU(di, hits.block.data() + i)),
                     di, hits.block.data() + i);
          active = hn::AndNot(hit, active);
        }
        stepping = hn::AndNot(hit, crossed);
      }
      const auto step = [&](Axis& axis, VF plane) {
        const MF passes = hn::And(stepping, hn::Eq(plane, leave));
        const VF next = hn::Add(axis.cell, axis.step);
        const MF left = hn::And(passes, hn::Or(hn::Lt(next, axis.low), hn::Gt(next, axis.last)));
        active = hn::AndNot(left, active);
        const MF stays = hn::AndNot(left, passes);
        axis.cell = hn::IfThenElse(stays, next, axis.cell);
        place = hn::Add(place, hn::IfThenElseZero(hn::RebindMask(di, stays), axis.pace));
      };
      step(x, plane_x);
      step(y, plane_y);
      step(z, plane_z);
      t = hn::IfThenElse(stepping, hn::Max(t, leave), t);
      active = hn::AndNot(hn::And(stepping, hn::Ge(t, end)), active);
    }
    farthest = hn::Max(farthest, hn::LoadU(df, hits.depth.data() + i));
  }
  return hn::GetLane(hn::MaxOfLanes(df, farthest));
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(FillRays);
HWY_EXPORT(Cast);
HWY_EXPORT(FillCorners);

void FillTileRays(const LatticeRays& lattice, int u, int v, TileRays& rays) {
  const auto run = UsesPlainKernels() ? plain::FillTileRays : HWY_DYNAMIC_DISPATCH(FillRays);
  run(lattice, u, v, rays);
}

void CopyCorners(const std::array<const Half*, 8>& from, RayBlock& block) {
  const auto run = UsesPlainKernels() ? plain::CopyCorners : HWY_DYNAMIC_DISPATCH(FillCorners);
  run(from, block);
}

void PrefetchBlock(const RayBlock& block) {
  constexpr std::size_t kLine = 64;
  const auto* bytes = reinterpret_cast<const char*>(&block);
  for (std::size_t i = 0; i < sizeof(RayBlock); i += kLine) hwy::Prefetch(bytes + i);
}

float CastThroughBlock(const RayBlock& block, std::int32_t number, const LatticeRays& lattice,
                       const TileRays& rays, float voxel, const TileValues& from, TileHits& hits) {
  const auto run = UsesPlainKernels() ? plain::CastThroughBlock : HWY_DYNAMIC_DISPATCH(Cast);
  return run(block, number, lattice, rays, voxel, from, hits);
}

}  // namespace tsdfpp
#endif
