#include "view_watch/jump_watch.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "object_tracking/sighting.h"
#include "view_watch/pair_residuals.h"

namespace huetrack::view_watch {
namespace {

struct JumpTuning {
  double times_the_speed = 5;     // of the steps before and after it; a throw, a bounce is as fast beside it
  double most_scale = 2;          // of the object in a view: half as far away; smaller ones are specks of its colour
  std::size_t longest_run = 2;    // jumps without a smooth step in between: one picture out of place
  std::size_t least_cameras = 2;  // that see them
};
constexpr JumpTuning tuning{};
// In a window: two such runs; an object of the colour that appears as another leaves is rarer.
constexpr std::size_t least_count = 2 * tuning.longest_run;

}  // namespace

void JumpWatch::look(std::span<const object_tracking::SeenRegion> regions, double now_s, double radius_m) {
  std::vector<Largest> now(last_.size());
  for (const auto& region : regions) {
    const auto c = static_cast<std::size_t>(region.camera);
    if (c < now.size() && region.radius_px > now[c].radius_px)
      now[c] = {region.px, region.radius_px, now_s, region.is_target};
  }
  constexpr double far = std::numeric_limits<double>::infinity();
  Step step{now_s, far, far, true};
  std::size_t views = 0;
  for (std::size_t c = 0; c < now.size(); ++c) {
    if (now[c].radius_px <= 0) continue;  // its last one stays
    const Largest before = std::exchange(last_[c], now[c]);
    const double since_s = now_s - before.at_s;
    if (since_s <= 0 || since_s > pair_sampling.longest_gap_s ||
        std::max(now[c].radius_px, before.radius_px) > tuning.most_scale * std::min(now[c].radius_px, before.radius_px))
      continue;
    ++views;
    const double radii = (now[c].px - before.px).norm() / std::min(now[c].radius_px, before.radius_px);
    step = {now_s, std::min(step.radii, radii), std::min(step.speed, radii / since_s),
            step.is_of_target && now[c].is_target};
  }
  while (!jumps_.empty() && jumps_.front().at_s < now_s - pair_sampling.window_s) jumps_.pop_front();
  if (!steps_.empty() && steps_.back().at_s < now_s - pair_sampling.longest_gap_s) steps_.clear();
  if (views < tuning.least_cameras) return;
  steps_.push_back(step);
  if (steps_.size() > tuning.longest_run + 2) steps_.pop_front();
  // A run of steps that are larger than the object, in every view that has just ended, with a small one of the tracked
  // object on either side: what flickers in its colour has none.
  for (std::size_t run = 1; run <= tuning.longest_run && steps_.size() >= run + 2; ++run) {
    const auto first = steps_.end() - 1 - static_cast<std::ptrdiff_t>(run);
    const double beside = std::max((first - 1)->speed, steps_.back().speed);
    const auto is_jump = [&](const Step& s) {
      return s.radii > object_tracking::sighting_tuning.extent_radii && s.speed > tuning.times_the_speed * beside;
    };
    if (!(first - 1)->is_of_target || !steps_.back().is_of_target || !std::all_of(first, steps_.end() - 1, is_jump))
      continue;
    for (auto jump = first; jump != steps_.end() - 1; ++jump) jumps_.push_back({jump->at_s, jump->radii * radius_m});
    break;
  }
}

std::optional<Jumps> JumpWatch::jumps() const {
  if (jumps_.size() < least_count) return std::nullopt;
  return Jumps{static_cast<int>(jumps_.size()), jumps_.back().at_s - jumps_.front().at_s,
               std::ranges::max(jumps_, {}, &Jump::size_m).size_m};
}

}  // namespace huetrack::view_watch
