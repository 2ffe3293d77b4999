// led_tables [RUNS] [herranz]: the figures of Herranz et al. by simulation, the paper's beside ours.
//
// The paper simulates and measures (Table I: 1 px of noise, 90 fps, pi/2 rad/s, 5000 particles); what it leaves open is
// set here:
//   small scale   a camera of 640x480 and 80.85 degrees circles 8 LEDs in a box of 0.5 x 0.4 x 0.12 m at 0.38 m of radius
//                 and 0.4 m of height, so that they fill half of the view, at pi/2 rad/s, looking at their middle; one LED
//                 is lit per frame, in turn. 4 LEDs: every second one.
//   room          5 x 5 x 2.5 m, LEDs at random places; the camera goes about smoothly at 0.5 m/s on the average and
//   turns at up
//                 to pi/2 rad/s; one LED per frame in turn, most of them out of view at a time.
// Every run has its own noise, LEDs and way. Errors are those of all frames with a pose after the first 2 s.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <numbers>
#include <random>

#include "benchmark/led_sequence.h"
#include "camera_tracking/led_filter.h"

namespace {

using namespace huetrack;
using Eigen::Vector3d;

Camera simulated_camera() {
  Camera camera;
  camera.name = "cam";
  camera.image_size = {640, 480};
  const double f = 320 / std::tan(80.85 / 2 * std::numbers::pi / 180);
  camera.model = CameraModel(PinholeRadtan{.fx = f, .fy = f, .cx = 319.5, .cy = 239.5, .distortion = {}});
  return camera;
}

Rigid3d looking_at(const Vector3d& from, const Vector3d& at) {
  const Vector3d z = (at - from).normalized(), x = z.cross(Vector3d::UnitZ()).normalized(), y = z.cross(x);
  Eigen::Matrix3d r;
  r << x, y, z;
  return {Eigen::Quaterniond(r).normalized(), from};
}

using Way = std::function<Rigid3d(double)>;

Way circle(double rate) {
  return [rate](double t) {
    return looking_at({0.38 * std::cos(rate * t), 0.38 * std::sin(rate * t), 0.40}, {0, 0, 0.06});
  };
}

// A smooth random way: sums of sines in position and in where it looks.
Way wander(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  struct Wave {
    double amplitude, rate, phase;
  };
  std::array<std::array<Wave, 3>, 5> waves{};
  for (std::size_t axis = 0; axis < waves.size(); ++axis)
    for (std::size_t k = 0; k < 3; ++k)
      waves[axis][k] = {(axis < 2    ? 0.8
                         : axis == 2 ? 0.25
                         : axis == 3 ? 0.8
                                     : 0.1) /
                            (1.0 + static_cast<double>(k)),
                        0.25 + 0.5 * (static_cast<double>(k) + unit(random)), 2 * std::numbers::pi * unit(random)};
  return [waves](double t) {
    std::array<double, 5> at{};
    for (std::size_t axis = 0; axis < waves.size(); ++axis)
      for (const auto& w : waves[axis]) at[axis] += w.amplitude * std::sin(w.rate * t + w.phase);
    const Vector3d from(2.5 + at[0], 2.5 + at[1], 1.25 + at[2]);
    const double yaw = at[3], pitch = at[4];
    return looking_at(
        from, from + Vector3d(std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch)));
  };
}

struct Setting {
  std::vector<Vector3d> leds;
  Way way;
  double fps = 90, noise_px = 1, seconds = 6, warm_up_s = 2;
  int particles = 5000;
  Vector3d room_min{-2, -2, 0}, room_max{2, 2, 2};
};

struct Errors {
  std::vector<double> mm, deg;
  int frames = 0, poses = 0,
      wrong = 0;  // after the warm-up; wrong: said to be tracking, and off by over 0.5 m or 20 degrees

  void add(const Errors& other) {
    mm.insert(mm.end(), other.mm.begin(), other.mm.end());
    deg.insert(deg.end(), other.deg.begin(), other.deg.end());
    frames += other.frames, poses += other.poses, wrong += other.wrong;
  }
};

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

bool paper_filter = false;

Errors simulate(const Setting& setting, std::uint64_t seed) {
  const Camera camera = simulated_camera();
  LedFilterOptions options;
  options.start.leds = setting.leds;
  options.start.room_min = setting.room_min;
  options.start.room_max = setting.room_max;
  options.particle_count = setting.particles;
  options.seed = seed;
  if (paper_filter) options.pixel_noise_px = setting.noise_px;
  const auto filter = paper_filter ? LedFilter::paper(camera, options) : LedFilter::huetrack(camera, options);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Errors errors;
  const int frames = static_cast<int>(setting.seconds * setting.fps);
  for (int i = 0; i < frames; ++i) {
    const double t = i / setting.fps;
    const Rigid3d truth = setting.way(t);
    LedFrame frame{.at = Timestamp(duration_of(t)),
                   .number = static_cast<std::uint64_t>(i),
                   .lit = static_cast<int>(static_cast<std::size_t>(i) % setting.leds.size()),
                   .dots = {}};
    const auto px = camera.model.project(inverse(truth) * setting.leds[static_cast<std::size_t>(*frame.lit)]);
    if (px && camera.contains(*px)) {
      const double du = normal(random), dv = normal(random);
      frame.dots.push_back(px->px + setting.noise_px * Eigen::Vector2d(du, dv));
    }
    const CameraEstimate e = filter->update(frame);
    if (t < setting.warm_up_s) continue;
    ++errors.frames;
    if (!e.has_pose()) continue;
    ++errors.poses;
    const PoseError error = pose_error(e.world_from_camera, truth);
    errors.wrong += e.state == CameraState::tracking && (error.metres > 0.5 || error.degrees > 20);
    errors.mm.push_back(1e3 * error.metres);
    errors.deg.push_back(error.degrees);
  }
  return errors;
}

std::vector<Vector3d> small_cluster(std::size_t count) {
  const std::vector<Vector3d> all{{-0.22, -0.20, 0.05}, {0.04, -0.19, 0.02}, {0.24, -0.18, 0.12}, {0.20, 0.03, 0.04},
                                  {0.25, 0.18, 0.09},   {-0.04, 0.21, 0.03}, {-0.24, 0.15, 0.14}, {-0.18, -0.02, 0.07}};
  if (count == all.size()) return all;
  std::vector<Vector3d> some;
  for (std::size_t i = 0; i < all.size(); i += all.size() / count) some.push_back(all[i]);
  return some;
}

int beaten = 0, missed = 0;
void row(const char* what, double paper, double ours) {
  const bool good = ours <= paper / 2;
  (good ? beaten : missed) += 1;
  std::printf("  %-46s %9.2f %9.2f %7.1fx%s\n", what, paper, ours, paper / ours, good ? "" : "   not twice as good");
}
void info(const Errors& e) {
  std::printf("    %d frames, %.1f %% with a pose; %d wrong ones\n", e.frames,
              e.frames > 0 ? 100.0 * e.poses / e.frames : 0.0, e.wrong);
}

Errors repeat(const Setting& setting, int runs) {
  Errors all;
  for (int r = 0; r < runs; ++r) all.add(simulate(setting, static_cast<std::uint64_t>(r) + 1));
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  int runs = 4;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "herranz") == 0)
      paper_filter = true;
    else
      runs = std::max(1, std::atoi(argv[i]));
  }
  std::printf("%s filter, %d runs; Table I: 1 px, 90 fps, pi/2 rad/s, 5000 particles; 90th percentiles unless said\n",
              paper_filter ? "the paper's" : "our", runs);
  std::printf("  %-46s %9s %9s %8s\n", "", "paper", "here", "ratio");
  const double rate = std::numbers::pi / 2;
  char text[80];

  std::printf("Number of LEDs (Fig. 3)\n");
  for (const auto& [count, mm, deg] : {std::tuple{std::size_t{4}, 22.93, 2.85}, {std::size_t{8}, 9.12, 1.71}}) {
    const Errors e = repeat({.leds = small_cluster(count), .way = circle(rate)}, runs);
    std::snprintf(text, sizeof text, "%zu LEDs: position [mm]", count);
    row(text, mm, quantile(e.mm, 0.9));
    std::snprintf(text, sizeof text, "%zu LEDs: angle [deg]", count);
    row(text, deg, quantile(e.deg, 0.9));
    info(e);
  }
  {
    Setting three{.leds = small_cluster(8), .way = circle(rate)};
    three.leds.resize(3);
    const Errors e = repeat(three, runs);
    std::printf("  3 LEDs: never a pose, as in the paper: %s (%d of %d frames)\n", e.poses == 0 ? "yes" : "NO", e.poses,
                e.frames);
  }

  std::printf("Frame rate (Fig. 4)\n");
  for (const auto& [fps, mm, deg] : {std::tuple{30.0, 31.2, 10.8}, {300.0, 6.03, 0.5}}) {
    const Errors e = repeat({.leds = small_cluster(8), .way = circle(rate), .fps = fps}, runs);
    std::snprintf(text, sizeof text, "%.0f fps: position [mm]", fps);
    row(text, mm, quantile(e.mm, 0.9));
    std::snprintf(text, sizeof text, "%.0f fps: angle [deg]", fps);
    row(text, deg, quantile(e.deg, 0.9));
    info(e);
  }

  std::printf("Measurement noise (Fig. 5; the paper gives no numbers but that of 1 px above)\n");
  for (const double noise : {0.25, 0.5, 1.0, 2.0, 4.0}) {
    const Errors e = repeat({.leds = small_cluster(8), .way = circle(rate), .noise_px = noise}, runs);
    std::printf("  %.2f px: %.2f mm, %.2f deg\n", noise, quantile(e.mm, 0.9), quantile(e.deg, 0.9));
    info(e);
  }

  std::printf("Table II: particles (the paper: measured data, their noise is not given)\n");
  for (const auto& [particles, mm, deg] :
       {std::tuple{1000, 13.0, 3.25}, {5000, 6.65, 2.25}, {10000, 6.4, 1.6}, {20000, 5.0, 1.55}}) {
    for (const double noise : {1.0, 0.5}) {
      const Errors e =
          repeat({.leds = small_cluster(8), .way = circle(rate), .noise_px = noise, .particles = particles},
                 std::max(1, runs / 2));
      std::snprintf(text, sizeof text, "%d particles, %.1f px: position [mm]", particles, noise);
      row(text, mm, quantile(e.mm, 0.9));
      std::snprintf(text, sizeof text, "%d particles, %.1f px: angle [deg]", particles, noise);
      row(text, deg, quantile(e.deg, 0.9));
    }
  }

  std::printf("Table III: a room of 5 x 5 m, by number of LEDs in it\n");
  for (const auto& [count, mm50, mm90, deg50, deg90] :
       {std::tuple{30, 21.5, 61.8, 1.85, 5.78}, {20, 37.8, 83.5, 2.14, 7.53}, {10, 67.4, 172.95, 3.09, 11.05}}) {
    Errors e;
    for (int r = 0; r < 2 * runs; ++r) {
      std::mt19937_64 random(static_cast<std::uint64_t>(1000 + r));
      std::uniform_real_distribution<double> unit(0, 1);
      Setting setting{.leds = {},
                      .way = wander(random),
                      .seconds = 12,
                      .warm_up_s = 3,
                      .room_min = {0, 0, 0},
                      .room_max = {5, 5, 2.5}};
      for (int l = 0; l < count; ++l) {
        const double x = unit(random), y = unit(random), z = unit(random);
        setting.leds.emplace_back(5 * x, 5 * y, 2.5 * z);
      }
      e.add(simulate(setting, static_cast<std::uint64_t>(r) + 1));
    }
    for (const auto& [what, paper, ours] : {std::tuple{"50 % position [mm]", mm50, quantile(e.mm, 0.5)},
                                            {"90 % position [mm]", mm90, quantile(e.mm, 0.9)},
                                            {"50 % angle [deg]", deg50, quantile(e.deg, 0.5)},
                                            {"90 % angle [deg]", deg90, quantile(e.deg, 0.9)}}) {
      std::snprintf(text, sizeof text, "%d LEDs: %s", count, what);
      row(text, paper, ours);
    }
    info(e);
  }
  std::printf("%d of %d entries are at least twice as good as the paper's\n", beaten, beaten + missed);
  return 0;
}
