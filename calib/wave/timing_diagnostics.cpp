#include "calib/wave/timing_diagnostics.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "calib/model/median.h"

namespace huetrack::wave {
namespace {

constexpr double window_s = 1;          // a camera's lag is about constant over it
constexpr std::size_t least_count = 8;  // samples per window
constexpr double slow_px_s = 60;        // slower samples are ignored
constexpr double normal_from_median = 1.4826;

struct Lag {
  double along_s, across_s;  // the residual over the speed
  double speed_px_s;
};

// Weighted by speed.
double weighted_median(std::vector<Lag> lags) {
  std::ranges::sort(lags, {}, &Lag::along_s);
  double half = 0;
  for (const Lag& lag : lags) half += lag.speed_px_s / 2;
  for (const Lag& lag : lags) {
    half -= lag.speed_px_s;
    if (half <= 0) return lag.along_s;
  }
  return 0;
}

double spread(std::vector<double> values) {
  for (double& v : values) v = std::abs(v);
  return values.empty() ? 0 : normal_from_median * calib::median(std::move(values));
}

}  // namespace

TimingDiagnostics timing_diagnostics(const std::vector<TimingSample>& samples, double frame_s) {
  std::map<int, std::vector<Lag>> windows;
  std::vector<double> across_px;
  std::size_t fast = 0, repeated = 0;
  constexpr double clear_px = 6, near_px = 3;  // motion per frame of a fast ball; tolerance across the motion
  for (const TimingSample& sample : samples) {
    const double speed = sample.velocity.norm();
    if (speed < slow_px_s) continue;
    const Eigen::Vector2d along = sample.velocity / speed, side(-along.y(), along.x());
    const Lag lag{along.dot(sample.residual) / speed, side.dot(sample.residual) / speed, speed};
    windows[static_cast<int>(std::floor(sample.t_s / window_s))].push_back(lag);
    across_px.push_back(side.dot(sample.residual));
    if (speed * frame_s < clear_px) continue;
    ++fast;
    const double frames_back = -lag.along_s / frame_s;
    repeated += frames_back > 0.6 && frames_back < 1.5 && std::abs(across_px.back()) < near_px ? 1 : 0;
  }
  TimingDiagnostics out;
  if (fast >= least_count) out.repeated = static_cast<double>(repeated) / static_cast<double>(fast);
  const double noise_px = spread(std::move(across_px));
  if (!(noise_px > 0)) return out;
  double lag2 = 0, noise2 = 0, sigmas2 = 0;
  int counted = 0;
  std::vector<double> along_px, beside_px;
  double speed2 = 0;
  for (const auto& [number, lags] : windows) {
    if (lags.size() < least_count) continue;
    const double lag_s = out.lag_s[number] = weighted_median(lags);
    double square = 0;
    for (const Lag& lag : lags) {
      square += lag.speed_px_s * lag.speed_px_s;
      along_px.push_back((lag.along_s - lag_s) * lag.speed_px_s);
      beside_px.push_back(lag.across_s * lag.speed_px_s);
    }
    speed2 += square;
    // Efficiency of a median, and correlation of an outline's error over some frames.
    constexpr double inefficiency = 2;
    const double variance = std::pow(inefficiency * noise_px, 2) / square;
    lag2 += lag_s * lag_s;
    noise2 += variance;
    sigmas2 += lag_s * lag_s / variance;
    ++counted;
  }
  if (counted == 0) return out;
  out.wander_s = std::sqrt(std::max(0.0, lag2 - noise2) / counted);
  out.wander_sigmas = std::sqrt(sigmas2 / counted);
  const auto count = static_cast<double>(along_px.size());
  const double along = spread(std::move(along_px)), beside = spread(std::move(beside_px));
  out.scatter_s = std::sqrt(std::max(0.0, along * along - beside * beside) / (speed2 / count));
  return out;
}

}  // namespace huetrack::wave
