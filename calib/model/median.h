// The middle value, and any other quantile, in one place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace huetrack::calib {

// The median of some values, whose order it changes: nothing is copied.
template <typename T>
T median_in_place(std::span<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The value that stands at the share of the way from the least to the largest, 0 to 1, as the nearest of those given
// (rounded up in the middle); changes their order. There must be one.
template <typename T>
T quantile_in_place(std::span<T> values, double share) {
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

// The median: of an even count the larger one of the two middle values (not their mean). of_none: for no values at all.
// T is a floating-point type or a duration; no value may be NaN.
template <typename T>
T median(std::vector<T> values, T of_none = 0) {
  return values.empty() ? of_none : median_in_place(std::span(values));
}

}  // namespace huetrack::calib
