// The middle of measured times.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tsdfpp {

// The upper one of the middle two where their number is even; there must be at least one.
inline double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace tsdfpp
