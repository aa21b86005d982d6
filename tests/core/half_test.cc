// Half precision against OpenCV's.
#include "core/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/core/half_values.h"

#ifdef __SSE2__
#include <xmmintrin.h>
#endif

namespace tsdfpp {
namespace {

TEST(HalfTest, HoldsEveryNumberThatThereIs) {
  for (unsigned bits = 0; bits < 0x10000U; ++bits) {
    const float expected = test::HalfFromBits(bits);
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
    const float expected = test::HalfFromBits(bits);
    const unsigned mode = _mm_getcsr();
    _mm_setcsr(mode | 0x8040U);  // flush to zero, and denormals are zero
    const float held = Half(expected);
    _mm_setcsr(mode);
    ASSERT_EQ(held, expected) << bits;
  }
}
#endif

TEST(HalfTest, RoundsAsOpenCvDoes) {
  for (const float value : test::FloatsAtHalves(std::numeric_limits<float>::infinity())) {
    test::ExpectSameHalf(Half(value), static_cast<float>(cv::float16_t(value)), value);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace tsdfpp
