// Converts capture time to published time.
#pragma once

#include <functional>
#include <utility>

#include "capture/frames/frame.h"

namespace huetrack::pipeline {

// Live, both are UNIX time. A replay adds an offset to the recording's clock. begin() once, before the first frame; all
// else: any thread.
class PublishedTime {
 public:
  // By a frame's capture time: what is added to the offset for it, because the replay was paused or not played at its
  // real speed. thread-safe.
  using Lag = std::function<capture::Duration(capture::Timestamp captured)>;

  void begin(capture::Duration offset, Lag lag = nullptr) {
    offset_ = offset;
    lag_ = std::move(lag);
  }
  // Published capture time minus the source's clock, for the newest frame.
  capture::Duration offset() const { return offset_at(capture::Timestamp::max()); }
  capture::Timestamp of(capture::Timestamp captured) const { return captured + offset_at(captured); }

 private:
  capture::Duration offset_at(capture::Timestamp captured) const {
    return offset_ + (lag_ ? lag_(captured) : capture::Duration{0});
  }

  capture::Duration offset_{0};
  Lag lag_;
};

}  // namespace huetrack::pipeline
