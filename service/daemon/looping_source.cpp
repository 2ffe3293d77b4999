#include "daemon/looping_source.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace huetrack::daemon {

LoopingSource::LoopingSource(std::unique_ptr<capture::FrameSource> source, capture::Timestamp first_at,
                             LoopingSourceOptions options)
    : source_(std::move(source)), first_at_(first_at), options_(std::move(options)), numbers_(options_.cameras) {
  if (options_.step <= capture::Duration{0}) throw std::invalid_argument("LoopingSource: step must be > 0");
}

void LoopingSource::take_back(const capture::Frame& last) {
  last_at_ = before_last_at_;
  numbers_.at(std::size_t(last.camera)).next = last.sequence;
}

void LoopingSource::seek(capture::Duration position) {
  from_ = first_at_ + position;
  source_ = options_.open(*from_);
  has_jumped_ = true;
  for (Numbers& numbers : numbers_) numbers.is_open = true;
}

std::optional<capture::Frame> LoopingSource::next_of_pass(const std::stop_token& stop) {
  for (;;) {
    auto frame = source_->next(stop);
    if (!frame || !from_ || frame->captured_at >= *from_) return frame;
  }
}

std::optional<capture::Frame> LoopingSource::next(std::stop_token stop) {
  auto frame = next_of_pass(stop);
  if (!frame && options_.loops && !stop.stop_requested()) {
    seek(capture::Duration{0});
    frame = next_of_pass(stop);
  }
  if (!frame) return std::nullopt;
  return continued(std::move(*frame));
}

capture::Frame LoopingSource::continued(capture::Frame frame) {
  if (std::exchange(has_jumped_, false)) {
    ++jumps_;
    if (last_at_) shift_ = *last_at_ + options_.step - frame.captured_at;
    arrival_shift_ = next_arrival_ - frame.arrival;
  }
  Numbers& numbers = numbers_.at(std::size_t(frame.camera));
  if (std::exchange(numbers.is_open, false) && numbers.next) numbers.shift = *numbers.next - frame.sequence;
  frame.sequence += numbers.shift;
  numbers.next = frame.sequence + 1;
  if (frame.arrival > 0) {
    frame.arrival += arrival_shift_;
    next_arrival_ = std::max(next_arrival_, frame.arrival + 1);
  }
  frame.captured_at += shift_;
  frame.stamped_at += shift_;
  before_last_at_ = last_at_;
  last_at_ = std::max(last_at_.value_or(frame.captured_at), frame.captured_at);
  return frame;
}

}  // namespace huetrack::daemon
