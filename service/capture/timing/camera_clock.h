// Smooths a camera's time stamps by estimating its frame clock.
#pragma once

#include <optional>

#include "capture/frames/frame.h"

namespace huetrack::capture {

// A sensor exposes frames at a constant period; the driver stamps them with jitter (scheduling, USB microframes) and
// sometimes milliseconds late. Phase and period are estimated by an expanding-memory polynomial filter of degree 1
// (Morrison 1969, ch. 10; Brookner 1998, ch. 1.2): the least-squares line at first, an alpha-beta filter after `memory`
// frames. Outliers are clamped. Causal, and a function of the stamps alone, so a replay gives the live times bit for
// bit. Lost frames show as whole periods; sequence numbers are not needed.
//
// The filter restarts after a gap, a clock step or a change of rate (three outliers in a row). Until it has a line, and
// while a camera's period is irregular, it returns the stamps themselves. Output is strictly ascending as long as the
// stamps are. thread-compatible.
class CameraClock {
 public:
  // Returns the smoothed stamp. A stamp that does not ascend restarts the filter.
  Timestamp smoothed(Timestamp stamp);

  // Standard deviation of the newest smoothed stamp, from the observed jitter. nullopt: too few stamps.
  std::optional<double> sigma_s() const;
  // nullopt: not known yet
  std::optional<double> period_s() const { return period_s_ > 0 ? std::optional(period_s_) : std::nullopt; }

 private:
  void begin(Timestamp stamp);

  std::optional<Timestamp> origin_;  // start of the line; all else is in seconds since then
  double phase_s_ = 0;               // of the newest frame
  double period_s_ = 0;              // 0: not known yet
  double variance_s2_ = 0;           // of a stamp about the line, outliers excepted
  int count_ = 0;                    // stamps in the line, at most `memory`
  int off_in_a_row_ = 0;
  std::optional<Timestamp> last_out_, last_stamp_;
};

}  // namespace huetrack::capture
