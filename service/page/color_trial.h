// A colour that was learnt from a recording, tried on it before it is written: the recording is tracked by it, and what
// comes of that is held to where somebody pointed. A place that was suggested and that nobody has looked at may be
// something else; where it is, the views contradict one another, and the object is not tracked where it was seen.
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

// Where somebody saw the object, and when: of that camera's frame.
struct SeenAt {
  color_teaching::TeachPoint point;
  capture::Timestamp at;
};

struct ColorTrial {
  std::uint64_t sets = 0, tracking = 0;  // of the recording; and those in which an object of the target was `tracking`
  // What was stated then, sqrt of the covariance's trace, metres: the median, and what every tenth is above.
  double sigma_m = 0, rare_sigma_m = 0;
  // Three of the first are within the object's radius, and one of the second: it is usually known to be no thing beside
  // it, and hardly ever may be anywhere.
  bool is_sure = false;
  // How far from where it was seen something is told, and how far it may be, px; nullopt: nothing is `tracking` within
  // a quarter of a second. In that very picture the region that is taken for it must hold the point; in others its
  // radius, three sigmas and what it may swerve until then are allowed.
  struct Beside {
    double off_px = 0, allowed_px = 0;
  };
  std::optional<Beside> at_point;

  bool is_found() const { return at_point && at_point->off_px <= at_point->allowed_px; }
};

// Tracks the recording up to a minute beyond the moment at which the object was seen, without outputs. words: as of
// recordings::read_recording(); target: with the colours to try. throws std::runtime_error, as a replay does.
ColorTrial try_color(config::ServiceConfig config, std::span<const std::string> words,
                     const object_tracking::TargetOptions& target, const SeenAt& seen, const std::stop_token& stop);

// A sentence for people; camera: that was pointed into.
std::string words_of(const ColorTrial& trial, const std::string& camera);

}  // namespace huetrack::page
