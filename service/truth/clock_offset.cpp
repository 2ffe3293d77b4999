#include "truth/clock_offset.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace huetrack::truth {
namespace {

constexpr double furthest_s = 0.5;  // latencies of cameras are tenths of a second at most
constexpr double coarse_s = 5e-3, fine_s = 2.5e-4;
constexpr std::size_t fewest = 30, most_in_search = 500, most_kept = 4000;
constexpr double least_share = 0.8;   // share of the estimates with a truth, with the offset
constexpr double explains = 0.5;      // maximum ratio of the rms errors with and without it
constexpr double plausible_nees = 6;  // twice the value of a consistent covariance

struct Errors {
  std::size_t count = 0;
  double rms_m = std::numeric_limits<double>::infinity();
  double mean_nees = std::numeric_limits<double>::infinity();
};

Errors errors_at(const Truth& truth, std::string_view target, std::span<const Estimated> estimates, std::size_t every,
                 double offset_s) {
  const auto offset = std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(offset_s));
  Errors errors;
  double squares = 0, sum_nees = 0;
  for (std::size_t i = 0; i < estimates.size(); i += every) {
    const auto there = truth.position(target, estimates[i].at - offset);
    if (!there) continue;
    const Eigen::Vector3d error = estimates[i].position - *there;
    squares += error.squaredNorm();
    sum_nees += nees(error, estimates[i].covariance);
    ++errors.count;
  }
  if (errors.count == 0) return errors;
  errors.rms_m = std::sqrt(squares / double(errors.count));
  errors.mean_nees = sum_nees / double(errors.count);
  return errors;
}

}  // namespace

std::optional<TrackOffset> explaining_offset(const Truth& truth, std::string_view target,
                                             std::span<const Estimated> estimates) {
  const Errors before = errors_at(truth, target, estimates, 1, 0);
  if (estimates.size() < fewest || before.count < fewest) return std::nullopt;
  const std::size_t every = 1 + estimates.size() / most_in_search;
  double best_s = 0, least_m = before.rms_m;
  const auto search = [&](double around_s, double reach_s, double step_s) {
    const int steps = int(std::lround(reach_s / step_s));
    for (int k = -steps; k <= steps; ++k) {
      const double offset_s = around_s + k * step_s;
      const Errors errors = errors_at(truth, target, estimates, every, offset_s);
      if (errors.rms_m >= least_m || double(errors.count * every) < least_share * double(before.count)) continue;
      least_m = errors.rms_m, best_s = offset_s;
    }
  };
  search(0, furthest_s, coarse_s);
  search(best_s, coarse_s, fine_s);
  const Errors after = errors_at(truth, target, estimates, 1, best_s);
  if (!(after.rms_m < explains * before.rms_m) || !(after.mean_nees < plausible_nees)) return std::nullopt;
  return TrackOffset{
      .offset_s = best_s, .rms_m = after.rms_m, .rms_without_m = before.rms_m, .mean_nees = after.mean_nees};
}

void EstimatedSample::add(const Estimated& estimate) {
  if (seen_++ % every_ != 0) return;
  kept_.push_back(estimate);
  if (kept_.size() < most_kept) return;
  for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
  kept_.resize((kept_.size() + 1) / 2);
  every_ *= 2;
}

}  // namespace huetrack::truth
