// Estimates the offset of another host's clock to ours, from round-trip exchanges and from NTP's or PTP's own error.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "capture/frames/frame.h"

namespace huetrack::hosts {

// Four time stamps as in NTP (RFC 5905, section 8): the first and the last by our clock, the others by the other
// host's.
struct Exchange {
  capture::Timestamp request_sent, request_received, reply_sent, reply_received;
};

// A prior of the offset without exchanges: two programs of one machine share a clock (sigma 0), and chrony, ntpd or PTP
// report how well they synchronise two machines.
struct ClockSync {
  capture::Duration offset{0};
  double sigma_s = std::numeric_limits<double>::infinity();  // infinite: the clocks are not synchronised
};

// Each exchange measures the offset to within half of its round trip. A line (offset and drift) is fitted to the recent
// past by weighted least squares; an exchange's sigma is its round trip in excess of the fastest, and the drift of
// quartz clocks, some 50 ppm, is the prior of the slope. After a clock step the fit restarts, once several exchanges
// agree. ClockSync is a second measurement, weighted by its variance, and is ignored while the exchanges contradict it.
// Unlike NTP there is no steering and no clock filter of eight samples: only time stamps are corrected.
// thread-compatible; never allocates.
class ClockOffset {
 public:
  void add(const Exchange& exchange);  // ignores impossible stamps (a reply before its request)
  void set_sync(const ClockSync& sync);
  void forget() { *this = {}; }

  bool is_known() const { return count_ >= enough; }
  // The other clock's lead over ours, at our time.
  capture::Duration at(capture::Timestamp ours) const;
  // Our time of their time.
  capture::Timestamp ours(capture::Timestamp theirs) const;
  // Standard deviation of at(). Asymmetric paths are not observable; they are bounded by half of the fastest round
  // trip, of which half is taken as sigma.
  double sigma_s(capture::Timestamp ours) const;
  double drift() const { return drift_; }                    // seconds per second, as measured
  double round_trip_s() const { return fastest_s_; }         // of the fastest remembered exchange
  bool is_contradicted() const { return is_contradicted_; }  // the exchanges contradict ClockSync

 private:
  static constexpr std::size_t kept = 128, enough = 4;
  struct Measured {
    double at_s = 0, offset_s = 0, took_s = 0;  // since origin_
  };
  void fit();
  void weigh();
  double measured_variance_s2(double at_s) const;

  std::optional<capture::Timestamp> origin_;
  double base_s_ = 0;  // offsets are relative to this: without NTP they may be years
  Measured measured_[kept];
  std::size_t count_ = 0, next_ = 0;
  std::size_t off_in_a_row_ = 0;
  double middle_s_ = 0, offset_s_ = 0, drift_ = 0, fastest_s_ = 0;
  double now_s_ = 0;  // of the newest exchange
  double level_variance_s2_ = 1, drift_variance_ = 0;
  ClockSync sync_;
  bool is_contradicted_ = false;
  double share_ = 1;  // weight of the exchanges; the rest is that of sync_
};

}  // namespace huetrack::hosts
