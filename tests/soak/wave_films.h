// What cameras see where a ball is all that the user has: it is waved through the room for some seconds, and
// then thrown some times, on a closed path. A folder with CAMERA.yuyv of three webcams 50 to 70 degrees wide, and with
// the truth: rig.yaml, and ball.csv (t, x, y, z: seconds and metres, one round of the path).
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <vector>

#include "soak/films.h"

namespace huetrack::soak {

inline constexpr int wave_fps = 20;
inline constexpr double wave_ball_radius_m = 0.05;

// A moment of a path; between two of them it is the polynomial of degree 5 that has both. That of two moments of a free
// flight is the flight.
struct PathKnot {
  double t_s = 0;
  Eigen::Vector3d p, v, a;
};

inline Eigen::Vector3d between(const PathKnot& from, const PathKnot& to, double t_s) {
  const double T = to.t_s - from.t_s, s = (t_s - from.t_s) / T;
  const Eigen::Vector3d v0 = T * from.v, v1 = T * to.v, a0 = T * T * from.a, a1 = T * T * to.a, d = to.p - from.p;
  const Eigen::Vector3d c3 = 10 * d - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
                        c4 = -15 * d + 8 * v0 + 7 * v1 + 1.5 * a0 - a1, c5 = 6 * d - 3 * (v0 + v1) - 0.5 * (a0 - a1);
  return from.p + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))));
}

// Ends where it begins.
inline std::vector<PathKnot> wave_with_throws(int throws) {
  constexpr double waved_s = 7.2, apart_s = 0.3, turn_s = 0.6, flight_s = 0.6, g = 9.81;
  std::vector<PathKnot> knots;
  for (double t = 0; t < waved_s; t += apart_s) {
    PathKnot& knot = knots.emplace_back(PathKnot{t, {}, {}, {}});
    constexpr double turns[] = {3, 2, 5}, reach[] = {0.6, 0.6, 0.45};
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double w = 2 * std::numbers::pi * turns[i] / waved_s, phase = w * t + double(i);
      knot.p[i] = reach[i] * std::sin(phase);
      knot.v[i] = reach[i] * w * std::cos(phase);
      knot.a[i] = -reach[i] * w * w * std::sin(phase);
    }
    knot.p.z() += 1;
  }
  for (int i = 0; i < throws; ++i) {
    const double angle = 2.4 * i;  // radians: in all directions
    const Eigen::Vector3d across(std::cos(angle), std::sin(angle), 0), fall(0, 0, -g);
    const PathKnot thrown{knots.back().t_s + turn_s, Eigen::Vector3d(0, 0, 0.8) - 0.4 * across,
                          0.8 / flight_s * across - flight_s / 2 * fall, fall};
    knots.push_back(thrown);
    knots.push_back({thrown.t_s + flight_s, thrown.p + flight_s * thrown.v + flight_s * flight_s / 2 * fall,
                     thrown.v + flight_s * fall, fall});
  }
  PathKnot last = knots.front();
  last.t_s = knots.back().t_s + turn_s;
  knots.push_back(last);
  return knots;
}

inline void make_wave_films(const std::filesystem::path& folder, int throws) {
  const std::vector<PathKnot> knots = wave_with_throws(throws);
  const double round_s = knots.back().t_s;
  scene::BallOptions ball{.radius_m = wave_ball_radius_m};
  ball.path = [knots, round_s](double t_s) {
    const double t = std::fmod(t_s, round_s);
    std::size_t k = 1;
    while (knots[k].t_s < t) ++k;
    return between(knots[k - 1], knots[k], t);
  };
  scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3, .radius_m = 2.1}).ball(ball).build();
  const double widths_deg[] = {70, 62, 52};
  for (std::size_t c = 0; c < scene.rig.cameras.size(); ++c) {
    calib::Camera& camera = scene.rig.cameras[c];
    auto lens = std::get<calib::PinholeRadtan>(camera.model.lens());
    lens.fx = lens.fy = 0.5 * camera.image_size.width / std::tan(widths_deg[c] * std::numbers::pi / 360);
    camera.model = calib::CameraModel(lens);
  }
  write_films(folder, scene, {.set_count = int(std::lround(round_s * wave_fps)), .fps = wave_fps});
  std::ofstream truth(folder / "ball.csv");
  constexpr double step_s = 0.005;
  for (double t = 0; t < round_s; t += step_s)
    truth << t << ',' << ball.path(t).x() << ',' << ball.path(t).y() << ',' << ball.path(t).z() << '\n';
}

}  // namespace huetrack::soak
