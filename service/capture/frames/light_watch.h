// Detects changing light in a camera's frames: flicker bands, automatic exposure and automatic white balance. A
// function of frames and their times alone.
//
// It samples 48 rows of 16 cells from some eight frames a second, at uneven gaps, for about four seconds: a window.
// Every frame is compared with the window's first one by medians over cells, which tolerate motion in less than half of
// the picture. A window in which the camera itself moves is discarded.
//   flicker   Lamps flicker at f = 100 or 120 Hz (twice the mains), and a rolling shutter exposes rows one after the
//             other, so the brightness of row r is 1 + m cos(2 pi (f t + k r / rows) + p), with t the frame's time and
//             k = f * readout. Detected when all other frequencies between 96 and 124 Hz have at most a third of its
//             power. At a frame rate that divides f the bands stand still and are not detected.
//   exposure  The whole picture becomes brighter or darker: most of eight vertical strips alike, and not in one step.
//   balance   The same for the ratio of red or blue to green.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

struct Flicker {
  double light_hz = 0;    // 100 or 120
  double modulation = 0;  // m, of the picture's values (after gamma)
  double bands = 0;       // |k|, over the image's height
};

struct LightFindings {
  std::optional<Flicker> flicker;
  // From the lowest to the highest value in a window: 0.1 is 10 % brighter.
  std::optional<double> exposure_change;
  std::optional<double> balance_change;               // of red or blue to green, the larger one
  bool operator==(const LightFindings& other) const;  // the same findings are present; their figures may differ
};

// thread-compatible; one per camera. look() allocates nothing.
class LightWatch {
 public:
  // window_s: > 0; length of a window. Below 3 s, changes of exposure are easily missed.
  explicit LightWatch(double window_s = 4.2);

  // Call with every frame's time, in order. True: call look() with this frame.
  bool is_wanted(Timestamp at);
  // True: findings() changed.
  bool look(const Image& image, Timestamp at);

  // Of the last complete window. A finding is kept for six windows without it: automatics rest while nothing changes.
  const LightFindings& findings() const { return findings_; }
  std::uint64_t windows() const { return windows_; }  // completed

  static constexpr std::size_t rows = 48, columns = 16, strips = 8, samples = 32;

 private:
  struct Cell {
    float r = 0, g = 0, b = 0;  // logarithms; NaN where clipped or too dark
  };
  using Cells = std::array<Cell, rows * columns>;
  using Series = std::array<double, samples>;
  struct Change {  // against the window's first frame
    std::array<Series, strips> of_strip{};
  };

  static void read(const Image& image, Cells& cells);
  bool add(const Image& image);  // a sample; false: discard the window
  void begin(const Image& image, Timestamp at);
  LightFindings judge_window();
  // The rows' changes relative to one another.
  struct Ripple {
    std::size_t used_rows = 0;
    double power = 0, frames_hz = 0;
  };
  struct Amplitudes;
  struct Peak;
  std::optional<Ripple> find_ripple();
  Amplitudes band_amplitudes(std::size_t used_rows) const;
  std::array<Peak, 2> peaks_at(double hz, double frames_hz, const Amplitudes& amplitude) const;
  std::optional<Flicker> find_flicker();
  static std::optional<double> find_drift(const Change& change, std::size_t count);

  double mean_gap_s_;
  std::uint64_t windows_ = 0;
  LightFindings findings_;
  std::array<int, 3> windows_without_{};  // since flicker, exposure, balance were found
  Cells first_{}, now_{};
  std::vector<double> scratch_;
  std::size_t count_ = 0, unsteady_ = 0;
  int frames_until_wanted_ = 0;
  Timestamp began_{}, last_frame_{};
  Series time_s_{};
  std::array<std::array<double, rows>, samples> row_change_{};
  Change exposure_, red_, blue_;
  std::array<double, 256> periods_{};  // between frames, seconds
  std::size_t period_count_ = 0;
};

}  // namespace huetrack::capture
