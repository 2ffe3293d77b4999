#include "object_tracking/objects/object_existence.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct ExistenceTuning {
  double confirmed = 11.5;  // log-odds: one false track an hour, in 1e5 frame sets
};
constexpr ExistenceTuning existence{};

double max_log_odds() {
  return 2 * existence.confirmed;
}

double density(const Eigen::Vector2d& d, const Eigen::Matrix2d& covariance) {
  return std::exp(-0.5 * d.dot(covariance.inverse() * d)) /
         (2 * std::numbers::pi * std::sqrt(covariance.determinant()));
}

// As often as something hides it in a view, something hides a part of it, and the sighting is off by about its radius.
double log_density(const Eigen::Vector2d& d, const Eigen::Matrix2d& covariance, double radius_px) {
  const Eigen::Matrix2d of_error = covariance + radius_px * radius_px * Eigen::Matrix2d::Identity();
  return std::log(detection.probability * density(d, covariance) + (1 - detection.probability) * density(d, of_error) +
                  std::numeric_limits<double>::min());
}

struct Evidence {
  double of_seen = 0, of_missing = 0;  // logarithms of odds
  double all() const { return of_seen + of_missing; }
};

// Sequential: each sighting updates the prediction of the next. times: the cameras' timing.
Evidence evidence_of(ExpectedPlace expected, std::span<const Sighting> sightings, const std::vector<TargetView>& views,
                     double radius_m, const MotionState& times, const ClutterMap& clutter,
                     const StaticClutterMask& still) {
  Evidence evidence;
  for (const Sighting& s : sightings) {
    const double dt = capture::seconds(s.row.at - expected.at);
    const double late_s = times.row_sigma_s(s.row.camera, s.row.below_middle);
    const auto in_view = project_ball(*s.camera, expected.position + dt * expected.velocity, radius_m);
    if (!in_view) continue;
    Eigen::Matrix2d of_sighting = s.covariance + s.inflation();
    of_sighting.diagonal().array() += s.bias_sigma_px * s.bias_sigma_px;
    const Eigen::Matrix<double, 2, 3>& by = in_view->jacobian;
    of_sighting += by *
                   ((dt * dt + late_s * late_s) * expected.velocity_covariance +
                    late_s * late_s * expected.velocity * expected.velocity.transpose()) *
                   by.transpose();
    const Eigen::Matrix2d spread = by * expected.covariance * by.transpose() + of_sighting;
    const Eigen::Vector2d d = s.px - in_view->px;
    evidence.of_seen += std::log(detection.probability / clutter.density(std::size_t(s.row.camera), s.px)) +
                        log_density(d, spread, in_view->radius_px);
    const Eigen::Matrix<double, 3, 2> gain = expected.covariance * by.transpose() * spread.inverse();
    expected.position += gain * d;
    expected.covariance = ((Eigen::Matrix3d::Identity() - gain * by) * expected.covariance).eval();
  }
  for (const TargetView& view : views) {
    const bool is_seen = std::ranges::any_of(sightings, [&](const Sighting& s) { return s.row.camera == view.index; });
    if (is_seen) continue;
    const auto in_view = project_ball(*view.camera, expected.position, radius_m);
    if (!in_view || !view.camera->contains({in_view->px})) continue;
    if (still.may_clip(std::size_t(view.index), in_view->px, in_view->radius_px)) continue;
    evidence.of_missing += std::log(1 - detection.probability);
  }
  return evidence;
}

}  // namespace

void ObjectExistence::begin(capture::Timestamp set_at, const Birth& birth, const std::vector<TargetView>& views,
                            double radius_m, const ObjectTrackerOptions& options, const MotionState& times,
                            const ClutterMap& clutter, const StaticClutterMask& still) {
  const double largest_m = (options.volume.max - options.volume.min).maxCoeff();
  const double speed_m_s = options.start_speed_m_s, travel_m = speed_m_s * birth.dt;
  const Eigen::Matrix3d of_velocity = speed_m_s * speed_m_s * Eigen::Matrix3d::Identity();
  const ExpectedPlace anywhere{.position = birth.earlier.position,
                               .covariance = largest_m * largest_m / 12 * Eigen::Matrix3d::Identity(),
                               .at = birth.earlier.sightings.front().row.at,
                               .velocity_covariance = of_velocity};
  const ExpectedPlace near{.position = birth.earlier.position,
                           .covariance = birth.earlier.covariance + travel_m * travel_m * Eigen::Matrix3d::Identity(),
                           .at = birth.now.sightings.front().row.at,
                           .velocity_covariance = of_velocity};
  of_set_ = evidence_of(near, birth.now.sightings, views, radius_m, times, clutter, still).all();
  is_chance_ = false;
  evidence_ = std::min(max_log_odds(),
                       birth.of_shape + of_set_ +
                           evidence_of(anywhere, birth.earlier.sightings, {}, radius_m, times, clutter, still).all());
  at_first_ = std::min(0.0, evidence_);
  has_moved_ = at_first_ >= 0, is_overdue_ = false;
  found_at_ = birth.now.position, found_when_ = set_at;
  has_been_sure_ = has_been_sure_ || is_sure();
}

void ObjectExistence::update(capture::Timestamp set_at, const MotionState& state, double power_density,
                             std::span<const Sighting> sightings, const std::vector<TargetView>& views, double radius_m,
                             const ClutterMap& clutter, const StaticClutterMask& still) {
  ExpectedPlace at{.position = state.position(),
                   .covariance = state.position_covariance(),
                   .at = state.at,
                   .velocity = state.velocity(),
                   .velocity_covariance = state.velocity_covariance()};
  if (!sightings.empty()) {
    at.at = sightings.front().row.at;
    at.position = state.position_at(at.at);
    at.covariance = state.seen_covariance(sightings.front().row, power_density);
  }
  has_moved_ = has_moved_ || (at.position - found_at_).norm() > 2 * radius_m;
  is_overdue_ = !has_moved_ && capture::seconds(set_at - found_when_) > sighting_tuning.confirmation_s;
  const Evidence evidence = evidence_of(at, sightings, views, radius_m, state, clutter, still);
  of_set_ = evidence.all(), is_chance_ = evidence.of_seen < 0;
  evidence_ = std::min(max_log_odds(), evidence_ + of_set_);
  has_been_sure_ = has_been_sure_ || is_sure();
  if (has_been_sure_) evidence_ = std::max(0.0, evidence_);
}

bool ObjectExistence::is_sure() const {
  return evidence_ >= existence.confirmed && has_moved_ && of_set_ >= 0;
}

bool ObjectExistence::is_refuted() const {
  return !has_been_sure_ && (evidence_ < at_first_ || is_overdue_);
}

}  // namespace huetrack::objects
