#include "room_watch/moved_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "calib/model/cross_matrix.h"
#include "room_watch/rotation_fit.h"

namespace huetrack::room_watch {
namespace {

struct MovedPoseTuning {
  double correlated_s = 0.25;    // seconds of sightings that count as one: their errors last while the object is there
  double time_constant_s = 20;   // of forgetting: a knocked camera may go on creeping
  double others_bias_m = 0.002;  // 1 sigma, common to all positions of the other cameras: their calibration
  double distance_share = 0.4;   // 1 sigma of the room's distance, of itself
  double tukey_sigmas = 8;       // no weight beyond: it is another object
};
constexpr MovedPoseTuning moved_pose{};

Eigen::Matrix3d rotation_matrix(const Eigen::Vector3d& rotation) {
  Eigen::Matrix3d out;
  for (int i = 0; i < 3; ++i) out.col(i) = turned(rotation, Eigen::Vector3d::Unit(i));
  return out;
}

}  // namespace

MovedPose::MovedPose(const calib::Camera& camera, double room_distance_m, double shift_sigma_m)
    : camera_(camera), room_distance_m_(room_distance_m), shift_sigma_m_(shift_sigma_m) {
  solve();
}

void MovedPose::set_room(const RoomRotation& room) {
  room_ = room;
  solve();
}

void MovedPose::add(const ReferenceSighting& sighting) {
  const Eigen::Vector3d turned_then =
      turned(room_.rotation, camera_.cam_from_world * (sighting.position + state_.tail<3>()));
  const Eigen::Matrix3d b = rotation_matrix(state_.head<3>());
  const Eigen::Vector3d q = b * turned_then;
  calib::CameraModel::Jacobian jacobian;
  const auto px = camera_.model.project(q + state_.segment<3>(3), jacobian);
  if (!px) return;
  const Eigen::Matrix<double, 2, 3> by_position =
      jacobian * b * rotation_matrix(room_.rotation) * camera_.cam_from_world.rotation.toRotationMatrix();
  Eigen::Matrix<double, 2, 9> by_state;
  by_state << -jacobian * calib::cross_matrix(q), jacobian, by_position;
  const Eigen::Matrix2d noise =
      sighting.covariance + by_position * sighting.position_covariance * by_position.transpose();
  const Eigen::Matrix2d expected = noise + by_state * covariance_ * by_state.transpose();
  const Eigen::Vector2d difference = sighting.px - px->px;
  constexpr double gate2 = moved_pose.tukey_sigmas * moved_pose.tukey_sigmas;
  const double inside = 1 - difference.dot(expected.inverse() * difference) / gate2;
  if (!(inside > 0)) return;
  const double since_s = last_at_ ? capture::seconds(sighting.at - *last_at_) : moved_pose.correlated_s;
  if (since_s < 0) return;
  last_at_ = sighting.at;
  const double weight = std::min(1.0, since_s / moved_pose.correlated_s) * inside * inside;
  const double kept = std::exp(-since_s / moved_pose.time_constant_s);
  const Eigen::Matrix<double, 9, 2> gain = weight * by_state.transpose() * noise.inverse();
  information_ = kept * information_ + gain * by_state;
  weighted_ = kept * weighted_ + gain * (difference + by_state * state_);
  solve();
}

void MovedPose::solve() {
  Matrix9 information = information_;
  information.block<3, 3>(3, 3) += Eigen::Matrix3d::Identity() / (shift_sigma_m_ * shift_sigma_m_);
  information.bottomRightCorner<3, 3>() +=
      Eigen::Matrix3d::Identity() / (moved_pose.others_bias_m * moved_pose.others_bias_m);
  // Covariance of the room's rotation: its noise, and the uncertain distance times the possible shift.
  const Eigen::Matrix3d by_shift = room_.shift_to_rotation / room_distance_m_;
  const Eigen::Vector3d shift = state_.segment<3>(3);
  const Eigen::Matrix3d shift_known = covariance_.block<3, 3>(3, 3);
  const bool is_first = information_.isZero();
  const Eigen::Matrix3d shift_square =
      is_first ? Eigen::Matrix3d(shift_sigma_m_ * shift_sigma_m_ * Eigen::Matrix3d::Identity())
               : Eigen::Matrix3d(shift_known + shift * shift.transpose());
  const Eigen::Matrix3d open =
      room_.covariance + 1e-12 * Eigen::Matrix3d::Identity() +
      moved_pose.distance_share * moved_pose.distance_share * by_shift * shift_square * by_shift.transpose();
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << Eigen::Matrix3d::Identity(), by_shift;
  information.topLeftCorner<6, 6>() += by_pose.transpose() * open.inverse() * by_pose;
  covariance_ = information.llt().solve(Matrix9::Identity());
  covariance_ = (covariance_ + covariance_.transpose()).eval() / 2;
  state_ = covariance_ * weighted_;
  estimate_.covariance = covariance_.topLeftCorner<6, 6>();

  const Eigen::Quaterniond now(rotation_matrix(state_.head<3>()) * rotation_matrix(room_.rotation));
  const calib::Rigid3d now_from_then{now.normalized(), state_.segment<3>(3)};
  estimate_.cam_from_world = now_from_then * camera_.cam_from_world;
  estimate_.rotation = calib::log({now_from_then.rotation, Eigen::Vector3d::Zero()}).head<3>();
  // The new centre has p_now = 0: its shift in the new axes is -v.
  estimate_.shift = -state_.segment<3>(3);
  estimate_.rotation_sigma = std::sqrt(estimate_.covariance.topLeftCorner<3, 3>().diagonal().maxCoeff());
  estimate_.shift_sigma = std::sqrt(estimate_.covariance.bottomRightCorner<3, 3>().diagonal().maxCoeff());
}

}  // namespace huetrack::room_watch
