#include "camera_tracking/leds/led_models.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace huetrack::leds {

namespace {

struct NoiseLevel {  // relative to the largest noise
  double acceleration, angular_acceleration, correlation;
};
// Gentle motion also keeps its accelerations for longer. The last two: carried or driven while it looks steadily ahead;
// on a turntable or a rail.
constexpr std::array noise_levels{NoiseLevel{1.0, 1.0, 1.0},    NoiseLevel{0.2, 0.2, 1.0},
                                  NoiseLevel{0.05, 0.05, 3.0},  NoiseLevel{0.02, 0.02, 3.0},
                                  NoiseLevel{0.02, 0.004, 6.0}, NoiseLevel{0.001, 0.001, 3.0}};
constexpr std::array pixel_scales{1.0, 4.0, 16.0, 64.0};  // of the sightings' sigma_px
struct Scale {
  NoiseLevel motion;
  double pixel;
};
constexpr auto scales = [] {
  std::array<Scale, noise_levels.size() * pixel_scales.size()> all{};
  for (std::size_t i = 0; i < all.size(); ++i)
    all[i] = {noise_levels[i / pixel_scales.size()], pixel_scales[i % pixel_scales.size()]};
  return all;
}();
// Rate of changes of the model. With 2 per second the wrong models keep half of the weight, and the error of a steady
// camera grows by half (tests/benchmark/led_tables particles).
constexpr double switching_per_s = 0.1;
constexpr double least_probability = 1e-4;

LedGaussian mixture(std::span<const LedGaussian> states, std::span<const double> weight) {
  const auto main = static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin());
  LedTangent mean = LedTangent::Zero();
  std::vector<LedTangent> off;
  for (std::size_t i = 0; i < states.size(); ++i) {
    off.push_back(difference(states[i].mean, states[main].mean));
    mean += weight[i] * off.back();
  }
  LedGaussian mixed;
  mixed.mean = corrected(states[main].mean, mean);
  mixed.covariance.setZero();
  for (std::size_t i = 0; i < states.size(); ++i) {
    const LedTangent d = off[i] - mean;
    mixed.covariance += weight[i] * (states[i].covariance + d * d.transpose());
  }
  return mixed;
}

}  // namespace

LedModels::LedModels(const LedGaussian& start, const LedMotionNoise& largest_noise)
    : states_(scales.size(), start), probability_(scales.size(), 1.0 / scales.size()), largest_noise_(largest_noise) {}

void LedModels::predict(double dt_s) {
  const std::size_t n = states_.size();
  const double stay = std::exp(-switching_per_s * dt_s);
  std::vector<LedGaussian> mixed;
  std::vector<double> probability(n, 0), weight(n);
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      weight[i] = probability_[i] * (i == j ? stay : (1 - stay) / static_cast<double>(n - 1));
      probability[j] += weight[i];
    }
    for (double& w : weight) w /= probability[j];
    mixed.push_back(mixture(states_, weight));
  }
  probability_ = probability;
  for (std::size_t j = 0; j < n; ++j)
    states_[j] =
        predicted(mixed[j], dt_s,
                  {.acceleration = scales[j].motion.acceleration * largest_noise_.acceleration,
                   .angular_acceleration = scales[j].motion.angular_acceleration * largest_noise_.angular_acceleration,
                   .correlation_s = scales[j].motion.correlation * largest_noise_.correlation_s});
}

void LedModels::update(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
                       std::span<const LedSighting> sightings, const LedMotionState& from) {
  std::vector<double> log_likelihood;
  std::vector<LedSighting> scaled(sightings.begin(), sightings.end());
  for (std::size_t i = 0; i < states_.size(); ++i) {
    LedGaussian& state = states_[i];
    double sum = 0;
    for (std::size_t k = 0; k < scaled.size(); ++k) {
      LedSighting& s = scaled[k];
      s.sigma_px = scales[i].pixel * sightings[k].sigma_px;
      LedJacobian j;
      const auto px = led_pixel(model, state.mean, leds[static_cast<std::size_t>(s.led)], s.dt_s, &j);
      if (!px) continue;
      const Eigen::Matrix2d spread =
          j * state.covariance * j.transpose() + s.sigma_px * s.sigma_px * Eigen::Matrix2d::Identity();
      const Eigen::Vector2d innovation = s.px - *px;
      sum -= 0.5 * (innovation.dot(spread.inverse() * innovation) + std::log(spread.determinant()));
    }
    log_likelihood.push_back(sum);
    if (const auto fit = fit_leds(model, leds, state, from, scaled, 8)) state = fit->posterior;
  }
  const double best = std::ranges::max(log_likelihood);
  double sum = 0;
  for (std::size_t i = 0; i < probability_.size(); ++i) {
    probability_[i] = std::max(least_probability, probability_[i] * std::exp(log_likelihood[i] - best));
    sum += probability_[i];
  }
  for (double& p : probability_) p /= sum;
}

LedGaussian LedModels::state() const {
  return mixture(states_, probability_);
}

double LedModels::pixel_scale() const {
  double square = 0;
  for (std::size_t i = 0; i < probability_.size(); ++i) square += probability_[i] * scales[i].pixel * scales[i].pixel;
  return std::sqrt(square);
}

}  // namespace huetrack::leds
