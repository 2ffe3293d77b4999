#include "recordings/picture_order.h"

#include <algorithm>
#include <utility>

namespace huetrack::recordings {
namespace {

constexpr std::size_t most_reordered = 17;  // a decoder of H.264 or HEVC keeps at most 16 pictures

}  // namespace

void PictureOrder::sent(std::optional<std::int64_t> stamp, bool is_trimmed) {
  if (!stamp) {
    ++unstamped_;
    return;
  }
  const auto later = std::ranges::upper_bound(pending_, *stamp, {}, &Sent::stamp);
  pending_.insert(later, {*stamp, packets_++, is_trimmed});
}

void PictureOrder::failed() {
  if (!takes_earliest_ || pending_.empty()) return;  // otherwise its own stamp tells, when a later one is shown
  decided_.push_back({pending_.front().stamp + shift_, nullptr});
  pending_.erase(pending_.begin());
}

void PictureOrder::shown(std::optional<std::int64_t> stamp, capture::FramePtr frame) {
  if (takes_earliest_) {
    if (pending_.empty() && unstamped_ == 0) return;  // failed() gave it up
    if (pending_.empty()) {
      --unstamped_;
      decided_.push_back({std::nullopt, std::move(frame)});
      return;
    }
    decided_.push_back({pending_.front().stamp + shift_, std::move(frame)});
    pending_.erase(pending_.begin());
    return;
  }
  const auto own = stamp ? std::ranges::find(pending_, *stamp, &Sent::stamp) : pending_.end();
  if (own == pending_.end()) {
    decide();
    if (unstamped_ > 0)
      --unstamped_;
    else if (!pending_.empty())
      pending_.erase(pending_.begin());
    decided_.push_back({stamp, std::move(frame)});
    return;
  }
  const Sent picture = *own;
  pending_.erase(own);
  // An earlier stamp that was sent first, and is shown later.
  const bool is_late = std::ranges::any_of(
      held_, [&](const Held& held) { return picture.stamp < held.sent.stamp && picture.number < held.sent.number; });
  held_.push_back({picture, std::move(frame)});
  if (is_late)
    take_decoding_order();
  else if (pending_.empty() || pending_.front().stamp > held_.back().sent.stamp || held_.size() > most_reordered)
    decide();
}

// Stamps are right: what is pending before them was lost.
void PictureOrder::decide() {
  // Trimmed pictures are kept back until one follows that is not: stamps of decoding trim the wrong ones.
  const auto kept = std::ranges::find_if(held_, [](const Held& held) { return !held.sent.is_trimmed; });
  if (!has_given_ && kept == held_.end() && held_.size() <= most_reordered) return;
  for (Held& held : std::exchange(held_, {})) {
    give_lost_before(held.sent.stamp);
    if (held.sent.is_trimmed) continue;
    has_given_ = true;
    decided_.push_back({held.sent.stamp, std::move(held.frame)});
  }
}

void PictureOrder::give_lost_before(std::int64_t stamp) {
  const auto end = std::ranges::lower_bound(pending_, stamp, {}, &Sent::stamp);
  for (auto lost = pending_.begin(); lost != end; ++lost)
    if (!lost->is_trimmed) decided_.push_back({lost->stamp, nullptr});
  pending_.erase(pending_.begin(), end);
}

void PictureOrder::take_decoding_order() {
  takes_earliest_ = is_decoding_order_ = true;
  auto held = std::exchange(held_, {});
  for (const Held& picture : held)
    pending_.insert(std::ranges::upper_bound(pending_, picture.sent.stamp, {}, &Sent::stamp), picture.sent);
  // What such stamps trim belongs to the film, which begins at the first stamp that is not trimmed.
  const auto kept = std::ranges::find(pending_, false, &Sent::is_trimmed);
  if (!has_given_ && kept != pending_.end()) shift_ = kept->stamp - pending_.front().stamp;
  for (Held& picture : held) shown(picture.sent.stamp, std::move(picture.frame));
}

void PictureOrder::end() {
  if (!takes_earliest_) decide();
  for (const Sent& lost : std::exchange(pending_, {}))
    if (takes_earliest_ || !lost.is_trimmed) decided_.push_back({lost.stamp + shift_, nullptr});
  for (; unstamped_ > 0; --unstamped_) decided_.push_back({std::nullopt, nullptr});
}

std::optional<PictureOrder::Picture> PictureOrder::next() {
  if (decided_.empty()) return std::nullopt;
  Picture picture = std::move(decided_.front());
  decided_.pop_front();
  return picture;
}

}  // namespace huetrack::recordings
