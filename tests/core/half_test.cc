// Half precision against OpenCV's, and the lanes of every instruction set against the numbers.
#include "core/half.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/mapper/half_test.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/half_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Rounds, stores and loads; the count is a multiple of 16.
void ThroughHalves(const float* from, std::size_t count, float* to) {
  const hn::CappedTag<float, 16> df;
  std::vector<Half> halves(count);
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    StoreHalves(df, RoundLanesToHalf(df, hn::LoadU(df, from + i)), &halves[i]);
    hn::StoreU(LoadHalves(df, &halves[i]), df, to + i);
  }
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {
namespace {

HWY_EXPORT(ThroughHalves);

float FromBits(unsigned bits) {
  return static_cast<float>(
      cv::float16_t(cv::float16_t::fromBits(static_cast<std::uint16_t>(bits))));
}

// Each half-precision number below `end`, what lies midway to the next, and their neighbours; of
// both signs.
std::vector<float> Floats(float end) {
  std::vector<float> values;
  for (unsigned bits = 0; FromBits(bits) < end; ++bits) {
    const float here = FromBits(bits);
    const float middle = here + (FromBits(bits + 1) - here) / 2;
    for (const float of : {here, middle}) {
      for (const float value : {std::nextafter(of, -1.0F), of, std::nextafter(of, 1e9F)}) {
        values.push_back(value);
        values.push_back(-value);
      }
    }
  }
  values.resize(values.size() / 16 * 16);
  return values;
}

void ExpectSame(float actual, float expected, float of) {
  ASSERT_EQ(actual, expected) << of;
  // What is nothing has no sign.
  ASSERT_EQ(std::signbit(actual), expected < 0) << of;
}

TEST(HalfTest, HoldsEveryNumberThatThereIs) {
  for (unsigned bits = 0; bits < 0x10000U; ++bits) {
    const float expected = FromBits(bits);
    if (std::isnan(expected)) {
      ASSERT_TRUE(std::isnan(float{Half(expected)})) << bits;
    } else {
      ASSERT_EQ(float{Half(expected)}, expected) << bits;
    }
  }
}

#ifdef __SSE2__
TEST(HalfTest, IsTheSameWhereSubnormalFloatsCountAsZero) {
  for (unsigned bits = 0; bits < 0x7C00U; ++bits) {
    const float expected = FromBits(bits);
    const unsigned mode = _mm_getcsr();
    _mm_setcsr(mode | 0x8040U);  // flush to zero, and denormals are zero
    const float held = Half(expected);
    _mm_setcsr(mode);
    ASSERT_EQ(held, expected) << bits;
  }
}
#endif

TEST(HalfTest, RoundsAsOpenCvDoes) {
  for (const float value : Floats(std::numeric_limits<float>::infinity())) {
    ExpectSame(Half(value), static_cast<float>(cv::float16_t(value)), value);
    if (HasFatalFailure()) return;
  }
}

TEST(HalfTest, LanesOfEveryInstructionSetRoundLikeOne) {
  const std::vector<float> values = Floats(0x1p15F);
  std::vector<float> back(values.size());
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    HWY_DYNAMIC_DISPATCH(ThroughHalves)(values.data(), values.size(), back.data());
    hwy::SetSupportedTargetsForTest(0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      ExpectSame(back[i], RoundToHalf(values[i]), values[i]);
      if (HasFatalFailure()) {
        ADD_FAILURE() << hwy::TargetName(target);
        return;
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
#endif
