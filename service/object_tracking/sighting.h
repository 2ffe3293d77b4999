// What one view says about where the target is: a colour region as a measurement of the projected centre, with an
// honest covariance. And from several views together: a position.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_belief.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_tracking {

// margin_m: how far outside of it still counts.
bool inside(const Volume& volume, const Eigen::Vector3d& p, double margin_m);

// Where a ball would appear in a view.
struct Appearance {
  Eigen::Vector2d px;                    // projection of its centre, raw pixels
  Eigen::Matrix<double, 2, 3> jacobian;  // d px / d p_world, pixels per metre
  double radius_px = 0;
};
std::optional<Appearance> appearance_of(const calib::Camera& camera, const Eigen::Vector3d& p_world, double radius_m);

// How far a pose that is not quite known (CameraTrust::pose_covariance) moves what is seen there, px^2.
Eigen::Matrix2d px_covariance_of_pose(const calib::Camera& camera, const Eigen::Vector3d& p_world, const Appearance& at,
                                      const Eigen::Matrix<double, 6, 6>& pose_covariance);

struct Sighting {
  SeenRow row;
  const calib::Camera* camera = nullptr;
  const calib::BatchProjector* projector = nullptr;
  Eigen::Vector2d px;          // measured centre, raw pixels
  Eigen::Matrix2d covariance;  // px^2, of what is new in every frame
  double lasting_px = 0;       // standard deviation of what lasts while the object rests
  double support = 0;          // 0..1, share of the expected disc that has the target's colour
  double radius_px = 0;        // of the disc of the region's area
  // px^2, of what lasts besides: by the pose that the camera is held to have, and by how far views contradict it.
  Eigen::Matrix2d of_pose = Eigen::Matrix2d::Zero();
  double doubt_px2 = 0;
  // Furniture of the target's colour is at its edge, or behind it, and left out: how far it is off by that says nothing
  // of whether views agree.
  bool is_cut = false;
  bool is_outline = false;  // it is not the middle of a region, but what its outline says

  Eigen::Matrix2d doubt() const { return of_pose + doubt_px2 * Eigen::Matrix2d::Identity(); }
};

void sort_by_time(std::vector<Sighting>& sightings);  // of their rows; stable

// The region has the shape of a disc, if not its size; and its size, too: nothing hides or cuts a part of it.
bool is_round(const Sighting& sighting);
bool is_whole_disc(const Sighting& sighting);

struct SightingTuning {
  double gate_nis = 16;           // chi-square, 2 dof, 99.97 %: a region within it may be the object's
  double min_disc_share = 0.15;   // share of the expected disc's area that a tracked object's region must cover
  double start_disc_share = 0.3;  // the same where nothing is tracked yet, or its place is not known (experiment)
  double max_disc_share = 4;      // the same, largest region that may still be the object there (experiment)
  double confirmation_s = 0.5;    // s, an unconfirmed candidate older than this is dropped
  int contested_sets = 8;         // frame sets that confirm a candidate against a view that should show it and does not
  std::size_t max_crossings = 4;  // candidates kept per frame set where one object is searched
  double repeat_px = 1;           // px, motion that changes a region of 100 px visibly: else the frame is a repeat
  double misfit_share = 0.2;      // of the radius, 1 sigma: shape noise of a small disc's outline (experiment)
  double whole_share = 0.9;       // share of the expected area from which a disc counts as unoccluded
};
inline constexpr SightingTuning sighting_tuning{};

// How far a place in a view is off by what is not seen in a region's shape, px^2, as sighting_of() has it: new in every
// frame, and what lasts.
struct UsualError {
  double fresh_px2, lasting_px2;
};
UsualError usual_error(double radius_px, double pixel_noise_px, double sample_px);
// The side of a square that is as large as the pixels that share a sample of color.
double sample_px(const capture::Image& image);

// How a ball's outline moves over the rows and during the exposure.
struct ImageMotion {
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of its centre, px/s
  double row_s = 0;                                    // between the exposures of two rows; < 0: upwards
  double longest_exposure_s = 0;
};

// The region's centre measures the ball's centre, in the row where it lies. Along each axis of the region its variance
// is
//   s^2 + (0.04 r)^2 + c^3 / (12 pi r) + (1.3 max(0, |e - w| - 0.2 r - b))^2
// w = 2 sqrt(the region's second central moment along it) is the half width of the disc that would be as wide and e the
// one that is expected: the radius r, but of a moving ball that is read row by row the disc is sheared and stretched.
// b: exposure smears it by velocity times time, which makes a region longer (half of the smear matches) or shorter (a
// third of that is granted, as what hides a part of the ball makes it shorter, too), and leaves its centre where it is.
// Where something hides a part of the ball, the visible rest is narrower than expected in the direction in which it is
// cut, and its centre is off by about as much; a region that is too wide (background of the same colour) is distrusted
// the same way. Misfits below a fifth of the radius are the noise of a small disc's outline and say nothing.
// s is options.pixel_noise_px; 0.04 r is the shading of a ball, whose bright side matches further out than its dark
// side; c, sample_px(), is how coarse the region's edge is. Of these, 0.2 last while the object rests (lasting_px), the
// remainder is new in every frame and stands in `covariance` with the misfit. The figures were fitted on data/rendered
// (README.md).
Sighting sighting_of(const TargetView& view, const color::ColorRegion& region, double radius_px, double pixel_noise_px,
                     const ImageMotion& motion);

// Gaussian in the world, in information form: what linearised sightings say. Positive semidefinite; rank 2 for one
// view.
struct PositionInformation {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // 1/m^2
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();       // information * position, 1/m
};

// Linearised at p_world; as if all had been seen at one time.
PositionInformation information_of(std::span<const Sighting> sightings, const Eigen::Vector3d& p_world);

// Midpoint of the shortest line between the rays through two raw pixels; nullopt when they are nearly parallel, or meet
// behind a camera.
std::optional<Eigen::Vector3d> crossing(const calib::Camera& camera0, const calib::RawPixel& px0,
                                        const calib::Camera& camera1, const calib::RawPixel& px1);

// A position that several views agree on.
struct PositionCandidate {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
  std::vector<Sighting> sightings;  // two or more
  double score = 0;                 // sum of supports, less 0.25 for each view that should see it and does not
  int sets = 1;                     // one after the other, in which such a candidate was found
};

// Rays crossed between views: each pair of regions in two views whose rays meet inside the volume, at a distance at
// which the target would have about the size that they have; refined over, and scored by, all views that agree. Best
// first, at most max_count. regions[i] belongs to views[i]. Of the belief only the cameras' times are used.
std::vector<PositionCandidate> cross_rays(const std::vector<TargetView>& views,
                                          std::span<const std::vector<color::ColorRegion>> regions,
                                          const TargetOptions& target, const ObjectTrackerOptions& options,
                                          const MotionBelief& times, std::size_t max_count);

// The row of a view, when it was exposed as far as is known.
SeenRow row_of(const TargetView& view, double row, const MotionBelief& times);

}  // namespace huetrack::object_tracking
