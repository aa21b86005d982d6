// The maps of a surface: the kernels of vectors and the plain ones give the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "mapper/segment/surface_kernels.h"
#include "mapper/segment/surface_maps.h"
#include "tests/mapper/kernel_twins.h"
#include "tests/mapper/segment_scenes.h"

namespace tsdfpp {
namespace {

using Floats = std::vector<float>;

// Values along a row of a surface whose depth jumps here and there: inverse depths, some missing,
// some beside what a camera gives.
float RandomValue(Dice& dice, float near) {
  switch (dice.Whole(16)) {
    case 0:
    case 1:
      return 0;  // nothing known
    case 2:
      return -0.0F;
    case 3:
      return std::numeric_limits<float>::quiet_NaN();
    case 4:
      return std::numeric_limits<float>::infinity();
    case 5:
      return -near;
    case 6:
      return near;  // exactly the same
    case 7:
      return near * 0x1p-130F;
    case 8:
    case 9:
      return static_cast<float>(dice.Uniform(0.05, 20));
    default:  // as noise and slopes part neighbours
      return near * static_cast<float>(1 + dice.Uniform(-0.03, 0.03));
  }
}

Floats RandomRow(Dice& dice, std::size_t pixels, float near) {
  Floats row(pixels);
  for (float& value : row) value = RandomValue(dice, near);
  return row;
}

bool SameRows(const Floats& a, const Floats& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), SameBits);
}

// Calls test(dice, pixels, near) with widths below, at and above each vector's, with every
// instruction set.
template <typename Test>
void ForRandomRows(std::uint64_t seed, const Test& test) {
  OnEveryInstructionSet([&] {
    Dice dice(seed);
    for (std::size_t pixels = 0; pixels <= 70; ++pixels) {
      for (int round = 0; round < 6; ++round) {
        test(dice, pixels, static_cast<float>(dice.Uniform(0.2, 3)));
        if (::testing::Test::HasFatalFailure()) return;
      }
    }
  });
}

// Of a camera: exact, or with noise.
float RandomNoise(Dice& dice) {
  return dice.Whole(3) == 0 ? 0.0F : static_cast<float>(dice.Uniform(0.2, 3));
}

TEST(SurfaceTwins, TheSamePairs) {
  int taken = 0;
  int left = 0;
  ForRandomRows(31, [&](Dice& dice, std::size_t pixels, float near) {
    const Floats before = RandomRow(dice, pixels, near);
    const Floats q = RandomRow(dice, pixels, near);
    const Floats behind = RandomRow(dice, pixels, near);
    const PairScale scale{RandomNoise(dice), 7.3F, 0.1F, 0.004F};
    Floats sum = q;
    Floats count(pixels, 1.0F);
    Floats plain_sum = sum;
    Floats plain_count = count;
    AddPairs(before.data(), q.data(), behind.data(), pixels, scale, sum.data(), count.data());
    plain::AddPairs(before.data(), q.data(), behind.data(), pixels, scale, plain_sum.data(),
                    plain_count.data());
    ASSERT_TRUE(SameRows(sum, plain_sum)) << pixels;
    ASSERT_TRUE(SameRows(count, plain_count)) << pixels;
    for (const float c : count) ++(c > 1 ? taken : left);
  });
  EXPECT_GT(taken, 1000);
  EXPECT_GT(left, 1000);
}

TEST(SurfaceTwins, TheSameNormalsAndNoise) {
  int known = 0;
  int grazing = 0;
  ForRandomRows(32, [&](Dice& dice, std::size_t pixels, float near) {
    const Floats q = RandomRow(dice, pixels, near);
    const Floats before = RandomRow(dice, pixels, near);
    const Floats after = RandomRow(dice, pixels, near);
    const Floats above = RandomRow(dice, pixels, near);
    const Floats below = RandomRow(dice, pixels, near);
    Floats ray_x(pixels);
    for (float& x : ray_x) x = static_cast<float>(dice.Uniform(-0.7, 0.7));
    const NormalRow row{q.data(),
                        before.data(),
                        after.data(),
                        above.data(),
                        below.data(),
                        ray_x.data(),
                        static_cast<float>(dice.Uniform(-0.5, 0.5))};
    const NormalScale scale{RandomNoise(dice), 3, 1 / 525.0F, 0.25F, 525, 520};
    Floats normal(3 * pixels);
    Floats sigma(pixels);
    Floats plain_normal(3 * pixels);
    Floats plain_sigma(pixels);
    NormalsOfRow(row, pixels, scale, normal.data(), sigma.data());
    plain::NormalsOfRow(row, pixels, scale, plain_normal.data(), plain_sigma.data());
    ASSERT_TRUE(SameRows(normal, plain_normal)) << pixels;
    ASSERT_TRUE(SameRows(sigma, plain_sigma)) << pixels;
    for (std::size_t u = 0; u < pixels; ++u) {
      if (!(normal[3 * u + 2] < 0)) continue;
      ++(normal[3 * u + 2] > -0.3F ? grazing : known);
    }
  });
  EXPECT_GT(known, 1000);
  EXPECT_GT(grazing, 1000);
}

TEST(SurfaceTwins, TheSameLinks) {
  int linked = 0;
  int jumps = 0;
  ForRandomRows(33, [&](Dice& dice, std::size_t pixels, float near) {
    const Floats before = RandomRow(dice, pixels, near);
    const Floats q0 = RandomRow(dice, pixels, near);
    const Floats q1 = RandomRow(dice, pixels, near);
    const Floats behind = RandomRow(dice, pixels, near);
    Floats sigma0 = RandomRow(dice, pixels, 0.004F);
    Floats sigma1 = RandomRow(dice, pixels, 0.004F);
    const JumpRow row{before.data(), q0.data(),     q1.data(),
                      behind.data(), sigma0.data(), sigma1.data()};
    const JumpScale scale{RandomNoise(dice), 1.5F / 525, 0.25F, 5.7F / 525};
    // What was there must be written over.
    std::vector<std::uint8_t> found(pixels, 77);
    std::vector<std::uint8_t> expected(pixels, 99);
    LinksOfRow(row, pixels, scale, found.data());
    plain::LinksOfRow(row, pixels, scale, expected.data());
    ASSERT_EQ(found, expected) << pixels;
    for (const std::uint8_t link : found) ++(link == 1 ? linked : jumps);
  });
  EXPECT_GT(linked, 1000);
  EXPECT_GT(jumps, 1000);
}

TEST(SurfaceTwins, TheSameTurns) {
  int turned = 0;
  int straight = 0;
  ForRandomRows(34, [&](Dice& dice, std::size_t pixels, float near) {
    const Floats z0 = RandomRow(dice, pixels, near);
    const Floats z = RandomRow(dice, pixels, near);
    const Floats z1 = RandomRow(dice, pixels, near);
    const Floats sigma = RandomRow(dice, pixels, 0.004F);
    const ChordScale scale{0.27F, RandomNoise(dice) * 0.05F};
    // Chords along a row have rays of their own and one slant; those along columns the reverse.
    for (const std::size_t stride : {std::size_t{1}, std::size_t{0}}) {
      constexpr std::size_t kStep = 4;
      Floats along(pixels + 2 * kStep + 1);
      for (std::size_t u = 0; u < along.size(); ++u) {
        along[u] = (static_cast<float>(u) - 20.0F) / 100;
      }
      Floats slant(pixels + 1);
      for (float& s : slant) s = static_cast<float>(dice.Uniform(1, 1.3));
      const ChordRow row{z0.data(),
                         z.data(),
                         z1.data(),
                         along.data(),
                         along.data() + kStep,
                         along.data() + 2 * kStep,
                         stride,
                         slant.data(),
                         sigma.data()};
      std::vector<std::uint8_t> found(pixels, 77);
      std::vector<std::uint8_t> expected(pixels, 99);
      TurnsOfRow(row, pixels, scale, found.data());
      plain::TurnsOfRow(row, pixels, scale, expected.data());
      ASSERT_EQ(found, expected) << pixels << ", stride " << stride;
      for (const std::uint8_t turn : found) ++(turn == 255 ? turned : straight);
    }
  });
  EXPECT_GT(turned, 1000);
  EXPECT_GT(straight, 1000);
}

// Whole images, by the functions that ask which kernels are used.
TEST(SurfaceTwins, TheSameMaps) {
  const Frame exact = test::Look({test::Table(), test::Block(7, {-0.1, 0, 0.08}, {0.1, 0.06, 0.08}),
                                  reference::Sphere(5, {9, 9, 200}, {0.16, 0, 0.08}, 0.08)});
  const Frame noisy = test::WithNoise(exact, 6);
  const auto same = [](const cv::Mat& a, const cv::Mat& b) {
    return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
           std::equal(a.datastart, a.dataend, b.datastart, b.dataend);
  };
  for (const auto& [frame, config] :
       {std::pair{exact, test::ExactConfig()}, std::pair{noisy, DepthSegmentsConfig{}}}) {
    SurfaceMapper mapper;
    const SurfaceMaps& by_vectors = mapper.Compute(frame.depth, frame.intrinsics, config);
    SurfaceMapper plain_mapper;
    const PlainKernels plain;
    const SurfaceMaps& plainly = plain_mapper.Compute(frame.depth, frame.intrinsics, config);
    EXPECT_TRUE(same(by_vectors.inverse_depth, plainly.inverse_depth));
    EXPECT_TRUE(same(by_vectors.normal, plainly.normal));
    EXPECT_TRUE(same(by_vectors.sigma, plainly.sigma));
    EXPECT_TRUE(same(by_vectors.reach_right, plainly.reach_right));
    EXPECT_TRUE(same(by_vectors.reach_down, plainly.reach_down));
    EXPECT_TRUE(same(by_vectors.concave, plainly.concave));
  }
}

}  // namespace
}  // namespace tsdfpp
