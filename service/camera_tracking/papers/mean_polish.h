// Beyond the papers by Lee and by Pupilli and Calway, whose pose is the particles' mean.
#pragma once

#include <optional>
#include <span>

#include "camera_tracking/pose_particles.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::papers {

// A few hundred particles over six dimensions leave their mean some centimetres off where turning and shifting the
// camera look alike; the points that the filter matched say more. Gauss-Newton from the mean over them, which must stay
// within what the cloud holds possible.
//   seen  the matched points, where the image shows them, with their sigmas
// nullopt: too few agree, or not there; the mean is then all there is.
std::optional<camera_tracking::PoseFit> polish_mean(const calib::CameraModel& lens,
                                                    const camera_tracking::PoseParticles& cloud,
                                                    const calib::Rigid3d& mean,
                                                    std::span<const camera_tracking::PoseObservation> seen);

// The sigma of a matched point: its pixel's, and the point's own as it looks from there.
double sigma_px_of(const calib::CameraModel& lens, double pixel_sigma, double position_sigma_m, double depth_m);

}  // namespace huetrack::papers
