// How a certificate is put to the test.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/certify/length_test.h"

namespace huetrack::certify {

// Of the lengths, the share that a certificate's expanded uncertainty covers.
inline double covered_by(double expanded_m, const std::vector<MeasuredLength>& lengths) {
  if (lengths.empty()) return 0;
  const auto inside = std::ranges::count_if(
      lengths, [&](const MeasuredLength& length) { return std::abs(length.error_m) <= expanded_m; });
  return static_cast<double>(inside) / static_cast<double>(lengths.size());
}

}  // namespace huetrack::certify
