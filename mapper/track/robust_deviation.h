// How far errors are spread, whatever the outliers.
#pragma once

#include <algorithm>
#include <vector>

namespace tsdfpp {

// 1.4826 times the median of the errors' sizes, which is the deviation of normal ones; 0 of none.
inline double RobustDeviation(std::vector<float> sizes) {
  constexpr double kNormalMedian = 1.4826;
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return kNormalMedian * static_cast<double>(*middle);
}

}  // namespace tsdfpp
