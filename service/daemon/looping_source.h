// A recording that is played from any position, and again and again, while its capture times only rise.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "capture/frames/frame_source.h"

namespace huetrack::daemon {

struct LoopingSourceOptions {
  std::size_t cameras = 0;
  bool loops = false;         // begins again at its end; otherwise it ends there
  capture::Duration step{0};  // > 0: from the last frame to the first one after a jump; a frame period
  // Opens the recording again. Frames captured before `from` (on its own clock) may be left out. Throws as it likes.
  std::function<std::unique_ptr<capture::FrameSource>(capture::Timestamp from)> open;
};

// At a jump (the end of the recording, or seek()) the capture times, sequence numbers and arrival numbers continue: the
// recording's own ones are shifted. thread-compatible: the thread of next() calls all.
class LoopingSource final : public capture::FrameSource {
 public:
  // source: the first pass, from the beginning. first_at: its first capture time. throws std::invalid_argument
  LoopingSource(std::unique_ptr<capture::FrameSource> source, capture::Timestamp first_at,
                LoopingSourceOptions options);

  std::optional<capture::Frame> next(std::stop_token stop) override;
  bool ended(int camera) const override { return !options_.loops && source_->ended(camera); }
  capture::Duration waited() const override { return source_->waited(); }
  std::uint64_t jumps() const override { return jumps_; }

  // Before seek(): the frame that next() returned last was not used.
  void take_back(const capture::Frame& last);
  // The next frame is the first one at or after this time from the recording's first frame.
  void seek(capture::Duration position);
  // Of a capture time of the last frame's pass, from the recording's first frame.
  capture::Duration position_of(capture::Timestamp captured_at) const { return captured_at - shift_ - first_at_; }
  capture::Duration step() const { return options_.step; }

 private:
  std::optional<capture::Frame> next_of_pass(const std::stop_token& stop);
  capture::Frame continued(capture::Frame frame);

  std::unique_ptr<capture::FrameSource> source_;
  const capture::Timestamp first_at_;
  const LoopingSourceOptions options_;
  std::optional<capture::Timestamp> from_;  // of this pass, on the recording's clock: earlier frames are left out
  bool has_jumped_ = false;                 // the next frame is the first after a jump
  std::uint64_t jumps_ = 0;
  capture::Duration shift_{0};
  std::optional<capture::Timestamp> last_at_, before_last_at_;  // newest capture time, shifted; before the last frame
  struct Numbers {
    std::optional<std::uint32_t> next;  // sequence of this camera's next frame without a gap
    std::uint32_t shift = 0;            // modulo 2^32
    bool is_open = false;               // to be found with this camera's next frame
  };
  std::vector<Numbers> numbers_;  // by camera
  std::uint64_t next_arrival_ = 0, arrival_shift_ = 0;
};

}  // namespace huetrack::daemon
