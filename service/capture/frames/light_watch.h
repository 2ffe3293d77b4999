// What a camera's frames say about light that is not still: bands of flicker, automatic exposure and white balance at
// work. A function of frames and their times alone, so that tests, recordings and cameras are all the same to it.
//
// Looked at are 48 rows of 16 cells, some eight frames a second at uneven gaps, for about four seconds: a window. Every
// frame is compared with the window's first one by medians over cells, which what moves in the picture does not reach
// while it covers less than half; a window in which the camera itself moves says nothing.
//   flicker   lamps flicker at 100 or 120 Hz (twice the mains), and rows are exposed one after the other: row r shows
//             the flicker at its own time, so the rows' brightness is 1 + m cos(2 pi (f t + k r / rows) + p), with one
//             k (flicker times readout) and a phase that goes on with the time t of the frame at f. Nothing else in a
//             picture does: at all other frequencies between 96 and 124 Hz there must be a third of its power at most.
//             At a frame rate that divides f the bands stand still, and are not found.
//   exposure  the whole picture becomes brighter or darker, most of eight upright strips alike, and not in one step
//   balance   the same of the ratio of red or blue to green
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
  double modulation = 0;  // m, of the values as they are in the picture (after gamma)
  double bands = 0;       // |k|, over the image's height
};

struct LightFindings {
  std::optional<Flicker> flicker;
  // From the lowest to the highest in a window, as a share: 0.1 is 10 % brighter.
  std::optional<double> exposure_change;
  std::optional<double> balance_change;               // of red or blue to green, whichever is more
  bool operator==(const LightFindings& other) const;  // the same is found; the figures may differ
};

// thread-compatible; one per camera. look() allocates nothing.
class LightWatch {
 public:
  // window_s: > 0; how long it watches until it says something. Below 3 s, changes of exposure are easily missed.
  explicit LightWatch(double window_s = 4.2);

  // Every frame's time, in their order. True: look() at it.
  bool is_wanted(Timestamp at);
  // The frame that is_wanted(). True: findings() are others than before.
  bool look(const Image& image, Timestamp at);

  // What was found in the last window that said something. It is kept for six windows in which it is not found again:
  // automatics rest while nothing changes.
  const LightFindings& findings() const { return findings_; }
  std::uint64_t windows() const { return windows_; }  // that said something

  static constexpr std::size_t rows = 48, columns = 16, strips = 8, samples = 32;

 private:
  struct Cell {
    float r = 0, g = 0, b = 0;  // logarithms; NaN where it is clipped or too dark to say anything
  };
  using Cells = std::array<Cell, rows * columns>;
  using Series = std::array<double, samples>;
  struct Change {  // against the window's first frame
    std::array<Series, strips> of_strip{};
  };

  static void read(const Image& image, Cells& cells);
  bool add(const Image& image);  // a sample; false: the window says nothing
  void begin(const Image& image, Timestamp at);
  LightFindings judge_window();
  // What rows do against one another.
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
