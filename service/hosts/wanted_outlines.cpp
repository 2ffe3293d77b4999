#include "hosts/wanted_outlines.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace huetrack::hosts {
namespace {

constexpr float furthest_px = 1e5, largest_radius_px = 1000;
// Margin around an outline: the fit's reach beyond the edge (outline/outline_fit.cpp: 4 px and half of an exposure's
// smear), some background for contrast, and the prediction's error. The acceleration of a throw or a hand, some
// 20 m/s^2, is 1 px in 30 ms at 500 px/m; a faster swerve is measured by its region alone.
constexpr double margin_px = 7, of_radius = 0.15, smeared_s = 0.005, px_per_s2 = 2000;

bool is_sound(const msg::ExpectedOutline& message) {
  return std::ranges::all_of(std::array{message.u(), message.v(), message.u_per_s(), message.v_per_s()},
                             [](float number) { return std::abs(number) < furthest_px; }) &&
         message.radius_px() > 0 && message.radius_px() < largest_radius_px;
}

capture::PatchPlace place_of(const capture::ExpectedOutline& outline, double after_s) {
  const double u = double(outline.u) + after_s * double(outline.u_per_s);
  const double v = double(outline.v) + after_s * double(outline.v_per_s);
  const double all_around =
      (1 + of_radius) * double(outline.radius_px) + margin_px + 0.5 * px_per_s2 * after_s * after_s;
  const auto span = [&](double at, double per_s) {
    const double reach = all_around + smeared_s * std::abs(per_s);
    const int first = 2 * static_cast<int>(std::floor((at - reach) / 2));
    return std::pair(first, 2 * static_cast<int>(std::ceil((at + reach) / 2)) - first);
  };
  const auto [first_u, width] = span(u, double(outline.u_per_s));
  const auto [first_v, height] = span(v, double(outline.v_per_s));
  return {.u = first_u, .v = first_v, .width = width, .height = height};
}

// The two overlap in most of the smaller one's width and height.
bool is_of_the_same(const capture::PatchPlace& a, const capture::PatchPlace& b) {
  const auto shared = [](int from_a, int length_a, int from_b, int length_b) {
    const int both = std::min(from_a + length_a, from_b + length_b) - std::max(from_a, from_b);
    return double(both) / std::min(length_a, length_b);
  };
  constexpr double mostly = 0.8;
  return shared(a.u, a.width, b.u, b.width) > mostly && shared(a.v, a.height, b.v, b.height) > mostly;
}

}  // namespace

void to_message(std::span<const capture::ExpectedOutline> outlines, msg::OutlinesOfCamera& out) {
  out.outlines().clear();
  for (const capture::ExpectedOutline& outline :
       outlines.first(std::min(outlines.size(), capture::Matches::most_patches))) {
    msg::ExpectedOutline& to = out.outlines().emplace_back();
    to.u(outline.u);
    to.v(outline.v);
    to.u_per_s(outline.u_per_s);
    to.v_per_s(outline.v_per_s);
    to.radius_px(outline.radius_px);
  }
}

bool outlines_of(const msg::OutlinesOfCamera& message, std::vector<capture::ExpectedOutline>& out) {
  if (message.outlines().size() > capture::Matches::most_patches || !std::ranges::all_of(message.outlines(), is_sound))
    return false;
  out.clear();
  for (const msg::ExpectedOutline& outline : message.outlines())
    out.push_back({.u = outline.u(),
                   .v = outline.v(),
                   .u_per_s = outline.u_per_s(),
                   .v_per_s = outline.v_per_s(),
                   .radius_px = outline.radius_px()});
  return true;
}

bool WantedOutlines::update(std::int64_t tracker, const msg::OutlinesOfCamera& message) {
  const Sent& of = sent_[message.number() % sent_.size()];
  if (of.number != message.number() || of.stamped_at == capture::Timestamp{}) return false;
  if (by_tracker_.size() >= most_trackers && !by_tracker_.contains(tracker)) return false;
  if (!outlines_of(message, scratch_)) return false;
  Predicted& predicted = by_tracker_[tracker];
  predicted.of = of.stamped_at;
  predicted.outlines.swap(scratch_);
  return true;
}

void WantedOutlines::places_at(capture::Timestamp stamped_at, std::vector<capture::PatchPlace>& out) {
  out.clear();
  std::erase_if(by_tracker_, [&](const auto& entry) {
    const capture::Duration after = stamped_at - entry.second.of;
    return after > forgotten_after || after < capture::Duration::zero();
  });
  for (const auto& [tracker, predicted] : by_tracker_) {
    const double after_s = capture::seconds(stamped_at - predicted.of);
    for (const capture::ExpectedOutline& outline : predicted.outlines) {
      const capture::PatchPlace place = place_of(outline, after_s);
      const auto same = std::ranges::find_if(out, [&](const auto& other) { return is_of_the_same(place, other); });
      if (same == out.end()) {
        if (out.size() < capture::Matches::most_patches) out.push_back(place);
        continue;
      }
      const int end_u = std::max(same->u + same->width, place.u + place.width);
      const int end_v = std::max(same->v + same->height, place.v + place.height);
      same->u = std::min(same->u, place.u), same->v = std::min(same->v, place.v);
      same->width = end_u - same->u, same->height = end_v - same->v;
    }
  }
}

}  // namespace huetrack::hosts
