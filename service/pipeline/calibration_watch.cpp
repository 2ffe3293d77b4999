#include "pipeline/calibration_watch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "calib/model/covariance_ellipse.h"

namespace huetrack::pipeline {
namespace {

using config::CalibrationMode;
using object_tracking::CameraTrust;
using room_watch::RoomState;

struct CalibrationWatchTuning {
  double room_depth_ratio = 1.5;  // depth of the background over that of the volume's centre, which is before it
  double lever_m = 0.3;           // m, pivot to optical centre on a tripod: shift per radian of a rotation
  double shift_m = 0.004;         // m, 1 sigma of the shift that a rotation of zero may have
  double resend_share = 0.3;  // a change below this share of the sigma is not sent: trackers restart learning on each
  double tolerated_effect_m = 0.01;  // m, rms of positions: error of an ordinary calibration
  double update_pause_s = 0.5;       // s, between two updates of one camera's trust, and of its effect
};
constexpr CalibrationWatchTuning calibration_tuning{};

const capture::Duration update_pause = capture::duration_of(calibration_tuning.update_pause_s);

// Whether the trackers need the new pose or covariance.
bool differs(const CameraTrust& wanted, const CameraTrust& given) {
  const double before = given.pose_covariance.trace(), after = wanted.pose_covariance.trace();
  if (after < (1 - calibration_tuning.resend_share) * before || before < (1 - calibration_tuning.resend_share) * after)
    return true;
  if (!wanted.cam_from_world || !given.cam_from_world) return false;
  const calib::Tangent6d change = calib::log(*wanted.cam_from_world * calib::inverse(*given.cam_from_world));
  const double rotation_sigma = std::sqrt(given.pose_covariance.topLeftCorner<3, 3>().trace());
  const double shift_sigma = std::sqrt(given.pose_covariance.bottomRightCorner<3, 3>().trace());
  return change.head<3>().norm() > calibration_tuning.resend_share * rotation_sigma ||
         change.tail<3>().norm() > calibration_tuning.resend_share * shift_sigma;
}

bool has_moved(RoomState state) {
  return state == RoomState::knocked || state == RoomState::sagging;
}

// A significant rotation that is below the threshold for reporting the camera as moved.
bool has_turned_a_little(const room_watch::RoomCondition& room) {
  if (room.state != RoomState::still || room.rotation.isZero(0)) return false;
  return room.rotation.dot(room.covariance.llt().solve(room.rotation)) > calib::chi2_999_in_3d;
}

bool is_of_no_use(RoomState state) {
  return state == RoomState::moving || state == RoomState::zoomed;
}

}  // namespace

CalibrationWatch::CalibrationWatch(const calib::CameraRig& rig, const object_tracking::Volume& volume,
                                   config::CalibrationConfig config, std::vector<bool> still)
    : rig_(rig), volume_(volume), config_(std::move(config)), facts_(rig.cameras.size()), trust_(rig.cameras.size()) {
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    const calib::Camera& camera = rig_.cameras[c];
    watched_.push_back({.watch = room_watch::CameraWatch(camera, known_patches(camera.name)), .is_still = still[c]});
  }
}

std::vector<room_watch::KeptPatch> CalibrationWatch::known_patches(const std::string& camera) const {
  const auto known = std::ranges::find(config_.room, camera, &config::KeptRoom::camera);
  return known == config_.room.end() ? std::vector<room_watch::KeptPatch>() : known->patches;
}

void CalibrationWatch::begin_anew() {
  std::vector<Watched> anew;
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    const calib::Camera& camera = rig_.cameras[c];
    std::vector<room_watch::KeptPatch> patches = watched_[c].watch.room();
    if (patches.empty()) patches = known_patches(camera.name);
    anew.push_back({.watch = room_watch::CameraWatch(camera, patches), .is_still = watched_[c].is_still});
    facts_[c] = {};
  }
  watched_.swap(anew);
}

bool CalibrationWatch::look(const capture::FrameSet& set) {
  for (std::size_t c = 0; c < watched_.size(); ++c) {
    const auto& frame = set.frames[c];
    if (!watched_[c].is_still || !frame) continue;
    watched_[c].watch.look(*frame, watched_[c].objects);
    follow(c);
    note(c, set.at);
  }
  const std::vector<bool> used = used_cameras();
  bool is_news = false;
  for (std::size_t c = 0; c < watched_.size(); ++c) is_news = trust_camera(c, used[c], set.at) || is_news;
  return is_news;
}

// Updates the pose estimate by the state of the room.
void CalibrationWatch::follow(std::size_t camera) {
  Watched& w = watched_[camera];
  const room_watch::RoomCondition& room = w.watch.condition();
  if (room.state == RoomState::still || room.state == RoomState::changed) {
    w.pose.reset();
    w.turns = room.turns;
  } else if (has_moved(room.state) && room.turn) {
    const bool is_new = w.turns != room.turns;
    w.turns = room.turns;
    if (!w.pose || (is_new && !room.turn->is_slow)) {
      const Eigen::Vector3d centre = (volume_.min + volume_.max) / 2;
      const double distance_m = calibration_tuning.room_depth_ratio * (rig_.cameras[camera].centre() - centre).norm();
      const double turned_rad = room_watch::rotation_between(room.turn->before, room.turn->after).norm();
      const double shift_m = calibration_tuning.shift_m + calibration_tuning.lever_m * turned_rad;
      w.pose.emplace(rig_.cameras[camera], distance_m, shift_m);
      w.rotation.setZero();
    }
    if (w.rotation != room.rotation) {
      w.rotation = room.rotation;
      w.pose->set_room({room.rotation, room.covariance, room.shift_to_rotation});
    }
  }
}

void CalibrationWatch::note(std::size_t camera, capture::Timestamp at) {
  Watched& w = watched_[camera];
  CameraCalibration& facts = facts_[camera];
  facts.room = w.watch.condition();
  facts.moved = w.pose ? std::optional(w.pose->estimate()) : std::nullopt;
  if (!facts.moved) facts.effect_m = 0, w.effect_at.reset();
  if (facts.moved && (!w.effect_at || at - *w.effect_at >= update_pause)) {
    w.effect_at = at;
    facts.effect_m = effect_of(camera, facts.moved->cam_from_world);
  }
}

// A position needs two cameras of a rig that has several. If fewer would remain, moved cameras with a small effect are
// used at their current pose (trust_camera).
std::vector<bool> CalibrationWatch::used_cameras() const {
  std::vector<bool> used(facts_.size(), true);
  std::vector<std::size_t> usable;
  for (std::size_t c = 0; c < facts_.size(); ++c) {
    const bool is_left_out = config_.watch == CalibrationMode::leave_out && facts_[c].moved;
    const bool is_useless = config_.watch != CalibrationMode::tell && is_of_no_use(facts_[c].room.state);
    used[c] = watched_[c].is_still && !is_left_out && !is_useless;
    if (is_left_out && !is_useless && facts_[c].effect_m < calibration_tuning.tolerated_effect_m) usable.push_back(c);
  }
  std::ranges::stable_sort(usable, {}, [&](std::size_t c) { return facts_[c].effect_m; });
  for (const std::size_t c : usable)
    if (std::ranges::count(used, true) < 2) used[c] = true;
  for (std::size_t c = 0; c < facts_.size(); ++c)
    if (!watched_[c].is_still) used[c] = true;  // not monitored
  return used;
}

// Returns whether the trackers need an update.
bool CalibrationWatch::trust_camera(std::size_t camera, bool is_used, capture::Timestamp at) {
  Watched& w = watched_[camera];
  CameraCalibration& facts = facts_[camera];
  CameraTrust wanted;
  wanted.is_used = is_used;
  wanted.has_moved = facts.moved.has_value();
  const bool is_kept = config_.watch == CalibrationMode::leave_out && is_used;
  if (facts.moved && (config_.watch == CalibrationMode::mend || is_kept)) {
    wanted.cam_from_world = facts.moved->cam_from_world;
    wanted.pose_covariance = facts.moved->covariance;
  } else if (facts.moved) {
    const calib::Tangent6d error =  // of the rig's pose, which the trackers keep
        calib::log(facts.moved->cam_from_world * calib::inverse(rig_.cameras[camera].cam_from_world));
    wanted.pose_covariance = facts.moved->covariance + error * error.transpose();
  } else if (has_turned_a_little(facts.room)) {
    const Eigen::Vector3d& turn = facts.room.rotation;
    wanted.pose_covariance.topLeftCorner<3, 3>() = facts.room.covariance + turn * turn.transpose();
  }
  const bool is_inflated = !wanted.pose_covariance.isZero(0);
  CameraTrust& given = trust_[camera];
  bool is_news =
      wanted.is_used != given.is_used || wanted.has_moved != given.has_moved || is_inflated != w.trusted_at.has_value();
  if (!is_news && is_inflated && at - *w.trusted_at >= update_pause) is_news = differs(wanted, given);
  if (!is_news) return false;
  given = wanted;
  w.trusted_at = is_inflated ? std::optional(at) : std::nullopt;
  facts.is_used = given.is_used;
  facts.is_mended = given.cam_from_world.has_value();
  return true;
}

void CalibrationWatch::learn(std::span<const object_tracking::ObjectEstimate> estimates) {
  // The others localise the object only if none of them has moved itself. Two cameras corrected by each other would
  // drift.
  const auto has_moved_in_use = [&](const CameraCalibration& facts) { return facts.moved && facts.is_used; };
  const auto moved_in_use = std::ranges::count_if(facts_, has_moved_in_use);
  for (std::size_t c = 0; c < watched_.size(); ++c) {
    Watched& w = watched_[c];
    const bool others_are_right = moved_in_use - (has_moved_in_use(facts_[c]) ? 1 : 0) == 0;
    w.objects.clear();
    for (const auto& estimate : estimates) {
      if (!estimate.has_position() || c >= estimate.per_view.size()) continue;
      const object_tracking::ViewSupport& view = estimate.per_view[c];
      if (view.in_view) w.objects.push_back({view.px.cast<double>(), double(view.radius_px)});
      if (!others_are_right || !w.pose || !view.leave_one_out || !has_moved(facts_[c].room.state)) continue;
      const object_tracking::LeaveOneOut& seen = *view.leave_one_out;
      w.pose->add({.at = seen.at,
                   .px = seen.px,
                   .covariance = seen.covariance,
                   .position = seen.position,
                   .position_covariance = seen.position_covariance});
    }
  }
}

std::vector<config::KeptRoom> CalibrationWatch::room() const {
  std::vector<config::KeptRoom> room;
  for (std::size_t c = 0; c < watched_.size(); ++c)
    if (auto patches = watched_[c].watch.room(); !patches.empty())
      room.push_back({rig_.cameras[c].name, std::move(patches)});
  return room;
}

// RMS error of positions that are found with the rig's pose while the camera has pose `now`: over those nodes of a grid
// in the volume that this camera and another one see. The only camera finds them by size: where they are in its frame.
double CalibrationWatch::effect_of(std::size_t camera, const calib::Rigid3d& now) const {
  constexpr std::array<double, 3> shares{0.2, 0.5, 0.8};  // layout: nodes of the grid on each axis
  double sum = 0;
  int places = 0;
  for (int k = 0; k < 27; ++k) {
    const Eigen::Vector3d share(shares[std::size_t(k % 3)], shares[std::size_t(k / 3 % 3)], shares[std::size_t(k / 9)]);
    const Eigen::Vector3d p = volume_.min + share.cwiseProduct(volume_.max - volume_.min);
    if (rig_.cameras.size() == 1) {
      const calib::Camera& view = rig_.cameras.front();
      const auto px = view.model.project(now * p);
      if (!px || !view.contains(*px)) continue;
      sum += (calib::inverse(view.cam_from_world) * (now * p) - p).squaredNorm();
      ++places;
      continue;
    }
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d pull = Eigen::Vector3d::Zero();
    int views = 0;
    bool is_seen = false;
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      if (!watched_[c].is_still) continue;
      const calib::Camera& view = rig_.cameras[c];
      calib::CameraModel::Jacobian jacobian;
      const auto px = view.model.project(view.cam_from_world * p, jacobian);
      if (!px || !view.contains(*px)) continue;
      ++views;
      const Eigen::Matrix<double, 2, 3> by_position = jacobian * view.cam_from_world.rotation.toRotationMatrix();
      information += by_position.transpose() * by_position;
      if (c != camera) continue;
      const auto seen = view.model.project(now * p);
      is_seen = seen.has_value();
      if (seen) pull = by_position.transpose() * (seen->px - px->px);
    }
    if (!is_seen || views < 2) continue;
    const Eigen::LLT<Eigen::Matrix3d> solver(information);
    if (solver.info() != Eigen::Success) continue;
    sum += solver.solve(pull).squaredNorm();
    ++places;
  }
  return places > 0 ? std::sqrt(sum / places) : 0;
}

}  // namespace huetrack::pipeline
