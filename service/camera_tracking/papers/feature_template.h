// Features of the papers' trackers: a patch of one frame, and its search regions.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "calib/model/camera_rig.h"
#include "camera_tracking/papers/depth_ray.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/template_patch.h"

namespace huetrack::papers {

using namespace camera_tracking;

constexpr int feature_side = 11;  // pixels of the papers' templates

// A feature's first sighting.
struct FeatureSource {
  std::shared_ptr<const Pyramid> pyramid;
  calib::Rigid3d cam_from_world;                 // the particles' mean
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw
};

// The template about px, interpolated. nullopt: at the image's border, or without texture.
std::optional<NccTemplate> cut_template(const GreyImage& image, const Eigen::Vector2d& px);
// Lee, section 3.5: the predicted template of a plane that faced the reference camera at `depth`.
bool predict_template(const calib::CameraModel& lens, const FeatureSource& source, double depth,
                      const calib::Rigid3d& cam_from_world, WarpedPatch& out);

// The anchors within centre +- half.
PixelRegion box_around(const Eigen::Vector2d& centre, double half_u, double half_v);

// The projection of the part of a depth ray that has weight: where a new feature is searched for.
struct EpipolarSegment {
  calib::RawPixel a, b;   // of the smallest and the largest inverse depth
  Eigen::Vector2d along;  // unit
  PixelRegion box;        // around both, plus the reach

  double distance(const Eigen::Vector2d& px) const;  // from the line, signed
};
// nullopt: an end does not project, or the segment is too long.
std::optional<EpipolarSegment> project_ray(const calib::CameraModel& lens, const DepthRay& ray,
                                           const calib::Rigid3d& cam_from_world, double reach_px);

// Lee, section 3.2: the best FAST corner of a randomly placed box that overlaps no feature in view.
std::optional<Eigen::Vector2d> corner_in_random_box(const GreyImage& image, std::span<const Eigen::Vector2d> features,
                                                    int box, particle_filter::Rng& rng);

// Covariance of the particles' (centre, quaternion) about their mean: Lee's Sigma_Cr of eq. (6).
Eigen::Matrix<double, 7, 7> state_covariance(const PoseParticles& particles, const calib::Rigid3d& mean);

}  // namespace huetrack::papers
