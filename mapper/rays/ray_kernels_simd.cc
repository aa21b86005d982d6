#include <hwy/cache_control.h>

#include "mapper/kernels.h"
#include "mapper/rays/ray_kernels.h"

// One pass of this file an instruction set, as fusion_kernels_simd.cc.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/rays/ray_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/rays/cubic_lanes-inl.h"
#include "mapper/volume/half_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

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

  HWY_INLINE VF At(VF depth) const { return hn::Add(origin, hn::Mul(direction, depth)); }
  HWY_INLINE VF DepthOf(VF plane) const { return hn::Mul(hn::Sub(plane, origin), inverse); }
};

// Rays on their way through a block, one a lane.
struct Walk {
  Axis x;
  Axis y;
  Axis z;
  VF t;       // depth
  VF end;     // where the box around the crossed cubes ends, or what has been met
  VI place;   // of the cube in the block
  MF active;  // the others have met something, or have left
};

// Where the rays leave the cubes that they are in.
struct WayOut {
  VF x;  // depths of the next planes
  VF y;
  VF z;
  VF first;
};

// Of a block's sixteen words the one that each lane names: they fit into the widest registers.
HWY_INLINE VI WordsAt(const std::int32_t* words, VI index) {
  const DI di;
#if HWY_MAX_BYTES >= 64 && HWY_TARGET != HWY_SCALAR
  if (hn::Lanes(di) == 16) {
    return hn::TableLookupLanes(hn::LoadU(di, words), hn::IndicesFromVec(di, index));
  }
#endif
  return hn::GatherIndex(di, words, index);
}

// Cuts the rays to the box around the crossed cubes, along one axis.
HWY_INLINE void EnterBox(const RayBlock& block, const TileRays& rays, float origin, std::size_t a,
                         std::size_t i, Axis& axis, Walk& walk) {
  const DF df;
  axis.origin = hn::Set(df, origin);
  axis.direction = hn::LoadU(df, rays.direction[a].data() + i);
  axis.inverse = hn::LoadU(df, rays.inverse[a].data() + i);
  const VF low = axis.DepthOf(hn::Set(df, block.cubes.low[a]));
  const VF high = axis.DepthOf(hn::Set(df, block.cubes.high[a]));
  walk.t = hn::Max(walk.t, hn::Min(low, high));
  walk.end = hn::Min(walk.end, hn::Max(low, high));
}

// The cubes in which the rays begin, and how they step, along one axis.
HWY_INLINE void BeginAt(const RayBlock& block, std::size_t a, Axis& axis, Walk& walk) {
  const DF df;
  const DI di;
  const VF zero = hn::Zero(df);
  const VF one = hn::Set(df, 1.0F);
  axis.low = hn::Set(df, block.cubes.low[a]);
  axis.last = hn::Set(df, static_cast<float>(block.cubes.high[a]) - 1.0F);
  const VF at = axis.At(hn::IfThenElse(walk.active, walk.t, zero));
  const VF inside = hn::Min(hn::Max(at, axis.low), axis.last);
  const VI cell = hn::ConvertTo(di, inside);
  axis.cell = hn::ConvertTo(df, cell);
  walk.place = hn::Add(walk.place, hn::ShiftLeftSame(cell, static_cast<int>(3 * a)));
  const MF up = hn::Gt(axis.direction, zero);
  axis.step = hn::IfThenElse(up, one, hn::Neg(one));
  axis.ahead = hn::IfThenElse(up, one, zero);
  const VI pace = hn::Set(di, 1 << (3 * a));
  axis.pace = hn::IfThenElse(hn::RebindMask(di, up), pace, hn::Neg(pace));
}

HWY_INLINE WayOut FindWayOut(const Walk& walk) {
  const auto to_plane = [](const Axis& axis) {
    return axis.DepthOf(hn::Add(axis.cell, axis.ahead));
  };
  WayOut out;
  out.x = to_plane(walk.x);
  out.y = to_plane(walk.y);
  out.z = to_plane(walk.z);
  out.first = hn::Min(hn::Min(out.x, out.y), out.z);
  return out;
}

HWY_INLINE MF InCrossedCube(const Walk& walk, const std::int32_t* words) {
  const DF df;
  const DI di;
  const VI word = WordsAt(words, hn::ShiftRight<5>(walk.place));
  const VI shift = hn::And(walk.place, hn::Set(di, 31));
  const VI bit = hn::And(hn::Shr(word, shift), hn::Set(di, 1));
  return hn::And(walk.active, hn::RebindMask(df, hn::Ne(bit, hn::Zero(di))));
}

// The rays `stepping` go on into the next cube along one axis, where that is the way out, or end
// with the box.
HWY_INLINE void StepAlong(MF stepping, VF plane, VF first, Axis& axis, Walk& walk) {
  const DI di;
  const MF passes = hn::And(stepping, hn::Eq(plane, first));
  const VF next = hn::Add(axis.cell, axis.step);
  const MF left = hn::And(passes, hn::Or(hn::Lt(next, axis.low), hn::Gt(next, axis.last)));
  walk.active = hn::AndNot(left, walk.active);
  const MF stays = hn::AndNot(left, passes);
  axis.cell = hn::IfThenElse(stays, next, axis.cell);
  walk.place = hn::Add(walk.place, hn::IfThenElseZero(hn::RebindMask(di, stays), axis.pace));
}

HWY_INLINE void Step(MF stepping, const WayOut& out, Walk& walk) {
  StepAlong(stepping, out.x, out.first, walk.x, walk);
  StepAlong(stepping, out.y, out.first, walk.y, walk);
  StepAlong(stepping, out.z, out.first, walk.z, walk);
  walk.t = hn::IfThenElse(stepping, hn::Max(walk.t, out.first), walk.t);
  walk.active = hn::AndNot(hn::And(stepping, hn::Ge(walk.t, walk.end)), walk.active);
}

// Of the lanes' cubes. Neighbours are mostly in the same few cubes, so that the corners of one cube
// after the other are read: far less than a gather for each lane. `places` is room for a vector.
HWY_INLINE Corners ReadCorners(const float* distance, MF wanted, VI place, std::int32_t* places) {
  const DF df;
  const DI di;
  const VF zero = hn::Zero(df);
  Corners corners{zero, zero, zero, zero, zero, zero, zero, zero};
  hn::Store(place, di, places);
  for (MF left = wanted;;) {
    const intptr_t lane = hn::FindFirstTrue(df, left);
    if (lane < 0) break;
    const std::int32_t cube = places[lane];
    const MF same = hn::And(left, hn::RebindMask(df, hn::Eq(place, hn::Set(di, cube))));
    left = hn::AndNot(same, left);
    const float* first =
        distance + kCorners * kCorners * (cube >> 6) + kCorners * ((cube >> 3) & 7) + (cube & 7);
    const auto read = [&](int offset, VF& corner) {
      corner = hn::IfThenElse(same, hn::Set(df, first[offset]), corner);
    };
    read(0, corners.c000);
    read(1, corners.c100);
    read(kCorners, corners.c010);
    read(kCorners + 1, corners.c110);
    read(kCorners * kCorners, corners.c001);
    read(kCorners * kCorners + 1, corners.c101);
    read(kCorners * kCorners + kCorners, corners.c011);
    read(kCorners * kCorners + kCorners + 1, corners.c111);
  }
  return corners;
}

HWY_INLINE Stretch StretchInCube(const Walk& walk, VF leave) {
  Stretch on;
  on.length = hn::Max(hn::Sub(leave, walk.t), hn::Zero(DF()));
  on.x = hn::Sub(walk.x.At(walk.t), walk.x.cell);
  on.y = hn::Sub(walk.y.At(walk.t), walk.y.cell);
  on.z = hn::Sub(walk.z.At(walk.t), walk.z.cell);
  on.dx = hn::Mul(walk.x.direction, on.length);
  on.dy = hn::Mul(walk.y.direction, on.length);
  on.dz = hn::Mul(walk.z.direction, on.length);
  return on;
}

// The hits take the lanes' points at `s` of their stretches, where these are nearer.
HWY_INLINE void KeepHits(const Trilinear& trilinear, const Stretch& on, VF t, VF s, MF hit,
                         std::int32_t number, const LatticeRays& lattice, std::size_t i,
                         TileHits& hits) {
  const DF df;
  const DI di;
  const VF depth = hn::Add(t, hn::Mul(s, on.length));
  const VF px = hn::Add(on.x, hn::Mul(s, on.dx));
  const VF py = hn::Add(on.y, hn::Mul(s, on.dy));
  const VF pz = hn::Add(on.z, hn::Mul(s, on.dz));
  const VF nx = trilinear.SlopeX(py, pz);
  const VF ny = trilinear.SlopeY(px, pz);
  const VF nz = trilinear.SlopeZ(px, py);
  const VF norm = hn::Sqrt(hn::Add(hn::Add(hn::Mul(nx, nx), hn::Mul(ny, ny)), hn::Mul(nz, nz)));
  const VF scale = hn::Div(hn::Set(df, 1.0F), hn::Max(norm, hn::Set(df, 1e-20F)));
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
}

// Rays wait in crossed cubes until all are in one: then all look for a root.
HWY_INLINE void WalkThrough(const RayBlock& block, std::int32_t number, const LatticeRays& lattice,
                            VF outside, std::size_t i, Walk& walk, TileHits& hits) {
  const DF df;
  const auto* words = reinterpret_cast<const std::int32_t*>(block.cubes.bits.data());
  HWY_ALIGN std::array<std::int32_t, HWY_MAX_BYTES / sizeof(std::int32_t)> places;
  while (true) {
    const WayOut out = FindWayOut(walk);
    const MF crossed = InCrossedCube(walk, words);
    const MF moving = hn::AndNot(crossed, walk.active);
    MF stepping = moving;
    if (hn::AllFalse(df, moving)) {
      if (hn::AllFalse(df, crossed)) return;
      const Trilinear trilinear(
          ReadCorners(block.distance.data(), crossed, walk.place, places.data()));
      const Stretch stretch = StretchInCube(walk, out.first);
      const Cubic cubic(trilinear, stretch);
      const Bracket change = FirstChange(cubic, crossed, outside);
      if (!hn::AllFalse(df, change.hit)) {
        const VF s = RootOf(cubic, change);
        KeepHits(trilinear, stretch, walk.t, s, change.hit, number, lattice, i, hits);
        walk.active = hn::AndNot(change.hit, walk.active);
      }
      stepping = hn::AndNot(change.hit, crossed);
    }
    Step(stepping, out, walk);
  }
}

float Cast(const RayBlock& block, std::int32_t number, const LatticeRays& lattice,
           const TileRays& rays, float voxel, const TileValues& from, TileHits& hits) {
  const DF df;
  const DI di;
  const VF outside = hn::Set(df, -5e-4F * voxel);
  std::array<float, 3> origin;
  const std::array<int, 3> first{block.index.x * kBlockSide, block.index.y * kBlockSide,
                                 block.index.z * kBlockSide};
  for (std::size_t a = 0; a < 3; ++a) origin[a] = static_cast<float>(lattice.origin[a] - first[a]);
  VF farthest = hn::Zero(df);

  for (std::size_t i = 0; i < kTilePixels; i += hn::Lanes(df)) {
    Walk walk;
    walk.t = hn::LoadU(df, from.data() + i);
    walk.end = hn::LoadU(df, hits.depth.data() + i);
    EnterBox(block, rays, origin[0], 0, i, walk.x, walk);
    EnterBox(block, rays, origin[1], 1, i, walk.y, walk);
    EnterBox(block, rays, origin[2], 2, i, walk.z, walk);
    walk.active = hn::Lt(walk.t, walk.end);
    if (!hn::AllFalse(df, walk.active)) {
      walk.place = hn::Zero(di);
      BeginAt(block, 0, walk.x, walk);
      BeginAt(block, 1, walk.y, walk);
      BeginAt(block, 2, walk.z, walk);
      WalkThrough(block, number, lattice, outside, i, walk, hits);
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
