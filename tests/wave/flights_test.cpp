#include "calib/wave/flights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>

#include "drawn.h"
#include "wave/throwing.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector3d;

// What three cameras with exact poses see of it, `noise_px` off.
std::vector<PathMeasurement> seen(const ThrownPath& path, double noise_px, std::uint64_t seed) {
  const calib::CameraRig rig = rig_of(3);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<PathMeasurement> out;
  for (int c = 0; c < 3; ++c) {
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
    for (double t = 0.011 * c; t < path.seconds(); t += 1 / 30.0) {
      calib::CameraModel::Jacobian by_cam;
      const auto px = camera.model.project(camera.cam_from_world * path(t), by_cam);
      if (!px || !camera.contains(*px)) continue;
      PathMeasurement& m = out.emplace_back();
      m.t_s = t;
      m.by_position = by_cam * camera.cam_from_world.rotation.toRotationMatrix() / noise_px;
      m.value = m.by_position * path(t) + drawn<2>(random, normal);
    }
  }
  std::ranges::stable_sort(out, {}, &PathMeasurement::t_s);
  return out;
}

// The path as the adjustment has it.
BallPath smooth(const ThrownPath& of) {
  BallPath path = BallPath::over(0, of.seconds(), 1 / 30.0);
  for (std::size_t k = 0; k < path.control.size(); ++k)
    path.control[k] = of(path.step_s * (static_cast<double>(k) - 1));
  return path;
}

std::optional<Gravity> found(const Throwing& throwing, double noise_px, FlightOptions options = {}) {
  const ThrownPath path = thrown(throwing);
  options.expected_g = 11;  // the ball's size is 10 % off
  options.radius = throwing.radius_m;
  return gravity_of(seen(path, noise_px, throwing.seed), smooth(path), options);
}

// Chi-square of three numbers.
double distance2(const Gravity& gravity, const Vector3d& truth) {
  const Eigen::Matrix3d covariance = gravity.by_priors + gravity.gain * gravity.gain.transpose();
  return (gravity.acceleration - truth).dot(covariance.inverse() * (gravity.acceleration - truth));
}

TEST(Flights, GiveGravityWithItsCovariance) {
  double sum = 0;
  int count = 0;
  for (const double density : {0.0, 84.0, 350.0}) {
    for (const double noise_px : {0.1, 0.3}) {
      for (std::uint64_t seed = 1; seed <= 4; ++seed, ++count) {
        const auto gravity = found({.seed = seed, .density_kg_m3 = density}, noise_px);
        ASSERT_TRUE(gravity) << density << " " << seed;
        EXPECT_GE(gravity->flights.size(), 7u);
        EXPECT_NEAR(gravity->acceleration.norm() / 9.81, 1, 0.007) << density << " " << seed;
        sum += distance2(*gravity, {0, 0, -9.81});
      }
    }
  }
  EXPECT_GT(sum / count, 0.5);  // the mean of a chi-square of 3 is 3; lift is expected, and was none
  EXPECT_LT(sum / count, 4.5);
}

TEST(Flights, AreThoseOfThePath) {
  const Throwing throwing{.seed = 3};
  const ThrownPath path = thrown(throwing);
  const auto gravity = found(throwing, 0.2);
  ASSERT_TRUE(gravity);
  for (const Flight& flight : gravity->flights) {
    EXPECT_TRUE(std::ranges::any_of(path.flights,
                                    [&](const auto& of) {
                                      return flight.from_s > of.first - 0.01 && flight.to_s < of.second + 0.01 &&
                                             flight.to_s - flight.from_s > of.second - of.first - 0.15;
                                    }))
        << flight.from_s << " " << flight.to_s;
  }
}

TEST(Flights, NeedNoWorldWithZUp) {
  const Vector3d up = Vector3d(0.3, -0.2, 1).normalized();
  const auto gravity = found({.seed = 5, .up = up}, 0.2);
  ASSERT_TRUE(gravity);
  EXPECT_LT(std::acos(-gravity->acceleration.normalized().dot(up)) * 180 / std::numbers::pi, 0.3);
}

TEST(Flights, AKnownMassMakesThemSurer) {
  const Throwing throwing{.seed = 2, .density_kg_m3 = 350};
  FlightOptions options;
  options.density_kg_m3 = 350;
  const auto sigma = [](const Gravity& g) { return std::sqrt((g.by_priors + g.gain * g.gain.transpose())(2, 2)); };
  EXPECT_LT(sigma(*found(throwing, 0.2, options)), sigma(*found(throwing, 0.2)));
  EXPECT_NEAR(found(throwing, 0.2)->air_over_ball, 1.2 / 350, 0.002);
}

TEST(Flights, AWavedBallNeverFlies) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    EXPECT_FALSE(found({.seed = seed, .throws = 0, .waved_s = 14}, 0.1 + 0.05 * static_cast<double>(seed))) << seed;
}

TEST(Flights, OnTheEllipsoid) {
  EXPECT_NEAR(normal_gravity(0), 9.780325, 1e-6);
  EXPECT_NEAR(normal_gravity(45), 9.806198, 1e-6);
  EXPECT_NEAR(normal_gravity(-90), 9.832185, 1e-6);
}

}  // namespace
}  // namespace huetrack::wave
