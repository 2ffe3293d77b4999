#include "object_tracking/view_agreement.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "object_tracking/expected_view.h"

namespace huetrack::object_tracking {
namespace {

struct ViewAgreementTuning {
  unsigned search_every = 4;   // frame sets between searches of the whole image of a view that lost the object: cost
  double speed_share = 0.25;   // of start_speed_m_s: largest velocity error that excuses an inconsistency
  unsigned settling_sets = 8;  // frame sets after a start in which all of start_speed_m_s excuses it
  double no_crossing_px = 50;  // px, residual of rays that do not meet in front of both cameras
  double min_age_s = 0.08;     // s, of the regions that motion is measured against
  double max_age_s = 0.5;      // s, the same
  double still_px = 2;         // px, a region that moved less stands still
  double still_radii = 0.2;    // radii, the same of large regions
  double extent_radii = 3;     // radii, largest extent of a region that a search joins
};
constexpr ViewAgreementTuning view_agreement{};

double still_px(double radius_px) {
  return std::max(view_agreement.still_px, view_agreement.still_radii * radius_px);
}

}  // namespace

ViewAgreement::ViewAgreement(std::size_t cameras, double radius_m, const ObjectTrackerOptions& options)
    : radius_m_(radius_m),
      options_(options),
      doubts_(cameras, radius_m),
      pose_covariance_(cameras, Eigen::Matrix<double, 6, 6>::Zero()),
      unseen_(cameras),
      is_shared_(cameras, false),
      finders_(cameras) {}

void ViewAgreement::trust(std::span<const std::size_t> changed, std::span<const CameraTrust> cameras) {
  for (const std::size_t c : changed) doubts_.forget(c);
  has_pose_covariance_ = false;
  for (std::size_t c = 0; c < pose_covariance_.size(); ++c) {
    pose_covariance_[c] = c < cameras.size() ? cameras[c].pose_covariance : Eigen::Matrix<double, 6, 6>::Zero();
    has_pose_covariance_ = has_pose_covariance_ || !pose_covariance_[c].isZero(0);
  }
}

void ViewAgreement::forget() {
  for (std::size_t c = 0; c < unseen_.size(); ++c) doubts_.forget(c);
}

// Beside where the object would be if it had gone on as it did.
std::optional<SeenBeside> ViewAgreement::beside(const Sighting& sighting, const MotionBelief& belief) const {
  const auto at = appearance_of(*sighting.camera, belief.position_at(sighting.row.at), radius_m_);
  if (!at) return std::nullopt;
  const Eigen::Vector2d px_per_s = at->jacobian * belief.velocity();
  const double time_sigma_s = belief.row_sigma_s(sighting.row.camera, sighting.row.below_middle);
  SeenBeside out{.camera = sighting.row.camera,
                 .at_s = capture::seconds(sighting.row.at - belief.at),
                 .px = sighting.px,
                 .off_px = sighting.px - at->px,
                 .covariance = sighting.covariance + sighting.of_pose +
                               time_sigma_s * time_sigma_s * px_per_s * px_per_s.transpose(),
                 .jacobian = at->jacobian};
  out.covariance.diagonal().array() += sighting.lasting_px * sighting.lasting_px;
  return out;
}

// Of what a whole image shows, the only region that may be the object and is not where one was a tenth of a second ago.
// What stands still is furniture. Several that move are several objects, and tell nothing.
const color::ColorRegion* ViewAgreement::only_moving(int camera, std::span<const color::ColorRegion> regions,
                                                     double radius_px, capture::Timestamp at) {
  const double disc_px2 = std::numbers::pi * radius_px * radius_px;
  Unseen& unseen = unseen_[static_cast<std::size_t>(camera)];
  if (capture::seconds(at - unseen.newer_at) >= view_agreement.min_age_s) {
    std::swap(unseen.older, unseen.newer);
    unseen.older_at = unseen.newer_at;
    unseen.newer.assign(regions.begin(), regions.end());
    unseen.newer_at = at;
  }
  const double age_s = capture::seconds(at - unseen.older_at);
  if (age_s < view_agreement.min_age_s || age_s > view_agreement.max_age_s) return nullptr;
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

// A view that should show the object, and does not where the others have it: shows it something like it elsewhere? Seen
// through another calibration it may be anywhere in the image.
std::optional<SeenBeside> ViewAgreement::far_off(const TargetView& view, capture::Timestamp set_at,
                                                 const MotionBelief& belief, SeenRegions& seen) {
  Unseen& unseen = unseen_[static_cast<std::size_t>(view.index)];
  const auto expected = expected_in(view, belief, radius_m_);
  if (is_shared_[static_cast<std::size_t>(view.index)] || !expected || !view.camera->contains({expected->at.px}))
    return std::nullopt;
  if (unseen.sets++ % view_agreement.search_every != 0 && !unseen.is_suspicious) return std::nullopt;
  const Appearance& at = expected->at;
  const double disc = std::numbers::pi * at.radius_px * at.radius_px;
  const auto& regions = finders_[static_cast<std::size_t>(view.index)].search(
      *view.matches, std::max(1, static_cast<int>(at.radius_px)),
      static_cast<int>(std::ceil(view_agreement.extent_radii * at.radius_px)) + 2,
      std::max(2, static_cast<int>(sighting_tuning.start_disc_share * disc)), at.radius_px);
  seen.add_others(view, regions);
  const color::ColorRegion* moved = only_moving(view.index, regions, at.radius_px, set_at);
  unseen.is_suspicious = moved != nullptr;
  if (moved == nullptr) return std::nullopt;
  Sighting sighting = sighting_of(view, *moved, at.radius_px, options_.pixel_noise_px, image_motion(view, at, belief));
  sighting.row = row_of(view, sighting.px.y(), belief);
  return beside(sighting, belief);
}

void ViewAgreement::compare_searched(const std::vector<TargetView>& views,
                                     std::span<const std::vector<color::ColorRegion>> regions,
                                     std::span<const double> expected_px, capture::Timestamp set_at,
                                     const MotionBelief& belief) {
  std::vector<Sighting> moving;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (is_shared_[static_cast<std::size_t>(views[i].index)]) continue;
    const double radius_px = expected_px[i];
    const color::ColorRegion* moved = only_moving(views[i].index, regions[i], radius_px, set_at);
    if (moved == nullptr) continue;
    moving.push_back(
        sighting_of(views[i], *moved, std::sqrt(moved->area / std::numbers::pi), options_.pixel_noise_px, {}));
    moving.back().row = row_of(views[i], moving.back().px.y(), belief);
  }
  for (std::size_t a = 0; a < moving.size(); ++a) {
    for (std::size_t b = a + 1; b < moving.size(); ++b) {
      const auto seen = disagreement_of(moving[a], moving[b], belief);
      // Where times are not known yet, what moves agrees with anything, and that it does says nothing.
      const bool tells = seen && (could_contradict(*seen, moving[a].radius_px, moving[b].radius_px) ||
                                  seen->off_px * seen->off_px > seen->expected_px2);
      if (tells)
        doubts_.add(static_cast<std::size_t>(moving[a].row.camera), static_cast<std::size_t>(moving[b].row.camera),
                    *seen);
    }
  }
}

// Of two views of something of which nothing else is known; nullopt: they tell nothing.
std::optional<Disagreement> ViewAgreement::disagreement_of(const Sighting& i, const Sighting& j,
                                                           const MotionBelief& belief) const {
  // Rays that do not meet before both cameras are as far apart as can be.
  Disagreement seen{.off_px = view_agreement.no_crossing_px, .expected_px2 = 1, .share_i = 0.5, .share_j = 0.5};
  const auto p = crossing(*i.camera, {i.px}, *j.camera, {j.px});
  if (!p) return seen;
  const auto beside_p = [&](const Sighting& s) -> std::optional<SeenBeside> {
    const auto at = appearance_of(*s.camera, *p, radius_m_);
    if (!at) return std::nullopt;
    SeenBeside out;
    out.camera = s.row.camera;
    out.off_px = s.px - at->px;
    out.covariance = s.covariance;
    out.covariance.diagonal().array() += s.lasting_px * s.lasting_px;
    out.jacobian = at->jacobian;
    return out;
  };
  const double apart_s = std::hypot(capture::seconds(i.row.at - j.row.at),
                                    std::hypot(belief.row_sigma_s(i.row.camera, i.row.below_middle),
                                               belief.row_sigma_s(j.row.camera, j.row.below_middle)));
  const double way_m = options_.start_speed_m_s * apart_s;
  const auto of_i = beside_p(i), of_j = beside_p(j);
  if (!of_i || !of_j || !disagreement(*of_i, *of_j, way_m * way_m, seen)) return std::nullopt;
  return seen;
}

void ViewAgreement::compare(const std::vector<TargetView>& views, capture::Timestamp set_at, const MotionBelief& belief,
                            std::vector<Sighting>& sightings, std::vector<Sighting>& watched, SeenRegions& seen) {
  besides_.clear();
  doubt(belief, sightings);
  for (const Sighting& s : sightings) {
    unseen_[static_cast<std::size_t>(s.row.camera)].sets = 0;
    unseen_[static_cast<std::size_t>(s.row.camera)].is_suspicious = false;
    if (s.is_cut) continue;
    if (const auto seen_beside = beside(s, belief)) besides_.push_back(*seen_beside);
  }
  for (const TargetView& view : views) {
    const auto by_view = std::ranges::find(sightings, view.index, [](const Sighting& s) { return s.row.camera; });
    if (by_view != sightings.end()) {
      seen.add_target(view, *by_view);
    } else if (!sightings.empty()) {
      if (const auto far = far_off(view, set_at, belief, seen)) besides_.push_back(*far);
    }
  }
  compare_besides(belief);
  doubt(belief, sightings);
  doubt(belief, watched);
}

void ViewAgreement::compare_found(const MotionBelief& belief, std::vector<Sighting>& sightings) {
  compared_sets_ = 0;
  compare_sightings(belief, sightings);
  doubt(belief, sightings);
}

void ViewAgreement::compare_sightings(const MotionBelief& belief, std::span<const Sighting> sightings) {
  besides_.clear();
  for (const Sighting& s : sightings) {
    if (s.is_cut) continue;
    if (const auto seen = beside(s, belief)) besides_.push_back(*seen);
  }
  compare_besides(belief);
}

void ViewAgreement::compare_besides(const MotionBelief& belief) {
  // A velocity that is not known any more, as the views contradict one another, is no excuse for them; one that is not
  // known yet is.
  const double excused = ++compared_sets_ > view_agreement.settling_sets ? view_agreement.speed_share : 1.0;
  const double velocity_sigma =
      std::min(largest_sigma(belief.velocity_covariance()), excused * options_.start_speed_m_s);
  doubts_.compare(besides_, velocity_sigma, options_.acceleration_m_s2);
}

// How far each of them may be off in every frame alike.
void ViewAgreement::doubt(const MotionBelief& belief, std::vector<Sighting>& sightings) const {
  for (Sighting& s : sightings) {
    const auto c = static_cast<std::size_t>(s.row.camera);
    s.doubt_px2 = doubts_.variance_px2(c);
    if (!has_pose_covariance_) continue;
    const Eigen::Vector3d then = belief.position_at(s.row.at);
    const auto at = appearance_of(*s.camera, then, radius_m_);
    if (at) s.of_pose = px_covariance_of_pose(*s.camera, then, *at, pose_covariance_[c]);
  }
}

void ViewAgreement::open(std::size_t camera, const calib::Camera& in_view, const Eigen::Vector3d& position,
                         const Appearance& at, Eigen::Matrix2d& covariance) const {
  covariance.diagonal().array() += doubts_.variance_px2(camera);
  if (has_pose_covariance_) covariance += px_covariance_of_pose(in_view, position, at, pose_covariance_[camera]);
}

double ViewAgreement::doubted_sigma(const MotionBelief& belief, std::span<const Sighting> sightings) const {
  if (!has_pose_covariance_ && !doubts_.any()) return 0;
  const double believed_m = largest_sigma(belief.position_covariance());
  if (sightings.size() < 2) return believed_m;
  std::vector<Sighting> opened(sightings.begin(), sightings.end());
  for (Sighting& s : opened) s.covariance += s.doubt();
  const PositionInformation seen = information_of(opened, belief.position());
  return std::min(believed_m, largest_sigma(seen.information.inverse()));
}

void add_witnesses(const MotionBelief& belief, double radius_m, double acceleration_m_s2, double anywhere_m,
                   std::span<const Sighting> seen, std::span<const Sighting> used, ObjectEstimate& estimate) {
  if (seen.size() < 2) return;
  const Eigen::Vector3d velocity = belief.velocity();
  const Eigen::Matrix3d velocity_covariance = belief.velocity_covariance();
  struct OnPath {
    Appearance at;
    Eigen::Matrix2d covariance;  // of all of its errors but what is only doubted
  };
  std::vector<std::optional<OnPath>> on_path;
  const auto path = [&](const Sighting& s) -> Eigen::Vector3d {
    return belief.position() + capture::seconds(s.row.at - belief.at) * velocity;
  };
  for (const Sighting& s : seen) {
    auto& out = on_path.emplace_back();
    const auto at = appearance_of(*s.camera, path(s), radius_m);
    if (!at) continue;
    const Eigen::Vector2d px_per_s = at->jacobian * velocity;
    const double time_sigma_s = belief.row_sigma_s(s.row.camera, s.row.below_middle);
    out = {*at, s.covariance + s.of_pose + time_sigma_s * time_sigma_s * px_per_s * px_per_s.transpose()};
    out->covariance.diagonal().array() += s.lasting_px * s.lasting_px;
  }
  const auto is_in_use = [&](int camera) {
    return std::ranges::any_of(used, [&](const Sighting& s) { return s.row.camera == camera; });
  };
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!on_path[i]) continue;
    // Along a single ray anything within the volume.
    PositionInformation others{.information = Eigen::Matrix3d::Identity() / (anywhere_m * anywhere_m)};
    ViewWitness witness;
    witness.at = seen[i].row.at;
    witness.px = seen[i].px;
    witness.covariance = on_path[i]->covariance;
    for (std::size_t j = 0; j < seen.size(); ++j) {
      if (j == i || !on_path[j] || !is_in_use(seen[j].row.camera)) continue;
      const double apart_s = capture::seconds(seen[j].row.at - seen[i].row.at);
      const double swerve_m = 0.5 * apart_s * apart_s * acceleration_m_s2;
      const Eigen::Matrix3d way =
          apart_s * apart_s * velocity_covariance + swerve_m * swerve_m * Eigen::Matrix3d::Identity();
      const auto& jacobian = on_path[j]->at.jacobian;
      const Eigen::Matrix2d covariance = on_path[j]->covariance + jacobian * way * jacobian.transpose();
      const Eigen::Matrix<double, 3, 2> weighted = jacobian.transpose() * covariance.inverse();
      others.information += weighted * jacobian;
      others.vector += weighted * (seen[j].px - on_path[j]->at.px);
      ++witness.others;
    }
    if (witness.others == 0) continue;
    witness.position_covariance = others.information.inverse();
    witness.position = path(seen[i]) + witness.position_covariance * others.vector;
    witness.velocity = velocity;
    estimate.per_view[static_cast<std::size_t>(seen[i].row.camera)].witness = witness;
  }
}

}  // namespace huetrack::object_tracking
