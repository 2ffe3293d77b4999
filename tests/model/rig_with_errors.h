// What a rig's uncertainty says may be true instead of it.
#pragma once

#include "calib/model/camera_rig.h"
#include "calib/model/lens_derivatives.h"
#include "calib/model/rig_uncertainty.h"

namespace huetrack::calib {

// The rig with every camera moved, and its lens changed, by these errors (beside the parameters).
inline CameraRig with_errors(CameraRig rig, const Eigen::VectorXd& errors) {
  if (!rig.uncertainty) return rig;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const RigUncertainty::CameraParameters& of = rig.uncertainty->cameras[c];
    Camera& camera = rig.cameras[c];
    if (of.has_pose) camera.cam_from_world = exp(errors.segment<6>(of.pose_at())) * camera.cam_from_world;
    if (of.lens_count == 0) continue;
    LensParameters lens = parameters_of(camera.model);
    lens.head(of.lens_count) += errors.segment(of.at, of.lens_count);
    camera.model = model_like(camera.model, lens);
  }
  return rig;
}

}  // namespace huetrack::calib
