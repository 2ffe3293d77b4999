#include "object_tracking/rig_error.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace huetrack::object_tracking {
namespace {

struct RigErrorTuning {
  double memory_s = 0.2;  // s, decay time of a view that lost the object: the filter's own memory
};
constexpr RigErrorTuning rig_error{};

constexpr double negligible = 1e-3;  // maths: of a view's weight, taken as zero

}  // namespace

RigError::RigError(const calib::CameraRig& rig, double position_sigma_m)
    : rig_(rig),
      as_found_(rig.uncertainty),
      elsewhere_(Eigen::Matrix3d::Identity() / (position_sigma_m * position_sigma_m)),
      last_views_(rig.cameras.size()) {}

void RigError::add(std::span<const Sighting> sightings) {
  if (!rig_.uncertainty) return;
  for (const Sighting& s : sightings) {
    Eigen::Matrix2d covariance = s.covariance + s.inflation();
    covariance.diagonal().array() += s.bias_sigma_px * s.bias_sigma_px;
    const bool is_size_used = s.size && rig_.cameras.size() == 1;
    last_views_[std::size_t(s.row.camera)] = {
        true, s.row.at, covariance.inverse(),
        is_size_used ? 1 / (s.size->log_sigma * s.size->log_sigma + s.size->log_bias * s.size->log_bias) : 0};
  }
}

void RigError::exclude_poses(std::span<const CameraTrust> cameras) {
  rig_.uncertainty = as_found_;
  for (std::size_t c = 0; rig_.uncertainty && c < cameras.size(); ++c) {
    if (cameras[c].cam_from_world)
      rig_.uncertainty = calib::with_pose_covariance(rig_, int(c), calib::Covariance6d::Zero());
  }
}

Eigen::Matrix3d RigError::left_open(const Eigen::Vector3d& position, capture::Timestamp at) const {
  if (!rig_.uncertainty) return Eigen::Matrix3d::Zero();
  std::vector<calib::PlaceView> views;
  for (std::size_t c = 0; c < last_views_.size(); ++c) {
    if (!last_views_[c].any) continue;
    const double share = std::exp(-std::abs(capture::seconds(at - last_views_[c].at)) / rig_error.memory_s);
    if (share > negligible)
      views.push_back({int(c), share * last_views_[c].information, share * last_views_[c].log_size_information});
  }
  const bool is_depth_measured =
      std::ranges::any_of(views, [](const calib::PlaceView& view) { return view.log_size_information > 0; });
  return calib::rig_covariance_at(rig_, position, views, is_depth_measured ? Eigen::Matrix3d::Zero() : elsewhere_);
}

}  // namespace huetrack::object_tracking
