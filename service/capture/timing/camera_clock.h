// A camera's own clock, found in its driver's time stamps.
#pragma once

#include <optional>

#include "capture/frames/frame.h"

namespace huetrack::capture {

// A sensor exposes frames at an even period of its own; the driver stamps them with jitter (scheduling, USB
// microframes) and now and then late by milliseconds. Phase and period are followed by an expanding-memory polynomial
// filter of degree 1 (Morrison 1969, ch. 10; Brookner 1998, ch. 1.2), which is the least-squares line while it is young
// and an alpha-beta filter from `memory` frames on; a stamp that is far off the line is not believed. Causal, and a
// function of the stamps alone: a replay of them gives the same times as the live camera, bit for bit. Lost frames are
// found as whole periods, so that no sequence numbers are needed.
//
// It begins anew where the stamps show no line: after a gap, when a clock was stepped or when the camera changes its
// rate (three stamps in a row that are off); until it has one, and while a camera keeps no even period, the times are
// the stamps themselves. Times ascend strictly as long as the stamps do. thread-compatible.
class CameraClock {
 public:
  // The stamps must ascend; one that does not begins the clock anew. Returns the smoothed stamp.
  Timestamp smoothed(Timestamp stamp);

  // Of the smoothed stamps: what the jitter that was seen leaves of uncertainty in the newest one, standard deviation.
  // nullopt while there are too few stamps to tell.
  std::optional<double> sigma_s() const;
  // Between two frames, as the camera counts; nullopt while it is not known.
  std::optional<double> period_s() const;

 private:
  void begin(Timestamp stamp);

  std::optional<Timestamp> origin_;  // where the clock began: all else is in seconds since then
  double phase_s_ = 0;               // of the newest frame
  double period_s_ = 0;              // 0: not known yet
  double variance_s2_ = 0;           // of a stamp about the line, late ones excepted
  int count_ = 0;                    // stamps that the line rests on, at most the memory
  int off_in_a_row_ = 0;
  std::optional<Timestamp> last_out_, last_stamp_;
};

}  // namespace huetrack::capture
