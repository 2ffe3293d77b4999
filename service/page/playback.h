// Interface to control a running replay.
#pragma once

namespace huetrack::page {

struct PlaybackState {
  bool is_paused = false;
  double speed = 0;       // multiple of the recorded speed; 0: as fast as possible
  double position_s = 0;  // of the last released frame, from the first one
};

// thread-safe.
class Playback {
 public:
  virtual PlaybackState state() const = 0;
  virtual void pause() = 0;
  virtual void go_on() = 0;
  virtual void step(int sets) = 0;           // >= 1; releases so many frames of every camera, then pauses
  virtual void set_speed(double speed) = 0;  // >= 0, as PlaybackState::speed

 protected:
  ~Playback() = default;
};

}  // namespace huetrack::page
