// Interface to control a running replay.
#pragma once

#include <optional>
#include <string>

namespace huetrack::page {

struct PlaybackState {
  bool is_paused = false;
  double speed = 0;                     // multiple of the recorded speed; 0: as fast as possible
  double position_s = 0;                // of the last released frame, from the recording's first one
  std::optional<double> length_s = {};  // of the recording; nullopt: no file says
  bool loops = false;                   // begins again at its end
  std::string why_no_seek = {};         // why seek() is not possible; empty: it is
};

// thread-safe.
class Playback {
 public:
  virtual PlaybackState state() const = 0;
  virtual void pause() = 0;
  virtual void go_on() = 0;
  virtual void step(int sets) = 0;           // >= 1; releases so many frames of every camera, then pauses
  virtual void set_speed(double speed) = 0;  // >= 0, as PlaybackState::speed
  // >= 0, from the recording's first frame: goes on there; while paused, shows the frames there. Returns at once.
  virtual void seek(double position_s) = 0;

 protected:
  ~Playback() = default;
};

}  // namespace huetrack::page
