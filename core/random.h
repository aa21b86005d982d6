// Counter-based random numbers (Philox 4x32-10, Random123): every draw is keyed, so any one of them
// can be made again alone, on any standard library.
#pragma once

#include <Random123/philox.h>

#include <array>
#include <cstdint>

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

}  // namespace tsdfpp
