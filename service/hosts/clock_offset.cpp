#include "hosts/clock_offset.h"

#include <algorithm>
#include <cmath>

namespace huetrack::hosts {
namespace {

constexpr double window_s = 40;
constexpr double usual_drift = 50e-6;  // of a quartz, standard deviation
constexpr double stamp_s = 20e-6;      // least sigma of an exchange: waking up and reading clocks
constexpr double of_one_way = 0.25;    // sigma of the path asymmetry, as a share of the fastest round trip
constexpr double step_sigmas = 6, least_step_s = 1e-3;
constexpr std::size_t steps_in_a_row = 4;
constexpr double contradiction_sigmas = 4;
// Extra tolerance on one machine, where a few slow exchanges mean nothing. A larger offset is real: the programs run in
// different time namespaces.
constexpr double contradiction_of_one_machine_s = 1e-3;

}  // namespace

void ClockOffset::add(const Exchange& exchange) {
  const auto there = exchange.request_received - exchange.request_sent,
             back = exchange.reply_sent - exchange.reply_received;
  const double took_s = capture::seconds((exchange.reply_received - exchange.request_sent) -
                                         (exchange.reply_sent - exchange.request_received));
  if (exchange.reply_received < exchange.request_sent || exchange.reply_sent < exchange.request_received || took_s < 0)
    return;
  if (!origin_) {
    origin_ = exchange.request_sent;
    base_s_ = capture::seconds(there);
  }
  const double half = 0.5 * (capture::seconds(there) - base_s_) + 0.5 * (capture::seconds(back) - base_s_);
  const Measured measured{
      .at_s = capture::seconds(exchange.reply_received - *origin_), .offset_s = half, .took_s = took_s};

  // A clock step: several exchanges in a row that are off by more than their round trip explains.
  if (is_known()) {
    const double off = std::abs(measured.offset_s - (offset_s_ + drift_ * (measured.at_s - middle_s_)));
    const double sigma_s = std::sqrt(measured_variance_s2(measured.at_s));
    const bool is_off = off > 0.5 * took_s + std::max(least_step_s, step_sigmas * sigma_s);
    off_in_a_row_ = is_off ? off_in_a_row_ + 1 : 0;
    if (is_off && off_in_a_row_ < steps_in_a_row) return;
    if (is_off) {
      const ClockSync sync = sync_;
      forget();
      sync_ = sync;
      add(exchange);
      return;
    }
  }
  measured_[next_] = measured;
  next_ = (next_ + 1) % kept;
  count_ = std::min(kept, count_ + 1);
  fit();
  weigh();
}

void ClockOffset::set_sync(const ClockSync& sync) {
  sync_ = sync;
  weigh();
}

void ClockOffset::fit() {
  const double now_s = measured_[(next_ + kept - 1) % kept].at_s;
  double fastest_s = 1e9;
  for (std::size_t i = 0; i < count_; ++i)
    if (now_s - measured_[i].at_s <= window_s) fastest_s = std::min(fastest_s, measured_[i].took_s);
  // The excess of a round trip over the fastest lies on one of its two paths: its error is at most half of it.
  const auto weight = [&](const Measured& measured) {
    const double sigma_s = stamp_s + 0.5 * (measured.took_s - fastest_s);
    return now_s - measured.at_s <= window_s ? 1 / (sigma_s * sigma_s) : 0.0;
  };
  double w = 0, wt = 0, wo = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double of = weight(measured_[i]);
    w += of, wt += of * measured_[i].at_s, wo += of * measured_[i].offset_s;
  }
  middle_s_ = wt / w;
  const double mean_s = wo / w;
  double tt = 1 / (usual_drift * usual_drift), to = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double of = weight(measured_[i]), t = measured_[i].at_s - middle_s_;
    tt += of * t * t, to += of * t * (measured_[i].offset_s - mean_s);
  }
  offset_s_ = mean_s;
  drift_ = to / tt;
  now_s_ = now_s;
  fastest_s_ = fastest_s;
  level_variance_s2_ = 1 / w;
  drift_variance_ = 1 / tt;
}

double ClockOffset::measured_variance_s2(double at_s) const {
  const double ahead_s = at_s - middle_s_, one_way_s = of_one_way * fastest_s_;
  return level_variance_s2_ + ahead_s * ahead_s * drift_variance_ + one_way_s * one_way_s;
}

void ClockOffset::weigh() {
  if (count_ == 0) return;
  const double measured_s2 = measured_variance_s2(now_s_), sync_s2 = sync_.sigma_s * sync_.sigma_s;
  const double off_s = base_s_ - capture::seconds(sync_.offset) + offset_s_ + drift_ * (now_s_ - middle_s_);
  const double least_s = sync_.sigma_s == 0 ? contradiction_of_one_machine_s : 0;
  is_contradicted_ = std::abs(off_s) > contradiction_sigmas * std::sqrt(measured_s2 + sync_s2) + least_s;
  share_ = is_contradicted_ || std::isinf(sync_s2) ? 1 : sync_s2 / (measured_s2 + sync_s2);
}

double ClockOffset::sigma_s(capture::Timestamp ours) const {
  if (!origin_) return 1;
  // Inverse-variance weighting: the combined variance is either one's variance times its weight.
  return std::sqrt(share_ * measured_variance_s2(capture::seconds(ours - *origin_)));
}

capture::Duration ClockOffset::at(capture::Timestamp ours) const {
  if (!origin_) return capture::Duration{0};
  const double at_s = capture::seconds(ours - *origin_);
  const capture::Duration measured =
      capture::duration_of(base_s_) + capture::duration_of(offset_s_ + drift_ * (at_s - middle_s_));
  if (share_ == 1) return measured;
  return sync_.offset + capture::duration_of(share_ * capture::seconds(measured - sync_.offset));
}

capture::Timestamp ClockOffset::ours(capture::Timestamp theirs) const {
  // The offset changes by some 50 us in a second: one iteration is enough.
  return theirs - at(theirs - at(theirs));
}

}  // namespace huetrack::hosts
