#include "reports/calibration_words.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

namespace huetrack::reports {
namespace {

using config::CalibrationMode;
using room_watch::RoomState;

constexpr double degrees = 180 / std::numbers::pi;
constexpr double unix_times_from_s = 1e9;  // of 2001; a recording's own clock begins near 0

std::string consequence(const pipeline::CameraCalibration& facts, CalibrationMode mode) {
  const double off_mm = 1e3 * facts.effect_m;
  const auto followed = [&] {
    return fmt::format("to {:.0f} mm and {:.2f} degrees", std::max(1.0, 1e3 * facts.moved->shift_sigma),
                       degrees * facts.moved->rotation_sigma);
  };
  switch (mode) {
    case CalibrationMode::tell:
      break;
    case CalibrationMode::leave_out:
      if (!facts.is_used)
        return fmt::format("it is left out until it fits again; with it positions would be off by about {:.0f} mm",
                           off_mm);
      if (facts.is_mended && facts.moved)
        return fmt::format("too few would be left without it: its pose is followed, {}", followed());
      break;
    case CalibrationMode::mend:
      if (facts.is_mended && facts.moved)
        return fmt::format("positions would be off by about {:.0f} mm; its pose is followed, {}", off_mm, followed());
      break;
  }
  return fmt::format("positions are off by about {:.0f} mm until it is mended", off_mm);
}

std::string by_how_much(const pipeline::CameraCalibration& facts) {
  const room_watch::MovedPoseEstimate& moved = *facts.moved;
  return fmt::format("{:.2f} degrees and moved by {:.0f} mm (+- {:.0f})", degrees * moved.rotation.norm(),
                     1e3 * moved.shift.norm(), std::max(1.0, 1e3 * moved.shift_sigma));
}

}  // namespace

std::string moment_text(capture::Timestamp at) {
  const double s = capture::seconds(at);
  if (s < unix_times_from_s) return fmt::format("{:.2f} s", s);
  return fmt::format("{:%H:%M:%S}", fmt::localtime(std::chrono::system_clock::to_time_t(
                                        std::chrono::time_point_cast<std::chrono::system_clock::duration>(at))));
}

std::string calibration_warning(const std::string& camera, const pipeline::CameraCalibration& facts,
                                CalibrationMode mode) {
  const std::string since = moment_text(facts.room.since);
  switch (facts.room.state) {
    case RoomState::learning:
    case RoomState::plain:
    case RoomState::still:
    case RoomState::moving:
      return {};
    case RoomState::knocked:
      if (!facts.moved || !facts.room.turn) return {};
      return fmt::format("{} was turned by {} at {}: {}", camera, by_how_much(facts),
                         moment_text(facts.room.turn->from), consequence(facts, mode));
    case RoomState::sagging:
      if (!facts.moved || !facts.room.turn) return {};
      return fmt::format("{} sags: since {} it has slowly turned by {}: {}", camera, moment_text(facts.room.turn->from),
                         by_how_much(facts), consequence(facts, mode));
    case RoomState::zoomed:
      return fmt::format(
          "{}'s picture {} by {:.1f} % at {}: its zoom or focus was changed: set it back, or calibrate its lens "
          "again{}",
          camera, facts.room.zoom > 0 ? "grew" : "shrank", 100 * std::abs(facts.room.zoom), since,
          facts.is_used ? "" : "; it is left out until then");
    case RoomState::blinded:
      return fmt::format("{} has seen next to nothing since {}: it is covered, in the dark, or its lens is dirty",
                         camera, since);
    case RoomState::hidden:
      return fmt::format(
          "{} has seen nothing of the room as it was since {}: it was turned far away, or something large is "
          "before it",
          camera, since);
  }
  return {};
}

}  // namespace huetrack::reports
