// The distance along rays inside cubes, a ray a lane: a cubic, and where it passes from outside to
// inside (docs/map.md, "Ray casting"). Included once an instruction set, after highway.h.
#if defined(TSDFPP_MAPPER_CUBIC_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TSDFPP_MAPPER_CUBIC_LANES_INL_H_
#undef TSDFPP_MAPPER_CUBIC_LANES_INL_H_
#else
#define TSDFPP_MAPPER_CUBIC_LANES_INL_H_
#endif

#include <hwy/highway.h>

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

// The distances at the corners of a cube a lane; digits are steps along x, y, z.
struct Corners {
  VF c000;
  VF c100;
  VF c010;
  VF c110;
  VF c001;
  VF c101;
  VF c011;
  VF c111;
};

// The trilinear distance in a cube as a polynomial of the place in it, and its gradient.
struct Trilinear {
  explicit HWY_INLINE Trilinear(const Corners& c)
      : k(c.c000),
        kx(hn::Sub(c.c100, c.c000)),
        ky(hn::Sub(c.c010, c.c000)),
        kz(hn::Sub(c.c001, c.c000)),
        kxy(hn::Sub(hn::Sub(c.c110, c.c010), kx)),
        kxz(hn::Sub(hn::Sub(c.c101, c.c001), kx)),
        kyz(hn::Sub(hn::Sub(c.c011, c.c001), ky)),
        kxyz(hn::Sub(hn::Sub(hn::Sub(c.c111, c.c011), hn::Sub(c.c101, c.c001)), kxy)) {}

  HWY_INLINE VF SlopeX(VF py, VF pz) const {
    return hn::Add(hn::Add(kx, hn::Mul(kxy, py)), hn::Mul(hn::Add(kxz, hn::Mul(kxyz, py)), pz));
  }
  HWY_INLINE VF SlopeY(VF px, VF pz) const {
    return hn::Add(hn::Add(ky, hn::Mul(kxy, px)), hn::Mul(hn::Add(kyz, hn::Mul(kxyz, px)), pz));
  }
  HWY_INLINE VF SlopeZ(VF px, VF py) const {
    return hn::Add(hn::Add(kz, hn::Mul(kxz, px)), hn::Mul(hn::Add(kyz, hn::Mul(kxyz, px)), py));
  }

  VF k;
  VF kx;
  VF ky;
  VF kz;
  VF kxy;
  VF kxz;
  VF kyz;
  VF kxyz;
};

// Stretches of rays inside their cubes: from (x, y, z) on by (dx, dy, dz), in the cube's frame.
struct Stretch {
  VF length;  // in depth
  VF x;
  VF y;
  VF z;
  VF dx;
  VF dy;
  VF dz;
};

// The distance along a stretch, a cubic of s = 0 ... 1.
struct Cubic {
  HWY_INLINE Cubic(const Trilinear& of, const Stretch& on)
      : a0(hn::Add(hn::Add(hn::Add(of.k, hn::Mul(of.kx, on.x)),
                           hn::Mul(hn::Add(of.ky, hn::Mul(of.kxy, on.x)), on.y)),
                   hn::Mul(of.SlopeZ(on.x, on.y), on.z))),
        a1(hn::Add(
            hn::Add(hn::Mul(of.SlopeX(on.y, on.z), on.dx), hn::Mul(of.SlopeY(on.x, on.z), on.dy)),
            hn::Mul(of.SlopeZ(on.x, on.y), on.dz))) {
    const VF dxy = hn::Mul(on.dx, on.dy);
    const VF dxz = hn::Mul(on.dx, on.dz);
    const VF dyz = hn::Mul(on.dy, on.dz);
    a2 = hn::Add(hn::Add(hn::Mul(hn::Add(of.kxy, hn::Mul(of.kxyz, on.z)), dxy),
                         hn::Mul(hn::Add(of.kxz, hn::Mul(of.kxyz, on.y)), dxz)),
                 hn::Mul(hn::Add(of.kyz, hn::Mul(of.kxyz, on.x)), dyz));
    a3 = hn::Mul(hn::Mul(dxy, on.dz), of.kxyz);
  }

  HWY_INLINE VF At(VF s) const {
    return hn::Add(a0, hn::Mul(s, hn::Add(a1, hn::Mul(s, hn::Add(a2, hn::Mul(s, a3))))));
  }
  HWY_INLINE VF Slope(VF s) const {
    const VF three = hn::Set(DF(), 3.0F);
    return hn::Add(a1, hn::Mul(s, hn::Add(hn::Add(a2, a2), hn::Mul(s, hn::Mul(three, a3)))));
  }

  VF a0;
  VF a1;
  VF a2;
  VF a3;
};

// Where the lanes `hit` pass from outside to inside: between `low` and `high` of the stretch, with
// the distances there.
struct Bracket {
  MF hit;
  VF low;
  VF high;
  VF g_low;
  VF g_high;

  HWY_INLINE VF Chord() const {
    return hn::Add(low, hn::Mul(hn::Sub(high, low), hn::Div(g_low, hn::Sub(g_low, g_high))));
  }
};

// The first of the cube's thirds at whose ends the distance changes from outside to inside. A face
// between two cubes is reached from both with other roundings: what is hardly negative, `outside`,
// counts as outside where a cube is entered.
HWY_INLINE Bracket FirstChange(const Cubic& cubic, MF crossed, VF outside) {
  const DF df;
  const VF zero = hn::Zero(df);
  const VF one = hn::Set(df, 1.0F);
  const VF third = hn::Set(df, 1.0F / 3.0F);
  const VF two_thirds = hn::Set(df, 2.0F / 3.0F);
  const VF g1 = cubic.At(third);
  const VF g2 = cubic.At(two_thirds);
  const VF g3 = cubic.At(one);
  const MF in_1 = hn::Lt(g1, zero);
  const MF in_2 = hn::Lt(g2, zero);
  const MF in_3 = hn::Lt(g3, zero);
  const MF at_1 = hn::And(hn::Ge(cubic.a0, outside), in_1);
  const MF at_2 = hn::AndNot(at_1, hn::AndNot(in_1, in_2));
  const MF at_3 = hn::AndNot(hn::Or(at_1, at_2), hn::AndNot(in_2, in_3));
  Bracket bracket;
  bracket.hit = hn::And(crossed, hn::Or(hn::Or(at_1, at_2), at_3));
  bracket.low = hn::IfThenElse(at_1, zero, hn::IfThenElse(at_2, third, two_thirds));
  bracket.high = hn::IfThenElse(at_1, third, hn::IfThenElse(at_2, two_thirds, one));
  bracket.g_low = hn::Max(hn::IfThenElse(at_1, cubic.a0, hn::IfThenElse(at_2, g1, g2)), zero);
  const VF g_high = hn::IfThenElse(at_1, g1, hn::IfThenElse(at_2, g2, g3));
  bracket.g_high = hn::IfThenElse(bracket.hit, g_high, hn::Neg(one));
  return bracket;
}

// The root by a chord, and then by one of Newton's steps where that stays between what is known to
// be outside and inside, else by another chord.
HWY_INLINE VF RootOf(const Cubic& cubic, Bracket bracket) {
  const DF df;
  const VF s = bracket.Chord();
  const VF g = cubic.At(s);
  const MF in = hn::Lt(g, hn::Zero(df));
  bracket.high = hn::IfThenElse(in, s, bracket.high);
  bracket.g_high = hn::IfThenElse(in, g, bracket.g_high);
  bracket.low = hn::IfThenElse(in, bracket.low, s);
  bracket.g_low = hn::IfThenElse(in, bracket.g_low, g);
  const VF newton = hn::Sub(s, hn::Div(g, hn::Min(cubic.Slope(s), hn::Set(df, -1e-9F))));
  const MF between = hn::And(hn::Gt(newton, bracket.low), hn::Lt(newton, bracket.high));
  return hn::IfThenElse(between, newton, bracket.Chord());
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
