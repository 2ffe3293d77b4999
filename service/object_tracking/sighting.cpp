#include "object_tracking/sighting.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/model/closest_approach.h"
#include "calib/model/cross_matrix.h"

namespace huetrack::object_tracking {
namespace {

struct RegionErrorTuning {
  double bias_share = 0.2;     // of the variance: constant while the object rests (wave::OutlineCorrelation)
  double misfit_gain = 1.3;    // centre error per pixel of misfit in width (experiment)
  double occlusion_smear = 3;  // a smear explains only 1/3 of it of a region that is too narrow: it may be occluded
};
constexpr RegionErrorTuning region_error{};

struct RayCrossingTuning {
  int refinements = 2;  // Gauss-Newton steps of a candidate's position
};
constexpr RayCrossingTuning ray_crossing{};

// maths: 1 sigma of log(length / width) of a disc whose radius is one chroma sample; each sample on the edge is in or
// out as a whole. Falls with the radius to the power of 3/2.
constexpr double width_noise = 0.4;

// Midpoint of the shortest line between two rays; nullopt when they are nearly parallel or meet behind a camera.
std::optional<Eigen::Vector3d> crossing(const Eigen::Vector3d& c0, const Eigen::Vector3d& d0, const Eigen::Vector3d& c1,
                                        const Eigen::Vector3d& d1) {
  const auto nearest = calib::closest_approach(c1 - c0, d0, d1, parallel_sine2);
  if (!nearest || nearest->along_0 <= 0 || nearest->along_1 <= 0) return std::nullopt;
  return (c0 + nearest->along_0 * d0 + c1 + nearest->along_1 * d1) / 2;
}

double mahalanobis2(const Eigen::Vector2d& d, const Eigen::Matrix2d& covariance) {
  return d.dot(covariance.inverse() * d);
}

// A region with the ray on which its centre lies, in the world.
struct RegionRay {
  const color::ColorRegion* region;
  Eigen::Vector3d direction;
};

// For one target of unknown velocity.
class RayCrosser {
 public:
  RayCrosser(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
             const TargetOptions& target, const ObjectTrackerOptions& options, const MotionState& times)
      : views_(views), regions_(regions), target_(target), options_(options), times_(times) {
    for (const TargetView& view : views) newest_ = std::max(newest_, view.frame->captured_at);
  }

  std::vector<RegionRay> rays_of(std::size_t view) const {
    std::vector<RegionRay> rays;
    const calib::Camera& camera = *views_[view].camera;
    for (std::size_t i = 0; i < std::min(regions_[view].size(), sighting_tuning.max_regions); ++i) {
      if (const auto ray = camera.model.ray({regions_[view][i].centre}))
        rays.push_back({&regions_[view][i], camera.cam_from_world.rotation.conjugate() * *ray});
    }
    return rays;
  }

  // nullopt: no crossing, outside of the volume, or at a distance that does not fit the regions' sizes.
  std::optional<Eigen::Vector3d> meeting(std::size_t i, const RegionRay& a, std::size_t j, const RegionRay& b) const {
    const calib::Camera& ci = *views_[i].camera;
    const calib::Camera& cj = *views_[j].camera;
    const auto p = crossing(ci.centre(), a.direction, cj.centre(), b.direction);
    if (!p || !inside(options_.volume, *p, target_.radius_m)) return std::nullopt;
    const auto in_i = project_ball(ci, *p, target_.radius_m);
    const auto in_j = project_ball(cj, *p, target_.radius_m);
    if (!in_i || !in_j || !fits(i, *a.region, *in_i, least_share(*a.region)) ||
        !fits(j, *b.region, *in_j, least_share(*b.region)))
      return std::nullopt;
    return p;
  }

  // What stands out of the room's colours may be the object, however little of it is seen.
  static double least_share(const color::ColorRegion& region) {
    return region.of_disc.any() ? 0.0 : sighting_tuning.start_disc_share;
  }

  // With one camera: a disc, at the distance that its size gives. nullopt: outside of the volume, or no disc.
  std::optional<PositionCandidate> by_size(const RegionRay& a) const {
    const calib::Camera& camera = *views_.front().camera;
    const auto at_one_metre = project_ball(camera, camera.centre() + a.direction, target_.radius_m);
    if (!at_one_metre) return std::nullopt;
    Sighting seen = sighting_at(0, *a.region, *at_one_metre);
    measure_hull(views_.front(), *a.region, {}, seen);
    if (!seen.size) return std::nullopt;
    const double distance_m = at_one_metre->radius_px / seen.size->radius_px;
    PositionCandidate c;
    c.position = camera.centre() + distance_m * a.direction;
    const auto at = project_ball(camera, c.position, target_.radius_m);
    if (!at || !inside(options_.volume, c.position, target_.radius_m)) return std::nullopt;
    c.sightings.push_back(sighting_at(0, *a.region, *at));
    Sighting& s = c.sightings.front();
    measure_hull(views_.front(), *a.region, {}, s);
    if (!s.size || !has_disc_shape(s)) return std::nullopt;
    const PositionInformation across = information_of(std::vector{set_apart(s, *at)}, c.position);
    const double along_m = distance_m * std::hypot(s.size->log_sigma, s.size->log_bias);
    c.covariance = (across.information + a.direction * a.direction.transpose() / (along_m * along_m)).inverse();
    c.score = s.support;
    return c;
  }

  // nullopt: fewer than two views are consistent with it.
  std::optional<PositionCandidate> refined(const Eigen::Vector3d& start) const {
    PositionCandidate c;
    c.position = start;
    for (int i = 0; i < ray_crossing.refinements; ++i) {
      const std::vector<Sighting> apart = look(c);
      if (apart.size() < 2) return std::nullopt;
      const PositionInformation z = information_of(apart, c.position);
      c.covariance = z.information.inverse();
      c.position = c.covariance * z.vector;
    }
    if (!c.position.allFinite()) return std::nullopt;
    return c;
  }

 private:
  Sighting sighting_at(std::size_t view, const color::ColorRegion& region, const BallProjection& at) const {
    Sighting s = sighting_of(views_[view], region, at.radius_px, options_.pixel_noise_px, {});
    s.row = row_of(views_[view], region.centre.y(), times_);
    return s;
  }

  // Adds the object's unknown motion between this row and the newest frame, and the bias.
  Sighting set_apart(Sighting s, const BallProjection& at) const {
    const double apart_s =
        std::hypot(capture::seconds(newest_ - s.row.at), times_.row_sigma_s(s.row.camera, s.row.below_middle));
    const double travel_m = options_.start_speed_m_s * apart_s;
    s.covariance += travel_m * travel_m * at.jacobian * at.jacobian.transpose();
    s.covariance.diagonal().array() += s.bias_sigma_px * s.bias_sigma_px;
    return s;
  }

  bool fits(std::size_t view, const color::ColorRegion& region, const BallProjection& at, double least_support) const {
    const double share = region.area / disc_area(at.radius_px);
    if (share < least_support || share > sighting_tuning.max_disc_share) return false;
    const Sighting s = set_apart(sighting_at(view, region, at), at);
    return mahalanobis2(s.px - at.px, s.covariance) <= sighting_tuning.gate_nis;
  }

  const color::ColorRegion* nearest_fitting(std::size_t view, const BallProjection& at) const {
    const color::ColorRegion* nearest = nullptr;
    for (const color::ColorRegion& region : regions_[view]) {
      if (!fits(view, region, at, sighting_tuning.min_disc_share)) continue;
      if (nearest == nullptr || (region.centre - at.px).norm() < (nearest->centre - at.px).norm()) nearest = &region;
    }
    return nearest;
  }

  // Sets the candidate's sightings and score; returns the sightings with set_apart() applied.
  std::vector<Sighting> look(PositionCandidate& c) const {
    std::vector<Sighting> apart;
    c.sightings.clear();
    c.score = 0;
    for (std::size_t v = 0; v < views_.size(); ++v) {
      const std::optional<BallProjection> at = project_ball(*views_[v].camera, c.position, target_.radius_m);
      if (!at || !views_[v].camera->contains({at->px})) continue;
      const color::ColorRegion* region = nearest_fitting(v, *at);
      if (region == nullptr) continue;
      c.sightings.push_back(sighting_at(v, *region, *at));
      apart.push_back(set_apart(c.sightings.back(), *at));
      c.score += c.sightings.back().support;
    }
    return apart;
  }

  const std::vector<TargetView>& views_;
  std::span<const std::vector<color::ColorRegion>> regions_;
  const TargetOptions& target_;
  const ObjectTrackerOptions& options_;
  const MotionState& times_;
  capture::Timestamp newest_ = capture::Timestamp::min();
};

}  // namespace

bool inside(const Volume& volume, const Eigen::Vector3d& p, double margin_m) {
  return ((p - volume.min).array() >= -margin_m).all() && ((volume.max - p).array() >= -margin_m).all();
}

bool may_be_inside(const Volume& volume, const Eigen::Vector3d& p, const Eigen::Matrix3d& covariance, double margin_m) {
  const auto axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>().computeDirect(covariance);
  const Eigen::Vector3d reach = std::sqrt(std::max(0.0, axes.eigenvalues()(2))) * axes.eigenvectors().col(2);
  double from = -1, to = 1;  // of the reach: where it is between all pairs of planes
  for (int i = 0; i < 3; ++i) {
    const double low = volume.min(i) - margin_m - p(i), high = volume.max(i) + margin_m - p(i);
    if (reach(i) == 0) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    from = std::max(from, std::min(low / reach(i), high / reach(i)));
    to = std::min(to, std::max(low / reach(i), high / reach(i)));
  }
  return from <= to;
}

bool inside(const Volume& volume, const MotionState& motion, double margin_m) {
  return motion.has_size() ? may_be_inside(volume, motion.position(), motion.position_covariance(), margin_m)
                           : inside(volume, motion.position(), margin_m);
}

bool inside(const Volume& volume, const PositionCandidate& candidate, double margin_m) {
  return candidate.sightings.size() == 1 ? may_be_inside(volume, candidate.position, candidate.covariance, margin_m)
                                         : inside(volume, candidate.position, margin_m);
}

std::optional<BallProjection> project_ball(const calib::Camera& camera, const Eigen::Vector3d& p_world,
                                           double radius_m) {
  const Eigen::Vector3d p_cam = camera.cam_from_world * p_world;
  calib::CameraModel::Jacobian px_from_cam;
  const std::optional<calib::RawPixel> px = camera.model.project(p_cam, px_from_cam);
  if (!px) return std::nullopt;
  BallProjection a;
  a.px = px->px;
  a.jacobian = px_from_cam * camera.cam_from_world.rotation.toRotationMatrix();
  // Mean scale across the line of sight: square root of the image area of a unit square there.
  const Eigen::Matrix2d across = px_from_cam * px_from_cam.transpose();
  a.radius_px = radius_m * std::sqrt(std::sqrt(std::max(0.0, across.determinant())));
  return a;
}

Eigen::Matrix2d px_covariance_of_pose(const calib::Camera& camera, const Eigen::Vector3d& p_world,
                                      const BallProjection& at, const Eigen::Matrix<double, 6, 6>& pose_covariance) {
  const Eigen::Matrix<double, 2, 3> px_from_cam =
      at.jacobian * camera.cam_from_world.rotation.toRotationMatrix().transpose();
  // exp(e) p = p + rotation x p + shift, to first order.
  Eigen::Matrix<double, 2, 6> by_pose;
  by_pose << -px_from_cam * calib::cross_matrix(camera.cam_from_world * p_world), px_from_cam;
  return by_pose * pose_covariance * by_pose.transpose();
}

double sample_px(const capture::Image& image) {
  switch (image.format) {
    case capture::PixelFormat::nv12:
    case capture::PixelFormat::i420:
      return 2;
    case capture::PixelFormat::yuyv:
    case capture::PixelFormat::i422:
      return std::numbers::sqrt2;
    case capture::PixelFormat::i444:
    case capture::PixelFormat::bgr:
    case capture::PixelFormat::grey:
      break;
  }
  return 1;
}

BaseError base_error(double radius_px, double pixel_noise_px, double sample_px) {
  // Each chroma sample on the edge is in or out as a whole: independent errors, as many as samples.
  const double rounding = std::pow(sample_px, 3) / (12 * std::numbers::pi * std::max(1.0, radius_px));
  const double error2 = pixel_noise_px * pixel_noise_px +
                        sighting_tuning.shading_share * sighting_tuning.shading_share * radius_px * radius_px +
                        rounding;
  return {.noise_px2 = (1 - region_error.bias_share) * error2, .bias_px2 = region_error.bias_share * error2};
}

namespace {

// 2 sigma of the log of length over width of a disc, by the coarseness of its edge.
double log_width_by_chance(double radius_px, double sample_px) {
  const double coarseness = sample_px / std::max(1.0, radius_px);
  return 2 * width_noise * coarseness * std::sqrt(coarseness);
}

// Log of length over width, smear subtracted, beyond chance: what is longer than wide is partly occluded.
double narrowing(const Eigen::Matrix2d& spread, const ImageMotion& motion, double by_chance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(spread);
  const double length_px = 2 * std::sqrt(std::max(0.0, axes.eigenvalues()(1))) -
                           0.5 * std::abs(axes.eigenvectors().col(1).dot(motion.velocity)) * motion.longest_exposure_s;
  const double width_px = 2 * std::sqrt(std::max(0.0, axes.eigenvalues()(0)));
  return std::max(0.0, std::log(std::max(1.0, length_px) / std::max(1.0, width_px)) - by_chance);
}

}  // namespace

Sighting sighting_of(const TargetView& view, const color::ColorRegion& region, double radius_px, double pixel_noise_px,
                     const ImageMotion& motion) {
  Sighting s;
  s.row.camera = view.index;
  s.camera = view.camera;
  s.projector = view.projector;
  s.px = region.centre;
  s.radius_px = disc_radius(region.area);
  const BaseError usual = base_error(radius_px, pixel_noise_px, sample_px(*view.image));
  s.bias_sigma_px = std::sqrt(usual.bias_px2);
  // Rolling shutter: a row dv below the centre shows the ball dv row_s later, so the outline is the disc's image under
  // the inverse of d -> d - velocity row_s d.v.
  const Eigen::Vector2d shear = (motion.row_s * motion.velocity).cwiseMax(-0.5).cwiseMin(0.5);
  Eigen::Matrix2d outline_from_disc = Eigen::Matrix2d::Identity();
  outline_from_disc.col(1) += shear / (1 - shear.y());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(region.spread);
  Eigen::Vector2d variance = Eigen::Vector2d::Constant(usual.noise_px2);
  double misfit_px2 = 0;  // mean of both axes
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d axis = axes.eigenvectors().col(i);
    const double expected_px = radius_px * (outline_from_disc.transpose() * axis).norm();
    const double smear_px = 0.5 * std::abs(axis.dot(motion.velocity)) * motion.longest_exposure_s;
    const double too_wide_px = 2 * std::sqrt(std::max(0.0, axes.eigenvalues()(i))) - expected_px;
    const double smeared_px = too_wide_px > 0 ? smear_px : smear_px / region_error.occlusion_smear;
    const double excess_px =
        region_error.misfit_gain *
        std::max(0.0, std::abs(too_wide_px) - sighting_tuning.misfit_share * radius_px - smeared_px);
    variance(i) += excess_px * excess_px;
    misfit_px2 += excess_px * excess_px / 2;
  }
  s.covariance = axes.eigenvectors() * variance.asDiagonal() * axes.eigenvectors().transpose() + region.of_disc;
  s.evidence = region.evidence;
  s.support = std::min(1.0, region.area / (std::numbers::pi * radius_px * radius_px));
  s.narrowed = narrowing(region.spread, motion, log_width_by_chance(radius_px, sample_px(*view.image)));
  if (region.of_disc.any()) {
    // What hides a part of a disc in a room that shares the colour is mostly a hand that moves along: the error lasts.
    s.hidden_px = sighting_tuning.cut_error * (1 - s.support) * radius_px;
    s.bias_sigma_px = std::sqrt(usual.bias_px2 + misfit_px2 + region.of_disc.trace() / 2 + s.hidden_px * s.hidden_px);
  } else {
    s.size = {.radius_px = s.radius_px,
              .log_sigma = std::hypot(std::sqrt(usual.noise_px2) / std::max(1.0, s.radius_px), s.narrowed),
              .log_bias = sighting_tuning.region_size_sigma,
              .is_bias_constant = true};
  }
  return s;
}

void measure_hull(const TargetView& view, const color::ColorRegion& region, const ImageMotion& motion, Sighting& s) {
  if (!s.size) return;
  const double chance = log_width_by_chance(s.radius_px, sample_px(*view.image));
  if (chance > sighting_tuning.shading_share) return;
  const color::ConvexHull hull = color::hull_of(*view.matches, region.box);
  const double edge = std::sqrt(std::max(0.0, std::pow(s.size->log_sigma, 2) - s.narrowed * s.narrowed));
  s.narrowed = narrowing(hull.spread, motion, chance);
  s.size->radius_px = disc_radius(hull.area);
  s.size->log_sigma = std::hypot(edge, s.narrowed);
  s.size->log_bias = sighting_tuning.shading_share;
}

void sort_by_time(std::vector<Sighting>& sightings) {
  std::ranges::stable_sort(sightings, {}, [](const Sighting& s) { return s.row.at; });
}

bool has_disc_shape(const Sighting& s) {
  return std::sqrt(s.covariance.trace() / 2) <= sighting_tuning.misfit_share * s.radius_px / std::sqrt(s.support);
}

bool is_too_large_alone(double radius_px, double expected_px) {
  return radius_px * radius_px > sighting_tuning.alone_share * expected_px * expected_px;
}

SeenRow row_of(const TargetView& view, double row, const MotionState& times) {
  SeenRow out{.camera = view.index, .below_middle = view.below_middle(row)};
  out.shift_s = times.row_offset_s(view.index, out.below_middle);
  out.at = view.frame->row_time(row) + capture::duration_of(out.shift_s);
  return out;
}

PositionInformation information_of(std::span<const Sighting> sightings, const Eigen::Vector3d& p_world) {
  PositionInformation out;
  for (const Sighting& s : sightings) {
    const std::optional<BallProjection> a = project_ball(*s.camera, p_world, 1);
    if (!a) continue;
    const Eigen::Matrix<double, 3, 2> weighted = a->jacobian.transpose() * s.covariance.inverse();
    out.information += weighted * a->jacobian;
    out.vector += weighted * (s.px - a->px + a->jacobian * p_world);
  }
  return out;
}

std::optional<Eigen::Vector3d> crossing(const calib::Camera& camera0, const calib::RawPixel& px0,
                                        const calib::Camera& camera1, const calib::RawPixel& px1) {
  const auto ray0 = camera0.model.ray(px0), ray1 = camera1.model.ray(px1);
  if (!ray0 || !ray1) return std::nullopt;
  return crossing(camera0.centre(), camera0.cam_from_world.rotation.conjugate() * *ray0, camera1.centre(),
                  camera1.cam_from_world.rotation.conjugate() * *ray1);
}

std::vector<PositionCandidate> cross_rays(const std::vector<TargetView>& views,
                                          std::span<const std::vector<color::ColorRegion>> regions,
                                          const TargetOptions& target, const ObjectTrackerOptions& options,
                                          const MotionState& times, std::size_t max_count) {
  const RayCrosser crosser(views, regions, target, options, times);
  std::vector<std::vector<RegionRay>> rays;
  for (std::size_t i = 0; i < views.size(); ++i) rays.push_back(crosser.rays_of(i));

  std::vector<PositionCandidate> out;
  if (views.size() == 1 && target.shape != TargetShape::blob) {
    for (const RegionRay& ray : rays.front()) {
      if (auto c = crosser.by_size(ray)) out.push_back(std::move(*c));
    }
  }
  const auto consider = [&](std::size_t i, const RegionRay& a, std::size_t j, const RegionRay& b) {
    const auto start = crosser.meeting(i, a, j, b);
    if (!start) return;
    auto c = crosser.refined(*start);
    if (!c) return;
    const bool again = std::ranges::any_of(
        out, [&](const PositionCandidate& o) { return (o.position - c->position).norm() < 0.5 * target.radius_m; });
    if (!again) out.push_back(std::move(*c));
  };
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      for (const RegionRay& a : rays[i]) {
        for (const RegionRay& b : rays[j]) consider(i, a, j, b);
      }
    }
  }
  std::ranges::stable_sort(out,
                           [](const PositionCandidate& a, const PositionCandidate& b) { return a.score > b.score; });
  if (out.size() > max_count) out.resize(max_count);
  return out;
}

}  // namespace huetrack::object_tracking
