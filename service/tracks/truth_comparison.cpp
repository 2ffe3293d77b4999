#include "tracks/truth_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/model/covariance_ellipse.h"

namespace huetrack::tracks {
namespace {

constexpr double lock_within_m = 0.05;

}  // namespace

std::optional<double> TruthComparison::add(const object_tracking::ObjectEstimate& estimate) {
  const bool tracking = estimate.state == object_tracking::TrackState::tracking;
  if (tracking) tracking_.add({estimate.at, estimate.position, estimate.covariance});
  const auto truth = truth_->position(target_, estimate.at);
  if (!truth) return std::nullopt;
  if (!first_at_) first_at_ = estimate.at;
  ++sums_.sets;
  if (!estimate.has_position()) return std::nullopt;
  const Eigen::Vector3d error = estimate.position - *truth;
  const double error_m = error.norm();
  if (tracking && !(error_m <= truth::wrong_beyond_m)) ++sums_.wrong_tracking;  // NaN counts as wrong
  if (!sums_.lock_set && tracking && error_m <= lock_within_m) {
    sums_.lock_set = sums_.sets;
    sums_.lock_s = capture::seconds(estimate.at - *first_at_);
  }
  if (sums_.lock_set) {
    ++sums_.samples;
    sums_.rms_m += error_m * error_m;
    if (tracking) {
      ++sums_.tracking_samples;
      sums_.tracking_rms_m += error_m * error_m;
    }
    sums_.max_m = std::max(sums_.max_m, error_m);
    const double squared = nees(error, estimate.covariance);
    sums_.mean_nees += squared;
    if (squared <= calib::chi2_95_in_3d) sums_.share_inside_95 += 1;
  }
  return error_m;
}

TruthFigures TruthComparison::figures() const {
  TruthFigures figures = sums_;
  if (const auto n = static_cast<double>(figures.samples); n > 0) {
    figures.rms_m = std::sqrt(figures.rms_m / n);
    figures.tracking_rms_m = std::sqrt(figures.tracking_rms_m / static_cast<double>(figures.tracking_samples));
    figures.mean_nees /= n;
    figures.share_inside_95 /= n;
  }
  return figures;
}

std::string to_text(const TruthFigures& f) {
  if (!f.lock_set)
    return fmt::format(
        "never within {:.0f} mm of the truth while tracking, in {} sets; over {:.0f} cm off while tracking: {}",
        1e3 * lock_within_m, f.sets, 1e2 * truth::wrong_beyond_m, f.wrong_tracking);
  const std::string tracking =
      f.tracking_samples < f.samples ? fmt::format(" ({:.1f} mm while tracking)", 1e3 * f.tracking_rms_m) : "";
  return fmt::format(
      "locked in set {} ({:.3f} s); then {} samples, rms error {:.1f} mm{}, max {:.1f} mm, mean NEES {:.2f}, truth "
      "inside the 95 % ellipsoid {:.1f} %; over {:.0f} cm off while tracking: {} of {}",
      *f.lock_set, f.lock_s, f.samples, 1e3 * f.rms_m, tracking, 1e3 * f.max_m, f.mean_nees, 100 * f.share_inside_95,
      1e2 * truth::wrong_beyond_m, f.wrong_tracking, f.sets);
}

}  // namespace huetrack::tracks
