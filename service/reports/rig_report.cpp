#include "reports/rig_report.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <numbers>

#include "reports/calibration_words.h"

namespace huetrack::reports {
namespace {

using namespace std::chrono_literals;
using room_watch::RoomState;

constexpr capture::Duration figures_pause = 500ms;  // of the figures in warnings
// A knock is told when its shift is known as well, or else so long after it was noticed: within two seconds of it.
constexpr capture::Duration waits_for_shift = 700ms;
constexpr double known_shift_sigma_m = 0.004;

// Whether there is a sentence for people.
bool is_told(RoomState state) {
  return is_trouble(state) || state == RoomState::changed;
}

std::string all_clear(const std::string& camera, RoomState before) {
  if (before == RoomState::changed) return "what " + camera + " sees of the room is known again";
  if (before == RoomState::defocused) return camera + "'s focus is again as it was";
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
      told_(cameras_.size()),
      warnings_(cameras_.size()),
      facts_(cameras_.size()) {}

// Whether there is something new of that camera, and enough is known of it.
bool RigReport::is_news(std::size_t camera, const pipeline::CameraCalibration& facts, capture::Timestamp at) {
  Told& told = told_[camera];
  const RoomState state = facts.room.state;
  if (state == RoomState::moving) return false;  // what comes of it is told
  const bool is_same = state == told.state && facts.room.turns == told.turns;
  if (is_same) {
    told.seen_at.reset();
    return false;
  }
  if (!is_told(state)) {
    told = {.state = state, .turns = facts.room.turns, .seen_at = {}};
    return state == RoomState::still &&
           std::ranges::any_of(happenings_, [&](const auto& h) { return h.camera == camera; });
  }
  if (!told.seen_at) told.seen_at = at;
  const bool may_be_better_known = facts.moved && facts.moved->shift_sigma > known_shift_sigma_m;
  if (may_be_better_known && at - *told.seen_at < waits_for_shift) return false;
  told = {.state = state, .turns = facts.room.turns, .seen_at = {}};
  return true;
}

void RigReport::on_set(const pipeline::TrackedSet& set) {
  if (set.calibration.empty()) return;
  const capture::Timestamp at = set.frames.at;
  bool has_news = !next_at_ || at >= *next_at_;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const pipeline::CameraCalibration& facts = set.calibration[c];
    const RoomState before = told_[c].state;
    if (is_news(c, facts, at)) {
      has_news = true;
      if (is_told(facts.room.state)) {
        spdlog::warn("{}", calibration_warning(cameras_[c], facts, mode_));
        happenings_.push_back(
            {.camera = c, .state = facts.room.state, .turns = facts.room.turns, .told_at = at, .facts = facts});
      } else {
        spdlog::info("{}", all_clear(cameras_[c], before));
      }
    }
  }
  if (!has_news) return;
  next_at_ = at + figures_pause;
  for (Happening& h : happenings_) {
    const pipeline::CameraCalibration& facts = set.calibration[h.camera];
    if (facts.room.state == h.state && facts.room.turns == h.turns) h.facts = facts;
  }
  const std::scoped_lock lock(mutex_);
  std::ranges::copy(set.calibration, facts_.begin());
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const bool is_out = told_[c].state == facts_[c].room.state && told_[c].turns == facts_[c].room.turns;
    warnings_[c] = is_out ? calibration_warning(cameras_[c], facts_[c], mode_) : std::string();
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
  for (const Happening& h : happenings_)
    all.push_back(
        fmt::format("told at {}: {}", moment_text(h.told_at), calibration_warning(cameras_[h.camera], h.facts, mode_)));
  for (std::size_t c = 0; c < cameras_.size(); ++c)
    if (facts_[c].room.state == RoomState::plain)
      all.push_back("too little of what " + cameras_[c] + " sees has structure: whether it was moved is not watched");
  return all;
}

bool RigReport::has_had_trouble() const {
  return std::ranges::any_of(happenings_, is_trouble, &Happening::state);
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
        key,
        fmt::format(
            "by huetrackd, from what it saw while tracking: turned by {:.2f} degrees, moved by {:.0f} mm (+- {:.0f})",
            m.rotation.norm() * 180 / std::numbers::pi, 1e3 * m.shift.norm(), 1e3 * m.shift_sigma));
  }
  return moved;
}

}  // namespace huetrack::reports
