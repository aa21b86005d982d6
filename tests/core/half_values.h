// Numbers at which rounding to half precision is tested.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace tsdfpp::test {

// The half-precision number with these bits, by OpenCV.
inline float HalfFromBits(unsigned bits) {
  return static_cast<float>(
      cv::float16_t(cv::float16_t::fromBits(static_cast<std::uint16_t>(bits))));
}

// Each half-precision number below `end`, what lies midway to the next, and their neighbours; of
// both signs.
inline std::vector<float> FloatsAtHalves(float end) {
  std::vector<float> values;
  for (unsigned bits = 0; HalfFromBits(bits) < end; ++bits) {
    const float here = HalfFromBits(bits);
    const float middle = here + (HalfFromBits(bits + 1) - here) / 2;
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

inline void ExpectSameHalf(float actual, float expected, float of) {
  ASSERT_EQ(actual, expected) << of;
  // What is nothing has no sign.
  ASSERT_EQ(std::signbit(actual), expected < 0) << of;
}

}  // namespace tsdfpp::test
