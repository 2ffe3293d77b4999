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
constexpr double unix_times_from_s = 1e9;  // unit: the year 2001; a recording's own clock begins near 0

std::string consequence(const pipeline::CameraCalibration& facts, CalibrationMode mode) {
  const double error_mm = 1e3 * facts.effect_m;
  const auto followed = [&] {
    return fmt::format("to {:.0f} mm and {:.2f} degrees", std::max(1.0, 1e3 * facts.moved->shift_sigma),
                       degrees * facts.moved->rotation_sigma);
  };
  switch (mode) {
    case CalibrationMode::tell:
      break;
    case CalibrationMode::leave_out:
      if (!facts.is_used)
        return fmt::format("it is left out until it fits again; with it, positions would be wrong by about {:.0f} mm",
                           error_mm);
      if (facts.is_mended && facts.moved)
        return fmt::format("too few cameras would remain without it, so its pose is followed, {}", followed());
      break;
    case CalibrationMode::mend:
      if (facts.is_mended && facts.moved)
        return fmt::format("positions would be wrong by about {:.0f} mm, so its pose is followed, {}", error_mm,
                           followed());
      break;
  }
  return fmt::format("positions are wrong by about {:.0f} mm until it is corrected", error_mm);
}

std::string by_how_much(const pipeline::CameraCalibration& facts) {
  const room_watch::MovedPoseEstimate& moved = *facts.moved;
  return fmt::format("{:.2f} degrees and moved by {:.0f} mm (+- {:.0f})", degrees * moved.rotation.norm(),
                     1e3 * moved.shift.norm(), std::max(1.0, 1e3 * moved.shift_sigma));
}

// middle: share of the picture's width and height.
std::string where(const Eigen::Vector2d& middle) {
  const auto of_three = [](double share, const char* low, const char* high) {
    return share < 1.0 / 3 ? low : share > 2.0 / 3 ? high : "";
  };
  const std::string row = of_three(middle.y(), "top", "bottom"), column = of_three(middle.x(), "left", "right");
  if (row.empty() && column.empty()) return "in the middle";
  return "at the " + row + (row.empty() || column.empty() ? "" : " ") + column;
}

std::string focus_text(const std::string& camera, const pipeline::CameraCalibration& facts, const std::string& since) {
  const double blur_px = facts.room.blur_px;
  const std::string by = blur_px < 0 ? "sharper" : fmt::format("blurred by {:.1f} px more", blur_px);
  return fmt::format(
      "{}'s focus has changed: since {} its pictures are {} than when its room was learnt{}: restore the focus, or "
      "calibrate the lens again",
      camera, since, by, blur_px < 0 ? "" : ", or its whole lens is smeared");
}

std::string change_text(const std::string& camera, const room_watch::RoomCondition& room, const std::string& since) {
  const double percent = 100 * room.change.share;
  const std::string place = where(room.change.middle);
  if (room.change.is_plain)
    return fmt::format(
        "a part of {}'s picture (about {:.0f} % of it, {}) has shown no structure since {}: the lens is dirty there, "
        "or something plain is in front of it: clean the lens or clear the view; meanwhile that part is not used to "
        "detect motion",
        camera, percent, place, since);
  return fmt::format(
      "the room has changed in {}'s view (about {:.0f} % of it, {}) at {}: that part is not used to detect motion "
      "until it is learnt again",
      camera, percent, place, since);
}

// For a rotation that a zoom explains equally well.
std::string or_zoom(const room_watch::RoomCondition& room) {
  if (room.zoom_instead == 0) return {};
  return fmt::format(
      " (or its zoom was changed by {:+.1f} %: it sees structure on one side only, which cannot distinguish the two)",
      100 * room.zoom_instead);
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
      return fmt::format("{} was turned by {} at {}{}: {}", camera, by_how_much(facts),
                         moment_text(facts.room.turn->from), or_zoom(facts.room), consequence(facts, mode));
    case RoomState::sagging:
      if (!facts.moved || !facts.room.turn) return {};
      return fmt::format("{} sags: since {} it has slowly turned by {}: {}", camera, moment_text(facts.room.turn->from),
                         by_how_much(facts), consequence(facts, mode));
    case RoomState::zoomed:
      return fmt::format(
          "{}'s picture {} by {:.1f} % at {}: its zoom or focus was changed: restore it, or calibrate the lens again{}",
          camera, facts.room.zoom > 0 ? "grew" : "shrank", 100 * std::abs(facts.room.zoom), since,
          facts.is_used ? "" : "; it is left out until then");
    case RoomState::defocused:
      return focus_text(camera, facts, since);
    case RoomState::changed:
      return change_text(camera, facts.room, since);
    case RoomState::blinded:
      return fmt::format(
          "{} has seen next to nothing since {}: it is covered, in the dark, or its lens is dirty: clear its view",
          camera, since);
    case RoomState::hidden:
      return fmt::format(
          "{} has seen nothing of the known room since {}: it was turned far away, or something large is in front of "
          "it: clear its view, or calibrate again",
          camera, since);
  }
  return {};
}

}  // namespace huetrack::reports
