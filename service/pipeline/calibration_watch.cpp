#include "pipeline/calibration_watch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;
using config::CalibrationMode;
using object_tracking::CameraTrust;
using room_watch::RoomState;

// The room around the volume is seen farther away than the volume's centre: walls behind it, the floor below it.
constexpr double room_beyond_centre = 1.5;
// How far a camera's centre goes when it is turned: about something so far away, on a tripod and on a mount that gives
// way, and by so much anyhow.
constexpr double knocked_lever_m = 0.3, knocked_shift_m = 0.004, sagged_lever_m = 0.1, sagged_shift_m = 0.002;

// A pose that changed by less than this share of what is known of it is not told to the trackers anew, which forget
// then what they learnt of the camera; nor more often than so.
constexpr double news_share = 0.3;
constexpr double news_rotation_rad = 1e-4, news_shift_m = 3e-4;
constexpr double still_good_m = 0.01;  // as much as an ordinary calibration is off by
constexpr capture::Duration trust_pause = 500ms, effect_pause = 500ms;

// A pose that would be told once more, or one that the trackers need.
bool differs(const CameraTrust& wanted, const CameraTrust& given) {
  const double before = given.pose_covariance.trace(), after = wanted.pose_covariance.trace();
  if (after < (1 - news_share) * before || before < (1 - news_share) * after) return true;
  if (!wanted.cam_from_world || !given.cam_from_world) return false;
  const calib::Tangent6d change = calib::log(*wanted.cam_from_world * calib::inverse(*given.cam_from_world));
  const double rotation_sigma = std::sqrt(given.pose_covariance.topLeftCorner<3, 3>().trace());
  const double shift_sigma = std::sqrt(given.pose_covariance.bottomRightCorner<3, 3>().trace());
  return change.head<3>().norm() > std::max(news_rotation_rad, news_share * rotation_sigma) ||
         change.tail<3>().norm() > std::max(news_shift_m, news_share * shift_sigma);
}

bool has_moved(RoomState state) {
  return state == RoomState::knocked || state == RoomState::sagging;
}

// By so little that it is not told yet, or not at all, but surely: chi-square, 3 degrees of freedom, once in a
// thousand. In good recordings the largest was 12.
bool has_turned_a_little(const room_watch::RoomCondition& room) {
  constexpr double surely = 16.3;
  if (room.state != RoomState::still || room.rotation.isZero(0)) return false;
  return room.rotation.dot(room.covariance.llt().solve(room.rotation)) > surely;
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
    const auto known = std::ranges::find(config_.room, camera.name, &config::KeptRoom::camera);
    watched_.push_back({.watch = known == config_.room.end() ? room_watch::CameraWatch(camera)
                                                             : room_watch::CameraWatch(camera, known->patches),
                        .is_still = still[c]});
  }
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

// The pose, from what the room says.
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
      const double distance_m = room_beyond_centre * (rig_.cameras[camera].centre() - centre).norm();
      const double turned_rad = room_watch::rotation_between(room.turn->before, room.turn->after).norm();
      const double shift_m = room.turn->is_slow ? sagged_shift_m + sagged_lever_m * turned_rad
                                                : knocked_shift_m + knocked_lever_m * turned_rad;
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
  if (facts.moved && (!w.effect_at || at - *w.effect_at >= effect_pause)) {
    w.effect_at = at;
    facts.effect_m = effect_of(camera, facts.moved->cam_from_world);
  }
}

// Two cameras fix a position. Before there would be fewer, one that is off by little is used all the same, where it
// stands now (trust_camera).
std::vector<bool> CalibrationWatch::used_cameras() const {
  std::vector<bool> used(facts_.size(), true);
  std::vector<std::size_t> spared;
  for (std::size_t c = 0; c < facts_.size(); ++c) {
    const bool is_left_out = config_.watch == CalibrationMode::leave_out && facts_[c].moved;
    const bool is_useless = config_.watch != CalibrationMode::tell && is_of_no_use(facts_[c].room.state);
    used[c] = watched_[c].is_still && !is_left_out && !is_useless;
    if (is_left_out && !is_useless && facts_[c].effect_m < still_good_m) spared.push_back(c);
  }
  std::ranges::stable_sort(spared, {}, [&](std::size_t c) { return facts_[c].effect_m; });
  for (const std::size_t c : spared)
    if (std::ranges::count(used, true) < 2) used[c] = true;
  for (std::size_t c = 0; c < facts_.size(); ++c)
    if (!watched_[c].is_still) used[c] = true;  // nothing is known of it
  return used;
}

// True: that is news for the trackers.
bool CalibrationWatch::trust_camera(std::size_t camera, bool is_used, capture::Timestamp at) {
  Watched& w = watched_[camera];
  CameraCalibration& facts = facts_[camera];
  CameraTrust wanted;
  wanted.is_used = is_used;
  wanted.has_moved = facts.moved.has_value();
  const bool is_spared = config_.watch == CalibrationMode::leave_out && is_used;
  if (facts.moved && (config_.watch == CalibrationMode::mend || is_spared)) {
    wanted.cam_from_world = facts.moved->cam_from_world;
    wanted.pose_covariance = facts.moved->covariance;
  } else if (facts.moved) {
    // It is held to stand where the rig says, which is off by this.
    const calib::Tangent6d off =
        calib::log(facts.moved->cam_from_world * calib::inverse(rig_.cameras[camera].cam_from_world));
    wanted.pose_covariance = facts.moved->covariance + off * off.transpose();
  } else if (has_turned_a_little(facts.room)) {
    const Eigen::Vector3d& turn = facts.room.rotation;
    wanted.pose_covariance.topLeftCorner<3, 3>() = facts.room.covariance + turn * turn.transpose();
  }
  const bool is_off = !wanted.pose_covariance.isZero(0);
  CameraTrust& given = trust_[camera];
  bool is_news =
      wanted.is_used != given.is_used || wanted.has_moved != given.has_moved || is_off != w.trusted_at.has_value();
  if (!is_news && is_off && at - *w.trusted_at >= trust_pause) is_news = differs(wanted, given);
  if (!is_news) return false;
  given = wanted;
  w.trusted_at = is_off ? std::optional(at) : std::nullopt;
  facts.is_used = given.is_used;
  facts.is_mended = given.cam_from_world.has_value();
  return true;
}

void CalibrationWatch::learn(std::span<const object_tracking::ObjectEstimate> estimates) {
  // What the others fix is worth nothing where one of them is off itself; and two that were mended by one another would
  // drift away together.
  const auto is_off = [&](const CameraCalibration& facts) { return facts.moved && facts.is_used; };
  const auto off = std::ranges::count_if(facts_, is_off);
  for (std::size_t c = 0; c < watched_.size(); ++c) {
    Watched& w = watched_[c];
    const bool others_fit = off - (is_off(facts_[c]) ? 1 : 0) == 0;
    w.objects.clear();
    for (const auto& estimate : estimates) {
      if (!estimate.has_position() || c >= estimate.per_view.size()) continue;
      const object_tracking::ViewSupport& view = estimate.per_view[c];
      if (view.in_view) w.objects.push_back({view.px.cast<double>(), double(view.radius_px)});
      if (!others_fit || !w.pose || !view.leave_one_out || !has_moved(facts_[c].room.state)) continue;
      const object_tracking::LeaveOneOut& said = *view.leave_one_out;
      w.pose->add({.at = said.at,
                   .px = said.px,
                   .covariance = said.covariance,
                   .position = said.position,
                   .position_covariance = said.position_covariance});
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

// What triangulating with the rig's pose does to positions when the camera stands elsewhere: over a grid in the volume,
// of the places that this camera and another one see.
double CalibrationWatch::effect_of(std::size_t camera, const calib::Rigid3d& now) const {
  constexpr std::array<double, 3> shares{0.2, 0.5, 0.8};
  double sum = 0;
  int places = 0;
  for (int k = 0; k < 27; ++k) {
    const Eigen::Vector3d share(shares[std::size_t(k % 3)], shares[std::size_t(k / 3 % 3)], shares[std::size_t(k / 9)]);
    const Eigen::Vector3d p = volume_.min + share.cwiseProduct(volume_.max - volume_.min);
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
