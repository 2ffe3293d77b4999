#include "daemon/held_source.h"

#include <chrono>
#include <thread>
#include <utility>

namespace huetrack::daemon {

HeldSource::HeldSource(std::unique_ptr<capture::FrameSource> source, std::size_t cameras)
    : source_(std::move(source)), seen_(cameras, false) {}

std::optional<capture::Frame> HeldSource::next(std::stop_token stop) {
  using Clock = std::chrono::steady_clock;
  if (!ahead_) ahead_ = source_->next(stop);
  if (!ahead_) return std::nullopt;
  if (seen_.at(std::size_t(ahead_->camera)) && !released_) {
    const auto since = Clock::now();
    while (!released_ && !stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    held_ns_ = (Clock::now() - since).count();
  }
  seen_[std::size_t(ahead_->camera)] = true;
  return std::exchange(ahead_, std::nullopt);
}

}  // namespace huetrack::daemon
