// A replay that waits: so that a colour can be taught on the first pictures.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "capture/frame_source.h"

namespace huetrack::daemon {

// Lets the first frame of every camera through, and then none until it is released.
class HeldSource final : public capture::FrameSource {
 public:
  HeldSource(std::unique_ptr<capture::FrameSource> source, std::size_t cameras);

  std::optional<capture::Frame> next(std::stop_token stop) override;
  bool ended(int camera) const override { return !ahead_ && source_->ended(camera); }

  // Any thread.
  void release() { released_ = true; }
  bool is_released() const { return released_; }
  const std::atomic<std::int64_t>& held_ns() const { return held_ns_; }  // how long; 0 until it is over

 private:
  std::unique_ptr<capture::FrameSource> source_;
  std::vector<bool> seen_;
  std::optional<capture::Frame> ahead_;
  std::atomic<bool> released_ = false;
  std::atomic<std::int64_t> held_ns_ = 0;
};

}  // namespace huetrack::daemon
