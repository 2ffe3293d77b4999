// Converts capture time to published time.
#pragma once

#include <atomic>
#include <cstdint>

#include "capture/frames/frame.h"

namespace huetrack::pipeline {

// Live, both are UNIX time. A replay adds an offset to the recording's clock. begin() once, before the first frame; all
// else: any thread.
class PublishedTime {
 public:
  // held_ns: added to the offset; may grow while the replay is held; nullptr: none.
  void begin(capture::Duration offset, const std::atomic<std::int64_t>* held_ns = nullptr) {
    offset_ = offset;
    held_ns_ = held_ns;
  }
  // Published capture time minus the source's clock.
  capture::Duration offset() const { return offset_ + capture::Duration(held_ns_ != nullptr ? held_ns_->load() : 0); }
  capture::Timestamp of(capture::Timestamp captured) const { return captured + offset(); }

 private:
  capture::Duration offset_{0};
  const std::atomic<std::int64_t>* held_ns_ = nullptr;
};

}  // namespace huetrack::pipeline
