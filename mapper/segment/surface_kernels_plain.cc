// The surface's maps pixel by pixel (docs/segmentation.md, "Maps").
#include <cmath>
#include <numbers>

#include "mapper/segment/surface_kernels.h"

namespace tsdfpp::plain {
namespace {

// Of what is not a number, as vectors compare: the second.
float Lesser(float a, float b) { return a < b ? a : b; }
float Greater(float a, float b) { return a > b ? a : b; }

// NoiseModel::HeadOnInverse: sigma0 / z^2.
float HeadOnInverse(float q, float scale) {
  const float beyond = 1.0F - 0.4F * q;
  return scale * (0.0012F * (q * q) + 0.0019F * (beyond * beyond));
}

// The pixel's slope along the row or the column, from the values s pixels before and after it: the
// mean of both sides where they agree, else the one nearer to 0; where there is one, that.
float SlopeAt(float before, float q, float after, float per_step, float tolerance) {
  const float back = (q - before) * per_step;
  const float ahead = (after - q) * per_step;
  if (before == 0) return after == 0 ? 0.0F : ahead;
  if (after == 0) return back;
  if (std::abs(back - ahead) <= tolerance) return (back + ahead) * 0.5F;
  return std::abs(back) < std::abs(ahead) ? back : ahead;
}

// th / (pi/2 - th) of the angle th with this cosine, at most 85 deg. pi/2 - th is the arc sine of
// the cosine, by its series: exact to 2e-5 rad above 60 deg. At 0 deg the ratio is 0.2 too large,
// which makes the lateral noise one in a hundred larger.
float AngleRatio(float cosine) {
  const float c = Greater(cosine, 0.08715574F);
  const float c2 = c * c;
  float series = 105.0F / 3456;
  for (const float factor : {15.0F / 336, 3.0F / 40, 1.0F / 6, 1.0F}) series = factor + c2 * series;
  series = c * series;
  return (std::numbers::pi_v<float> / 2 - series) / series;
}

// The noise along the ray at depth 1/q and this angle of incidence, and, in quadrature, the noise
// across it times the slope of depth (depth_noise.h).
float Sigma(float q, float cosine, float slope_x, float slope_y, float noise) {
  const float z = 1.0F / q;
  const float ratio = AngleRatio(cosine);
  const float beyond = z - 0.4F;
  const float frontal = 0.0012F + 0.0019F * (beyond * beyond);
  const float grazing = 0.0001F * (ratio * ratio) / std::sqrt(z);
  const float along = noise * (frontal + (cosine < 0.5F ? grazing : 0.0F));
  const float pixels_across = noise * (0.8F + 0.035F * ratio);
  const float steep = std::sqrt(slope_x * slope_x + slope_y * slope_y);
  const float across = pixels_across * (steep * (z * z));
  return std::sqrt(along * along + across * across);
}

// Whether the surface goes on from q0 to q1: where both are known, and one side goes on as the
// other.
bool IsLinked(const JumpRow& row, std::size_t u, const JumpScale& scale) {
  const float before = row.before[u];
  const float q0 = row.q0[u];
  const float q1 = row.q1[u];
  const float behind = row.behind[u];
  if (q0 == 0 || q1 == 0) return false;
  const float q = Greater(q0, q1);  // the nearer one
  const float sigma = q0 > q1 ? row.sigma0[u] : row.sigma1[u];
  // A pixel's width: w z / z^2.
  const float tolerance = scale.noise * sigma * q * q + scale.width * q;
  const float step = q1 - q0;
  // How far the step is off the slope on either side, or off the steepest surface.
  const float off0 = std::abs(step - (q0 - before) * scale.per_step);
  const float off1 = std::abs(step - (behind - q1) * scale.per_step);
  if (before == 0 && behind == 0) return std::abs(step) - scale.steepest * q <= tolerance;
  if (before == 0) return off1 <= tolerance;
  if (behind == 0) return off0 <= tolerance;
  return off0 <= tolerance || off1 <= tolerance;
}

// Half of a chord, in the chord's plane, metres.
struct HalfChord {
  float across = 0;
  float deep = 0;
};
float Dot(const HalfChord& a, const HalfChord& b) { return a.across * b.across + a.deep * b.deep; }

// Whether the chord turns towards the camera by more than the limit.
bool IsTurned(const HalfChord& a, const HalfChord& b, float tangent, float noise) {
  // |a| |b| sin of the turn, positive where the middle lies behind the chord, and cos.
  const float turn = a.deep * b.across - a.across * b.deep;
  const float ahead = Greater(Dot(a, b), 0.0F);
  const float h2 = Lesser(Dot(a, a), Dot(b, b));
  // Both sides times h^2, which may be 0.
  return turn > 0 && turn * h2 > (tangent * h2 + noise) * ahead;
}

}  // namespace

void AddPairs(const float* before, const float* q, const float* behind, std::size_t pixels,
              const PairScale& scale, float* sum, float* count) {
  for (std::size_t u = 0; u < pixels; ++u) {
    const float slope = std::abs(behind[u] - before[u]) * scale.shift;
    const float shift = Lesser(slope, scale.steepest * q[u]);
    const float tolerance = scale.sigmas * (HeadOnInverse(q[u], scale.noise) + shift);
    const float both = before[u] + behind[u];
    const float off = std::abs(both - (q[u] + q[u]));
    const bool taken = before[u] != 0 && q[u] != 0 && behind[u] != 0 && off <= tolerance;
    sum[u] += taken ? both : 0.0F;
    count[u] += taken ? 2.0F : 0.0F;
  }
}

void NormalsOfRow(const NormalRow& row, std::size_t pixels, const NormalScale& scale, float* normal,
                  float* sigma) {
  for (std::size_t u = 0; u < pixels; ++u) {
    const float q = row.q[u];
    if (q == 0) {
      normal[3 * u] = normal[3 * u + 1] = normal[3 * u + 2] = 0;
      sigma[u] = 0;
      continue;
    }
    const float noise_and_width =
        scale.sigmas * HeadOnInverse(q, scale.noise) + scale.pixel_width * q;
    const float tolerance = noise_and_width * scale.per_step;
    const float slope_x = SlopeAt(row.before[u], q, row.after[u], scale.per_step, tolerance);
    const float slope_y = SlopeAt(row.above[u], q, row.below[u], scale.per_step, tolerance);
    const float ray_x = row.ray_x[u];
    const float ray_y = row.ray_y;
    // -(a, b, c) is the normal times the length of (a, b, c). q is the plane's inverse distance
    // times ray * normal, and positive.
    const float a = slope_x * scale.per_x;
    const float b = slope_y * scale.per_y;
    const float c = (q - a * ray_x) - b * ray_y;
    const float per_length = -1.0F / std::sqrt((a * a + b * b) + c * c);
    normal[3 * u] = a * per_length;
    normal[3 * u + 1] = b * per_length;
    normal[3 * u + 2] = c * per_length;
    const float ray = std::sqrt((ray_x * ray_x + ray_y * ray_y) + 1.0F);
    const float cosine = -(q * per_length) / ray;
    sigma[u] = Sigma(q, cosine, slope_x, slope_y, scale.noise);
  }
}

void LinksOfRow(const JumpRow& row, std::size_t pixels, const JumpScale& scale,
                std::uint8_t* linked) {
  for (std::size_t u = 0; u < pixels; ++u) linked[u] = IsLinked(row, u, scale) ? 1 : 0;
}

void TurnsOfRow(const ChordRow& row, std::size_t pixels, const ChordScale& scale,
                std::uint8_t* turns) {
  for (std::size_t u = 0; u < pixels; ++u) {
    const std::size_t k = row.stride * u;
    const float slant = row.slant[(1 - row.stride) * u];
    const float z0 = row.z0[u];
    const float z = row.z[u];
    const float z1 = row.z1[u];
    const float here = row.along[k] * z;
    const HalfChord to_here{here - row.along0[k] * z0, slant * (z - z0)};
    const HalfChord from_here{row.along1[k] * z1 - here, slant * (z1 - z)};
    const float noise = scale.noise * row.sigma[u] * z;
    turns[u] = IsTurned(to_here, from_here, scale.tangent, noise) ? 255 : 0;
  }
}

}  // namespace tsdfpp::plain
