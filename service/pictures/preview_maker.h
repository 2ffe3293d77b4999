// Creates messages for PagePublisher: previews with overlays as data, and the scene. Pure functions.
#pragma once

#include "config/service_config.h"
#include "idl/huetrack_view.h"
#include "pictures/picture_job.h"

namespace huetrack::pictures {

// One per camera with a valid frame in this set.
//   clock_offset   added to capture times
std::vector<msg::Preview> make_previews(const config::ServiceConfig& config, const PictureJob& job,
                                        capture::Duration clock_offset);

// All fields except host, pid and frame_id.
msg::Scene make_scene(const config::ServiceConfig& config, bool may_teach, const std::string& why_not);

// The 95 % ellipse of a projected covariance: semi-axes (px), angle of the first from u towards v (rad); NaN if the
// position has no pixel.
std::array<float, 3> projected_ellipse(const calib::Camera& camera, const Eigen::Vector3d& position,
                                       const Eigen::Matrix3d& covariance);

}  // namespace huetrack::pictures
