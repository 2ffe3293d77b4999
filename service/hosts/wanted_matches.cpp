#include "hosts/wanted_matches.h"

#include <algorithm>
#include <utility>

#include "color/match_tiles.h"

namespace huetrack::hosts {
namespace {

constexpr double longest_picture_every_s = 1e6;

}  // namespace

void to_message(const Wanted& wanted, msg::LookedForColors& out) {
  out.colors().clear();
  for (const capture::MatchedColor& color : wanted.colors) {
    msg::LookedFor& to = out.colors().emplace_back();
    to.hue_min_deg(color.hue_min_deg);
    to.hue_max_deg(color.hue_max_deg);
    to.saturation_min(color.saturation_min);
    to.saturation_max(color.saturation_max);
    to.intensity_min(color.intensity_min);
    to.intensity_max(color.intensity_max);
  }
  out.picture_every_s(capture::seconds(wanted.picture_every));
}

std::optional<Wanted> wanted_of(const msg::LookedForColors& message) {
  Wanted wanted;
  if (message.colors().size() > capture::Matches::most ||
      !(message.picture_every_s() >= 0 && message.picture_every_s() < longest_picture_every_s))
    return std::nullopt;
  for (const msg::LookedFor& color : message.colors()) {
    wanted.colors.push_back({.hue_min_deg = color.hue_min_deg(),
                             .hue_max_deg = color.hue_max_deg(),
                             .saturation_min = color.saturation_min(),
                             .saturation_max = color.saturation_max(),
                             .intensity_min = color.intensity_min(),
                             .intensity_max = color.intensity_max()});
    if (!color::range_of(wanted.colors.back()).problems().empty()) return std::nullopt;
  }
  wanted.picture_every = capture::duration_of(message.picture_every_s());
  return wanted;
}

bool WantedMatches::update(const msg::LookedForColors& message, Clock::time_point now) {
  auto wanted = wanted_of(message);
  if (!wanted || (by_tracker_.size() >= most_trackers && !by_tracker_.contains(message.tracker()))) return false;
  by_tracker_[message.tracker()] = {.wanted = std::move(*wanted), .at = now};
  return true;
}

void WantedMatches::all(Clock::time_point now, MatchFinderOptions& out) {
  out.colors.clear();
  out.picture_every = {};
  std::erase_if(by_tracker_, [&](const auto& entry) { return now - entry.second.at > forgotten_after; });
  for (const auto& [tracker, request] : by_tracker_) {
    for (const capture::MatchedColor& color : request.wanted.colors)
      if (out.colors.size() < capture::Matches::most && std::ranges::count(out.colors, color) == 0)
        out.colors.push_back(color);
    const capture::Duration every = request.wanted.picture_every;
    if (every > capture::Duration::zero())
      out.picture_every = out.picture_every > capture::Duration::zero() ? std::min(out.picture_every, every) : every;
  }
}

}  // namespace huetrack::hosts
