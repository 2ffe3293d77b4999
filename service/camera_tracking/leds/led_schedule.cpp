#include "camera_tracking/leds/led_schedule.h"

#include <algorithm>
#include <cmath>

namespace huetrack::leds {

namespace {

using Eigen::Vector2d;
using namespace std::chrono_literals;

constexpr double early_slots = 0.1;
constexpr std::size_t sightings_wanted = 16;  // 32 equations for 12 unknowns and the offset
constexpr capture::Duration schedule_window = 600ms;
constexpr int tries_per_frame = 1;  // 10 to 30 ms each
constexpr double pixel_noise_px = 0.06;

double slots_of(const LedStart& start, const LedMoment& moment, int offset) {
  if (start.slot_s > 0) return capture::seconds(moment.at) / start.slot_s + early_slots + 0.5 * offset;
  return static_cast<double>(moment.index) + 0.5 + 0.5 * offset;
}

}  // namespace

LedMoment moment_of(const capture::Frame& frame) {
  return {frame.captured_at, frame.stream_index.value_or(static_cast<std::int64_t>(frame.sequence))};
}

std::optional<int> lit_led(const LedStart& start, const LedMoment& moment, int offset) {
  if (start.schedule.empty()) return std::nullopt;
  const auto n = static_cast<std::int64_t>(start.schedule.size());
  const auto slot = static_cast<std::int64_t>(std::floor(slots_of(start, moment, offset)));
  return start.schedule[static_cast<std::size_t>(((slot % n) + n) % n)];
}

LedOffsetSearch::LedOffsetSearch(const calib::Camera& camera, const LedStart& start, int particle_count,
                                 particle_filter::Rng rng)
    : start_(start),
      search_(camera,
              {.leds = start.leds,
               .room_min = start.room_min,
               .room_max = start.room_max,
               .particle_count = particle_count},
              rng) {}

void LedOffsetSearch::forget() {
  window_.clear();
  tried_on_.clear();
  untried_.clear();
  explained_by_.clear();
}

// Of the offsets that imply the same LEDs, the one with the largest margin.
std::vector<LedOffsetSearch::OffsetTrial> LedOffsetSearch::trials() const {
  std::vector<OffsetTrial> all;
  const int step = start_.slot_s > 0 ? 1 : 2;
  for (int offset = 0; offset < 2 * static_cast<int>(start_.schedule.size()); offset += step) {
    OffsetTrial c{.offset = offset, .margin = 1, .lit = {}};
    for (const TimedDot& s : tried_on_) {
      const double slots = slots_of(start_, s.moment, offset), part = slots - std::floor(slots);
      c.margin = std::min({c.margin, part, 1 - part});
      c.lit.push_back(*lit_led(start_, s.moment, offset));
    }
    if (std::ranges::find(c.lit, -1) != c.lit.end()) continue;  // a LED was seen while none is lit
    const auto same = std::ranges::find(all, c.lit, &OffsetTrial::lit);
    if (same == all.end())
      all.push_back(c);
    else if (c.margin > same->margin)
      *same = c;
  }
  return all;
}

std::optional<int> LedOffsetSearch::update(const LedMoment& moment, const std::optional<Vector2d>& dot) {
  if (dot) window_.push_back({moment, *dot});
  while (!window_.empty() &&
         (window_.size() > sightings_wanted || moment.at - window_.front().moment.at > schedule_window))
    window_.pop_front();
  if (tried_on_.empty()) {
    if (window_.size() < sightings_wanted) return std::nullopt;
    tried_on_.assign(window_.begin(), window_.end());
    untried_ = trials();
    explained_by_.clear();
  }
  for (int k = 0; k < tries_per_frame && !untried_.empty(); ++k) {
    const OffsetTrial c = untried_.back();
    untried_.pop_back();
    std::vector<LedSighting> sightings;
    for (std::size_t i = 0; i < tried_on_.size(); ++i)
      sightings.push_back({c.lit[i], tried_on_[i].px,
                           capture::seconds(tried_on_[i].moment.at - tried_on_.back().moment.at), pixel_noise_px});
    // An ambiguous pose explains the sightings, too.
    if (search_.find(sightings) || search_.is_ambiguous()) explained_by_.emplace_back(search_.noise_scale(), c.offset);
  }
  if (!untried_.empty()) return std::nullopt;
  tried_on_.clear();
  window_.clear();
  std::ranges::sort(explained_by_);
  const bool is_clear =
      explained_by_.size() == 1 || (explained_by_.size() > 1 && explained_by_[0].first < explained_by_[1].first);
  return is_clear ? std::optional(explained_by_.front().second) : std::nullopt;
}

}  // namespace huetrack::leds
