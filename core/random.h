// Counter-based random numbers (Philox 4x32-10, Random123): every draw is keyed, so any one of them
// can be made again alone, on any standard library.
#pragma once

#include <Random123/philox.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace tsdfpp {

// Four uniform numbers in [0, 1) with 32 random bits each, for (seed, stream, a, b).
inline std::array<double, 4> UniformDraw(std::uint64_t seed, std::uint32_t stream, std::uint64_t a,
                                         std::uint32_t b = 0) {
  const r123::Philox4x32::ctr_type counter{
      {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(a >> 32U), b, stream}};
  const r123::Philox4x32::key_type key{
      {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U)}};
  const auto bits = r123::Philox4x32()(counter, key);
  constexpr double kScale = 1.0 / 4294967296.0;
  return {bits[0] * kScale, bits[1] * kScale, bits[2] * kScale, bits[3] * kScale};
}

// Four independent standard normal numbers for the same keys, by Box and Muller's transform of
// UniformDraw; none is beyond 6.7 in magnitude.
inline std::array<double, 4> GaussianDraw(std::uint64_t seed, std::uint32_t stream, std::uint64_t a,
                                          std::uint32_t b = 0) {
  const std::array<double, 4> u = UniformDraw(seed, stream, a, b);
  std::array<double, 4> normal{};
  for (std::size_t i = 0; i < 4; i += 2) {
    // 1 - u lies in (0, 1], where the logarithm is finite.
    const double radius = std::sqrt(-2 * std::log(1 - u[i]));
    const double angle = 2 * std::numbers::pi * u[i + 1];
    normal[i] = radius * std::cos(angle);
    normal[i + 1] = radius * std::sin(angle);
  }
  return normal;
}

}  // namespace tsdfpp
