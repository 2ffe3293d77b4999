#include "particle_filter/resample.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace huetrack {

bool normalize_weights(std::span<float> weight) {
  double sum = 0;
  for (const float w : weight) sum += static_cast<double>(w);
  if (!(sum > 0)) {
    std::ranges::fill(weight, 1.0f / static_cast<float>(weight.size()));
    return false;
  }
  const auto scale = static_cast<float>(1.0 / sum);
  for (float& w : weight) w *= scale;
  return true;
}

bool normalize_log_weights(std::span<const float> log_weight, std::span<float> weight) {
  const float largest = *std::ranges::max_element(log_weight);
  if (!std::isfinite(largest)) {
    std::ranges::fill(weight, 1.0f / static_cast<float>(weight.size()));
    return false;
  }
  for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = std::exp(log_weight[i] - largest);
  return normalize_weights(weight);
}

double effective_sample_size(std::span<const float> weight) {
  double sum = 0;
  for (const float w : weight) sum += static_cast<double>(w) * static_cast<double>(w);
  return std::clamp(1.0 / sum, 1.0, static_cast<double>(weight.size()));
}

void systematic_ancestors(std::span<const float> weight, double offset, std::span<std::uint32_t> ancestor) {
  // Each particle says how many of the comb's teeth lie below its cumulative weight; no search, no inner loop that a
  // branch predictor could miss much.
  const auto n = static_cast<double>(ancestor.size());
  double cumulative = 0;
  std::size_t done = 0;
  for (std::size_t i = 0; i < weight.size() && done < ancestor.size(); ++i) {
    cumulative += static_cast<double>(weight[i]);
    const double teeth = std::ceil(cumulative * n - offset);
    const auto below = std::min(ancestor.size(), static_cast<std::size_t>(std::max(0.0, teeth)));
    for (; done < below; ++done) ancestor[done] = static_cast<std::uint32_t>(i);
  }
  // Rounding can leave the last tooth above a sum of 0.9999999: it belongs to the last particle that weighs anything.
  std::size_t last = weight.size() - 1;
  while (last > 0 && !(weight[last] > 0)) --last;
  for (; done < ancestor.size(); ++done) ancestor[done] = static_cast<std::uint32_t>(last);
}

}  // namespace huetrack
