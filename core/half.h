// Half precision, in which distances are kept (docs/map.md): eleven significant bits, so that a
// distance is the finer the nearer the surface.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace tsdfpp {

// An IEEE 754 binary16 number. From float: rounded to the nearest, ties to even; what rounds to
// zero is +0.
class Half {
 public:
  constexpr Half() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): stands for the float
  constexpr Half(float value) : bits_(Rounded(value)) {}
  // NOLINTNEXTLINE(google-explicit-constructor): exact
  constexpr operator float() const {
    const std::uint32_t sign = (bits_ & 0x8000U) << 16U;
    const std::uint32_t rest = (bits_ & 0x7FFFU) << 13U;
    const std::uint32_t special = rest >= 0x0F800000U ? 0x38000000U : 0U;
    // No float on the way is subnormal: some renderers have their threads take those for 0.
    const float tiny = static_cast<float>(static_cast<std::int32_t>(rest >> 13U)) * 0x1p-24F;
    const std::uint32_t positive =
        rest < 0x00800000U ? std::bit_cast<std::uint32_t>(tiny) : rest + 0x38000000U + special;
    return std::bit_cast<float>(positive | sign);
  }

 private:
  static constexpr std::uint16_t Rounded(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    const std::uint32_t sign = (bits & 0x80000000U) >> 16U;
    const std::uint32_t rest = bits & 0x7FFFFFFFU;
    std::uint32_t half = 0;
    if (rest >= 0x47800000U) {  // 2^16 and beyond, infinity or not a number
      half = rest > 0x7F800000U ? 0x7E00U : 0x7C00U;
    } else if (rest < 0x38800000U) {  // below 2^-14: a whole number of 2^-24
      half = std::bit_cast<std::uint32_t>(std::bit_cast<float>(rest) + 0.5F) - 0x3F000000U;
    } else {
      half = (rest + 0xFFFU + ((rest >> 13U) & 1U) - 0x38000000U) >> 13U;
    }
    return static_cast<std::uint16_t>(half == 0 ? 0 : half | sign);
  }

  std::uint16_t bits_ = 0;
};
static_assert(sizeof(Half) == 2);

constexpr float RoundToHalf(float value) { return Half(value); }

inline void ToFloats(const Half* from, std::size_t count, float* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[i];
}

}  // namespace tsdfpp
