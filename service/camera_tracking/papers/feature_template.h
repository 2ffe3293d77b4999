// A feature of the papers' trackers: one patch of one frame, and where it is sought.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "calib/model/camera_rig.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/template_patch.h"

namespace huetrack::papers {

constexpr int feature_side = 11;  // pixels of the papers' templates

// The frame that a feature was first seen in, and where.
struct FeatureSource {
  std::shared_ptr<const camera_tracking::Pyramid> pyramid;
  calib::Rigid3d cam_from_world;                 // the particles' mean, then
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw
};

// The template as it was about px, which may lie between pixels: nullopt at the image's border, or without texture.
std::optional<camera_tracking::NccTemplate> cut_template(const camera_tracking::GreyImage& image,
                                                         const Eigen::Vector2d& px);
// Lee, section 3.5: as it should look now, on a plane that faced the reference camera at `depth`.
bool predict_template(const calib::CameraModel& lens, const FeatureSource& source, double depth,
                      const calib::Rigid3d& cam_from_world, camera_tracking::WarpedPatch& out);

// A box of anchors around mean +- half.
camera_tracking::PixelRegion box_around(const Eigen::Vector2d& centre, double half_u, double half_v);

// Lee, section 3.2: the best FAST corner of a box that is placed at random, not overlapping any of the features in
// view.
std::optional<Eigen::Vector2d> corner_in_random_box(const camera_tracking::GreyImage& image,
                                                    std::span<const Eigen::Vector2d> features, int box,
                                                    particle_filter::Rng& rng);

// 7x7 covariance of (centre, quaternion) of the particles about their mean: Lee's Sigma_Cr of eq. (6).
Eigen::Matrix<double, 7, 7> state_covariance(const camera_tracking::PoseParticles& particles,
                                             const calib::Rigid3d& mean);

}  // namespace huetrack::papers
