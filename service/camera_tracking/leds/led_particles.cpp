#include "camera_tracking/leds/led_particles.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "particle_filter/resample.h"

namespace huetrack::leds {

namespace {

using Eigen::Vector3d;

// Uniform over all rotations (Shoemake 1992).
Eigen::Quaterniond any_rotation(double a, double b, double c) {
  const double tau = 2 * std::numbers::pi, r1 = std::sqrt(1 - a), r2 = std::sqrt(a);
  return {r2 * std::cos(tau * c), r1 * std::sin(tau * b), r1 * std::cos(tau * b), r2 * std::sin(tau * c)};
}

Vector3d three(const float* z) {
  return {static_cast<double>(z[0]), static_cast<double>(z[1]), static_cast<double>(z[2])};
}

// Sum of squared normalised distances of a greedy one-to-one assignment. If two dots could share a LED, a camera far
// away, which sees all LEDs as one dot, would fit.
double sum_of_pairs(std::span<const LedSighting> dots, std::span<const std::optional<Eigen::Vector2d>> leds,
                    double miss2) {
  std::vector<bool> dot_used(dots.size(), false), led_used(leds.size(), false);
  double sum = 0;
  for (std::size_t pair = 0; pair < dots.size(); ++pair) {
    double least = miss2;
    std::size_t dot = dots.size(), led = leds.size();
    for (std::size_t d = 0; d < dots.size(); ++d) {
      if (dot_used[d]) continue;
      for (std::size_t l = 0; l < leds.size(); ++l) {
        if (led_used[l] || !leds[l]) continue;
        const double d2 = (*leds[l] - dots[d].px).squaredNorm();
        if (d2 < least) least = d2, dot = d, led = l;
      }
    }
    if (dot == dots.size()) break;
    dot_used[dot] = led_used[led] = true;
    sum += least / (dots[dot].sigma_px * dots[dot].sigma_px);
  }
  for (std::size_t d = 0; d < dots.size(); ++d)
    if (!dot_used[d]) sum += miss2 / (dots[d].sigma_px * dots[d].sigma_px);
  return sum;
}

}  // namespace

LedParticles::LedParticles(int count, particle_filter::Rng rng)
    : states_(static_cast<std::size_t>(count)),
      resampled_(states_.size()),
      weight_(states_.size(), 1.0f / static_cast<float>(count)),
      log_weight_(states_.size()),
      squared_(states_.size()),
      ancestor_(states_.size()),
      rng_(rng) {}

void LedParticles::scatter(const Vector3d& room_min, const Vector3d& room_max, const LedStartVelocity& velocity) {
  const std::size_t n = states_.size();
  noise_.resize(12 * n);
  const std::span uniform(noise_.data(), 6 * n), normal(noise_.data() + 6 * n, 6 * n);
  rng_.fill_uniform(uniform);
  rng_.fill_normal(normal);
  for (std::size_t i = 0; i < n; ++i) {
    const float *const u = &uniform[6 * i], *const z = &normal[6 * i];
    LedMotionState& s = states_[i];
    s.world_from_camera.translation = room_min + (room_max - room_min).cwiseProduct(three(u));
    const Vector3d r = three(u + 3);
    s.world_from_camera.rotation = any_rotation(r.x(), r.y(), r.z());
    s.velocity = velocity.velocity * three(z);
    s.angular_rate = velocity.angular_rate * three(z + 3);
  }
  std::ranges::fill(weight_, 1.0f / static_cast<float>(n));
}

void LedParticles::draw(const LedGaussian& from) {
  const std::size_t n = states_.size();
  const LedCovariance root = from.covariance.llt().matrixL();
  noise_.resize(led_dimensions * n);
  rng_.fill_normal(noise_);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Map<const Eigen::Matrix<float, led_dimensions, 1>> z(&noise_[led_dimensions * i]);
    states_[i] = corrected(from.mean, root * z.cast<double>());
  }
  std::ranges::fill(weight_, 1.0f / static_cast<float>(n));
}

void LedParticles::predict(double dt_s, const LedMotionNoise& noise) {
  const std::size_t n = states_.size();
  noise_.resize(6 * n);
  rng_.fill_normal(noise_);
  // White noise with the long-term effect of the accelerations on the velocities.
  const double root = std::sqrt(2 * noise.correlation_s * dt_s);
  for (std::size_t i = 0; i < n; ++i) {
    LedMotionState& s = states_[i];
    const float* const z = &noise_[6 * i];
    const Vector3d dv = noise.acceleration * root * three(z), dw = noise.angular_acceleration * root * three(z + 3);
    s.velocity += 0.5 * dv;  // the mean over the step
    s.angular_rate += 0.5 * dw;
    s = moved(s, dt_s);
    s.velocity += 0.5 * dv;
    s.angular_rate += 0.5 * dw;
  }
}

double LedParticles::weigh(const calib::CameraModel& model, std::span<const Vector3d> leds,
                           std::span<const LedSighting> sightings, double least_share, double enough_share,
                           double miss_px) {
  if (sightings.empty()) return 1;
  const std::size_t n = states_.size();
  const double miss2 = miss_px * miss_px;
  std::vector<std::optional<Eigen::Vector2d>> pixels(leds.size());
  for (std::size_t i = 0; i < n; ++i) {
    const calib::Rigid3d camera_from_world = calib::inverse(states_[i].world_from_camera);
    const auto pixel_of = [&](int led) -> std::optional<Eigen::Vector2d> {
      const auto px = model.project(camera_from_world * leds[static_cast<std::size_t>(led)]);
      return px ? std::optional(px->px) : std::nullopt;
    };
    double sum = 0;
    if (sightings.front().led < 0) {
      for (std::size_t l = 0; l < leds.size(); ++l) pixels[l] = pixel_of(static_cast<int>(l));
      sum = sum_of_pairs(sightings, pixels, miss2);
    } else {
      for (const LedSighting& s : sightings) {
        double d2 = miss2;
        if (const auto px = pixel_of(s.led)) d2 = std::min(d2, (*px - s.px).squaredNorm());
        sum += d2 / (s.sigma_px * s.sigma_px);
      }
    }
    squared_[i] = sum;
  }
  const double best = *std::ranges::min_element(squared_);
  const auto weigh_with = [&](double widening) {
    const double scale = -0.5 / (widening * widening);
    for (std::size_t i = 0; i < n; ++i)
      log_weight_[i] = std::log(weight_[i]) + static_cast<float>(scale * (squared_[i] - best));
  };
  std::vector<float> fresh(n);
  const auto survivors = [&](double widening) {
    weigh_with(widening);
    particle_filter::normalize_log_weights(log_weight_, fresh);
    return huetrack::particle_filter::effective_sample_size(fresh);
  };
  const double least = least_share * static_cast<double>(n);
  double widening = 1;
  if (survivors(1) < enough_share * static_cast<double>(n)) {
    double low = 1, high = 2;
    while (survivors(high) < least && high < 1e6) low = high, high *= 2;
    for (int k = 0; k < 8; ++k) {
      const double middle = std::sqrt(low * high);
      (survivors(middle) < least ? low : high) = middle;
    }
    widening = high;
    survivors(widening);
  }
  weight_.swap(fresh);
  return widening;
}

double LedParticles::anneal(const calib::CameraModel& model, std::span<const Vector3d> leds,
                            std::span<const LedSighting> sightings, const Vector3d& room_min, const Vector3d& room_max,
                            const LedStartVelocity& velocity, double miss_px) {
  // Faster shrinking, or another jitter, converges in fewer frames (EXPERIMENTS.md).
  constexpr double shrinking = 0.85, parting = 0.2;
  const std::size_t n = states_.size();
  Vector3d middle(0, 0, 0);
  for (const Vector3d& led : leds) middle += led / static_cast<double>(leds.size());

  scatter(room_min, room_max, velocity);
  std::vector<LedSighting> wide(sightings.begin(), sightings.end());
  const double last = std::ranges::min(wide, {}, &LedSighting::sigma_px).sigma_px;
  double rms_px = miss_px;
  for (double width = miss_px / 2;; width = std::max(last, shrinking * width)) {
    for (LedSighting& s : wide) s.sigma_px = width;
    constexpr double none = 1e-9;  // no further widening
    weigh(model, leds, wide, none, none, miss_px);
    rms_px = width * std::sqrt(*std::ranges::min_element(squared_) / static_cast<double>(wide.size()));
    particle_filter::systematic_ancestors(weight_, rng_.uniform(), ancestor_);
    noise_.resize(12 * n);
    rng_.fill_normal(noise_);
    // Moves the LEDs by this share of the width.
    const double turn = std::min(0.3, parting * width / model.fx());
    for (std::size_t i = 0; i < n; ++i) {
      const float* const z = &noise_[12 * i];
      const LedMotionState& from = states_[ancestor_[i]];
      LedTangent off = LedTangent::Zero();
      off.head<3>() = turn * (from.world_from_camera.translation - middle).norm() * three(z);
      off.segment<3>(3) = turn * three(z + 3);
      LedMotionState& to = resampled_[i];
      to = corrected(from, off);
      to.world_from_camera.translation = to.world_from_camera.translation.cwiseMax(room_min).cwiseMin(room_max);
      // Not observable from one frame: drawn anew.
      to.velocity = velocity.velocity * three(z + 6);
      to.angular_rate = velocity.angular_rate * three(z + 9);
    }
    states_.swap(resampled_);
    std::ranges::fill(weight_, 1.0f / static_cast<float>(n));
    if (width <= last) return rms_px;
  }
}

void LedParticles::resample(double jitter) {
  const std::size_t n = states_.size();
  const LedCovariance root =
      jitter * (moments().covariance + 1e-12 * LedCovariance::Identity()).llt().matrixL().toDenseMatrix();
  particle_filter::systematic_ancestors(weight_, rng_.uniform(), ancestor_);
  noise_.resize(led_dimensions * n);
  rng_.fill_normal(noise_);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Map<const Eigen::Matrix<float, led_dimensions, 1>> z(&noise_[led_dimensions * i]);
    resampled_[i] = corrected(states_[ancestor_[i]], root * z.cast<double>());
  }
  states_.swap(resampled_);
  std::ranges::fill(weight_, 1.0f / static_cast<float>(n));
}

// Iterated mean in the tangent space; two rounds are enough for a cloud below a radian.
LedMotionState LedParticles::mean() const {
  LedMotionState about = states_[static_cast<std::size_t>(std::ranges::max_element(weight_) - weight_.begin())];
  for (int round = 0; round < 2; ++round) {
    LedTangent mean = LedTangent::Zero();
    for (std::size_t i = 0; i < states_.size(); ++i)
      if (weight_[i] > 1e-12f) mean += static_cast<double>(weight_[i]) * difference(states_[i], about);
    about = corrected(about, mean);
  }
  return about;
}

LedGaussian LedParticles::moments() const {
  LedGaussian g;
  g.mean = mean();
  g.covariance.setZero();
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (!(weight_[i] > 1e-12f)) continue;
    const LedTangent d = difference(states_[i], g.mean);
    g.covariance.noalias() += static_cast<double>(weight_[i]) * d * d.transpose();
  }
  return g;
}

double LedParticles::effective_sample_size() const {
  return huetrack::particle_filter::effective_sample_size(weight_);
}

}  // namespace huetrack::leds
