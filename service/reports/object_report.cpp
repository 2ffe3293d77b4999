#include "reports/object_report.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace huetrack::reports {
namespace {

constexpr std::uint64_t looked_at_every = 15;  // sets; views are sampled twice a second
// Of a picture: a ball of ten pixels covers as much of 640x480. Less is told no more, but not at once.
constexpr double told_share = 0.001, not_told_share = 0.0005;
// Where objects come and go all the time, the log does not.
constexpr int most_in_a_row = 40;
constexpr double in_a_row_s = 10;

std::string text_of(const Eigen::Vector3d& p) {
  return fmt::format("{:.2f}, {:.2f}, {:.2f} m", p.x(), p.y(), p.z());
}

}  // namespace

std::string left_out_text(const std::string& camera, const std::string& target,
                          const object_tracking::ColorShare& share) {
  if (share.still < told_share) return {};
  const auto& box = share.still_box;
  return fmt::format(
      "{}: {:.1f} % of the picture has the colour of {} and never moves, most of it around {:.0f}, {:.0f} "
      "(from {}, {} to {}, {}): it is left out, and so is an object before it; a narrower colour sees both",
      camera, 100 * share.still, target, share.still_px.x(), share.still_px.y(), box[0], box[1], box[2], box[3]);
}

std::string further_text(const object_tracking::TargetOptions& target, const Eigen::Vector3d& at) {
  if (target.count > 1)
    return fmt::format(
        "{}: there are more than the {} of its count, one at {}, and which of them are told is chance: raise count, or "
        "narrow the colour",
        target.name, target.count, text_of(at));
  return fmt::format(
      "{}: something else has its colour and its size, at {}, and may be taken for it: if there are several, write "
      "count: up to 2 (or more); if not, narrow the colour, or ignore the place",
      target.name, text_of(at));
}

std::string other_colors_text(const std::string& camera, const std::string& target) {
  return fmt::format(
      "{}: its frames say which pixels match other colours than that of {}, and so nothing of it: a recording of such "
      "a "
      "camera (send: matches) can be replayed with the colours only that it was made with, which its huetrackd.yaml "
      "has",
      camera, target);
}

ObjectReport::ObjectReport(const config::ServiceConfig& config)
    : cameras_(config.rig.camera_names()), targets_(config.targets.size()), options_(config.targets) {
  for (Target& target : targets_) {
    target.left_out.resize(cameras_.size()), target.untold.resize(cameras_.size());
    target.other_colors.resize(cameras_.size()), target.in_a_row.resize(cameras_.size());
  }
}

void ObjectReport::Told::say(std::string sentence, const std::string& when_gone) {
  if (now.empty() && !sentence.empty()) spdlog::warn("{}", sentence);
  if (!now.empty() && sentence.empty() && !when_gone.empty()) spdlog::info("{}", when_gone);
  if (!sentence.empty()) ever = sentence;
  now = std::move(sentence);
}

void ObjectReport::on_set(const pipeline::TrackedSet& set) {
  tell_objects(set);
  if (sets_++ % looked_at_every != 0) return;
  tell_left_out(set);
  tell_further(set);
  tell_other_colors(set);
}

bool ObjectReport::may_tell(capture::Timestamp at) {
  if (capture::seconds(at - told_since_) > in_a_row_s || at < told_since_) {
    if (not_told_ > 0) spdlog::info("{} more objects came or went meanwhile", not_told_);
    told_since_ = at, told_ = 0, not_told_ = 0;
  }
  if (told_ < most_in_a_row) return ++told_ > 0;
  ++not_told_;
  return false;
}

void ObjectReport::tell_objects(const pipeline::TrackedSet& set) {
  for (const auto& estimate : set.estimates) {
    if (estimate.object == 0) continue;
    Target& target = targets_[estimate.target];
    const auto name = [&] {
      const std::scoped_lock lock(mutex_);
      return object_tracking::object_name(options_[estimate.target].name, estimate.object);
    };
    if (estimate.is_end) {
      const auto known = target.objects.extract(estimate.object);
      if (known && may_tell(estimate.at))
        spdlog::info("{} is gone after {:.1f} s, last at {}; there now: {}", name(),
                     capture::seconds(estimate.at - known.mapped().since), text_of(known.mapped().last),
                     target.objects.size());
      continue;
    }
    const auto [it, is_new] = target.objects.try_emplace(estimate.object);
    if (is_new) it->second.since = estimate.at;
    if (estimate.has_position()) it->second.last = estimate.position;
    if (is_new && may_tell(estimate.at))
      spdlog::info("{} is found at {}, seen by {} cameras; there now: {}", name(), text_of(estimate.position),
                   estimate.views, target.objects.size());
  }
}

void ObjectReport::tell_left_out(const pipeline::TrackedSet& set) {
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    const auto shares = set.trackers[t].color_shares();
    Target& target = targets_[t];
    const std::scoped_lock lock(mutex_);
    for (std::size_t c = 0; c < shares.size() && c < cameras_.size(); ++c) {
      std::string now = left_out_text(cameras_[c], options_[t].name, shares[c]);
      if (now.empty() && !target.left_out[c].now.empty() && shares[c].still > not_told_share) continue;
      target.left_out[c].say(std::move(now),
                             fmt::format("{}: what had the colour of {} and never moved is gone, or has moved",
                                         cameras_[c], options_[t].name));
    }
  }
}

void ObjectReport::tell_further(const pipeline::TrackedSet& set) {
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    const auto at = set.trackers[t].further_object();
    const std::scoped_lock lock(mutex_);
    targets_[t].further.say(at ? further_text(options_[t], *at) : std::string(),
                            options_[t].name + ": what was one too many of its colour is gone");
  }
}

// A change of colour takes a host some tenths of a second; what lasts for a second is told.
void ObjectReport::tell_other_colors(const pipeline::TrackedSet& set) {
  constexpr std::uint64_t most_of_them = looked_at_every / 2 + 1;
  constexpr int looks_until_told = 3;
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    Target& target = targets_[t];
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const std::uint64_t before = std::exchange(target.other_colors[c], set.trackers[t].frames_of_other_colors(c));
      // A new tracker counts from 0.
      const bool is_most = target.other_colors[c] >= before && target.other_colors[c] - before >= most_of_them;
      target.in_a_row[c] = is_most ? target.in_a_row[c] + 1 : 0;
      const bool is_told = target.in_a_row[c] >= looks_until_told;
      const std::scoped_lock lock(mutex_);
      target.untold[c].say(is_told ? other_colors_text(cameras_[c], options_[t].name) : std::string(), "");
    }
  }
}

void ObjectReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  options_ = config.targets;
}

std::vector<std::string> ObjectReport::all(std::string Told::*which) const {
  std::vector<std::string> sentences;
  const auto add = [&](const Told& told) {
    if (!(told.*which).empty()) sentences.push_back(told.*which);
  };
  for (const Target& target : targets_) {
    std::ranges::for_each(target.left_out, add);
    std::ranges::for_each(target.untold, add);
    add(target.further);
  }
  return sentences;
}

std::vector<std::string> ObjectReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  return all(&Told::now);
}

std::vector<std::string> ObjectReport::summary() const {
  return all(&Told::ever);
}

}  // namespace huetrack::reports
