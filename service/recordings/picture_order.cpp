#include "recordings/picture_order.h"

#include <algorithm>
#include <cstdlib>

namespace huetrack::recordings {
namespace {

constexpr std::size_t most_reordered = 17;  // a decoder of H.264 or HEVC keeps at most 16 pictures

}  // namespace

void PictureOrder::sent(std::optional<std::int64_t> stamp, bool is_trimmed, bool is_key) {
  if (is_key) ++key_packets_;
  if (!stamp) {
    ++unstamped_;
    return;
  }
  const Sent packet{*stamp, packets_++, is_trimmed, is_key, key_packets_};
  pending_.insert(std::ranges::upper_bound(pending_, packet.place(), {}, &Sent::place), packet);
}

void PictureOrder::failed() {
  if (takes_earliest_) give_waiting();
  if (!takes_earliest_ || pending_.empty()) return;  // otherwise its own stamp tells, when a later one is shown
  last_ = pending_.front().stamp;
  place({last_, nullptr});
  pending_.erase(pending_.begin());
}

void PictureOrder::shown(std::optional<std::int64_t> stamp, capture::FramePtr frame) {
  if (takes_earliest_) {
    show_earliest(stamp, std::move(frame));
    return;
  }
  const auto own = stamp ? std::ranges::find(pending_, *stamp, &Sent::stamp) : pending_.end();
  if (own == pending_.end()) {
    decide();
    if (unstamped_ > 0)
      --unstamped_;
    else if (!pending_.empty())
      pending_.erase(pending_.begin());
    last_.reset();
    decided_.push_back({stamp, std::move(frame)});
    return;
  }
  const Sent picture = *own;
  pending_.erase(own);
  // An earlier stamp that was sent first, and is shown later.
  const bool is_late = std::ranges::any_of(held_, [&](const Held& held) {
    return picture.place() < held.sent.place() && picture.key == held.sent.key && picture.number < held.sent.number;
  });
  held_.push_back({picture, std::move(frame)});
  if (is_late)
    take_decoding_order();
  else if (pending_.empty() || pending_.front().place() > held_.back().sent.place() || held_.size() > most_reordered)
    decide();
}

void PictureOrder::show_earliest(std::optional<std::int64_t> stamp, capture::FramePtr frame) {
  if (waiting_.size() == pending_.size()) {
    give_waiting();
    if (unstamped_ == 0) return;  // failed() gave it up
    --unstamped_;
    place({std::nullopt, std::move(frame)});
    return;
  }
  waiting_.push_back(std::move(frame));
  if (stamp && (!latest_ || *stamp > *latest_)) latest_ = stamp;
  const auto sent_up_to =
      latest_ ? std::ranges::count_if(pending_, [&](const Sent& sent) { return sent.stamp <= *latest_; }) : 0;
  if (std::size_t(sent_up_to) <= waiting_.size() || waiting_.size() > most_reordered) give_waiting();
}

void PictureOrder::give_waiting() {
  const std::size_t ahead = waiting_.empty() ? 0 : waiting_.size() - 1;
  latest_.reset();
  for (std::size_t k = 1; k < pending_.size() && k <= waiting_.size(); ++k) {
    const std::int64_t step = pending_[k].stamp - pending_[k - 1].stamp;
    if (step > 0) step_ = std::min(step_.value_or(step), step);
  }
  for (bool is_first = true; capture::FramePtr & frame : std::exchange(waiting_, {})) {
    const std::int64_t waits = waits_before(std::exchange(is_first, false) ? ahead : 0);
    last_ = pending_.front().stamp;
    pending_.erase(pending_.begin());
    place({last_, std::move(frame), waits});
  }
  longest_run_ = std::max(longest_run_, ahead);
  if (longest_run_ == 0) return;
  has_b_frames_ = true;
  settle();
}

// Before the earliest stamp that is pending. ahead: pictures that are shown before the one that was coded with it.
std::int64_t PictureOrder::waits_before(std::size_t ahead) {
  const bool has_waited = longest_run_ == 0 || lead_ >= 0;
  if (!last_ || !step_ || ahead <= longest_run_ || !has_waited) return 0;
  const std::int64_t missing = pending_.front().stamp - *last_ - *step_;
  const std::int64_t waits = (2 * missing + *step_ - 1) / (2 * *step_);
  return std::clamp<std::int64_t>(waits, 0, static_cast<std::int64_t>(ahead - longest_run_));
}

void PictureOrder::place(Ordered picture) {
  if (!is_unsettled_) {
    assign(std::move(picture));
    return;
  }
  unsettled_.push_back(std::move(picture));
  if (unsettled_.back().waits > 0 || unsettled_.size() > most_reordered) settle();
}

// An encoder that is called waits before its first B frames.
void PictureOrder::settle() {
  if (!std::exchange(is_unsettled_, false)) return;
  if (unsettled_.empty() || unsettled_.back().waits == 0) lead_ = -decoder_delay_;
  for (Ordered& picture : std::exchange(unsettled_, {})) assign(std::move(picture));
}

void PictureOrder::assign(Ordered picture) {
  if (picture.waits > 0) {
    if (lead_ < 0) lead_ = offset_ = 0;
    lead_ += picture.waits;
    taken_out_ += picture.waits * *step_;
  }
  if (const auto stamp = picture.stamp) {
    const std::int64_t shown = ordered_++ + lead_;
    if (!first_) first_ = stamp;
    if (shown <= 0) offset_ = *stamp - *first_;
    while (timed_ < shown) add_time(last_time_.value_or(*first_) + (last_time_ ? *step_ : 0));
    if (timed_ == std::max<std::int64_t>(shown, 0)) add_time(*stamp - offset_);
  }
  untimed_.push_back(std::move(picture));
  give_timed();
}

void PictureOrder::add_time(std::int64_t time) {
  if (std::exchange(is_anew_, false) && last_time_ && step_) {
    const std::int64_t missing = time - *last_time_ - *step_;
    if (2 * std::abs(missing - decoder_delay_ * *step_) <=
        *step_) {  // the new encoder's delay, where films were joined
      if (joints_.taken_out++ == 0) joints_.first = given_ + timed_;
      shift_ -= missing, taken_out_ += missing;
      last_time_ = time - *step_;  // no gap
    }
  }
  if (last_time_ && step_ && 2 * (time - *last_time_ - *step_) > *step_ && gaps_.count++ == 0)
    gaps_.first_after = given_ + timed_;
  last_time_ = time;
  times_.push_back(time);
  ++timed_;
}

void PictureOrder::give_timed() {
  while (!untimed_.empty() && (!untimed_.front().stamp || !times_.empty())) {
    Ordered picture = std::move(untimed_.front());
    untimed_.pop_front();
    if (picture.stamp) {
      picture.stamp = times_.front() + shift_;
      times_.pop_front();
    }
    decided_.push_back({picture.stamp, std::move(picture.frame)});
  }
}

// The times of the last pictures are not in the file.
void PictureOrder::end_earliest() {
  give_waiting();
  if (repeats_ && !pending_.empty()) pending_.pop_back();  // the first repeated stamp's own is one too many
  for (const Sent& lost : std::exchange(pending_, {})) place({lost.stamp, nullptr});
  settle();
  while (!untimed_.empty()) {
    add_time(*last_time_ + step_.value_or(1));
    give_timed();
  }
}

// Stamps are right: what is pending before them was lost.
void PictureOrder::decide() {
  // Trimmed pictures are kept back until one follows that is not: stamps of decoding trim the wrong ones.
  const auto kept = std::ranges::find_if(held_, [](const Held& held) { return !held.sent.is_trimmed; });
  if (!has_given_ && kept == held_.end() && held_.size() <= most_reordered) return;
  for (Held& held : std::exchange(held_, {})) {
    give_lost_before(held.sent);
    if (held.sent.is_trimmed) continue;
    judge_joint(held.sent);
    has_given_ = true;
    last_ = held.sent.stamp;
    ++given_;
    decided_.push_back({held.sent.stamp + shift_, std::move(held.frame)});
  }
}

// Between the picture given last and this one.
void PictureOrder::judge_joint(const Sent& picture) {
  if (!last_ || picture.stamp <= *last_) return;
  const std::int64_t step = picture.stamp - *last_;
  step_ = std::min(step_.value_or(step), step);
  const std::int64_t missing = step - *step_;
  if (2 * missing <= *step_) return;
  const bool is_joint = picture.is_key && gaps_.count == 0;
  if (is_joint && delay_ > 0 && 2 * std::abs(missing - delay_ * *step_) <= *step_) {
    if (joints_.taken_out++ == 0) joints_.first = given_;
    shift_ -= missing, taken_out_ += missing;
  } else if (is_joint) {
    if (joints_.left++ == 0) joints_.first_left = given_;
    joints_.longest_left = std::max(joints_.longest_left, missing);
  } else {
    ++gaps_.count;
  }
}

PictureOrder::Joints PictureOrder::joints() const {
  Joints joints = joints_;
  if (gaps_.count > 0) joints.left = 0;
  return joints;
}

void PictureOrder::give_lost_before(const Sent& picture) {
  const auto end = std::ranges::lower_bound(pending_, picture.place(), {}, &Sent::place);
  for (auto lost = pending_.begin(); lost != end; ++lost) {
    if (lost->is_trimmed) continue;
    last_ = lost->stamp;
    decided_.push_back({lost->stamp + shift_, nullptr});
  }
  pending_.erase(pending_.begin(), end);
}

void PictureOrder::take_decoding_order() {
  takes_earliest_ = is_decoding_order_ = true;
  last_time_ = last_;
  auto held = std::exchange(held_, {});
  for (const Held& picture : held)
    pending_.insert(std::ranges::upper_bound(pending_, picture.sent.place(), {}, &Sent::place), picture.sent);
  // What such stamps trim belongs to the film, which begins at the first stamp that is not trimmed.
  const auto kept = std::ranges::find(pending_, false, &Sent::is_trimmed);
  if (!has_given_ && kept != pending_.end()) shift_ = kept->stamp - pending_.front().stamp;
  for (Held& picture : held) shown(picture.sent.stamp, std::move(picture.frame));
}

void PictureOrder::end() {
  if (takes_earliest_)
    end_earliest();
  else
    decide();
  for (const Sent& lost : std::exchange(pending_, {}))
    if (!lost.is_trimmed) decided_.push_back({lost.stamp + shift_, nullptr});
  for (; unstamped_ > 0; --unstamped_) decided_.push_back({std::nullopt, nullptr});
}

void PictureOrder::begin_anew() {
  times_.clear();  // of pictures that the encoder before kept
  given_ += std::exchange(ordered_, 0);
  timed_ = lead_ = offset_ = 0;
  longest_run_ = 0;
  first_.reset();
  is_unsettled_ = is_anew_ = decoder_delay_ > 0;
}

std::optional<PictureOrder::Picture> PictureOrder::next() {
  if (decided_.empty()) return std::nullopt;
  Picture picture = std::move(decided_.front());
  decided_.pop_front();
  return picture;
}

}  // namespace huetrack::recordings
