// A ball that is waved, and then thrown; most throws bounce on a floor. With air: a sphere's drag, and what air
// carries.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "wave/waving.h"

namespace huetrack::wave {

struct Throwing {
  std::uint64_t seed = 1;
  int throws = 5;
  double waved_s = 8;
  double radius_m = 0.04, density_kg_m3 = 350;  // 0: no air
  double gravity = 9.81;                        // in vacuum
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

struct ThrownPath {
  static constexpr double step_s = 5e-4;
  std::vector<Eigen::Vector3d> at;
  std::vector<std::pair<double, double>> flights;  // from, to
  double seconds() const { return step_s * static_cast<double>(at.size() - 1); }
  Eigen::Vector3d operator()(double t) const {
    const double u = std::clamp(t / step_s, 0.0, static_cast<double>(at.size()) - 1.001);
    const auto i = static_cast<std::size_t>(u);
    return at[i] + (u - static_cast<double>(i)) * (at[i + 1] - at[i]);
  }
};

class Thrower {
 public:
  explicit Thrower(const Throwing& of) : of_(of), random_(of.seed) {
    const double air = of.density_kg_m3 > 0 ? 1.2 / of.density_kg_m3 : 0;
    drag_ = 3.0 / 8 * 0.47 * air / of.radius_m / (1 + air / 2);
    down_ = -of.gravity * (1 - air) / (1 + air / 2) * of.up;
    for (double t = 0; t < of.waved_s; t += ThrownPath::step_s) path_.at.push_back(lissajous(t));
    v_ = (lissajous(of.waved_s + 1e-4) - lissajous(of.waved_s - 1e-4)) / 2e-4;
    for (int k = 0; k < of.throws; ++k) throw_once(k % 5 < 3);
  }
  ThrownPath path() const { return path_; }

 private:
  double between(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }

  // As an arm does: without acceleration at either end.
  void carry(const Eigen::Vector3d& p1, const Eigen::Vector3d& v1, double seconds) {
    const Eigen::Vector3d p0 = path_.at.back(), a = v_ * seconds, b = v1 * seconds, d = p1 - p0;
    for (double u = ThrownPath::step_s / seconds; u < 1; u += ThrownPath::step_s / seconds)
      path_.at.push_back(p0 + a * u + (10 * d - 6 * a - 4 * b) * std::pow(u, 3) +
                         (-15 * d + 8 * a + 7 * b) * std::pow(u, 4) + (6 * d - 3 * a - 3 * b) * std::pow(u, 5));
    v_ = v1;
  }

  void fly(double until_z) {
    const double from = path_.seconds();
    Eigen::Vector3d p = path_.at.back();
    const auto acceleration = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d { return down_ - drag_ * v.norm() * v; };
    while (v_.dot(of_.up) > 0 || p.dot(of_.up) > until_z) {
      const Eigen::Vector3d middle = v_ + ThrownPath::step_s / 2 * acceleration(v_);
      v_ += ThrownPath::step_s * acceleration(middle);
      path_.at.push_back(p += ThrownPath::step_s * middle);
    }
    path_.flights.emplace_back(from, path_.seconds());
  }

  void throw_once(bool bounces) {
    constexpr double floor_z = 0.2;
    const Eigen::Vector3d from(between(-0.4, 0.4), between(-0.4, 0.4), between(0.8, 1.1));
    const Eigen::Vector3d aim(between(-0.3, 0.3), between(-0.3, 0.3), 0);
    Eigen::Vector3d v = (aim - from) / 0.75;
    v -= of_.up * v.dot(of_.up);
    v += of_.up * (bounces ? between(1.2, 2.4) : between(2.4, 3.4));
    carry(from, v, between(0.5, 0.8));
    if (bounces) {
      fly(floor_z);
      v_ = 0.9 * (v_ - v_.dot(of_.up) * of_.up) - 0.8 * v_.dot(of_.up) * of_.up;
      fly(0.5);
    } else {
      fly(0.9);
    }
    carry(path_.at.back() - 0.1 * of_.up, Eigen::Vector3d::Zero(), 0.25);
  }

  const Throwing of_;
  std::mt19937_64 random_;
  double drag_ = 0;
  Eigen::Vector3d down_, v_;
  ThrownPath path_;
};

inline ThrownPath thrown(const Throwing& of) {
  return Thrower(of).path();
}

}  // namespace huetrack::wave
