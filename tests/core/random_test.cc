#include "core/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace tsdfpp {
namespace {

// The uniform numbers of four 32-bit words.
std::array<double, 4> Scaled(std::array<std::uint32_t, 4> words) {
  std::array<double, 4> uniform{};
  for (std::size_t i = 0; i < 4; ++i) uniform[i] = words[i] / 4294967296.0;
  return uniform;
}

// The three known answers for philox4x32-10 in Random123's kat_vectors. Counter words are (a low, a
// high, b, stream), key words the seed's low and high half.
TEST(Random, KnownAnswersOfRandom123) {
  EXPECT_EQ(UniformDraw(0, 0, 0, 0), Scaled({0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(UniformDraw(~0ULL, ~0U, ~0ULL, ~0U),
            Scaled({0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(UniformDraw(0x299f31d0a4093822ULL, 0x03707344U, 0x85a308d3243f6a88ULL, 0x13198a2eU),
            Scaled({0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Random, DrawsDoNotDependOnOrder) {
  constexpr std::uint64_t kDraws = 1000;
  std::vector<std::array<double, 4>> forwards;
  for (std::uint64_t i = 0; i < kDraws; ++i) forwards.push_back(UniformDraw(3, 1, i, 5));
  for (std::uint64_t i = kDraws; i-- > 0;) EXPECT_EQ(UniformDraw(3, 1, i, 5), forwards[i]);
}

TEST(Random, EveryKeyMatters) {
  const auto draw = UniformDraw(1, 2, 3, 4);
  EXPECT_NE(UniformDraw(2, 2, 3, 4), draw);
  EXPECT_NE(UniformDraw(1 + (1ULL << 32U), 2, 3, 4), draw);
  EXPECT_NE(UniformDraw(1, 3, 3, 4), draw);
  EXPECT_NE(UniformDraw(1, 2, 4, 4), draw);
  EXPECT_NE(UniformDraw(1, 2, 3 + (1ULL << 32U), 4), draw);
  EXPECT_NE(UniformDraw(1, 2, 3, 5), draw);
}

TEST(Random, IsUniform) {
  constexpr int kDraws = 100000;
  // Six standard deviations of the mean (1 / sqrt(12 n)) and of the second moment (0.3 / sqrt(n)).
  constexpr double kMeanTolerance = 6 * 0.2887 / 632.0;
  constexpr double kSquareTolerance = 6 * 0.2982 / 632.0;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < kDraws; ++i) {
    for (const double u : UniformDraw(11, 0, static_cast<std::uint64_t>(i))) {
      ASSERT_GE(u, 0.0);
      ASSERT_LT(u, 1.0);
      sum += u;
      squares += u * u;
    }
  }
  EXPECT_NEAR(sum / (4 * kDraws), 0.5, kMeanTolerance);
  EXPECT_NEAR(squares / (4 * kDraws), 1.0 / 3, kSquareTolerance);
}

TEST(Random, GaussianIsTheTransformOfTheUniformDraw) {
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const auto u = UniformDraw(4, 9, i, 2);
    const auto normal = GaussianDraw(4, 9, i, 2);
    // Box and Muller backwards: radius and angle of the first pair.
    const double squares = normal[0] * normal[0] + normal[1] * normal[1];
    EXPECT_NEAR(1 - std::exp(-squares / 2), u[0], 1e-12);
    EXPECT_NEAR(std::sin(2 * std::numbers::pi * u[3]) * std::hypot(normal[2], normal[3]), normal[3],
                1e-12);
  }
}

TEST(Random, IsGaussian) {
  constexpr int kDraws = 100000;
  constexpr double kCount = 4.0 * kDraws;
  double sum = 0;
  double squares = 0;
  double fourths = 0;
  double pairs = 0;
  int beyond_two = 0;
  for (int i = 0; i < kDraws; ++i) {
    const auto normal = GaussianDraw(11, 0, static_cast<std::uint64_t>(i));
    for (std::size_t k = 0; k < 4; ++k) {
      sum += normal[k];
      squares += normal[k] * normal[k];
      fourths += std::pow(normal[k], 4);
      pairs += normal[k] * normal[(k + 1) % 4];
      beyond_two += normal[k] > 2 ? 1 : 0;
    }
  }
  // Six standard deviations of each mean: of x it is 1, of x^2 sqrt(2), of x^4 sqrt(96), of xy 1.
  const double six = 6 / std::sqrt(kCount);
  EXPECT_NEAR(sum / kCount, 0, six);
  EXPECT_NEAR(squares / kCount, 1, six * std::sqrt(2.0));
  EXPECT_NEAR(fourths / kCount, 3, six * std::sqrt(96.0));
  EXPECT_NEAR(pairs / kCount, 0, six);
  const double tail = std::erfc(std::sqrt(2.0)) / 2;
  EXPECT_NEAR(beyond_two / kCount, tail, six * std::sqrt(tail));
}

}  // namespace
}  // namespace tsdfpp
