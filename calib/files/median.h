// Median and quantiles.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace huetrack::files {

// Median; reorders the values.
template <typename T>
T median_in_place(std::span<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Quantile, share 0 to 1: the nearest of the values, ties rounded up. Reorders them; must not be empty.
template <typename T>
T quantile_in_place(std::span<T> values, double share) {
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

// Median; of an even count the larger of the two middle values. if_empty: the result for no values. T: a floating-point
// type or a duration; no NaN.
template <typename T>
T median(std::vector<T> values, T if_empty = 0) {
  return values.empty() ? if_empty : median_in_place(std::span(values));
}

}  // namespace huetrack::files
