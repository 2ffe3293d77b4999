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
  for (Target& target : targets_) target.left_out.resize(cameras_.size()), target.ever.resize(cameras_.size());
  for (Target& target : targets_) {
    target.other_colors.resize(cameras_.size()), target.in_a_row.resize(cameras_.size());
    target.untold.resize(cameras_.size()), target.ever_untold.resize(cameras_.size());
  }
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
      std::string& told = target.left_out[c];
      std::string now = left_out_text(cameras_[c], options_[t].name, shares[c]);
      if (now.empty() && !told.empty() && shares[c].still > not_told_share) continue;
      if (told.empty() && !now.empty()) spdlog::warn("{}", now);
      if (!told.empty() && now.empty())
        spdlog::info("{}: what had the colour of {} and never moved is gone, or has moved", cameras_[c],
                     options_[t].name);
      if (!now.empty()) target.ever[c] = now;
      told = std::move(now);
    }
  }
}

void ObjectReport::tell_further(const pipeline::TrackedSet& set) {
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    const auto at = set.trackers[t].further_object();
    Target& target = targets_[t];
    const std::scoped_lock lock(mutex_);
    std::string now = at ? further_text(options_[t], *at) : std::string();
    if (target.further.empty() && !now.empty()) spdlog::warn("{}", now);
    if (!target.further.empty() && now.empty())
      spdlog::info("{}: what was one too many of its colour is gone", options_[t].name);
    if (!now.empty()) target.ever_further = now;
    target.further = std::move(now);
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
      if (is_told == !target.untold[c].empty()) continue;
      target.untold[c] = is_told ? other_colors_text(cameras_[c], options_[t].name) : std::string();
      if (!is_told) continue;
      target.ever_untold[c] = target.untold[c];
      spdlog::warn("{}", target.untold[c]);
    }
  }
}

void ObjectReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  options_ = config.targets;
}

std::vector<std::string> ObjectReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> all;
  for (const Target& target : targets_) {
    std::ranges::copy_if(target.left_out, std::back_inserter(all), [](const auto& text) { return !text.empty(); });
    std::ranges::copy_if(target.untold, std::back_inserter(all), [](const auto& text) { return !text.empty(); });
    if (!target.further.empty()) all.push_back(target.further);
  }
  return all;
}

std::vector<std::string> ObjectReport::summary() const {
  std::vector<std::string> all;
  for (const Target& target : targets_) {
    std::ranges::copy_if(target.ever, std::back_inserter(all), [](const auto& text) { return !text.empty(); });
    std::ranges::copy_if(target.ever_untold, std::back_inserter(all), [](const auto& text) { return !text.empty(); });
    if (!target.ever_further.empty()) all.push_back(target.ever_further);
  }
  return all;
}

}  // namespace huetrack::reports
