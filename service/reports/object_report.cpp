#include "reports/object_report.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "reports/radius_advice.h"
#include "reports/search_advice.h"

namespace huetrack::reports {
namespace {

constexpr std::uint64_t check_sets = 15;  // sets between two checks: half a second
// Share of a picture, with hysteresis: a ball of ten pixels in 640x480.
constexpr double clutter_share = 0.001, no_clutter_share = 0.0005;
// Limit of log lines about objects that appear and end.
constexpr int max_lines = 40;
constexpr double lines_period_s = 10;
constexpr std::uint64_t window = 60;  // tracked sets: two seconds; a track begins with a wide sigma

std::string text_of(const Eigen::Vector3d& p) {
  return fmt::format("{:.2f}, {:.2f}, {:.2f} m", p.x(), p.y(), p.z());
}

}  // namespace

std::string clutter_text(const std::string& camera, const std::string& target,
                         const object_tracking::ColorShare& share) {
  if (share.still < clutter_share) return {};
  const auto& box = share.still_box;
  return fmt::format(
      "{}: {:.1f} % of the picture has the colour of {} and never moves, most of it around {:.0f}, {:.0f} (from {}, {} "
      "to {}, {}): it is ignored as long as it looks the same; an object in front of it is seen where it looks "
      "different: narrow the colour, or cover it",
      camera, 100 * share.still, target, share.still_px.x(), share.still_px.y(), box[0], box[1], box[2], box[3]);
}

std::string extra_object_text(const object_tracking::TargetOptions& target, const Eigen::Vector3d& at) {
  if (target.count > 1)
    return fmt::format(
        "{}: there are more objects than the {} of its count, one at {}, and which of them are published is arbitrary: "
        "raise count, or narrow the colour",
        target.name, target.count, text_of(at));
  return fmt::format(
      "{}: something else has its colour and its size, at {}, and may be tracked instead: if there are several "
      "objects, set count to the number of balls; if not, narrow the colour, or ignore the place",
      target.name, text_of(at));
}

std::string other_colors_text(const std::string& camera, const std::string& target) {
  return fmt::format(
      "{}: its frames hold matches of other colours, none for {}: replay a recording with `send: matches` with the "
      "colours that it was made with, which are in its huetrackd.yaml",
      camera, target);
}

std::string shared_place_text(const std::string& target, const std::string& other) {
  return fmt::format(
      "{} and {} are tracked at the same place: one object has the colours of both: narrow one of them, or remove one "
      "target",
      target, other);
}

ObjectReport::ObjectReport(const config::ServiceConfig& config)
    : cameras_(config.rig.camera_names()), options_(config.targets) {
  for (const auto& options : options_) {
    Target& target = targets_.emplace_back(Target{.tracked = {options.radius_m, cameras_.size()}});
    target.clutter.resize(cameras_.size()), target.other_colors.resize(cameras_.size());
    target.frames_of_others.resize(cameras_.size()), target.bad_checks.resize(cameras_.size());
  }
}

void ObjectReport::Finding::set(std::string sentence, const std::string& when_gone) {
  if (now.empty() && !sentence.empty()) spdlog::warn("{}", sentence);
  if (!now.empty() && sentence.empty() && !when_gone.empty()) spdlog::info("{}", when_gone);
  if (!sentence.empty()) ever = sentence;
  now = std::move(sentence);
}

void ObjectReport::on_set(const pipeline::TrackedSet& set) {
  log_objects(set);
  check_certainty(set);
  check_shared_places(set);
  if (sets_++ % check_sets != 0) return;
  check_clutter(set);
  check_radius(set);
  check_extra_objects(set);
  check_other_colors(set);
}

bool ObjectReport::may_log(capture::Timestamp at) {
  if (capture::seconds(at - log_since_) > lines_period_s || at < log_since_) {
    if (suppressed_ > 0) spdlog::info("{} more objects appeared or ended meanwhile", suppressed_);
    log_since_ = at, logged_ = 0, suppressed_ = 0;
  }
  if (logged_ < max_lines) return ++logged_ > 0;
  ++suppressed_;
  return false;
}

void ObjectReport::log_objects(const pipeline::TrackedSet& set) {
  for (const auto& estimate : set.estimates) {
    if (estimate.object == 0) continue;
    Target& target = targets_[estimate.target];
    const auto name = [&] {
      const std::scoped_lock lock(mutex_);
      return object_tracking::object_name(options_[estimate.target].name, estimate.object);
    };
    if (estimate.is_end) {
      const auto known = target.objects.extract(estimate.object);
      if (known && may_log(estimate.at))
        spdlog::info("{} ended after {:.1f} s, last at {}; objects now: {}", name(),
                     capture::seconds(estimate.at - known.mapped().since), text_of(known.mapped().last),
                     target.objects.size());
      continue;
    }
    const auto [it, is_new] = target.objects.try_emplace(estimate.object);
    if (is_new) it->second.since = estimate.at;
    if (estimate.has_position()) it->second.last = estimate.position;
    if (is_new && may_log(estimate.at))
      spdlog::info("{} found at {}, seen by {} cameras; objects now: {}", name(), text_of(estimate.position),
                   estimate.views, target.objects.size());
  }
}

void ObjectReport::check_clutter(const pipeline::TrackedSet& set) {
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    const auto shares = set.trackers[t].color_shares();
    Target& target = targets_[t];
    const std::scoped_lock lock(mutex_);
    for (std::size_t c = 0; c < shares.size() && c < cameras_.size(); ++c) {
      std::string now = clutter_text(cameras_[c], options_[t].name, shares[c]);
      if (now.empty() && !target.clutter[c].now.empty() && shares[c].still > no_clutter_share) continue;
      target.clutter[c].set(std::move(now), fmt::format("{}: the clutter of the colour of {} is gone, or has moved",
                                                        cameras_[c], options_[t].name));
    }
  }
}

void ObjectReport::check_radius(const pipeline::TrackedSet& set) {
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    const auto shown_m = set.trackers[t].shown_radius_m();
    if (shown_m == std::exchange(targets_[t].shown_radius_m, shown_m) || !shown_m) continue;
    const std::scoped_lock lock(mutex_);
    spdlog::warn("{}: {}", options_[t].name, unset_radius_text(shown_m, false, options_[t]));
  }
}

void ObjectReport::check_extra_objects(const pipeline::TrackedSet& set) {
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    const auto at = set.trackers[t].further_object();
    const std::scoped_lock lock(mutex_);
    targets_[t].extra_object.set(at ? extra_object_text(options_[t], *at) : std::string(),
                                 options_[t].name + ": the extra object of its colour is gone");
  }
}

// A host needs some tenths of a second to apply new colours: only what lasts for over a second is reported.
void ObjectReport::check_other_colors(const pipeline::TrackedSet& set) {
  constexpr std::uint64_t most_frames = check_sets / 2 + 1;
  constexpr int min_checks = 3;
  for (std::size_t t = 0; t < set.trackers.size() && t < targets_.size(); ++t) {
    Target& target = targets_[t];
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const std::uint64_t before = std::exchange(target.frames_of_others[c], set.trackers[t].frames_of_other_colors(c));
      // A new tracker counts from 0.
      const bool is_most = target.frames_of_others[c] >= before && target.frames_of_others[c] - before >= most_frames;
      target.bad_checks[c] = is_most ? target.bad_checks[c] + 1 : 0;
      const bool is_lasting = target.bad_checks[c] >= min_checks;
      const std::scoped_lock lock(mutex_);
      target.other_colors[c].set(is_lasting ? other_colors_text(cameras_[c], options_[t].name) : std::string(), "");
    }
  }
}

void ObjectReport::check_certainty(const pipeline::TrackedSet& set) {
  const std::scoped_lock lock(mutex_);
  for (const auto& estimate : set.estimates) {
    Target& target = targets_[estimate.target];
    const object_tracking::TargetOptions& options = options_[estimate.target];
    target.tracked.add(estimate);
    // Views that contradict one another widen the sigma, too.
    const bool is_explained =
        estimate.target < set.mistakes.size() &&
        std::ranges::any_of(set.mistakes[estimate.target], view_watch::is_of_rig, &view_watch::Mistake::kind);
    if (target.tracked.tracked() < window && !is_explained) continue;
    std::string advice = is_explained ? "" : unsure_advice(double(target.tracked.unsure()) / double(window), options);
    target.is_unsure.set(advice.empty() ? advice : options.name + ": " + advice, "");
    target.tracked = {options.radius_m, cameras_.size()};
  }
}

// Two objects cannot be as near to one another as this; for moments their estimates can.
void ObjectReport::check_shared_places(const pipeline::TrackedSet& set) {
  std::map<std::pair<std::size_t, std::size_t>, std::uint64_t> together;
  const std::scoped_lock lock(mutex_);
  for (const auto& a : set.estimates) {
    for (const auto& b : set.estimates) {
      constexpr auto tracking = object_tracking::TrackState::tracking;
      if (a.target >= b.target || a.state != tracking || b.state != tracking) continue;
      if ((a.position - b.position).norm() < std::min(options_[a.target].radius_m, options_[b.target].radius_m))
        together[{a.target, b.target}] = together_[{a.target, b.target}] + 1;
    }
  }
  together_ = std::move(together);
  for (std::size_t t = 0; t < targets_.size() && t < options_.size(); ++t) {
    const auto lasting = std::ranges::find_if(
        together_, [&](const auto& pair) { return pair.first.first == t && pair.second >= window; });
    targets_[t].shared_place.set(
        lasting == together_.end() ? "" : shared_place_text(options_[t].name, options_[lasting->first.second].name),
        "");
  }
}

void ObjectReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  options_ = config.targets;
  together_.clear();
  for (std::size_t t = 0; t < targets_.size() && t < options_.size(); ++t) {
    targets_[t].tracked = {options_[t].radius_m, cameras_.size()};
    targets_[t].is_unsure = {};
  }
}

std::vector<std::string> ObjectReport::all(std::string Finding::*which) const {
  std::vector<std::string> sentences;
  const auto add = [&](const Finding& finding) {
    if (!(finding.*which).empty()) sentences.push_back(finding.*which);
  };
  for (const Target& target : targets_) {
    std::ranges::for_each(target.clutter, add);
    std::ranges::for_each(target.other_colors, add);
    add(target.extra_object);
    add(target.shared_place);
  }
  return sentences;
}

std::vector<std::string> ObjectReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> sentences = all(&Finding::now);
  for (const Target& target : targets_)
    if (!target.is_unsure.now.empty()) sentences.push_back(target.is_unsure.now);
  return sentences;
}

}  // namespace huetrack::reports
