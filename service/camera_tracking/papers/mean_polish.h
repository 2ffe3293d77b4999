// Least-squares refinement of the particles' mean, which is the pose in the papers by Lee and by Pupilli and Calway.
#pragma once

#include <optional>
#include <span>

#include "camera_tracking/pose_particles.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::papers {

using namespace camera_tracking;

// Gauss-Newton from the mean over the matched points; the result must lie within the cloud. (A few hundred particles in
// six dimensions leave centimetres of error where rotation and translation are hard to distinguish.)
//   seen  the matched points with their measured pixels and sigmas
// nullopt: too few inliers, or outside the cloud.
std::optional<PoseFit> polish_mean(const calib::CameraModel& lens, const PoseParticles& cloud,
                                   const calib::Rigid3d& mean, std::span<const PoseObservation> seen);

// The sigma of a matched point: of its pixel and of its projected position.
double sigma_px_of(const calib::CameraModel& lens, double pixel_sigma, double position_sigma_m, double depth_m);

}  // namespace huetrack::papers
