#include "reports/rig_report.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <numbers>
#include <ranges>

#include "reports/calibration_words.h"

namespace huetrack::reports {
namespace {

using namespace std::chrono_literals;
using room_watch::RoomState;

constexpr capture::Duration figures_pause = 500ms;  // between two updates of the figures in warnings
// A moved camera is reported once its shift is known (m, 1 sigma), or this long after detection: within 2 s of the
// event.
constexpr capture::Duration waits_for_shift = 700ms;
constexpr double known_shift_sigma_m = 0.004;

bool is_reportable(RoomState state) {
  return is_trouble(state) || state == RoomState::changed;
}

std::string all_clear(const std::string& camera, RoomState before) {
  if (before == RoomState::changed) return "the changed part of " + camera + "'s view is learnt again";
  if (before == RoomState::defocused) return camera + "'s focus is as it was";
  return camera + " stands again where the rig says";
}

}  // namespace

bool is_trouble(RoomState state) {
  return state == RoomState::knocked || state == RoomState::sagging || state == RoomState::zoomed ||
         state == RoomState::defocused || state == RoomState::blinded || state == RoomState::hidden;
}

RigReport::RigReport(const config::ServiceConfig& config)
    : cameras_(config.rig.camera_names()),
      mode_(config.calibration.watch),
      reported_(cameras_.size()),
      warnings_(cameras_.size()),
      facts_(cameras_.size()) {}

// Whether the camera has a new state that is known well enough to be reported; notes it as reported.
bool RigReport::is_news(std::size_t camera, const pipeline::CameraCalibration& facts, capture::Timestamp at) {
  Reported& reported = reported_[camera];
  const RoomState state = facts.room.state;
  if (state == RoomState::moving) return false;  // the state after the motion is reported
  const bool is_same = state == reported.state && facts.room.turns == reported.turns;
  if (is_same) {
    reported.pending_since.reset();
    return false;
  }
  if (!is_reportable(state)) {
    reported = {.state = state, .turns = facts.room.turns, .pending_since = {}};
    return state == RoomState::still && std::ranges::any_of(events_, [&](const auto& h) { return h.camera == camera; });
  }
  if (!reported.pending_since) reported.pending_since = at;
  const bool may_be_better_known = facts.moved && facts.moved->shift_sigma > known_shift_sigma_m;
  if (may_be_better_known && at - *reported.pending_since < waits_for_shift) return false;
  reported = {.state = state, .turns = facts.room.turns, .pending_since = {}};
  return true;
}

void RigReport::on_set(const pipeline::TrackedSet& set) {
  if (set.calibration.empty()) return;
  const capture::Timestamp at = set.frames.at;
  bool has_news = !next_at_ || at >= *next_at_;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const pipeline::CameraCalibration& facts = set.calibration[c];
    const RoomState before = reported_[c].state;
    if (is_news(c, facts, at)) {
      has_news = true;
      if (is_reportable(facts.room.state)) {
        spdlog::warn("{}", calibration_warning(cameras_[c], facts, mode_));
        events_.push_back(
            {.camera = c, .state = facts.room.state, .turns = facts.room.turns, .reported_at = at, .facts = facts});
      } else {
        spdlog::info("{}", all_clear(cameras_[c], before));
      }
    }
  }
  if (!has_news) return;
  next_at_ = at + figures_pause;
  update_latest_events(set.calibration);
  const std::scoped_lock lock(mutex_);
  std::ranges::copy(set.calibration, facts_.begin());
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const bool is_current = reported_[c].state == facts_[c].room.state && reported_[c].turns == facts_[c].room.turns;
    warnings_[c] = is_current ? calibration_warning(cameras_[c], facts_[c], mode_) : std::string();
  }
}

// A camera's earlier events are over, and so is the latest one if the current state began after its report.
void RigReport::update_latest_events(std::span<const pipeline::CameraCalibration> calibration) {
  std::vector<bool> is_done(cameras_.size(), false);
  for (Event& h : std::views::reverse(events_)) {
    if (is_done[h.camera]) continue;
    is_done[h.camera] = true;
    const pipeline::CameraCalibration& facts = calibration[h.camera];
    if (facts.room.state == h.state && facts.room.turns == h.turns && facts.room.since <= h.reported_at)
      h.facts = facts;
  }
}

std::vector<std::string> RigReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> all;
  std::ranges::copy_if(warnings_, std::back_inserter(all), [](const auto& warning) { return !warning.empty(); });
  return all;
}

std::vector<pipeline::CameraCalibration> RigReport::cameras() const {
  const std::scoped_lock lock(mutex_);
  return facts_;
}

std::vector<std::string> RigReport::summary() const {
  std::vector<std::string> all;
  for (const Event& h : events_)
    all.push_back(fmt::format("reported at {}: {}", moment_text(h.reported_at),
                              calibration_warning(cameras_[h.camera], h.facts, mode_)));
  for (std::size_t c = 0; c < cameras_.size(); ++c)
    if (facts_[c].room.state == RoomState::plain)
      all.push_back("the view of " + cameras_[c] + " has too little structure to detect whether it is moved");
  return all;
}

int RigReport::mend(calib::CameraRig& rig) const {
  int moved = 0;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (!facts_[c].moved) continue;
    ++moved;
    const room_watch::MovedPoseEstimate& m = *facts_[c].moved;
    rig.cameras[c].cam_from_world = m.cam_from_world;
    rig.uncertainty = calib::with_pose_covariance(rig, int(c), m.covariance);
    const std::string key = "mended_" + cameras_[c];
    std::erase_if(rig.made_by, [&](const auto& entry) { return entry.first == key; });
    rig.made_by.emplace_back(
        key, fmt::format("by huetrackd while tracking: turned by {:.2f} degrees, moved by {:.0f} mm (+- {:.0f})",
                         m.rotation.norm() * 180 / std::numbers::pi, 1e3 * m.shift.norm(), 1e3 * m.shift_sigma));
  }
  return moved;
}

}  // namespace huetrack::reports
