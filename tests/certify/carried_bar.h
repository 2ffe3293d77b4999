// A bar that somebody carries about, as a tracker would tell its balls.
#pragma once

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "calib/certify/length_test.h"
#include "drawn.h"

namespace huetrack::certify {

inline constexpr double carried_length_m = 0.4;

// Its ends are measured with this noise; all lengths are `scale` times too long.
struct CarriedBar {
  double noise_m = 0.002, stated_m = 0.002, scale = 1, lag_s = 0, seconds = 90;
  unsigned seed = 1;

  Eigen::Vector3d end(double t, double sign) const {
    const Eigen::Vector3d at(0.7 * std::sin(0.6 * t + seed), 0.6 * std::cos(0.5 * t), 1 + 0.5 * std::sin(0.8 * t));
    const double heading = 0.7 * t, rise = 1.2 * std::sin(0.55 * t);
    return at +
           sign * carried_length_m / 2 *
               Eigen::Vector3d(std::cos(heading) * std::cos(rise), std::sin(heading) * std::cos(rise), std::sin(rise));
  }
  std::array<BallTrack, 2> tracks() const {
    std::mt19937 rng(seed);
    std::normal_distribution<double> noise(0, noise_m);
    std::array<BallTrack, 2> out;
    for (int k = 0; k < 30 * seconds; ++k) {
      for (const std::size_t ball : {0U, 1U}) {
        const double t = k / 30.0 + (ball == 1 ? lag_s : 0), sign = ball == 0 ? -1 : 1;
        BallFix fix{
            .set = static_cast<std::uint64_t>(k), .t_s = t, .position = scale * end(t, sign) + drawn<3>(rng, noise)};
        fix.velocity = (end(t + 1e-4, sign) - end(t - 1e-4, sign)) / 2e-4;
        fix.covariance = stated_m * stated_m * Eigen::Matrix3d::Identity();
        out[ball].push_back(fix);
      }
    }
    return out;
  }
  std::vector<MeasuredLength> lengths() const {
    const auto both = tracks();
    return bar_lengths(both[0], both[1], carried_length_m, {});
  }
};

}  // namespace huetrack::certify
