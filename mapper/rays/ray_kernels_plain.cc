// Rays one by one through the crossed cubes of a block (docs/map.md, "Ray casting").
#include <algorithm>
#include <cmath>
#include <optional>

#include "mapper/rays/ray_kernels.h"

namespace tsdfpp::plain {
namespace {

constexpr float kLeastDirection = 1e-4F;  // voxels per metre

std::size_t Number(int i) { return static_cast<std::size_t>(i); }

// Of equal numbers the second, as vectors have it: zero has two signs.
float Least(float a, float b) { return a < b ? a : b; }
float Most(float a, float b) { return a > b ? a : b; }

float KeptOffZero(float component) {
  if (std::abs(component) >= kLeastDirection) return component;
  return component < 0 ? -kLeastDirection : kLeastDirection;
}

// In voxels from the block's first, by depth in metres.
struct Ray {
  std::array<float, 3> origin;
  std::array<float, 3> direction;
  std::array<float, 3> inverse;  // 1 / direction

  float At(int axis, float depth) const {
    return origin[Number(axis)] + direction[Number(axis)] * depth;
  }
  float DepthOfPlane(int axis, float plane) const {
    return (plane - origin[Number(axis)]) * inverse[Number(axis)];
  }
};

using Cube = std::array<int, 3>;  // its lowest corner, from the block's first voxel

bool IsCrossed(const RayBlock& block, const Cube& cube) {
  const int bit = 64 * cube[2] + 8 * cube[1] + cube[0];
  return (block.cubes.bits[Number(bit / 32)] >> static_cast<unsigned>(bit % 32) & 1U) != 0;
}

// The trilinear distance inside a cube as a polynomial of the place in it.
struct Trilinear {
  float k, kx, ky, kz, kxy, kxz, kyz, kxyz;

  float SlopeX(float y, float z) const { return (kx + kxy * y) + (kxz + kxyz * y) * z; }
  float SlopeY(float x, float z) const { return (ky + kxy * x) + (kyz + kxyz * x) * z; }
  float SlopeZ(float x, float y) const { return (kz + kxz * x) + (kyz + kxyz * x) * y; }
  float At(float x, float y, float z) const {
    return ((k + kx * x) + (ky + kxy * x) * y) + SlopeZ(x, y) * z;
  }
};

Trilinear TrilinearIn(const RayBlock& block, const Cube& cube) {
  const auto c = [&](int x, int y, int z) {
    return block
        .distance[Number(kCorners * (kCorners * (cube[2] + z) + cube[1] + y) + cube[0] + x)];
  };
  Trilinear of{};
  of.k = c(0, 0, 0);
  of.kx = c(1, 0, 0) - of.k;
  of.ky = c(0, 1, 0) - of.k;
  of.kz = c(0, 0, 1) - of.k;
  of.kxy = (c(1, 1, 0) - c(0, 1, 0)) - of.kx;
  of.kxz = (c(1, 0, 1) - c(0, 0, 1)) - of.kx;
  of.kyz = (c(0, 1, 1) - c(0, 0, 1)) - of.ky;
  of.kxyz = ((c(1, 1, 1) - c(0, 1, 1)) - (c(1, 0, 1) - c(0, 0, 1))) - of.kxy;
  return of;
}

// A ray's stretch inside a cube: from `start` on by `way`, both in the cube's frame, s = 0 ... 1.
struct Stretch {
  float begin = 0;   // depth, metres
  float length = 0;  // in depth, metres
  std::array<float, 3> start;
  std::array<float, 3> way;

  float At(int axis, float s) const { return start[Number(axis)] + s * way[Number(axis)]; }
};

// The distance along a stretch: a0 + a1 s + a2 s^2 + a3 s^3.
struct Cubic {
  float a0, a1, a2, a3;

  float At(float s) const { return a0 + s * (a1 + s * (a2 + s * a3)); }
  float Slope(float s) const { return a1 + s * ((a2 + a2) + s * (3 * a3)); }
};

Cubic CubicAlong(const Trilinear& of, const Stretch& along) {
  const auto [x, y, z] = along.start;
  const auto [dx, dy, dz] = along.way;
  Cubic cubic{};
  cubic.a0 = of.At(x, y, z);
  cubic.a1 = (of.SlopeX(y, z) * dx + of.SlopeY(x, z) * dy) + of.SlopeZ(x, y) * dz;
  const float dxy = dx * dy;
  cubic.a2 = ((of.kxy + of.kxyz * z) * dxy + (of.kxz + of.kxyz * y) * (dx * dz)) +
             (of.kyz + of.kxyz * x) * (dy * dz);
  cubic.a3 = (dxy * dz) * of.kxyz;
  return cubic;
}

// Two places on a stretch, the first outside, the other inside.
struct Bracket {
  float low, high;
  float g_low, g_high;  // the distances there

  float Chord() const { return low + (high - low) * (g_low / (g_low - g_high)); }
};

// The first of the stretch's thirds at whose ends the distance changes from outside to inside.
std::optional<Bracket> FirstChange(const Cubic& cubic, float voxel) {
  // A face between two cubes is reached from both with other roundings: what is hardly negative
  // counts as outside where a cube is entered.
  const float outside = -5e-4F * voxel;
  constexpr float kThird = 1.0F / 3.0F;
  constexpr float kTwoThirds = 2.0F / 3.0F;
  const float g1 = cubic.At(kThird);
  const float g2 = cubic.At(kTwoThirds);
  const float g3 = cubic.At(1);
  if (cubic.a0 >= outside && g1 < 0) return Bracket{0, kThird, Most(cubic.a0, 0), g1};
  if (!(g1 < 0) && g2 < 0) return Bracket{kThird, kTwoThirds, Most(g1, 0), g2};
  if (!(g2 < 0) && g3 < 0) return Bracket{kTwoThirds, 1, Most(g2, 0), g3};
  return std::nullopt;
}

// The root by a chord, and then by one of Newton's steps where that stays between what is known to
// be outside and inside, else by another chord.
float RootOf(const Cubic& cubic, Bracket bracket) {
  const float s = bracket.Chord();
  const float g = cubic.At(s);
  if (g < 0) {
    bracket.high = s;
    bracket.g_high = g;
  } else {
    bracket.low = s;
    bracket.g_low = g;
  }
  const float newton = s - g / Least(cubic.Slope(s), -1e-9F);
  return newton > bracket.low && newton < bracket.high ? newton : bracket.Chord();
}

struct Hit {
  float depth = 0;              // metres
  std::array<float, 3> normal;  // in the lattice, of any length
};

// Where the ray passes from outside to inside in a crossed cube.
std::optional<Hit> HitInCube(const RayBlock& block, const Cube& cube, const Stretch& along,
                             float voxel) {
  const Trilinear trilinear = TrilinearIn(block, cube);
  const Cubic cubic = CubicAlong(trilinear, along);
  const std::optional<Bracket> change = FirstChange(cubic, voxel);
  if (!change) return std::nullopt;
  const float s = RootOf(cubic, *change);
  const float x = along.At(0, s);
  const float y = along.At(1, s);
  const float z = along.At(2, s);
  return Hit{along.begin + s * along.length,
             {trilinear.SlopeX(y, z), trilinear.SlopeY(x, z), trilinear.SlopeZ(x, y)}};
}

// A ray on its way through the cubes of a block.
class Walk {
 public:
  Walk(const RayBlock& block, const Ray& ray) : block_(block), ray_(ray) {}

  // The first hit at a depth of at least `from`, and in a cube that begins before `end`.
  std::optional<Hit> FirstHit(float from, float end, float voxel) {
    if (!Enter(from, end)) return std::nullopt;
    do {
      FindWayOut();
      if (IsCrossed(block_, cube_)) {
        if (auto hit = HitInCube(block_, cube_, StretchInCube(), voxel)) return hit;
      }
    } while (StepToNextCube());
    return std::nullopt;
  }

 private:
  // Into the box around the crossed cubes; false where the ray misses it.
  bool Enter(float from, float end) {
    t_ = from;
    end_ = end;
    for (int a = 0; a < 3; ++a) {
      const float low = ray_.DepthOfPlane(a, block_.cubes.low[Number(a)]);
      const float high = ray_.DepthOfPlane(a, block_.cubes.high[Number(a)]);
      t_ = Most(t_, Least(low, high));
      end_ = Least(end_, Most(low, high));
    }
    if (!(t_ < end_)) return false;
    for (int a = 0; a < 3; ++a) {
      const auto low = static_cast<float>(block_.cubes.low[Number(a)]);
      const auto last = static_cast<float>(block_.cubes.high[Number(a)] - 1);
      cube_[Number(a)] = static_cast<int>(Least(Most(ray_.At(a, t_), low), last));
    }
    return true;
  }

  bool GoesUp(int axis) const { return ray_.direction[Number(axis)] > 0; }

  // The depths at which the ray meets the cube's next planes, and the first of them.
  void FindWayOut() {
    for (int a = 0; a < 3; ++a) {
      const int plane = cube_[Number(a)] + (GoesUp(a) ? 1 : 0);
      planes_[Number(a)] = ray_.DepthOfPlane(a, static_cast<float>(plane));
    }
    leave_ = Least(Least(planes_[0], planes_[1]), planes_[2]);
  }

  Stretch StretchInCube() const {
    Stretch along;
    along.begin = t_;
    along.length = Most(leave_ - t_, 0);
    for (int a = 0; a < 3; ++a) {
      along.start[Number(a)] = ray_.At(a, t_) - static_cast<float>(cube_[Number(a)]);
      along.way[Number(a)] = ray_.direction[Number(a)] * along.length;
    }
    return along;
  }

  // False where the ray leaves the box, or ends.
  bool StepToNextCube() {
    for (int a = 0; a < 3; ++a) {
      if (planes_[Number(a)] != leave_) continue;
      int& place = cube_[Number(a)];
      place += GoesUp(a) ? 1 : -1;
      if (place < block_.cubes.low[Number(a)] || place >= block_.cubes.high[Number(a)])
        return false;
    }
    t_ = Most(t_, leave_);
    return t_ < end_;
  }

  const RayBlock& block_;
  const Ray& ray_;
  float t_ = 0;  // depth, metres
  float end_ = 0;
  Cube cube_{};
  std::array<float, 3> planes_{};
  float leave_ = 0;
};

// The i-th ray of the tile, from the block's first voxel.
Ray RayOf(const RayBlock& block, const LatticeRays& lattice, const TileRays& rays, std::size_t i) {
  const std::array<int, 3> first{block.index.x * kBlockSide, block.index.y * kBlockSide,
                                 block.index.z * kBlockSide};
  Ray ray{};
  for (std::size_t a = 0; a < 3; ++a) {
    ray.origin[a] = static_cast<float>(lattice.origin[a] - first[a]);
    ray.direction[a] = rays.direction[a][i];
    ray.inverse[a] = rays.inverse[a][i];
  }
  return ray;
}

// The normal turned into the world's frame, of length 1.
std::array<float, 3> WorldNormal(const LatticeRays& lattice, const std::array<float, 3>& n) {
  const float norm = std::sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]);
  const float scale = 1 / Most(norm, 1e-20F);
  std::array<float, 3> normal{};
  for (std::size_t r = 0; r < 3; ++r) {
    const float* row = &lattice.R_WL[3 * r];
    normal[r] = ((row[0] * n[0] + row[1] * n[1]) + row[2] * n[2]) * scale;
  }
  return normal;
}

}  // namespace

void FillTileRays(const LatticeRays& lattice, int u, int v, TileRays& rays) {
  const TileOrder& order = OrderOfTile();
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    const auto column = static_cast<float>(u + order.x[i]);
    const auto row = static_cast<float>(v + order.y[i]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float direction = KeptOffZero((lattice.at_pixel_0[axis] + lattice.per_row[axis] * row) +
                                          lattice.per_column[axis] * column);
      rays.direction[axis][i] = direction;
      rays.inverse[axis][i] = 1 / direction;
    }
  }
}

void CopyCorners(const std::array<const Half*, 8>& from, RayBlock& block) {
  for (int z = 0; z < kCorners; ++z) {
    for (int y = 0; y < kCorners; ++y) {
      for (int x = 0; x < kCorners; ++x) {
        const int which = x / kBlockSide + 2 * (y / kBlockSide) + 4 * (z / kBlockSide);
        block.distance[Number(kCorners * (kCorners * z + y) + x)] =
            from[Number(which)][PlaceInBlock({x, y, z})];
      }
    }
  }
}

float CastThroughBlock(const RayBlock& block, std::int32_t number, const LatticeRays& lattice,
                       const TileRays& rays, float voxel, const TileValues& from, TileHits& hits) {
  float farthest = 0;
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    const Ray ray = RayOf(block, lattice, rays, i);
    const std::optional<Hit> hit = Walk(block, ray).FirstHit(from[i], hits.depth[i], voxel);
    if (hit && hit->depth < hits.depth[i]) {
      hits.depth[i] = hit->depth;
      hits.block[i] = number;
      const std::array<float, 3> normal = WorldNormal(lattice, hit->normal);
      for (std::size_t r = 0; r < 3; ++r) hits.normal[r][i] = normal[r];
    }
    farthest = std::max(farthest, hits.depth[i]);
  }
  return farthest;
}

}  // namespace tsdfpp::plain
