// How far errors are spread, whatever the outliers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace tsdfpp {

// Of an even number the upper one; 0 of none.
template <typename T>
T MiddleOne(std::vector<T> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// 1.4826 times the median of the errors' sizes, which is the deviation of normal ones, in their
// unit; 0 of none.
inline double RobustDeviation(std::vector<float> sizes) {
  constexpr double kNormalMedian = 1.4826;
  return kNormalMedian * static_cast<double>(MiddleOne(std::move(sizes)));
}

}  // namespace tsdfpp
