// Predicts where in a camera's next frame trackers need pixels, from the outlines that they predicted for earlier
// frames.
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

// Sets the outlines of `out`; at most as many as a frame has patches.
void to_message(std::span<const capture::ExpectedOutline> outlines, msg::OutlinesOfCamera& out);
// The message is untrusted. False: invalid, and `out` is unchanged; otherwise `out` is replaced.
bool outlines_of(const msg::OutlinesOfCamera& message, std::vector<capture::ExpectedOutline>& out);

// One per camera of a camera host. thread-compatible.
class WantedOutlines {
 public:
  static constexpr std::size_t most_trackers = 16;
  // Predictions for an older frame are useless: unknown motion has moved the object.
  static constexpr std::chrono::milliseconds forgotten_after{300};

  // Remembers the stamp of a frame that is being sent.
  void note(std::uint32_t number, capture::Timestamp stamped_at) {
    sent_[number % sent_.size()] = {number, stamped_at};
  }
  // The message is untrusted. False: invalid, or for a frame that is no longer remembered.
  bool update(std::int64_t tracker, const msg::OutlinesOfCamera& message);
  // The places in a frame of this time; replaces the content of `out`. They may lie beyond the image. Two trackers'
  // outlines of one object are one place.
  void places_at(capture::Timestamp stamped_at, std::vector<capture::PatchPlace>& out);

 private:
  struct Sent {
    std::uint32_t number = 0;
    capture::Timestamp stamped_at{};  // zero: none yet
  };
  struct Predicted {
    capture::Timestamp of{};  // stamp of the frame that the outlines are for
    std::vector<capture::ExpectedOutline> outlines;
  };
  std::array<Sent, 64> sent_{};
  std::map<std::int64_t, Predicted> by_tracker_;
  std::vector<capture::ExpectedOutline> scratch_;  // of update()
};

}  // namespace huetrack::hosts
