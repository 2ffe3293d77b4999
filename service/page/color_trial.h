// Tests a colour learnt from a recording before it is saved: tracks the recording with it and compares the track with
// the place that the user clicked on. If an unconfirmed suggestion in another view was wrong, the object is not tracked
// there.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include "capture/frames/frame.h"
#include "color_teaching/color_teacher.h"
#include "config/service_config.h"

namespace huetrack::page {

// The clicked point and the time of its frame.
struct SeenAt {
  color_teaching::TeachPoint point;
  capture::Timestamp at;
};

struct ColorTrial {
  std::uint64_t sets = 0, tracking = 0;  // of the recording; with an object of the target in `tracking`
  // sqrt of the covariance's trace while tracking, metres: median and 90th percentile. Without the rig's uncertainty,
  // which is a constant that all positions share.
  double sigma_m = 0, rare_sigma_m = 0;
  // Three times the median and one time the percentile of the sigma in the pictures are within the object's radius
  // there: the object is distinguished from its surroundings. How far away the only camera sees it does not count.
  bool is_sure = false;
  // Distance of the track from the clicked point, and its limit, px; nullopt: not `tracking` within a quarter of a
  // second. In the clicked frame, the object's region must contain the point; in others the limit is the radius, three
  // sigmas and the possible manoeuvre meanwhile.
  struct Distance {
    double px = 0, limit_px = 0;
  };
  std::optional<Distance> at_point;

  // 1/m: the higher, the better the range: tracked more often, or with a smaller sigma.
  double precision() const { return sigma_m > 0 ? double(tracking) / sigma_m : 0; }

  bool is_found() const { return at_point && at_point->px <= at_point->limit_px; }
};

// Tracks the recording up to a minute beyond the clicked frame. words: as for recordings::read_recording(); target:
// with the colours to test. throws std::runtime_error, as a replay.
ColorTrial try_color(config::ServiceConfig config, std::span<const std::string> words,
                     const object_tracking::TargetOptions& target, const SeenAt& seen, const std::stop_token& stop);

// A sentence for people; camera: that of the click.
std::string words_of(const ColorTrial& trial, const std::string& camera);

}  // namespace huetrack::page
