// How far the clock of another host is ahead of ours, from questions and answers that took some time each way.
#pragma once

#include <cstddef>
#include <optional>

#include "capture/frame.h"

namespace huetrack::hosts {

// Four time stamps as in NTP (RFC 5905, section 8): asked and answer_came by our clock, question_came and answered by
// the other's.
struct Exchange {
  capture::Timestamp asked, question_came, answered, answer_came;
};

// Each exchange says the offset to half of what it took; those that took least say most. A line (offset and drift) is
// fitted to the recent past by least squares, each weighted by how much longer it took than the fastest; the drift of
// quartz clocks, some 50 ppm, is its prior. A clock that was stepped is followed after some exchanges that agree. As
// long as an offset cannot be told from none, there is none: clocks that chrony or PTP keep together, or that are one,
// are better than what can be measured of them. Departure from NTP: no steering and no filter of eight, as nothing is
// adjusted by it but time stamps. thread-compatible; never allocates.
class ClockOffset {
 public:
  // Those whose stamps make no sense (answered before it was asked) are left out.
  void add(const Exchange& exchange);
  void forget() { *this = {}; }

  bool is_known() const { return count_ >= enough; }
  // Of the other's clock over ours, at this time of ours; 0 while it cannot be told from that.
  capture::Duration at(capture::Timestamp ours) const;
  // What time it is with us when it is `theirs` there.
  capture::Timestamp ours(capture::Timestamp theirs) const;
  // Standard deviation of the offset now. What the way there takes longer than the way back is not seen in it, but
  // bounded by half of the fastest exchange, of which a quarter is taken.
  double sigma_s() const { return sigma_s_; }
  double drift() const { return drift_; }  // seconds per second
  bool is_corrected() const { return is_corrected_; }
  double fastest_s() const { return fastest_s_; }  // of the exchanges that it rests on

 private:
  static constexpr std::size_t kept = 128, enough = 4;
  struct Seen {
    double at_s = 0, offset_s = 0, took_s = 0;  // since origin_
  };
  void fit();

  std::optional<capture::Timestamp> origin_;
  double base_s_ = 0;  // what offsets are counted from: those of hosts without NTP may be years
  Seen seen_[kept];
  std::size_t count_ = 0, next_ = 0;
  std::size_t off_in_a_row_ = 0;
  bool is_corrected_ = false;
  double middle_s_ = 0, offset_s_ = 0, drift_ = 0, sigma_s_ = 1, fastest_s_ = 0;
};

}  // namespace huetrack::hosts
