// Where in a camera's next frame trackers expect outlines, by what they have said of frames before it.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "capture/frames/frame.h"
#include "idl/camera_host.h"

namespace huetrack::hosts {

// As it is said: the outlines, at most as many as a frame has patches for, and nothing else, of `out`.
void to_message(std::span<const capture::ExpectedOutline> outlines, msg::OutlinesOfCamera& out);
// Anybody may have said it. False: it makes no sense, and `out` is as it was; otherwise it is replaced.
bool outlines_of(const msg::OutlinesOfCamera& said, std::vector<capture::ExpectedOutline>& out);

// One per camera of a camera host. thread-compatible.
class WantedOutlines {
 public:
  static constexpr std::size_t most_trackers = 16;
  // What was said of an older frame says nothing any more: motion that is not known has taken the object elsewhere, and
  // the pixels would be sent for nothing.
  static constexpr std::chrono::milliseconds forgotten_after{300};

  // A frame is on its way to trackers, which may say something of it.
  void note(std::uint32_t number, capture::Timestamp stamped_at) {
    sent_[number % sent_.size()] = {number, stamped_at};
  }
  // Anybody may have said it. False: it makes no sense, or is of a frame that nobody remembers.
  bool hear(std::int64_t tracker, const msg::OutlinesOfCamera& said);
  // Where a frame of this time shows what they said. Replaces what is in `out`. The places may lie beyond the image;
  // what two trackers say of one object is one place.
  void places_at(capture::Timestamp stamped_at, std::vector<capture::PatchPlace>& out);

 private:
  struct Sent {
    std::uint32_t number = 0;
    capture::Timestamp stamped_at{};  // zero: none yet
  };
  struct Heard {
    capture::Timestamp of{};  // the stamp of the frame that it was said of
    std::vector<capture::ExpectedOutline> outlines;
  };
  std::array<Sent, 64> sent_{};
  std::map<std::int64_t, Heard> by_tracker_;
  std::vector<capture::ExpectedOutline> heard_;  // hear()'s own
};

}  // namespace huetrack::hosts
