// How far the clock of another host is ahead of ours, from questions and answers that took some time each way, and from
// what else keeps the two clocks together.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "capture/frames/frame.h"

namespace huetrack::hosts {

// Four time stamps as in NTP (RFC 5905, section 8): asked and answer_came by our clock, question_came and answered by
// the other's.
struct Exchange {
  capture::Timestamp asked, question_came, answered, answer_came;
};

// What is known of the offset without asking: two programs of one machine have one clock (sigma 0), and chrony, ntpd or
// PTP say how well they keep one.
struct KeptTogether {
  capture::Duration offset{0};
  double sigma_s = std::numeric_limits<double>::infinity();  // standard deviation; infinite: nobody keeps them together
};

// Each exchange says the offset to half of what it took; those that took least say most. A line (offset and drift) is
// fitted to the recent past by least squares, each weighted by how much longer it took than the fastest; the drift of
// quartz clocks, some 50 ppm, is its prior. A clock that was stepped is followed after some exchanges that agree. What
// keeps the clocks together is a second measurement, and the two are weighed by their variances: PTP's microseconds
// are not spoilt by a network's jitter, and over a good network chrony's millisecond is made better. What keeps them is
// not believed where the exchanges contradict it. Departure from NTP: no steering and no filter of eight, as nothing is
// adjusted by it but time stamps. thread-compatible; never allocates.
class ClockOffset {
 public:
  // Those whose stamps make no sense (answered before it was asked) are left out.
  void add(const Exchange& exchange);
  void set_kept(const KeptTogether& kept);
  void forget() { *this = {}; }

  bool is_known() const { return count_ >= enough; }
  // Of the other's clock over ours, at this time of ours.
  capture::Duration at(capture::Timestamp ours) const;
  // What time it is with us when it is `theirs` there.
  capture::Timestamp ours(capture::Timestamp theirs) const;
  // Standard deviation of at(). What the way there takes longer than the way back is not seen in it, but bounded by
  // half of the fastest exchange, of which a quarter is taken.
  double sigma_s(capture::Timestamp ours) const;
  double drift() const { return drift_; }                    // seconds per second, as measured
  double round_trip_s() const { return fastest_s_; }         // of the fastest exchange that is remembered
  bool is_contradicted() const { return is_contradicted_; }  // what keeps the clocks together: by the exchanges

 private:
  static constexpr std::size_t kept = 128, enough = 4;
  struct Measured {
    double at_s = 0, offset_s = 0, took_s = 0;  // since origin_
  };
  void fit();
  void weigh();
  double measured_variance_s2(double at_s) const;

  std::optional<capture::Timestamp> origin_;
  double base_s_ = 0;  // what offsets are counted from: those of hosts without NTP may be years
  Measured measured_[kept];
  std::size_t count_ = 0, next_ = 0;
  std::size_t off_in_a_row_ = 0;
  double middle_s_ = 0, offset_s_ = 0, drift_ = 0, fastest_s_ = 0;
  double now_s_ = 0;  // of the newest exchange
  double level_variance_s2_ = 1, drift_variance_ = 0;
  KeptTogether together_;
  bool is_contradicted_ = false;
  double share_ = 1;  // of the exchanges; the remainder is what keeps the clocks together
};

}  // namespace huetrack::hosts
