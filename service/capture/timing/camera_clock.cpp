#include "capture/timing/camera_clock.h"

#include <algorithm>
#include <cmath>

namespace huetrack::capture {
namespace {

// Frames: 10 s at 15 fps, 2.5 s at 60 fps. Averages 0.5 ms of jitter to some 0.1 ms; an oscillator drifts by less
// meanwhile.
constexpr int memory = 150;
constexpr double first_jitter_s = 1e-3;      // prior of an unknown driver: USB's frame of 1 ms
constexpr double least_jitter_s = 2e-6;      // finer than any interrupt; stamps with six digits round by half of it
constexpr double off_sigmas = 4;             // a stamp further off the line is late
constexpr double variance_share = 1.0 / 30;  // weight of each new stamp in the jitter's variance
constexpr int off_in_a_row_to_begin = 3;     // late stamps come alone: three in a row are another line
constexpr double longest_gap_s = 2;          // after a longer one the camera may have been restarted, in another phase
// Largest jitter of a regular camera, as a share of its period. A camera that waits for light, or for its host, has
// more; its stamps are then the best estimate.
constexpr double even_share = 0.05;
constexpr int even_count = 10;          // stamps on a line before it is used
constexpr double largest_misfit = 0.3;  // of a period; beyond it the number of lost frames is ambiguous

}  // namespace

void CameraClock::begin(Timestamp stamp) {
  origin_ = stamp;
  phase_s_ = 0;
  period_s_ = 0;
  count_ = 1;
  off_in_a_row_ = 0;
}

Timestamp CameraClock::smoothed(Timestamp stamp) {
  const double since_last_s = last_stamp_ ? seconds(stamp - *last_stamp_) : 0;
  const bool is_new = !last_stamp_ || since_last_s <= 0 || since_last_s > longest_gap_s;
  if (since_last_s <= 0) last_out_.reset();
  last_stamp_ = stamp;

  double at_s = 0;
  if (is_new) {
    variance_s2_ = first_jitter_s * first_jitter_s;
    begin(stamp);
  } else {
    const double measured_s = seconds(stamp - *origin_);
    const double step_s = measured_s - phase_s_;
    at_s = measured_s;
    if (count_ == 1) {
      period_s_ = step_s;
      phase_s_ = measured_s;
      count_ = 2;
    } else {
      const double periods = std::round(step_s / period_s_);
      const double misfit_s = step_s - periods * period_s_;
      const bool is_other_rate = periods < 1 || std::abs(misfit_s) > largest_misfit * period_s_;
      const double sigma = std::sqrt(variance_s2_);
      // The variance of the fit's prediction one step ahead, relative to that of a stamp.
      const double n = count_;
      const double line_share = 2 * (2 * n + 1) / (n * (n - 1));
      const double limit_s = off_sigmas * sigma * std::sqrt(1 + line_share);
      const bool is_off = std::abs(misfit_s) > limit_s;
      off_in_a_row_ = is_off ? off_in_a_row_ + 1 : 0;
      if (is_other_rate || off_in_a_row_ >= off_in_a_row_to_begin) {
        // A camera that restarts again and again is irregular.
        const double off_s = std::min(std::abs(misfit_s), period_s_ / 2);
        variance_s2_ += variance_share * (off_s * off_s - variance_s2_);
        begin(stamp);
        at_s = 0;
      } else {
        const double clamped_s = std::clamp(misfit_s, -limit_s, limit_s);
        phase_s_ += periods * period_s_;
        if (!is_off) {
          const double m = std::min(count_ + 1, memory);
          phase_s_ += 2 * (2 * m - 1) / (m * (m + 1)) * clamped_s;
          period_s_ += 6 / (m * (m + 1)) * clamped_s / periods;
          count_ = static_cast<int>(m);
        }
        const double of_a_stamp = clamped_s * clamped_s / (1 + line_share);
        variance_s2_ += variance_share * (of_a_stamp - variance_s2_);
        variance_s2_ = std::max(variance_s2_, least_jitter_s * least_jitter_s);
        if (count_ >= even_count && std::sqrt(variance_s2_) < even_share * period_s_) at_s = phase_s_;
      }
    }
  }
  Timestamp out = *origin_ + duration_of(at_s);
  if (last_out_) out = std::max(out, *last_out_ + Duration(1));
  last_out_ = out;
  return out;
}

std::optional<double> CameraClock::sigma_s() const {
  if (count_ < 3) return std::nullopt;
  const double n = count_;
  return std::sqrt(variance_s2_ * 2 * (2 * n - 1) / (n * (n + 1)));
}

}  // namespace huetrack::capture
