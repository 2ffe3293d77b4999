#include "object_tracking/region_tracker.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "particle_filter/resample.h"

namespace huetrack {
namespace {

// White acceleration has a power density a^2 tau: an acceleration of a that lasts for about tau.
constexpr double acceleration_time_s = 0.1;
constexpr double least_acceleration_m_s2 = 1;   // nothing moves more evenly than this for long
constexpr double floor_likelihood = 1.0 / 25;   // the paper's, eqs. (5), (6): tolerates occlusion and locks nothing out
constexpr double region_gate = 16;              // chi-square, 2 degrees of freedom, 99.97 %
constexpr double least_support = 0.15;          // of a region that counts as the object
constexpr std::size_t max_candidates = 4;

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, covariance.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()));
}

}  // namespace

ObjectEstimate RegionTracker::update(const FrameSet& set) {
  const std::vector<TargetView>& views = views_.look_at(set);
  sightings_.clear();
  if (state_ == TrackState::tracking || state_ == TrackState::coasting) {
    const double dt = std::max(0.0, seconds(set.at - last_at_));
    choose_acceleration(views, dt);        // finds the sightings on its way
    propose_and_weigh(prior());
    summarize();
    resample_if_poor();
    judge(set);
  }
  if (state_ != TrackState::tracking) search(set, views);
  last_at_ = set.at;
  return report(set, views);
}

RegionTracker::RegionTracker(const CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options, Rng rng)
    : target_(target),
      options_(options),
      views_(rig, target),
      rng_(rng),
      acceleration_(options.acceleration_m_s2),
      finders_(rig.cameras.size()),
      regions_(rig.cameras.size()) {
  scatter();
}

void RegionTracker::scatter() {
  const auto n = static_cast<std::size_t>(options_.particle_count);
  p_.resize(n), v_.resize(n);
  noise_.resize(3 * n);
  rng_.fill_uniform(noise_);
  const Eigen::Vector3f min = options_.volume.min.cast<float>();
  const Eigen::Vector3f extent = (options_.volume.max - options_.volume.min).cast<float>();
  for (std::size_t i = 0; i < n; ++i) {
    p_.x[i] = min.x() + extent.x() * noise_[i];
    p_.y[i] = min.y() + extent.y() * noise_[n + i];
    p_.z[i] = min.z() + extent.z() * noise_[2 * n + i];
    v_.x[i] = v_.y[i] = v_.z[i] = 0;
  }
  weight_.assign(n, 1.0f / static_cast<float>(n));
}

// Constant velocity: predicted = p + v dt.
void RegionTracker::predict(double dt_s) {
  const auto dt = static_cast<float>(dt_s);
  const std::size_t n = p_.size();
  predicted_.resize(n);
  for (std::size_t i = 0; i < n; ++i) predicted_.x[i] = p_.x[i] + dt * v_.x[i];
  for (std::size_t i = 0; i < n; ++i) predicted_.y[i] = p_.y[i] + dt * v_.y[i];
  for (std::size_t i = 0; i < n; ++i) predicted_.z[i] = p_.z[i] + dt * v_.z[i];
}

void RegionTracker::set_motion_noise(double dt) {
  const double q = acceleration_ * acceleration_ * acceleration_time_s;
  var_p_ = velocity_variance_ * dt * dt + q * dt * dt * dt / 3 + 1e-10;
  cov_pv_ = velocity_variance_ * dt + q * dt * dt / 2;
  var_v_ = velocity_variance_ + q * dt;
}

RegionTracker::Prior RegionTracker::prior() const {
  const std::size_t n = predicted_.size();
  const float ox = predicted_.x[0], oy = predicted_.y[0], oz = predicted_.z[0];
  float sx = 0, sy = 0, sz = 0, xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, vx = 0, vy = 0, vz = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const float w = weight_[i], dx = predicted_.x[i] - ox, dy = predicted_.y[i] - oy, dz = predicted_.z[i] - oz;
    sx += w * dx, sy += w * dy, sz += w * dz;
    xx += w * dx * dx, xy += w * dx * dy, xz += w * dx * dz;
    yy += w * dy * dy, yz += w * dy * dz, zz += w * dz * dz;
    vx += w * v_.x[i], vy += w * v_.y[i], vz += w * v_.z[i];
  }
  Prior out;
  const Eigen::Vector3d shift = Eigen::Vector3f(sx, sy, sz).cast<double>();
  out.mean = Eigen::Vector3f(ox, oy, oz).cast<double>() + shift;
  out.velocity = Eigen::Vector3f(vx, vy, vz).cast<double>();
  Eigen::Matrix3f second;
  second << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  out.covariance = second.cast<double>() - shift * shift.transpose() + var_p_ * Eigen::Matrix3d::Identity();
  return out;
}

// Covariance matching: raise the acceleration until the innovation is one that it explains, lower it slowly while the
// innovations are smaller than they need be. Only sightings that fix all three axes can tell.
void RegionTracker::choose_acceleration(const std::vector<TargetView>& views, double dt) {
  predict(dt);
  set_motion_noise(dt);
  Prior before = prior();
  sightings_ = sight(views, before);
  if (sightings_.size() < 2 || dt <= 0) return;
  const PositionInformation z = information_of(sightings_, before.mean, before.velocity);
  Eigen::Matrix3d z_covariance;
  bool invertible = false;
  z.information.computeInverseWithCheck(z_covariance, invertible, 1e-3);
  if (!invertible || !(z_covariance.trace() < 0.01)) return;
  const Eigen::Vector3d innovation = z_covariance * z.vector - before.mean;
  const double ceiling = 4 * options_.acceleration_m_s2;
  const auto surprise = [&] { return innovation.dot((before.covariance + z_covariance).inverse() * innovation) / 3; };
  double nis = surprise();
  while (nis > 3 && acceleration_ < ceiling) {
    const double var_p_before = var_p_;
    acceleration_ = std::min(ceiling, 1.5 * acceleration_);
    set_motion_noise(dt);
    before.covariance.diagonal().array() += var_p_ - var_p_before;
    nis = surprise();
  }
  acceleration_ = std::clamp(acceleration_ * std::exp(0.05 * (std::min(nis, 3.0) - 1)), least_acceleration_m_s2, ceiling);
}

// In each view the region near the prediction that explains it best, if there is one.
std::vector<Sighting> RegionTracker::sight(const std::vector<TargetView>& views, const Prior& before) {
  std::vector<Sighting> out;
  // The gate allows for the hardest usual acceleration, whatever the filter has learnt: a throw must not lose the object.
  const double dt2 = velocity_variance_ > 0 ? (var_v_ - velocity_variance_) / (acceleration_ * acceleration_ * acceleration_time_s) : 0;
  const double reach_m = 0.5 * 2 * options_.acceleration_m_s2 * dt2 * dt2;
  const Eigen::Matrix3d wide = before.covariance + reach_m * reach_m * Eigen::Matrix3d::Identity();
  for (const TargetView& view : views) {
    const auto at = appearance_of(*view.camera, before.mean - view.age_s * before.velocity, target_.radius_m);
    if (!at) continue;
    const Eigen::Matrix2d s = at->jacobian * wide * at->jacobian.transpose();
    const double extent_u = 3 * std::sqrt(s(0, 0)) + 2 * at->radius_px + 2;
    const double extent_v = 3 * std::sqrt(s(1, 1)) + 2 * at->radius_px + 2;
    const double limit = 2.0 * (view.matches->width() + view.matches->height());
    if (!(std::abs(at->px.x()) < limit && std::abs(at->px.y()) < limit)) continue;
    const PixelBox box{static_cast<int>(std::floor(at->px.x() - std::min(extent_u, limit))),
                       static_cast<int>(std::floor(at->px.y() - std::min(extent_v, limit))),
                       static_cast<int>(std::ceil(at->px.x() + std::min(extent_u, limit))),
                       static_cast<int>(std::ceil(at->px.y() + std::min(extent_v, limit)))};
    const double disc = std::numbers::pi * at->radius_px * at->radius_px;
    const int min_area = std::max(2, static_cast<int>(least_support * disc));
    double best = -1e30;
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
    if (chosen) out.push_back(*chosen);
  }
  return out;
}

// Optimal proposal: given particle i, prior N(predicted_i, var_p I) times the linearised sightings is Gaussian, with one
// covariance for all particles; draw from it, and let the weight put right what the linearisation and the floor neglect:
//   w_i *= prod_m p_m(s_i | img_m) * p(s_i | path) / q(s_i)
void RegionTracker::propose_and_weigh(const Prior& before) {
  const std::size_t n = p_.size();
  PositionInformation z = information_of(sightings_, before.mean, before.velocity);
  if (z.information.trace() > 0) {          // linearise again where the object is, if that is far from where it was expected
    const Eigen::Matrix3d prior_information = before.covariance.inverse();
    const Eigen::Vector3d there =
        (prior_information + z.information).ldlt().solve(prior_information * before.mean + z.vector);
    if ((there - before.mean).norm() > target_.radius_m) z = information_of(sightings_, there, before.velocity);
  }
  proposal_covariance_ = (Eigen::Matrix3d::Identity() / var_p_ + z.information).inverse();
  const Eigen::Matrix3f keep = (proposal_covariance_ / var_p_).cast<float>();       // mean_i = keep * predicted_i + add
  const Eigen::Vector3f add = (proposal_covariance_ * z.vector).cast<float>();
  const Eigen::Matrix3f root = Eigen::Matrix3d(proposal_covariance_.llt().matrixL()).cast<float>();
  noise_.resize(3 * n);
  rng_.fill_normal(noise_);
  mean_.resize(n);
  log_weight_.resize(n);
  const auto inverse_var_p = static_cast<float>(1 / var_p_);
  const auto velocity_gain = static_cast<float>(cov_pv_ / var_p_);    // E[v | path]: Kalman gain of a seen displacement
  const float* e0 = noise_.data();
  const float* e1 = e0 + n;
  const float* e2 = e1 + n;
  for (std::size_t i = 0; i < n; ++i) {
    const float px = predicted_.x[i], py = predicted_.y[i], pz = predicted_.z[i];
    const float mx = keep(0, 0) * px + keep(0, 1) * py + keep(0, 2) * pz + add(0);
    const float my = keep(1, 0) * px + keep(1, 1) * py + keep(1, 2) * pz + add(1);
    const float mz = keep(2, 0) * px + keep(2, 1) * py + keep(2, 2) * pz + add(2);
    const float x = mx + root(0, 0) * e0[i];
    const float y = my + root(1, 0) * e0[i] + root(1, 1) * e1[i];
    const float s = mz + root(2, 0) * e0[i] + root(2, 1) * e1[i] + root(2, 2) * e2[i];
    const float dx = x - px, dy = y - py, dz = s - pz;
    mean_.x[i] = mx, mean_.y[i] = my, mean_.z[i] = mz;
    p_.x[i] = x, p_.y[i] = y, p_.z[i] = s;
    v_.x[i] += velocity_gain * dx, v_.y[i] += velocity_gain * dy, v_.z[i] += velocity_gain * dz;
    log_weight_[i] = 0.5f * (e0[i] * e0[i] + e1[i] * e1[i] + e2[i] * e2[i]) -
                     0.5f * inverse_var_p * (dx * dx + dy * dy + dz * dz);
  }
  velocity_variance_ = std::max(0.0, var_v_ - cov_pv_ * cov_pv_ / var_p_);

  u_.resize(n), v_px_.resize(n);
  for (const Sighting& sighting : sightings_) {
    const auto age = static_cast<float>(sighting.view->age_s);
    const float *x = p_.x.data(), *y = p_.y.data(), *s = p_.z.data();
    if (age != 0) {                         // where each particle was when this view looked
      scratch_.resize(n);
      for (std::size_t i = 0; i < n; ++i) scratch_.x[i] = p_.x[i] - age * v_.x[i];
      for (std::size_t i = 0; i < n; ++i) scratch_.y[i] = p_.y[i] - age * v_.y[i];
      for (std::size_t i = 0; i < n; ++i) scratch_.z[i] = p_.z[i] - age * v_.z[i];
      x = scratch_.x.data(), y = scratch_.y.data(), s = scratch_.z.data();
    }
    sighting.view->projector->project(x, y, s, n, u_.data(), v_px_.data());
    // p_m = max(1/25, support * exp(-d^2 / 2)), d the distance to the region's centre in its covariance
    const Eigen::Matrix2f information = sighting.covariance.inverse().cast<float>();
    const float a = information(0, 0), b = 2 * information(0, 1), c = information(1, 1);
    const auto cu = static_cast<float>(sighting.px.x()), cv = static_cast<float>(sighting.px.y());
    const auto floor = static_cast<float>(std::log(floor_likelihood));
    const auto top = static_cast<float>(std::log(sighting.support));
    for (std::size_t i = 0; i < n; ++i) {
      const float du = u_[i] - cu, dv = v_px_[i] - cv;
      log_weight_[i] += std::max(floor, top - 0.5f * (a * du * du + b * du * dv + c * dv * dv));
    }
  }
  for (std::size_t i = 0; i < n; ++i) log_weight_[i] += std::log(std::max(weight_[i], 1e-30f));
  normalize_log_weights(log_weight_, weight_);
  effective_sample_size_ = effective_sample_size(weight_);
}

// Rao-Blackwellised moments: the mean of the particles' conditional means, and the conditional covariance on top of their
// spread. The same expectation as over the drawn positions, with less Monte Carlo noise.
void RegionTracker::summarize() {
  const std::size_t n = p_.size();
  const float ox = mean_.x[0], oy = mean_.y[0], oz = mean_.z[0];
  float sx = 0, sy = 0, sz = 0, xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, vx = 0, vy = 0, vz = 0;
  std::size_t best = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const float w = weight_[i], dx = mean_.x[i] - ox, dy = mean_.y[i] - oy, dz = mean_.z[i] - oz;
    sx += w * dx, sy += w * dy, sz += w * dz;
    xx += w * dx * dx, xy += w * dx * dy, xz += w * dx * dz;
    yy += w * dy * dy, yz += w * dy * dz, zz += w * dz * dz;
    vx += w * v_.x[i], vy += w * v_.y[i], vz += w * v_.z[i];
    if (w > weight_[best]) best = i;
  }
  const Eigen::Vector3d shift = Eigen::Vector3f(sx, sy, sz).cast<double>();
  Eigen::Matrix3f second;
  second << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  position_ = Eigen::Vector3f(ox, oy, oz).cast<double>() + shift;
  covariance_ = second.cast<double>() - shift * shift.transpose() + proposal_covariance_;
  velocity_ = Eigen::Vector3f(vx, vy, vz).cast<double>();
  map_ = Eigen::Vector3f(p_.x[best], p_.y[best], p_.z[best]).cast<double>();
}

void RegionTracker::resample_if_poor() {
  const std::size_t n = p_.size();
  if (effective_sample_size_ > 0.5 * static_cast<double>(n)) return;
  ancestor_.resize(n);
  systematic_ancestors(weight_, rng_.uniform(), ancestor_);
  scratch_.resize(n);
  for (PositionParticles* set : {&p_, &v_}) {
    for (std::size_t i = 0; i < n; ++i) {
      scratch_.x[i] = set->x[ancestor_[i]];
      scratch_.y[i] = set->y[ancestor_[i]];
      scratch_.z[i] = set->z[ancestor_[i]];
    }
    std::swap(*set, scratch_);
  }
  weight_.assign(n, 1.0f / static_cast<float>(n));
}

void RegionTracker::judge(const FrameSet& set) {
  const double sigma_m = largest_sigma(covariance_);
  if (!sightings_.empty() && sigma_m <= options_.max_tracking_sigma_m) {
    state_ = TrackState::tracking;
    last_tracking_ = set.at;
  } else if (sigma_m > options_.max_coast_sigma_m || seconds(set.at - last_tracking_) > options_.coast_s) {
    state_ = TrackState::lost;
    scatter();
  } else {
    state_ = TrackState::coasting;
  }
}

// Two candidates in two frame sets on end that one object can explain are a find. One alone never is: a chance match of
// background pixels does not move like an object.
void RegionTracker::search(const FrameSet& set, const std::vector<TargetView>& views) {
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    // How large the object can be in this view: at the corners of the volume.
    double smallest = 1e9, largest = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d p((corner & 1 ? options_.volume.max : options_.volume.min).x(),
                              (corner & 2 ? options_.volume.max : options_.volume.min).y(),
                              (corner & 4 ? options_.volume.max : options_.volume.min).z());
      if (const auto at = appearance_of(*view.camera, p, target_.radius_m)) {
        smallest = std::min(smallest, at->radius_px);
        largest = std::max(largest, at->radius_px);
      }
    }
    if (largest == 0) {
      regions_[i].clear();
      continue;
    }
    const int step = std::max(1, static_cast<int>(smallest));
    const int extent = static_cast<int>(std::ceil(3 * largest)) + 2;
    regions_[i] = finders_[static_cast<std::size_t>(view.index)].search(
        *view.matches, *view.image, *view.table, step, extent, std::max(2, static_cast<int>(0.3 * smallest * smallest)), largest);
  }
  std::vector<Candidate> now =
      cross_rays(views, std::span(regions_).first(views.size()), target_, options_, max_candidates);
  const double dt = seconds(set.at - candidates_at_);
  const Candidate* found = nullptr;
  const Candidate* earlier = nullptr;
  double best = -1e30;
  if (dt > 0 && dt < 0.5) {
    for (const Candidate& c : now) {
      for (const Candidate& e : candidates_) {
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
    state_ = TrackState::tracking;
    last_tracking_ = set.at;
    candidates_.clear();
    return;
  }
  candidates_ = std::move(now);
  candidates_at_ = set.at;
}

void RegionTracker::start_at(const Candidate& found, const Eigen::Vector3d& velocity, double velocity_variance) {
  const auto n = static_cast<std::size_t>(options_.particle_count);
  p_.resize(n), v_.resize(n);
  noise_.resize(6 * n);
  rng_.fill_normal(noise_);
  const Eigen::Matrix3d root = found.covariance.llt().matrixL();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d e = Eigen::Vector3f(noise_[3 * i], noise_[3 * i + 1], noise_[3 * i + 2]).cast<double>();
    const Eigen::Vector3f p = (found.position + root * e).cast<float>();
    p_.x[i] = p.x(), p_.y[i] = p.y(), p_.z[i] = p.z();
    v_.x[i] = static_cast<float>(velocity.x());
    v_.y[i] = static_cast<float>(velocity.y());
    v_.z[i] = static_cast<float>(velocity.z());
  }
  weight_.assign(n, 1.0f / static_cast<float>(n));
  velocity_variance_ = velocity_variance;
  acceleration_ = options_.acceleration_m_s2;
  position_ = map_ = found.position;
  covariance_ = found.covariance;
  velocity_ = velocity;
  effective_sample_size_ = static_cast<double>(n);
  sightings_ = found.sightings;
}

ObjectEstimate RegionTracker::report(const FrameSet& set, const std::vector<TargetView>& views) const {
  ObjectEstimate e;
  e.at = set.at;
  e.set_number = set.number;
  e.state = state_;
  e.particle_count = static_cast<int>(p_.size());
  e.effective_sample_size = e.has_position() ? effective_sample_size_ : static_cast<double>(p_.size());
  e.per_view.resize(views_.camera_count());
  for (const TargetView& view : views) e.per_view[static_cast<std::size_t>(view.index)].delivered = true;
  if (!e.has_position()) return e;
  e.position = position_;
  e.velocity = velocity_;
  e.covariance = covariance_;
  e.map_position = map_;
  for (const TargetView& view : views) {
    ViewSupport& support = e.per_view[static_cast<std::size_t>(view.index)];
    const auto at = appearance_of(*view.camera, position_ - view.age_s * velocity_, target_.radius_m);
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
  // How sure we are that this is the object, not where it is (the covariance says that): that not all supports are chance.
  double doubt = 1;
  for (const Sighting& s : sightings_) doubt *= 1 - 0.9 * s.support;
  e.confidence = 1 - doubt;
  return e;
}

}  // namespace huetrack
