#include "camera_tracking/leds/led_search.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

namespace huetrack::leds {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int least_leds = 4;
constexpr std::size_t least_sightings = 8;                // 16 equations for 12 unknowns
constexpr std::size_t polished = 48;                      // best positions that are refined
constexpr double coarse_sigma_px = 4;                     // of sightings extrapolated to one time
constexpr std::array noise_scales{1.0, 4.0, 16.0, 64.0};  // of the sightings' sigma_px, as in LedModels
constexpr double unique_by_chi2 = 25;                     // least margin of the second best pose
// Unidentified dots: tolerance of the angle between two LEDs, and gates of the matches in each iteration.
constexpr double angle_tolerance_rad = 0.03, match_px = 12;
constexpr std::array match_reaches_px{8 * match_px, 3 * match_px, match_px, 0.4 * match_px};
constexpr double unexplained_chi2 = 100;  // cost of a dot that matches no LED

// Extrapolates each LED's pixels linearly to one time; LEDs that were seen once by the mean flow of the others.
std::vector<LedSighting> at_one_time(std::span<const LedSighting> sightings, double dt_s) {
  struct Line {
    double n = 0, t = 0, tt = 0;
    Vector2d p{0, 0}, tp{0, 0};
    Vector2d last{0, 0};
    double last_t = 0;
  };
  std::map<int, Line> lines;
  for (const LedSighting& s : sightings) {
    Line& l = lines[s.led];
    const double t = s.dt_s - dt_s;
    l.n += 1, l.t += t, l.tt += t * t, l.p += s.px, l.tp += t * s.px;
    if (l.n == 1 || std::abs(t) < std::abs(l.last_t)) l.last = s.px, l.last_t = t;
  }
  Vector2d flow(0, 0);
  int flows = 0;
  std::map<int, Vector2d> speed;
  for (const auto& [led, l] : lines) {
    const double spread = l.tt - l.t * l.t / l.n;
    if (l.n < 2 || !(spread > 1e-6)) continue;
    speed[led] = (l.tp - l.t * l.p / l.n) / spread;
    flow += speed[led], ++flows;
  }
  if (flows > 0) flow /= flows;
  std::vector<LedSighting> now;
  for (const auto& [led, l] : lines) {
    const auto own = speed.find(led);
    const Vector2d px =
        own != speed.end() ? Vector2d(l.p / l.n - own->second * (l.t / l.n)) : Vector2d(l.last - flow * l.last_t);
    now.push_back({.led = led, .px = px, .dt_s = 0, .sigma_px = coarse_sigma_px});
  }
  return now;
}

// Wahba's problem: the rotation from rays to directions (Markley 1988).
Eigen::Quaterniond rotation_between(std::span<const Vector3d> rays, std::span<const Vector3d> directions) {
  Eigen::Matrix3d b = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < rays.size(); ++i) b += directions[i] * rays[i].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(b, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double mirror = svd.matrixU().determinant() * svd.matrixV().determinant();
  const Eigen::Matrix3d r =
      svd.matrixU() * Vector3d(1, 1, mirror < 0 ? -1 : 1).asDiagonal() * svd.matrixV().transpose();
  return Eigen::Quaterniond(r).normalized();
}

bool is_same_pose(const calib::Rigid3d& a, const calib::Rigid3d& b) {
  return (a.translation - b.translation).norm() < 0.05 && a.rotation.angularDistance(b.rotation) < 0.05;
}

LedGaussian open_prior(const calib::Rigid3d& at, const LedStartVelocity& velocity, const LedMotionNoise& motion) {
  LedGaussian prior;
  prior.mean.world_from_camera = at;
  LedTangent sigma;
  sigma << Vector3d::Constant(10), Vector3d::Constant(10), Vector3d::Constant(velocity.velocity),
      Vector3d::Constant(velocity.angular_rate), Vector3d::Constant(motion.acceleration),
      Vector3d::Constant(motion.angular_acceleration);
  prior.covariance = sigma.cwiseAbs2().asDiagonal();
  return prior;
}

}  // namespace

LedSearch::LedSearch(const calib::Camera& camera, LedSearchOptions options, particle_filter::Rng rng)
    : camera_(camera),
      options_(std::move(options)),
      rng_(rng),
      positions_(static_cast<std::size_t>(options_.particle_count)),
      noise_(3 * positions_.size()) {}

void LedSearch::scatter() {
  rng_.fill_uniform(noise_);
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    const Eigen::Vector3f u(&noise_[3 * i]);
    positions_[i] = options_.room_min + (options_.room_max - options_.room_min).cwiseProduct(u.cast<double>());
  }
}

std::optional<LedGaussian> LedSearch::find(std::span<const LedSighting> sightings) {
  candidates_.clear();
  is_ambiguous_ = false;
  if (sightings.size() < least_sightings) return std::nullopt;
  const double reference = 0.5 * (sightings.front().dt_s + sightings.back().dt_s);
  const std::vector<LedSighting> coarse = at_one_time(sightings, reference);
  if (coarse.size() < least_leds) return std::nullopt;

  std::vector<Vector3d> rays, led;
  for (const LedSighting& s : coarse) {
    const auto ray = camera_.model.ray(calib::RawPixel{s.px});
    if (!ray) continue;
    rays.push_back(*ray);
    led.push_back(options_.leds[static_cast<std::size_t>(s.led)]);
  }
  const std::size_t n = rays.size();
  if (n < least_leds) return std::nullopt;
  std::vector<double> cosine(n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) cosine[i * n + j] = rays[i].dot(rays[j]);

  scatter();
  std::vector<std::pair<double, std::size_t>> score(positions_.size());  // lower is better
  std::vector<Vector3d> towards(n);
  for (std::size_t p = 0; p < positions_.size(); ++p) {
    for (std::size_t i = 0; i < n; ++i) towards[i] = (led[i] - positions_[p]).normalized();
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = i + 1; j < n; ++j) {
        const double off = towards[i].dot(towards[j]) - cosine[i * n + j];
        sum += off * off;
      }
    score[p] = {sum, p};
  }
  const std::size_t best = std::min(polished, score.size());
  std::ranges::partial_sort(score, score.begin() + static_cast<std::ptrdiff_t>(best));
  for (std::size_t k = 0; k < best; ++k) {
    const Vector3d& at = positions_[score[k].second];
    for (std::size_t i = 0; i < n; ++i) towards[i] = (led[i] - at).normalized();
    candidates_.push_back({rotation_between(rays, towards), at});
  }
  return polish(candidates_, coarse, sightings, reference);
}

// Fits every start at the reference time as if the camera stood still, then the best ones with velocities to all
// sightings at their own times. Only one pose may fit.
std::optional<LedGaussian> LedSearch::polish(std::span<const calib::Rigid3d> starts,
                                             std::span<const LedSighting> coarse, std::span<const LedSighting> fine,
                                             double reference_dt_s) {
  const calib::CameraModel& model = camera_.model;
  constexpr LedStartVelocity still{.velocity = 1e-3, .angular_rate = 1e-3};
  const auto in_front = [&](const calib::Rigid3d& pose) {
    return (pose.translation.array() >= options_.room_min.array()).all() &&
           (pose.translation.array() <= options_.room_max.array()).all();
  };
  std::vector<std::pair<double, LedMotionState>> coarse_fits;
  for (const calib::Rigid3d& start : starts) {
    const LedGaussian prior = open_prior(start, still, options_.motion);
    const auto fit = fit_leds(model, options_.leds, prior, prior.mean, coarse, 15);
    if (!fit || fit->used < static_cast<int>(coarse.size())) continue;
    const calib::Rigid3d& pose = fit->posterior.mean.world_from_camera;
    if (!in_front(pose)) continue;
    if (std::ranges::any_of(coarse_fits, [&](const auto& f) { return is_same_pose(f.second.world_from_camera, pose); }))
      continue;
    coarse_fits.emplace_back(fit->chi2, fit->posterior.mean);
  }
  std::ranges::stable_sort(coarse_fits, {}, [](const auto& f) { return f.first; });
  if (coarse_fits.size() > 8) coarse_fits.resize(8);

  // The pixel noise is unknown: the least one at which a pose fits.
  for (const double noise : noise_scales) {
    // Accelerations are not constant over the window: the sigma grows with the distance from the reference time.
    std::vector<LedSighting> timed(fine.begin(), fine.end());
    for (LedSighting& s : timed) {
      s.dt_s -= reference_dt_s;
      const double drift_px = model.fx() * options_.motion.angular_acceleration / options_.motion.correlation_s / 6 *
                              std::pow(std::abs(s.dt_s), 3);
      s.sigma_px = std::hypot(noise * s.sigma_px, drift_px);
    }
    std::vector<LedFit> fits;
    for (const auto& [_, start] : coarse_fits) {
      const LedGaussian prior = open_prior(start.world_from_camera, options_.start_velocity, options_.motion);
      const auto fit = fit_leds(model, options_.leds, prior, start, timed, 40);
      if (!fit || fit->used < static_cast<int>(timed.size())) continue;
      const calib::Rigid3d& pose = fit->posterior.mean.world_from_camera;
      if (!in_front(pose)) continue;
      if (std::ranges::any_of(fits,
                              [&](const LedFit& f) { return is_same_pose(f.posterior.mean.world_from_camera, pose); }))
        continue;
      fits.push_back(*fit);
    }
    if (fits.empty()) return std::nullopt;
    std::ranges::stable_sort(fits, {}, &LedFit::chi2);
    candidates_.clear();
    for (const LedFit& f : fits) candidates_.push_back(f.posterior.mean.world_from_camera);
    const LedFit& first = fits.front();
    const double freedom = 2.0 * first.used - 12;
    if (!(first.chi2 < freedom + 5 * std::sqrt(2 * freedom))) continue;
    noise_scale_ = noise;
    is_ambiguous_ = fits.size() > 1 && fits[1].chi2 < first.chi2 + unique_by_chi2;
    if (is_ambiguous_) return std::nullopt;
    return predicted(first.posterior, -reference_dt_s, options_.motion);
  }
  return std::nullopt;
}

// The nearest LED of each dot, none twice; returns the sum of squares over those within reach.
double LedSearch::match(const calib::Rigid3d& pose, std::span<const Dot> dots, double reach_px,
                        std::vector<LedSighting>& out) const {
  const calib::Rigid3d camera_from_world = calib::inverse(pose);
  out.clear();
  std::set<int> used;
  double sum = 0;
  std::vector<std::optional<calib::RawPixel>> px;
  for (const Vector3d& led : options_.leds) px.push_back(camera_.model.project(camera_from_world * led));
  for (const Dot& dot : dots) {
    int nearest = -1;
    double least = reach_px * reach_px;
    for (std::size_t l = 0; l < px.size(); ++l) {
      if (!px[l]) continue;
      if (const double d2 = (px[l]->px - dot.sighting.px).squaredNorm(); d2 < least)
        least = d2, nearest = static_cast<int>(l);
    }
    sum += least;
    if (nearest < 0 || !used.insert(nearest).second) continue;
    out.push_back(dot.sighting);
    out.back().led = nearest;
  }
  return sum;
}

// The poses that explain the dots best: from every position, with the rotations by pairs of LEDs that subtend the angle
// of two dots.
std::vector<calib::Rigid3d> LedSearch::turned_by_pairs(std::span<const Dot> dots) {
  // The two dots that are farthest apart determine the rotation best.
  std::size_t a = 0, b = 1;
  for (std::size_t i = 0; i < dots.size(); ++i)
    for (std::size_t j = i + 1; j < dots.size(); ++j)
      if (dots[i].ray.dot(dots[j].ray) < dots[a].ray.dot(dots[b].ray)) a = i, b = j;
  const double angle = std::acos(std::clamp(dots[a].ray.dot(dots[b].ray), -1.0, 1.0));
  const std::array rays{dots[a].ray, dots[b].ray};

  scatter();
  std::vector<std::pair<double, calib::Rigid3d>> scored;
  std::vector<LedSighting> matched;
  for (const Vector3d& at : positions_) {
    for (std::size_t i = 0; i < options_.leds.size(); ++i) {
      const Vector3d to_i = (options_.leds[i] - at).normalized();
      for (std::size_t j = 0; j < options_.leds.size(); ++j) {
        if (i == j) continue;
        const Vector3d to_j = (options_.leds[j] - at).normalized();
        if (std::abs(std::acos(std::clamp(to_i.dot(to_j), -1.0, 1.0)) - angle) > angle_tolerance_rad) continue;
        const calib::Rigid3d pose{rotation_between(rays, std::array{to_i, to_j}), at};
        const double sum = match(pose, dots, match_reaches_px.front(), matched);
        if (matched.size() >= least_leds) scored.emplace_back(sum, pose);
      }
    }
  }
  const std::size_t best = std::min<std::size_t>(4 * polished, scored.size());
  std::ranges::partial_sort(scored, scored.begin() + static_cast<std::ptrdiff_t>(best), {},
                            [](const auto& s) { return s.first; });
  std::vector<calib::Rigid3d> poses;
  for (std::size_t i = 0; i < best; ++i) poses.push_back(scored[i].second);
  return poses;
}

// Alternates fits and matches. nullopt: more than one dot is unexplained.
std::optional<LedSearch::Explanation> LedSearch::explain(const calib::Rigid3d& start, std::span<const Dot> dots) const {
  const LedGaussian prior =
      open_prior(start, LedStartVelocity{.velocity = 1e-3, .angular_rate = 1e-3}, options_.motion);
  LedMotionState at = prior.mean;
  std::optional<LedFit> fit;
  std::vector<LedSighting> matched;
  for (const double reach_px : match_reaches_px) {
    match(at.world_from_camera, dots, reach_px, matched);
    if (matched.size() < least_leds) break;
    fit = fit_leds(camera_.model, options_.leds, prior, at, matched, 10);
    if (!fit) break;
    at = fit->posterior.mean;
  }
  if (!fit || matched.size() + 1 < dots.size() || matched.size() < least_leds + 1) return std::nullopt;
  return Explanation{*fit, fit->chi2 + unexplained_chi2 * static_cast<double>(dots.size() - matched.size())};
}

std::optional<LedGaussian> LedSearch::find_unidentified(std::span<const LedSighting> sightings) {
  candidates_.clear();
  is_ambiguous_ = false;
  if (sightings.size() < least_leds + 1) return std::nullopt;
  std::vector<Dot> dots;
  for (const LedSighting& s : sightings)
    if (const auto ray = camera_.model.ray(calib::RawPixel{s.px})) dots.push_back({s, *ray});
  if (dots.size() < least_leds + 1) return std::nullopt;

  std::vector<Explanation> found;
  for (const calib::Rigid3d& start : turned_by_pairs(dots)) {
    const auto explanation = explain(start, dots);
    if (explanation && std::ranges::none_of(found, [&](const Explanation& other) {
          return is_same_pose(other.fit.posterior.mean.world_from_camera,
                              explanation->fit.posterior.mean.world_from_camera);
        }))
      found.push_back(*explanation);
  }
  if (found.empty()) return std::nullopt;
  std::ranges::stable_sort(found, {}, &Explanation::cost);
  for (const Explanation& f : found) candidates_.push_back(f.fit.posterior.mean.world_from_camera);
  const LedFit& first = found.front().fit;
  const double freedom = 2.0 * first.used - 6;
  const auto fitting = std::ranges::find_if(
      noise_scales, [&](double noise) { return first.chi2 / (noise * noise) < freedom + 5 * std::sqrt(2 * freedom); });
  if (fitting == noise_scales.end()) return std::nullopt;
  noise_scale_ = *fitting;
  is_ambiguous_ = found.size() > 1 && found[1].cost - found[0].cost < unique_by_chi2 * *fitting * *fitting;
  if (is_ambiguous_) return std::nullopt;
  LedGaussian now = first.posterior;  // its velocities are undetermined by one frame
  const LedGaussian open = open_prior({}, options_.start_velocity, options_.motion);
  now.covariance *= *fitting * *fitting;
  now.covariance.rightCols<12>().setZero();
  now.covariance.bottomRows<12>().setZero();
  now.covariance.bottomRightCorner<12, 12>() = open.covariance.bottomRightCorner<12, 12>();
  return now;
}

}  // namespace huetrack::leds
