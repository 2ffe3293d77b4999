// The middle value, in one place.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace huetrack::calib {

// The median: of an even count the larger one of the two middle values (not their mean). of_none: for no values at all.
// T is a floating-point type or a duration; no value may be NaN.
template <typename T>
T median(std::vector<T> values, T of_none = 0) {
  if (values.empty()) return of_none;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace huetrack::calib
