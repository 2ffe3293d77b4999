#include "object_tracking/objects/object_existence.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

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

// What a sighting says of the object's place, and how it moves that.
struct SeenAs {
  double log_odds;  // of the object over clutter
  Eigen::Vector3d step;
  Eigen::Matrix3d covariance;
  Eigen::Vector2d d;       // innovation
  Eigen::Matrix2d spread;  // its covariance
};

std::optional<SeenAs> seen_as(const ExpectedPlace& expected, const Sighting& s, double radius_m,
                              const MotionState& times, const ClutterMap& clutter, const StaticClutterMask& still,
                              bool is_followed) {
  const double dt = capture::seconds(s.row.at - expected.at);
  const double late_s = times.row_sigma_s(s.row.camera, s.row.below_middle);
  const auto in_view = project_ball(*s.camera, expected.position + dt * expected.velocity, radius_m);
  if (!in_view) return std::nullopt;
  Eigen::Matrix2d of_sighting = s.covariance + s.inflation();
  of_sighting.diagonal().array() += s.bias_sigma_px * s.bias_sigma_px;
  const Eigen::Matrix<double, 2, 3>& by = in_view->jacobian;
  of_sighting += by *
                 ((dt * dt + late_s * late_s) * expected.velocity_covariance +
                  late_s * late_s * expected.velocity * expected.velocity.transpose()) *
                 by.transpose();
  const Eigen::Matrix2d spread = by * expected.covariance * by.transpose() + of_sighting;
  const Eigen::Vector2d d = s.px - in_view->px;
  const Eigen::Matrix<double, 3, 2> gain = expected.covariance * by.transpose() * spread.inverse();
  const auto camera = std::size_t(s.row.camera);
  double of_clutter = clutter.density(camera, s.px, near_radii(still) * in_view->radius_px);
  if (is_followed) of_clutter += still.uncovered_density(camera, s.px, in_view->radius_px);
  const double log_odds = std::log(detection.probability / of_clutter) + clutter.log_ratio(camera, s.evidence) +
                          log_density(d, spread, in_view->radius_px);
  return SeenAs{log_odds, gain * d, expected.covariance - gain * by * expected.covariance, d, spread};
}

struct Evidence {
  double log_odds = 0;
  std::vector<int> chance = {};  // cameras
  std::vector<std::pair<int, Eigen::Matrix2d>> doubts = {};
};

// Sequential: each sighting updates the prediction of the next, the likeliest first. times: the cameras' timing.
// is_followed: for a track, not a find. Sightings that are more likely clutter are not used, and the clutter density
// includes StaticClutterMask::uncovered_density().
Evidence evidence_of(ExpectedPlace expected, std::span<const Sighting> sightings, const std::vector<TargetView>& views,
                     double radius_m, const MotionState& times, const ClutterMap& clutter,
                     const StaticClutterMask& still, bool is_followed) {
  Evidence evidence;
  std::vector<const Sighting*> open;
  for (const Sighting& s : sightings) open.push_back(&s);
  double of_seen = 0;
  while (!open.empty()) {
    std::optional<SeenAs> likeliest;
    std::size_t which = 0;
    for (std::size_t i = 0; i < open.size(); ++i) {
      const auto seen = seen_as(expected, *open[i], radius_m, times, clutter, still, is_followed);
      if (seen && (!likeliest || seen->log_odds > likeliest->log_odds)) likeliest = seen, which = i;
    }
    if (!likeliest) break;
    if (is_followed && likeliest->log_odds < 0 && may_be_clutter(*open[which], clutter, still)) {
      evidence.chance.push_back(open[which]->row.camera);
    } else {
      of_seen += likeliest->log_odds;
      if (still.is_room_shared()) {
        const double probability = 1 / (1 + (1 - detection.probability) * std::exp(-likeliest->log_odds));
        evidence.doubts.emplace_back(open[which]->row.camera,
                                     association_px2(likeliest->spread, likeliest->d, probability));
      }
      expected.position += likeliest->step;
      expected.covariance = likeliest->covariance;
    }
    open.erase(open.begin() + std::ptrdiff_t(which));
  }
  evidence.log_odds = of_seen;
  if (is_followed && of_seen < 0)
    for (const Sighting& s : sightings) evidence.chance.push_back(s.row.camera);
  for (const TargetView& view : views) {
    const bool is_seen = std::ranges::any_of(sightings, [&](const Sighting& s) { return s.row.camera == view.index; });
    if (is_seen && (of_seen < 0 || !std::ranges::count(evidence.chance, view.index))) continue;
    const auto in_view = project_ball(*view.camera, expected.position, radius_m);
    if (!in_view || !view.camera->contains({in_view->px})) continue;
    if (still.may_clip(std::size_t(view.index), in_view->px, in_view->radius_px)) continue;
    evidence.log_odds += std::log(1 - detection.probability);
  }
  return evidence;
}

// At the first sighting's row.
ExpectedPlace place_of(const MotionState& state, double power_density, std::span<const Sighting> sightings) {
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
  return at;
}

}  // namespace

Eigen::Matrix2d association_px2(const Eigen::Matrix2d& spread, const Eigen::Vector2d& d, double probability) {
  const double kept = probability * (1 - (1 - probability) * d.dot(spread.inverse() * d));
  return (1 / std::max(double(std::numeric_limits<float>::epsilon()), kept) - 1) * spread;
}

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
  of_set_ = evidence_of(near, birth.now.sightings, views, radius_m, times, clutter, still, false).log_odds;
  chance_.clear(), doubts_.clear();
  evidence_ =
      std::min(max_log_odds(),
               birth.of_shape + of_set_ +
                   evidence_of(anywhere, birth.earlier.sightings, {}, radius_m, times, clutter, still, false).log_odds);
  at_first_ = std::min(0.0, evidence_);
  has_moved_ = at_first_ >= 0, is_overdue_ = false;
  found_when_ = set_at;
  first_.clear();
  for (const Sighting& s : birth.now.sightings) first_.push_back({s.row.camera, s.px});
  has_been_sure_ = has_been_sure_ || is_sure();
}

void ObjectExistence::update(capture::Timestamp set_at, const MotionState& state, double power_density,
                             std::span<const Sighting> sightings, const std::vector<TargetView>& views, double radius_m,
                             const ClutterMap& clutter, const StaticClutterMask& still) {
  const ExpectedPlace at = place_of(state, power_density, sightings);
  int moved = 0;  // views
  for (const Sighting& s : sightings) {
    const auto first = std::ranges::find(first_, s.row.camera, &FirstSeen::camera);
    const auto in_view = project_ball(*s.camera, at.position, radius_m);
    if (first == first_.end())
      first_.push_back({s.row.camera, s.px});
    else if (in_view && (s.px - first->px).norm() > in_view->radius_px)
      ++moved;
  }
  has_moved_ = has_moved_ || moved >= std::min(2, int(first_.size()));
  is_overdue_ = !has_moved_ && capture::seconds(set_at - found_when_) > sighting_tuning.confirmation_s;
  Evidence evidence = evidence_of(at, sightings, views, radius_m, state, clutter, still, true);
  of_set_ = evidence.log_odds, chance_ = std::move(evidence.chance), doubts_ = std::move(evidence.doubts);
  evidence_ = std::min(max_log_odds(), evidence_ + of_set_);
  has_been_sure_ = has_been_sure_ || is_sure();
  if (has_been_sure_) evidence_ = std::max(0.0, evidence_);
}

bool may_be_clutter(const Sighting& s, const ClutterMap& clutter, const StaticClutterMask& still) {
  const auto camera = std::size_t(s.row.camera);
  if (!still.is_room_shared()) return false;
  return std::log(detection.probability / clutter.expected(camera)) + clutter.log_ratio(camera, s.evidence) < 0;
}

void ObjectExistence::leave_out_chance(const MotionState& state, double power_density,
                                       const std::vector<TargetView>& views, double radius_m, const ClutterMap& clutter,
                                       const StaticClutterMask& still, std::vector<Sighting>& sightings) const {
  if (!still.is_room_shared()) return;
  const ExpectedPlace at = place_of(state, power_density, sightings);
  const std::vector<int> chance = evidence_of(at, sightings, views, radius_m, state, clutter, still, true).chance;
  std::erase_if(sightings, [&](Sighting& s) {
    const bool may_be = may_be_clutter(s, clutter, still);
    if (may_be && !is_sure()) s.is_cut = true;
    return may_be && std::ranges::count(chance, s.row.camera) > 0;
  });
}

bool ObjectExistence::is_sure() const {
  return evidence_ >= existence.confirmed && has_moved_ && of_set_ >= 0;
}

Eigen::Matrix2d ObjectExistence::chance_px2(int camera) const {
  const auto of = std::ranges::find(doubts_, camera, &std::pair<int, Eigen::Matrix2d>::first);
  return of == doubts_.end() ? Eigen::Matrix2d::Zero() : of->second;
}

bool ObjectExistence::is_evident() const {
  return of_set_ >= existence.confirmed;
}

bool ObjectExistence::is_refuted() const {
  return !has_been_sure_ && (evidence_ < at_first_ || is_overdue_);
}

}  // namespace huetrack::objects
