#include "object_tracking/view_consistency.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "object_tracking/expected_view.h"

namespace huetrack::object_tracking {
namespace {

struct ViewConsistencyTuning {
  double speed_share = 0.25;  // of start_speed_m_s: largest velocity error that excuses an inconsistency
  double min_age_s = 0.08;    // s, of the regions that motion is measured against; between searches for it
};
constexpr ViewConsistencyTuning view_consistency{};

double still_px(double radius_px) {
  return std::max(sighting_tuning.still_px(), sighting_tuning.misfit_share * radius_px);
}

}  // namespace

ViewConsistency::ViewConsistency(std::size_t cameras, double radius_m, const ObjectTrackerOptions& options)
    : radius_m_(radius_m),
      options_(options),
      epipolar_(cameras, radius_m),
      pose_covariance_(cameras, Eigen::Matrix<double, 6, 6>::Zero()),
      unseen_(cameras),
      is_shared_(cameras, false),
      finders_(cameras) {}

void ViewConsistency::trust(std::span<const std::size_t> changed, std::span<const CameraTrust> cameras) {
  for (const std::size_t c : changed) epipolar_.forget(c);
  has_pose_covariance_ = false;
  for (std::size_t c = 0; c < pose_covariance_.size(); ++c) {
    pose_covariance_[c] = c < cameras.size() ? cameras[c].pose_covariance : Eigen::Matrix<double, 6, 6>::Zero();
    has_pose_covariance_ = has_pose_covariance_ || !pose_covariance_[c].isZero(0);
  }
}

void ViewConsistency::forget() {
  for (std::size_t c = 0; c < unseen_.size(); ++c) epipolar_.forget(c);
}

std::optional<PathResidual> ViewConsistency::residual_of(const Sighting& sighting, const MotionState& state) const {
  const auto at = project_ball(*sighting.camera, state.position_at(sighting.row.at), radius_m_);
  if (!at) return std::nullopt;
  const Eigen::Vector2d px_per_s = at->jacobian * state.velocity();
  const double time_sigma_s = state.row_sigma_s(sighting.row.camera, sighting.row.below_middle);
  PathResidual out{.camera = sighting.row.camera,
                   .at_s = capture::seconds(sighting.row.at - state.at),
                   .px = sighting.px,
                   .off_px = sighting.px - at->px,
                   .covariance = sighting.covariance + sighting.of_pose +
                                 time_sigma_s * time_sigma_s * px_per_s * px_per_s.transpose(),
                   .jacobian = at->jacobian,
                   .is_cut = sighting.is_cut};
  out.covariance.diagonal().array() += sighting.bias_sigma_px * sighting.bias_sigma_px;
  return out;
}

// The only region of a whole image that may be the object and has moved within the last tenth of a second; nullptr:
// none, or several, which may be several objects.
const color::ColorRegion* ViewConsistency::only_moving(int camera, std::span<const color::ColorRegion> regions,
                                                       double radius_px, capture::Timestamp at) {
  const double disc_px2 = std::numbers::pi * radius_px * radius_px;
  Unseen& unseen = unseen_[std::size_t(camera)];
  if (capture::seconds(at - unseen.newer_at) >= view_consistency.min_age_s) {
    std::swap(unseen.older, unseen.newer);
    unseen.older_at = unseen.newer_at;
    unseen.newer.assign(regions.begin(), regions.end());
    unseen.newer_at = at;
  }
  const double age_s = capture::seconds(at - unseen.older_at);
  if (age_s < view_consistency.min_age_s || age_s > sighting_tuning.confirmation_s) return nullptr;
  const color::ColorRegion* moved = nullptr;
  for (const color::ColorRegion& region : regions) {
    if (region.area < sighting_tuning.start_disc_share * disc_px2) continue;
    if (region.area > sighting_tuning.max_disc_share * disc_px2) return nullptr;
    const bool was_there = std::ranges::any_of(unseen.older, [&](const color::ColorRegion& before) {
      return (before.centre - region.centre).norm() < still_px(radius_px);
    });
    if (was_there) continue;
    if (moved != nullptr) return nullptr;
    moved = &region;
  }
  return moved;
}

// Of a moving region elsewhere in the image: with a wrong calibration the object may be anywhere in it.
std::optional<PathResidual> ViewConsistency::residual_elsewhere(const TargetView& view, capture::Timestamp set_at,
                                                                const MotionState& state, SeenRegions& seen) {
  Unseen& unseen = unseen_[std::size_t(view.index)];
  const auto expected = expected_in(view, state, radius_m_);
  if (is_shared_[std::size_t(view.index)] || !expected || !view.camera->contains({expected->at.px}))
    return std::nullopt;
  if (!unseen.is_suspicious && capture::seconds(set_at - unseen.newer_at) < view_consistency.min_age_s)
    return std::nullopt;
  const BallProjection& at = expected->at;
  const double disc = disc_area(at.radius_px);
  const auto& regions = finders_[std::size_t(view.index)].search(
      *view.matches, std::max(1, int(at.radius_px)), int(std::ceil(sighting_tuning.extent_radii * at.radius_px)) + 2,
      std::max(2, int(sighting_tuning.start_disc_share * disc)), at.radius_px);
  seen.add_others(view, regions);
  const color::ColorRegion* moved = only_moving(view.index, regions, at.radius_px, set_at);
  unseen.is_suspicious = moved != nullptr;
  if (moved == nullptr) return std::nullopt;
  Sighting sighting = sighting_of(view, *moved, at.radius_px, options_.pixel_noise_px, image_motion(view, at, state));
  if (!has_disc_shape(sighting)) return std::nullopt;  // a part of something else
  sighting.row = row_of(view, sighting.px.y(), state);
  return residual_of(sighting, state);
}

void ViewConsistency::compare_moving(const std::vector<TargetView>& views,
                                     std::span<const std::vector<color::ColorRegion>> regions,
                                     std::span<const double> expected_px, capture::Timestamp set_at,
                                     const MotionState& state) {
  std::vector<Sighting> moving;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (is_shared_[std::size_t(views[i].index)]) continue;
    const double radius_px = expected_px[i];
    const color::ColorRegion* moved = only_moving(views[i].index, regions[i], radius_px, set_at);
    if (moved == nullptr) continue;
    Sighting sighting = sighting_of(views[i], *moved, disc_radius(moved->area), options_.pixel_noise_px, {});
    if (!has_disc_shape(sighting)) continue;
    sighting.row = row_of(views[i], sighting.px.y(), state);
    moving.push_back(sighting);
  }
  for (std::size_t a = 0; a < moving.size(); ++a) {
    for (std::size_t b = a + 1; b < moving.size(); ++b) {
      const auto seen = pair_residual(moving[a], moving[b], state);
      // With unknown timing a moving region is consistent with anything: then only inconsistency is evidence.
      const bool is_evidence = seen && (is_discriminating(*seen, moving[a].radius_px, moving[b].radius_px) ||
                                        seen->off_px * seen->off_px > seen->expected_px2);
      if (is_evidence) epipolar_.add(std::size_t(moving[a].row.camera), std::size_t(moving[b].row.camera), *seen);
    }
  }
}

// Of two views of an object of which nothing else is known.
std::optional<EpipolarResidual> ViewConsistency::pair_residual(const Sighting& i, const Sighting& j,
                                                               const MotionState& state) const {
  // If the rays do not meet in front of both cameras.
  EpipolarResidual seen{.off_px = sighting_tuning.behind_px, .expected_px2 = 1, .share_i = 0.5, .share_j = 0.5};
  const auto p = crossing(*i.camera, {i.px}, *j.camera, {j.px});
  if (!p) return seen;
  const auto beside_p = [&](const Sighting& s) -> std::optional<PathResidual> {
    const auto at = project_ball(*s.camera, *p, radius_m_);
    if (!at) return std::nullopt;
    PathResidual out;
    out.camera = s.row.camera;
    out.off_px = s.px - at->px;
    out.covariance = s.covariance;
    out.covariance.diagonal().array() += s.bias_sigma_px * s.bias_sigma_px;
    out.jacobian = at->jacobian;
    return out;
  };
  const double apart_s = std::hypot(capture::seconds(i.row.at - j.row.at),
                                    std::hypot(state.row_sigma_s(i.row.camera, i.row.below_middle),
                                               state.row_sigma_s(j.row.camera, j.row.below_middle)));
  const double path_m = options_.start_speed_m_s * apart_s;
  const auto of_i = beside_p(i), of_j = beside_p(j);
  if (!of_i || !of_j || !epipolar_residual(*of_i, *of_j, path_m * path_m, seen)) return std::nullopt;
  return seen;
}

void ViewConsistency::compare(const std::vector<TargetView>& views, capture::Timestamp set_at, const MotionState& state,
                              std::vector<Sighting>& sightings, std::vector<Sighting>& watched, SeenRegions& seen) {
  residuals_.clear();
  inflate(state, sightings);
  for (const Sighting& s : sightings) {
    unseen_[std::size_t(s.row.camera)].is_suspicious = false;
    if (const auto residual = residual_of(s, state)) residuals_.push_back(*residual);
  }
  for (const TargetView& view : views) {
    const auto by_view = std::ranges::find(sightings, view.index, [](const Sighting& s) { return s.row.camera; });
    if (by_view != sightings.end()) {
      seen.add_target(view, *by_view);
    } else if (!sightings.empty()) {
      if (const auto far = residual_elsewhere(view, set_at, state, seen)) residuals_.push_back(*far);
    }
  }
  compare_residuals(state);
  inflate(state, sightings);
  inflate(state, watched);
}

void ViewConsistency::compare_found(const MotionState& state, std::vector<Sighting>& sightings) {
  compared_sets_ = 0;
  compare_sightings(state, sightings);
  inflate(state, sightings);
}

void ViewConsistency::compare_sightings(const MotionState& state, std::span<const Sighting> sightings) {
  residuals_.clear();
  for (const Sighting& s : sightings) {
    if (const auto seen = residual_of(s, state)) residuals_.push_back(*seen);
  }
  compare_residuals(state);
}

void ViewConsistency::compare_residuals(const MotionState& state) {
  // An unknown velocity excuses inconsistency after a start, but not when inconsistency is why it is unknown.
  const double excused = ++compared_sets_ > pair_history.min_residuals ? view_consistency.speed_share : 1.0;
  const double velocity_sigma =
      std::min(largest_sigma(state.velocity_covariance()), excused * options_.start_speed_m_s);
  epipolar_.compare(residuals_, velocity_sigma, options_.acceleration_m_s2);
}

void ViewConsistency::inflate(const MotionState& state, std::vector<Sighting>& sightings) const {
  for (Sighting& s : sightings) {
    const auto c = std::size_t(s.row.camera);
    s.inflation_px2 = epipolar_.variance_px2(c);
    if (!has_pose_covariance_) continue;
    const Eigen::Vector3d then = state.position_at(s.row.at);
    const auto at = project_ball(*s.camera, then, radius_m_);
    if (at) s.of_pose = px_covariance_of_pose(*s.camera, then, *at, pose_covariance_[c]);
  }
}

void ViewConsistency::inflate_prediction(std::size_t camera, const calib::Camera& in_view,
                                         const Eigen::Vector3d& position, const BallProjection& at,
                                         Eigen::Matrix2d& covariance) const {
  covariance.diagonal().array() += epipolar_.variance_px2(camera);
  if (has_pose_covariance_) covariance += px_covariance_of_pose(in_view, position, at, pose_covariance_[camera]);
}

double ViewConsistency::inflated_sigma(const MotionState& state, std::span<const Sighting> sightings) const {
  if (!has_pose_covariance_ && !epipolar_.any()) return 0;
  if (state.has_size()) {  // the distance is by the size, which a pose does not change
    if (sightings.empty()) return 0;
    const Eigen::Vector3d ray = (state.position() - sightings.front().camera->centre()).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    return largest_sigma(across * state.position_covariance() * across);
  }
  const double filtered_m = largest_sigma(state.position_covariance());
  if (sightings.size() < 2) return filtered_m;
  std::vector<Sighting> opened(sightings.begin(), sightings.end());
  for (Sighting& s : opened) s.covariance += s.inflation();
  const PositionInformation seen = information_of(opened, state.position());
  return std::min(filtered_m, largest_sigma(seen.information.inverse()));
}

void add_leave_one_out(const MotionState& state, double radius_m, double acceleration_m_s2, double anywhere_m,
                       std::span<const Sighting> seen, std::span<const Sighting> used, ObjectEstimate& estimate) {
  if (seen.size() < 2) return;
  const Eigen::Vector3d velocity = state.velocity();
  const Eigen::Matrix3d velocity_covariance = state.velocity_covariance();
  struct OnPath {
    BallProjection at;
    Eigen::Matrix2d covariance;  // without inflation by inconsistency
  };
  std::vector<std::optional<OnPath>> on_path;
  const auto path = [&](const Sighting& s) -> Eigen::Vector3d {
    return state.position() + capture::seconds(s.row.at - state.at) * velocity;
  };
  for (const Sighting& s : seen) {
    auto& out = on_path.emplace_back();
    const auto at = project_ball(*s.camera, path(s), radius_m);
    if (!at) continue;
    const Eigen::Vector2d px_per_s = at->jacobian * velocity;
    const double time_sigma_s = state.row_sigma_s(s.row.camera, s.row.below_middle);
    out = {*at, s.covariance + s.of_pose + time_sigma_s * time_sigma_s * px_per_s * px_per_s.transpose()};
    out->covariance.diagonal().array() += s.bias_sigma_px * s.bias_sigma_px;
  }
  const auto is_in_use = [&](int camera) {
    return std::ranges::any_of(used, [&](const Sighting& s) { return s.row.camera == camera; });
  };
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!on_path[i]) continue;
    PositionInformation others{.information = Eigen::Matrix3d::Identity() / (anywhere_m * anywhere_m)};
    LeaveOneOut leave_one_out;
    leave_one_out.at = seen[i].row.at;
    leave_one_out.px = seen[i].px;
    leave_one_out.covariance = on_path[i]->covariance;
    for (std::size_t j = 0; j < seen.size(); ++j) {
      if (j == i || !on_path[j] || !is_in_use(seen[j].row.camera)) continue;
      const double apart_s = capture::seconds(seen[j].row.at - seen[i].row.at);
      const double swerve_m = 0.5 * apart_s * apart_s * acceleration_m_s2;
      const Eigen::Matrix3d drift =
          apart_s * apart_s * velocity_covariance + swerve_m * swerve_m * Eigen::Matrix3d::Identity();
      const auto& jacobian = on_path[j]->at.jacobian;
      const Eigen::Matrix2d covariance = on_path[j]->covariance + jacobian * drift * jacobian.transpose();
      const Eigen::Matrix<double, 3, 2> weighted = jacobian.transpose() * covariance.inverse();
      others.information += weighted * jacobian;
      others.vector += weighted * (seen[j].px - on_path[j]->at.px);
      ++leave_one_out.others;
    }
    if (leave_one_out.others == 0) continue;
    leave_one_out.position_covariance = others.information.inverse();
    leave_one_out.position = path(seen[i]) + leave_one_out.position_covariance * others.vector;
    leave_one_out.velocity = velocity;
    estimate.per_view[std::size_t(seen[i].row.camera)].leave_one_out = leave_one_out;
  }
}

}  // namespace huetrack::object_tracking
