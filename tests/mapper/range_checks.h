// What tests of the voxels' range share: directions to its ends, and how what lies beyond is
// refused.
#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp::test {

inline constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

inline const std::vector<Index3>& Directions() {
  static const std::vector<Index3> directions{{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                              {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
  return directions;
}
inline Index3 Times(const Index3& direction, int blocks) {
  return {direction.x * blocks, direction.y * blocks, direction.z * blocks};
}

// A sentence about data, with `what` in it.
inline void ExpectRefused(const Expected<void>& status, const std::string& what) {
  ASSERT_FALSE(status.has_value()) << what;
  EXPECT_EQ(status.error().kind, ErrorKind::kData);
  const std::string& message = status.error().message;
  EXPECT_NE(message.find(what), std::string::npos) << message;
  EXPECT_LT(message.size(), 500U) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

}  // namespace tsdfpp::test
