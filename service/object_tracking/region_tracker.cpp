#include "object_tracking/region_tracker.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "particle_filter/moments.h"
#include "particle_filter/resample.h"

namespace huetrack::object_tracking {
namespace {

// White acceleration has a power density a^2 tau: an acceleration of a that lasts for about tau.
constexpr double acceleration_time_s = 0.1;
constexpr double least_acceleration_m_s2 = 3;  // nothing moves more evenly than this for long
constexpr double floor_likelihood = 1.0 / 25;  // the paper's, eqs. (5), (6): tolerates occlusion and locks nothing out
constexpr double region_gate = 16;             // chi-square, 2 degrees of freedom, 99.97 %
constexpr double least_support = 0.15;         // of a region that counts as the object
constexpr std::size_t max_candidates = 4;
constexpr double longest_confirmation_s = 0.5;  // a candidate that is older confirms nothing

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, covariance.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()));
}

}  // namespace

using Vector6d = Eigen::Matrix<double, 6, 1>;

ObjectEstimate RegionTracker::update(const capture::FrameSet& set) {
  const std::vector<TargetView>& views = views_.look_at(set);
  sightings_.clear();
  if (set.at < last_at_) forget();  // the clock was put back: what was known is of another time
  if (state_ == TrackState::tracking || state_ == TrackState::coasting) {
    const double dt = std::max(0.0, capture::seconds(set.at - last_at_));
    Belief predicted = predict(dt);
    sight(views, predicted, dt);  // colour regions near the prediction, one per view at most
    predicted = learn_acceleration(dt, predicted);
    const Belief proposal = propose(predicted);  // motion and regions together, linearised
    draw_particles(proposal);
    weigh(proposal);  // what the linearisation and the floor change
    estimate(proposal);
    judge(set);
  }
  if (state_ != TrackState::tracking) search(set, views);
  last_at_ = set.at;
  return report(set, views);
}

RegionTracker::RegionTracker(const calib::CameraRig& rig, const TargetOptions& target,
                             const ObjectTrackerOptions& options, particle_filter::Rng rng)
    : target_(target),
      options_(options),
      views_(rig, target),
      rng_(rng),
      acceleration_(options.acceleration_m_s2),
      finders_(rig.cameras.size()),
      regions_(rig.cameras.size()),
      search_log_(rig.cameras.size()) {
  for (const calib::Camera& camera : rig.cameras) size_in_view_.push_back(size_in(camera));
  scatter();
}

// How small and how large the target appears in a view anywhere in the volume: on a grid, of which only what is in the
// image counts (a corner of the volume may be beside or behind the camera).
RegionTracker::SizeInView RegionTracker::size_in(const calib::Camera& camera) const {
  constexpr int steps = 12;
  SizeInView out;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k) {
        const Eigen::Array3d share = Eigen::Array3d(i, j, k) / steps;
        const Eigen::Vector3d p =
            options_.volume.min.array() + share * (options_.volume.max - options_.volume.min).array();
        const auto at = appearance_of(camera, p, target_.radius_m);
        if (!at || !camera.contains({at->px})) continue;
        out.smallest_px = out.largest_px == 0 ? at->radius_px : std::min(out.smallest_px, at->radius_px);
        out.largest_px = std::max(out.largest_px, at->radius_px);
      }
    }
  }
  return out;
}

void RegionTracker::scatter() {
  const auto n = static_cast<std::size_t>(options_.particle_count);
  particles_.resize(n);
  unit_.resize(3 * n);
  rng_.fill_uniform(unit_);
  const Eigen::Vector3f min = options_.volume.min.cast<float>();
  const Eigen::Vector3f extent = (options_.volume.max - options_.volume.min).cast<float>();
  for (std::size_t i = 0; i < n; ++i) {
    particles_.x[i] = min.x() + extent.x() * unit_[i];
    particles_.y[i] = min.y() + extent.y() * unit_[n + i];
    particles_.z[i] = min.z() + extent.z() * unit_[2 * n + i];
  }
  weight_.assign(n, 1.0f / static_cast<float>(n));
  effective_sample_size_ = static_cast<double>(n);
}

double RegionTracker::power_density() const {
  return acceleration_ * acceleration_ * acceleration_time_s;
}

// Constant velocity with white acceleration (Bar-Shalom, Li, Kirubarajan 2001, section 6.2.2).
Belief RegionTracker::predict(double dt) const {
  const Eigen::Matrix3d pp = belief_.covariance.topLeftCorner<3, 3>();
  const Eigen::Matrix3d pv = belief_.covariance.topRightCorner<3, 3>();
  const Eigen::Matrix3d vv = belief_.covariance.bottomRightCorner<3, 3>();
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const double q = power_density();
  Belief out;
  out.mean << belief_.position() + dt * belief_.velocity(), belief_.velocity();
  const Eigen::Matrix3d new_pv = pv + dt * vv + q * dt * dt / 2 * identity;
  out.covariance.topLeftCorner<3, 3>() =
      pp + dt * (pv + pv.transpose()) + dt * dt * vv + q * dt * dt * dt / 3 * identity;
  out.covariance.topRightCorner<3, 3>() = new_pv;
  out.covariance.bottomLeftCorner<3, 3>() = new_pv.transpose();
  out.covariance.bottomRightCorner<3, 3>() = vv + q * dt * identity;
  return out;
}

// In each view the region near the prediction that explains it best, if there is one.
void RegionTracker::sight(const std::vector<TargetView>& views, const Belief& predicted, double dt) {
  // The gate allows for twice the hardest usual acceleration, whatever the filter has learnt: a throw must not lose the
  // object.
  const double reach_m = options_.acceleration_m_s2 * dt * dt;
  const Eigen::Matrix3d spread = predicted.position_covariance() + reach_m * reach_m * Eigen::Matrix3d::Identity();
  for (const TargetView& view : views) {
    const auto at =
        appearance_of(*view.camera, predicted.position() - view.age_s * predicted.velocity(), target_.radius_m);
    if (!at) continue;
    const Eigen::Matrix2d s = at->jacobian * spread * at->jacobian.transpose();
    // Not beyond the image's own size around it: a box is clipped to the image anyway, and an int must hold it.
    const double limit = view.matches->width() + view.matches->height();
    if (!(std::abs(at->px.x()) < 2 * limit && std::abs(at->px.y()) < 2 * limit)) continue;
    const double reach_u = std::min(limit, 3 * std::sqrt(s(0, 0)) + 2 * at->radius_px + 2);
    const double reach_v = std::min(limit, 3 * std::sqrt(s(1, 1)) + 2 * at->radius_px + 2);
    const PixelBox box{
        static_cast<int>(std::floor(at->px.x() - reach_u)), static_cast<int>(std::floor(at->px.y() - reach_v)),
        static_cast<int>(std::ceil(at->px.x() + reach_u)), static_cast<int>(std::ceil(at->px.y() + reach_v))};
    const double disc = std::numbers::pi * at->radius_px * at->radius_px;
    const int min_area = std::max(2, static_cast<int>(least_support * disc));
    double best = -std::numeric_limits<double>::infinity();
    std::optional<Sighting> chosen;
    for (const ColorRegion& region :
         finders_[static_cast<std::size_t>(view.index)].find(*view.matches, box, min_area, 1.3 * at->radius_px)) {
      const Sighting sighting = sighting_of(view, region, at->radius_px, options_.pixel_noise_px);
      const Eigen::Matrix2d total = s + sighting.covariance;
      const Eigen::Vector2d d = sighting.px - at->px;
      const double d2 = d.dot(total.inverse() * d);
      if (d2 > region_gate) continue;
      const double score = std::log(sighting.support) - 0.5 * d2 - 0.5 * std::log(sighting.covariance.determinant());
      if (score > best) best = score, chosen = sighting;
    }
    if (chosen) sightings_.push_back(*chosen);
  }
}

// Covariance matching: raise the acceleration until the innovations of all sightings together are ones that it
// explains, lower it slowly while they are smaller than they need be. Returns the prediction with what was learnt.
Belief RegionTracker::learn_acceleration(double dt, const Belief& predicted) {
  if (sightings_.empty() || dt <= 0) return predicted;
  const auto size = static_cast<Eigen::Index>(2 * sightings_.size());
  Eigen::VectorXd innovation(size);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(size, 6);
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < sightings_.size(); ++i) {
    const Sighting& sighting = sightings_[i];
    const double age = sighting.view->age_s;
    const auto at =
        appearance_of(*sighting.view->camera, predicted.position() - age * predicted.velocity(), target_.radius_m);
    if (!at) return predicted;
    const auto row = static_cast<Eigen::Index>(2 * i);
    innovation.segment<2>(row) = sighting.px - at->px;
    h.block<2, 3>(row, 0) = at->jacobian;
    h.block<2, 3>(row, 3) = -age * at->jacobian;
    noise.block<2, 2>(row, row) = sighting.covariance;
  }
  Belief out = predicted;
  const auto surprise = [&] {  // 1 when all is as it should be
    const Eigen::MatrixXd s = h * out.covariance * h.transpose() + noise;
    return innovation.dot(s.llt().solve(innovation)) / static_cast<double>(size);
  };
  const double ceiling = 4 * options_.acceleration_m_s2;
  double nis = surprise();
  while (nis > 3 && acceleration_ < ceiling) {
    acceleration_ = std::min(ceiling, 1.5 * acceleration_);
    out = predict(dt);
    nis = surprise();
  }
  acceleration_ =
      std::clamp(acceleration_ * std::exp(0.05 * (std::min(nis, 3.0) - 1)), least_acceleration_m_s2, ceiling);
  return out;
}

// Kalman update with each sighting, all linearised at one point. A view that looked age_s earlier saw p - age v.
Belief RegionTracker::linear_update(const Belief& predicted, const Vector6d& linearised_at) {
  Belief out = predicted;
  linear_views_.clear();
  for (const Sighting& sighting : sightings_) {
    const double age = sighting.view->age_s;
    const Eigen::Vector3d then = linearised_at.head<3>() - age * linearised_at.tail<3>();
    const auto at = appearance_of(*sighting.view->camera, then, target_.radius_m);
    if (!at) continue;
    linear_views_.push_back({&sighting, at->jacobian, at->px - at->jacobian * then});
    Eigen::Matrix<double, 2, 6> h;
    h << at->jacobian, -age * at->jacobian;
    // What the object may have swerved since the view looked.
    const Eigen::Matrix2d swerve = power_density() * age * age * age / 3 * at->jacobian * at->jacobian.transpose();
    const Eigen::Matrix<double, 6, 2> ph = out.covariance * h.transpose();
    const Eigen::Matrix2d s = h * ph + sighting.covariance + swerve;
    const Eigen::Matrix<double, 6, 2> gain = ph * s.inverse();
    out.mean += gain * (sighting.px - at->px - h * (out.mean - linearised_at));
    out.covariance -= gain * ph.transpose();
  }
  out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
  return out;
}

// Linearised again where the object turns out to be, when that is not where it was expected (Bell and Cathey 1993).
// What a single view leaves open must be the ray through its pixel, to a fraction of the pixel over all of the open
// depth, or particles along the wrong line make the filter sure of a depth that nobody measured.
Belief RegionTracker::propose(const Belief& predicted) {
  Belief out = linear_update(predicted, predicted.mean);
  for (int iteration = 0; iteration < 3; ++iteration) {
    const Vector6d before = out.mean;
    if ((out.position() - predicted.position()).norm() < 0.1 * target_.radius_m) break;
    out = linear_update(predicted, before);
    if ((out.position() - before.head<3>()).norm() < 0.01 * target_.radius_m) break;
  }
  return out;
}

// Antithetic pairs, shaped to the proposal's covariance exactly: where everything is Gaussian the filter is then
// exactly the Kalman filter, and the only Monte Carlo noise left is in what is not.
void RegionTracker::draw_particles(const Belief& proposal) {
  const auto n = static_cast<std::size_t>(options_.particle_count);
  const std::size_t pairs = (n + 1) / 2;
  unit_.resize(3 * pairs);
  rng_.fill_normal(unit_);
  const float *e0 = unit_.data(), *e1 = e0 + pairs, *e2 = e1 + pairs;
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  for (std::size_t i = 0; i < pairs; ++i) {
    xx += e0[i] * e0[i], xy += e0[i] * e1[i], xz += e0[i] * e2[i];
    yy += e1[i] * e1[i], yz += e1[i] * e2[i], zz += e2[i] * e2[i];
  }
  Eigen::Matrix3f drawn;
  drawn << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  const Eigen::Matrix3d sample = drawn.cast<double>() / static_cast<double>(pairs);
  const Eigen::Matrix3d root = proposal.position_covariance().llt().matrixL();
  // root * sample_root^-1 turns the draws' own covariance into the proposal's; with fewer than four pairs they have
  // none.
  const Eigen::LLT<Eigen::Matrix3d> sample_root(sample);
  Eigen::Matrix3d shape = root;
  if (pairs > 3 && sample_root.info() == Eigen::Success) {
    shape = root * Eigen::Matrix3d(sample_root.matrixL()).inverse();
  }
  const Eigen::Matrix3f a = shape.cast<float>();
  const Eigen::Vector3f m = proposal.position().cast<float>();
  particles_.resize(n);
  const auto draw = [&](std::size_t from, std::size_t count, float sign) {
    for (std::size_t i = 0; i < count; ++i) {
      particles_.x[from + i] = m(0) + sign * (a(0, 0) * e0[i] + a(0, 1) * e1[i] + a(0, 2) * e2[i]);
      particles_.y[from + i] = m(1) + sign * (a(1, 0) * e0[i] + a(1, 1) * e1[i] + a(1, 2) * e2[i]);
      particles_.z[from + i] = m(2) + sign * (a(2, 0) * e0[i] + a(2, 1) * e1[i] + a(2, 2) * e2[i]);
    }
  };
  draw(0, pairs, 1);
  draw(pairs, n - pairs, -1);
}

// Weight of a particle: prior times likelihood over proposal. The proposal is the prior times the linearised Gaussian
// likelihoods, so what is left is, per view,
//   p_m(s_i | img_m) / Gauss_m(s_i),   p_m = max(1/25, support * exp(-d^2 / 2))
// with d the distance from the particle's projection, through the whole lens and at the view's own time, to the centre
// of the colour region, in the region's covariance.
void RegionTracker::weigh(const Belief& proposal) {
  const std::size_t n = particles_.size();
  log_weight_.assign(n, 0.0f);
  u_.resize(n), v_.resize(n);
  const Eigen::Matrix3d p_information = proposal.position_covariance().inverse();
  const Eigen::Matrix3d velocity_of_position = proposal.covariance.bottomLeftCorner<3, 3>() * p_information;
  for (const LinearView& linear : linear_views_) {
    const Sighting& sighting = *linear.sighting;
    const double age = sighting.view->age_s;
    // Given the position, the velocity is that of the regression; so the position at the view's time is linear in it.
    const Eigen::Matrix3d back = Eigen::Matrix3d::Identity() - age * velocity_of_position;
    const Eigen::Vector3d mean_then = proposal.position() - age * proposal.velocity();
    const float *x = particles_.x.data(), *y = particles_.y.data(), *z = particles_.z.data();
    if (age != 0) {
      const Eigen::Matrix3f b = back.cast<float>();
      const Eigen::Vector3f c = (mean_then - back * proposal.position()).cast<float>();
      seen_at_.resize(n);
      for (std::size_t i = 0; i < n; ++i) seen_at_.x[i] = b(0, 0) * x[i] + b(0, 1) * y[i] + b(0, 2) * z[i] + c(0);
      for (std::size_t i = 0; i < n; ++i) seen_at_.y[i] = b(1, 0) * x[i] + b(1, 1) * y[i] + b(1, 2) * z[i] + c(1);
      for (std::size_t i = 0; i < n; ++i) seen_at_.z[i] = b(2, 0) * x[i] + b(2, 1) * y[i] + b(2, 2) * z[i] + c(2);
      x = seen_at_.x.data(), y = seen_at_.y.data(), z = seen_at_.z.data();
    }
    sighting.view->projector->project(x, y, z, n, u_.data(), v_.data());

    const Eigen::Matrix2f information = sighting.covariance.inverse().cast<float>();
    const float i_uu = information(0, 0), i_uv = 2 * information(0, 1), i_vv = information(1, 1);
    const auto d2_of = [=](float du, float dv) { return i_uu * du * du + i_uv * du * dv + i_vv * dv * dv; };
    const auto cu = static_cast<float>(sighting.px.x()), cv = static_cast<float>(sighting.px.y());
    const auto floor = static_cast<float>(std::log(floor_likelihood / sighting.support));
    // The linearisation: du = j p + k.
    const Eigen::Matrix<float, 2, 3> j = linear.jacobian.cast<float>();
    const Eigen::Vector2f k = (linear.offset - sighting.px).cast<float>();
    for (std::size_t i = 0; i < n; ++i) {
      const float linear_du = j(0, 0) * x[i] + j(0, 1) * y[i] + j(0, 2) * z[i] + k(0);
      const float linear_dv = j(1, 0) * x[i] + j(1, 1) * y[i] + j(1, 2) * z[i] + k(1);
      const float likelihood = std::max(std::min(floor, 0.0f), -0.5f * d2_of(u_[i] - cu, v_[i] - cv));
      log_weight_[i] += likelihood + 0.5f * std::min(d2_of(linear_du, linear_dv), 50.0f);
    }
  }
  weight_.resize(n);
  particle_filter::normalize_log_weights(log_weight_, weight_);
  // The floor gives the target heavier tails than the proposal has, so that a few particles far out can outweigh all
  // others; a handful of particles is a worse answer than the linearised one, which equal weights are.
  effective_sample_size_ = particle_filter::effective_sample_size(weight_);
  if (effective_sample_size_ < 0.1 * static_cast<double>(n)) weight_.assign(n, 1.0f / static_cast<float>(n));
}

// The weighted particles' mean and covariance are the position's; the velocity follows by regression on the position.
void RegionTracker::estimate(const Belief& proposal) {
  const particle_filter::WeightedMoments moments =
      particle_filter::weighted_moments(particles_.x.data(), particles_.y.data(), particles_.z.data(), weight_.data(),
                                        particles_.size(), proposal.position().cast<float>());
  const Eigen::Matrix3d covariance = moments.covariance + 1e-10 * Eigen::Matrix3d::Identity();
  const Eigen::Vector3d shift = moments.mean - proposal.position();
  const Eigen::Matrix3d p_information = proposal.position_covariance().inverse();
  const Eigen::Matrix3d regression = proposal.covariance.bottomLeftCorner<3, 3>() * p_information;
  belief_.mean << moments.mean, proposal.velocity() + regression * shift;
  belief_.covariance = proposal.covariance;
  belief_.covariance.topLeftCorner<3, 3>() = covariance;
  belief_.covariance.bottomLeftCorner<3, 3>() = regression * covariance;
  belief_.covariance.topRightCorner<3, 3>() = (regression * covariance).transpose();
  belief_.covariance.bottomRightCorner<3, 3>() +=
      regression * (covariance - proposal.position_covariance()) * regression.transpose();
  map_ = Eigen::Vector3f(particles_.x[moments.best], particles_.y[moments.best], particles_.z[moments.best])
             .cast<double>();
}

void RegionTracker::forget() {
  if (state_ != TrackState::searching) state_ = TrackState::lost;
  candidates_.clear();
  scatter();
}

void RegionTracker::judge(const capture::FrameSet& set) {
  const double sigma_m = largest_sigma(belief_.position_covariance());
  if (!sightings_.empty() && sigma_m <= options_.max_tracking_sigma_m) {
    state_ = TrackState::tracking;
    last_tracking_ = set.at;
  } else if (sigma_m > options_.max_coast_sigma_m || capture::seconds(set.at - last_tracking_) > options_.coast_s) {
    forget();
  } else {
    state_ = TrackState::coasting;
  }
}

// Two candidates in two frame sets that one object can explain are a find. One alone never is: a chance match of
// background pixels does not move like an object.
void RegionTracker::search(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  if (views.size() < 2) return;  // of cameras of different rates: such a set neither confirms nor refutes
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    const SizeInView& size = size_in_view_[static_cast<std::size_t>(view.index)];
    if (size.largest_px == 0) {  // no part of the volume is in view
      regions_[i].clear();
      continue;
    }
    const int step = std::max(1, static_cast<int>(size.smallest_px));
    const int extent = static_cast<int>(std::ceil(3 * size.largest_px)) + 2;
    const int min_area = std::max(2, static_cast<int>(0.3 * size.smallest_px * size.smallest_px));
    regions_[i] = finders_[static_cast<std::size_t>(view.index)].search(*view.matches, step, extent, min_area,
                                                                        2 * size.smallest_px);
  }
  std::vector<PositionCandidate> now =
      cross_rays(views, std::span(regions_).first(views.size()), target_, options_, max_candidates);
  if (now.empty()) {  // nor does one in which too few of these views see it
    search_log_.add(views, std::span(regions_).first(views.size()), options_.volume);
    return;
  }
  const double dt = capture::seconds(set.at - candidates_at_);
  const PositionCandidate* found = nullptr;
  const PositionCandidate* earlier = nullptr;
  double best = -1e30;
  if (dt > 0 && dt < longest_confirmation_s) {
    for (const PositionCandidate& c : now) {
      for (const PositionCandidate& e : candidates_) {
        const double spread = 3 * (largest_sigma(c.covariance) + largest_sigma(e.covariance));
        if ((c.position - e.position).norm() > options_.start_speed_m_s * dt + spread) continue;
        if (c.score + e.score > best) best = c.score + e.score, found = &c, earlier = &e;
      }
    }
  }
  if (found != nullptr) {
    const Eigen::Vector3d velocity = (found->position - earlier->position) / dt;
    const double variance = (found->covariance.trace() + earlier->covariance.trace()) / 3 / (dt * dt) +
                            std::pow(options_.acceleration_m_s2 * dt, 2);
    start_at(*found, velocity, variance);
    state_ =
        largest_sigma(found->covariance) <= options_.max_tracking_sigma_m ? TrackState::tracking : TrackState::coasting;
    last_tracking_ = set.at;
    candidates_.clear();
    search_log_.clear();
    return;
  }
  candidates_ = std::move(now);
  candidates_at_ = set.at;
}

void RegionTracker::start_at(const PositionCandidate& found, const Eigen::Vector3d& velocity,
                             double velocity_variance) {
  belief_.mean << found.position, velocity;
  belief_.covariance.setZero();
  belief_.covariance.topLeftCorner<3, 3>() = found.covariance;
  belief_.covariance.bottomRightCorner<3, 3>() = velocity_variance * Eigen::Matrix3d::Identity();
  acceleration_ = options_.acceleration_m_s2;
  sightings_ = found.sightings;
  draw_particles(belief_);
  weight_.assign(particles_.size(), 1.0f / static_cast<float>(particles_.size()));
  effective_sample_size_ = static_cast<double>(particles_.size());
  map_ = found.position;
}

ObjectEstimate RegionTracker::report(const capture::FrameSet& set, const std::vector<TargetView>& views) const {
  ObjectEstimate e;
  e.at = set.at;
  e.set_number = set.number;
  e.state = state_;
  e.particle_count = static_cast<int>(particles_.size());
  e.effective_sample_size = effective_sample_size_;
  e.per_view.resize(views_.camera_count());
  for (const TargetView& view : views) e.per_view[static_cast<std::size_t>(view.index)].delivered = true;
  if (!e.has_position()) return e;
  e.position = belief_.position();
  e.velocity = belief_.velocity();
  e.covariance = belief_.position_covariance();
  e.map_position = map_;
  for (const TargetView& view : views) {
    ViewSupport& support = e.per_view[static_cast<std::size_t>(view.index)];
    const auto at = appearance_of(*view.camera, e.position - view.age_s * e.velocity, target_.radius_m);
    if (!at || !view.camera->contains({at->px})) continue;
    support.in_view = true;
    support.px = at->px.cast<float>();
    support.radius_px = static_cast<float>(at->radius_px);
    for (const Sighting& s : sightings_) {
      if (s.view->index != view.index) continue;
      support.seen = true;
      support.support = static_cast<float>(s.support);
      support.residual_px = static_cast<float>((s.px - at->px).norm());
    }
    e.views += support.seen ? 1 : 0;
  }
  // How sure we are that this is the object, not where it is (the covariance says that): that not all supports are
  // chance.
  double doubt = 1;
  for (const Sighting& s : sightings_) doubt *= 1 - 0.9 * s.support;
  e.confidence = 1 - doubt;
  return e;
}

}  // namespace huetrack::object_tracking
