// Measurements: a colour region as a measurement of the object's projected centre; positions from several views.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_tracking {

// margin_m: tolerance outside of it.
bool inside(const Volume& volume, const Eigen::Vector3d& p, double margin_m);
// The same, or a place within one sigma along the least certain axis is: with one camera, its ray.
bool may_be_inside(const Volume& volume, const Eigen::Vector3d& p, const Eigen::Matrix3d& covariance, double margin_m);
// With one camera the latter, with several the former.
bool inside(const Volume& volume, const MotionState& motion, double margin_m);
struct PositionCandidate;
bool inside(const Volume& volume, const PositionCandidate& candidate, double margin_m);

inline double disc_area(double radius_px) {
  return std::numbers::pi * radius_px * radius_px;
}
inline double disc_radius(double area_px2) {
  return std::sqrt(area_px2 / std::numbers::pi);
}

// The image of a ball, to first order.
struct BallProjection {
  Eigen::Vector2d px;                    // projection of its centre, raw pixels
  Eigen::Matrix<double, 2, 3> jacobian;  // d px / d p_world, pixels per metre
  double radius_px = 0;
};
std::optional<BallProjection> project_ball(const calib::Camera& camera, const Eigen::Vector3d& p_world,
                                           double radius_m);

// Image covariance by a pose's uncertainty (CameraTrust::pose_covariance), px^2.
Eigen::Matrix2d px_covariance_of_pose(const calib::Camera& camera, const Eigen::Vector3d& p_world,
                                      const BallProjection& at, const Eigen::Matrix<double, 6, 6>& pose_covariance);

// A ball's radius as a view measures it; its distance follows.
struct MeasuredSize {
  double radius_px = 0;
  double log_sigma = 0;           // of the radius' logarithm: independent in every frame
  double log_bias = 0;            // 1 sigma of the logarithm's bias
  bool is_bias_constant = false;  // a region's; an outline's varies slowly
};

struct Sighting {
  SeenRow row;
  const calib::Camera* camera = nullptr;
  const calib::BatchProjector* projector = nullptr;
  Eigen::Vector2d px;                                 // measured centre, raw pixels
  Eigen::Matrix2d covariance;                         // px^2, independent in every frame
  double bias_sigma_px = 0;                           // 1 sigma of the bias that stays while the object rests
  double hidden_px = 0;                               // of it, by what hides a part of a disc (DiscFinder)
  double unmodelled_px = 0;                           // 1 sigma, of an outline: outline::Fit::model_error
  color::DiscEvidence evidence = {};                  // ColorRegion::evidence
  double support = 0;                                 // 0..1, share of the expected disc that has the target's colour
  double radius_px = 0;                               // of the disc of the region's area
  std::optional<MeasuredSize> size;                   // read with one camera only; nullopt: not measured
  double narrowed = 0;                                // log of the region's length over its width, less the smear
  Eigen::Matrix2d of_pose = Eigen::Matrix2d::Zero();  // px^2, bias by CameraTrust::pose_covariance
  double inflation_px2 = 0;                           // px^2, bias by inconsistency with other views
  double missing = 0;                                 // hidden share of the usual area; measured for one object only
  bool is_cut = false;      // clutter may hide a part of it, or be it: excluded from consistency tests
  bool is_outline = false;  // measured by its outline, not by its region's centroid

  Eigen::Matrix2d inflation() const { return of_pose + inflation_px2 * Eigen::Matrix2d::Identity(); }
};

void sort_by_time(std::vector<Sighting>& sightings);  // of their rows; stable

// By the region's shape alone.
bool has_disc_shape(const Sighting& sighting);
// The disc has more than the object's area and blur.
bool is_too_large_alone(double radius_px, double expected_px);

struct SightingTuning {
  double gate_nis = 16;           // chi-square, 2 dof, 99.97 %: a region within it may be the object's
  double min_disc_share = 0.15;   // share of the expected disc's area that a region in a known place must cover
  double start_disc_share = 0.3;  // the same where nothing is tracked yet, or its place is not known (experiment)
  double max_disc_share = 3;      // the same, largest region that may still be the object there (experiment)
  double confirmation_s = 0.5;    // s, an unconfirmed candidate older than this is dropped
  double prediction_sigmas = 3;   // reach of a predicted or measured place: 99.7 % on one axis
  double extent_radii = 3;        // radii, largest extent of a region where one object is searched
  double part_radii = 1.3;  // radii from a region's centre in which another one is a part of the object (experiment)
  double same_object_radii = 1.5;  // radii, nearer candidates or detections are of one object (experiment)
  double shading_share = 0.04;     // of the radius, 1 sigma: a ball's bright side matches further out (experiment)
  std::size_t max_regions = 8;     // per view, the largest ones, that may be the object searched for
  std::size_t max_crossings = 4;   // candidates kept per frame set and possible object
  double same_place_px = 1;        // px, motion after which a region lies on other pixels
  double same_time_s = 0.002;      // s, moments this near to each other are one
  double behind_px = 50;           // px, residual of rays that meet behind a camera
  double covered_radii = 1.1;      // radii around an object in which nothing is learnt
  double covered_px = 4;           // px, in addition: blur
  double misfit_share = 0.2;       // of the radius, 1 sigma: shape noise of a small disc's outline (experiment)
  double cut_error = 0.85;         // radii of error per missing share: an edge leaves 0.42 at half, 0.65 at a quarter
  double region_size_sigma = 0.2;  // of the log of a region's radius: dark edges do not match (experiment)
  double size_memory = 300;        // frames in the mean of a size: 10 s at 30 fps
  double alone_share = 1.4;        // share of the expected area up to which it is one object alone: its edge is blurred

  // px, a region that moved less stands still: each of the two may be as far off as regions of one place are.
  constexpr double still_px() const { return 2 * same_place_px; }
};
inline constexpr SightingTuning sighting_tuning{};

constexpr double parallel_sine2 = 1e-6;  // maths: below it two rays' crossing is ill-conditioned

// Variance of a whole region's centre, px^2: independent in every frame, and bias. See sighting_of().
struct BaseError {
  double noise_px2, bias_px2;
};
BaseError base_error(double radius_px, double pixel_noise_px, double sample_px);
// Side of the square of pixels that share a chroma sample.
double sample_px(const capture::Image& image);

// How a ball's outline moves over the rows and during the exposure.
struct ImageMotion {
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of its centre, px/s
  double row_s = 0;                                    // between the exposures of two rows; < 0: upwards
  double longest_exposure_s = 0;
};

// A region's centroid as a measurement of the ball's centre. Variance along each axis of the region:
//   s^2 + (0.04 r)^2 + c^3 / (12 pi r) + (1.3 max(0, |e - w| - 0.2 r - b))^2
// s: pixel_noise_px; 0.04 r: shading; c: sample_px(), the edge's coarseness; w: half width, 2 sqrt(second central
// moment); e: expected half width, the radius r under the shear of a rolling shutter; b: motion blur, velocity *
// exposure / 2, a third of it where the region is too narrow. The last term is misfit: a part is hidden, or background
// is included, and the centroid is off by about as much. A fifth of the first three is bias. Fitted to rendered balls
// (EXPERIMENTS.md).
Sighting sighting_of(const TargetView& view, const color::ColorRegion& region, double radius_px, double pixel_noise_px,
                     const ImageMotion& motion);

// With one camera. A ball's image is convex: the size of the region's convex hull is right where stripes, glints or
// what covers a part make its area too small. Of small discs the coarseness of the edge makes the hull too large: there
// the area stays. No effect where `size` is not measured.
void measure_hull(const TargetView& view, const color::ColorRegion& region, const ImageMotion& motion,
                  Sighting& sighting);

// Gaussian over a position in information form; positive semidefinite, rank 2 for one view.
struct PositionInformation {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // 1/m^2
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();       // information * position, 1/m
};

// Linearised at p_world; ignores the sightings' times.
PositionInformation information_of(std::span<const Sighting> sightings, const Eigen::Vector3d& p_world);

// Midpoint of the shortest line between the rays through two raw pixels; nullopt when they are nearly parallel, or meet
// behind a camera.
std::optional<Eigen::Vector3d> crossing(const calib::Camera& camera0, const calib::RawPixel& px0,
                                        const calib::Camera& camera1, const calib::RawPixel& px1);

// A position that several views are consistent with.
struct PositionCandidate {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
  std::vector<Sighting> sightings;  // two or more; with one camera, one
  double score = 0;                 // sum of supports
};

// Triangulates each pair of regions in two views whose rays meet inside the volume at a distance that fits their sizes;
// refines and scores it over all consistent views. With one camera, a ball's size gives its distance. Best first, at
// most max_count. regions[i] belongs to views[i]. Of `times` only the cameras' timing is used.
std::vector<PositionCandidate> cross_rays(const std::vector<TargetView>& views,
                                          std::span<const std::vector<color::ColorRegion>> regions,
                                          const TargetOptions& target, const ObjectTrackerOptions& options,
                                          const MotionState& times, std::size_t max_count);

// A row of a view, with its time by the estimated timing.
SeenRow row_of(const TargetView& view, double row, const MotionState& times);

}  // namespace huetrack::object_tracking
