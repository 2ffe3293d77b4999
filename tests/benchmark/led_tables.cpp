// led_tables [RUNS] [herranz] [leds|rate|noise|particles|room]...: the figures of Herranz et al. by simulation, the
// paper's beside ours, and beside both what could be known at all (see bound()).
//
// The paper simulates and measures (Table I: 1 px of noise, 90 fps, pi/2 rad/s, 5000 particles); what it leaves open is
// set here:
//   small scale   a camera of 640x480 and 80.85 degrees circles 8 LEDs in a box of 0.5 x 0.4 x 0.12 m at 0.38 m of
//   radius
//                 and 0.4 m of height, so that they fill half of the view, at pi/2 rad/s, looking at their middle; one
//                 LED is lit per frame, in turn. 4 LEDs: every second one.
//   room          5 x 5 x 2.5 m, LEDs at random places; the camera goes about smoothly at 0.5 m/s on the average and
//   turns at up
//                 to pi/2 rad/s; one LED per frame in turn, most of them out of view at a time.
// Every run has its own noise, LEDs and way. Errors are those of all frames with a pose after the first 2 s.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <numbers>
#include <random>
#include <span>

#include "benchmark/led_sequence.h"
#include "camera_tracking/leds/led_filter.h"

namespace {

using namespace huetrack;
using Eigen::Vector3d;

calib::Camera simulated_camera() {
  calib::Camera camera;
  camera.name = "cam";
  camera.image_size = {640, 480};
  const double f = 320 / std::tan(80.85 / 2 * std::numbers::pi / 180);
  camera.model = calib::CameraModel(calib::PinholeRadtan{.fx = f, .fy = f, .cx = 319.5, .cy = 239.5, .distortion = {}});
  return camera;
}

calib::Rigid3d looking_at(const Vector3d& from, const Vector3d& at) {
  const Vector3d z = (at - from).normalized(), x = z.cross(Vector3d::UnitZ()).normalized(), y = z.cross(x);
  Eigen::Matrix3d r;
  r << x, y, z;
  return {Eigen::Quaterniond(r).normalized(), from};
}

using Way = std::function<calib::Rigid3d(double)>;

Way circle(double rate) {
  return [rate](double t) {
    return looking_at({0.38 * std::cos(rate * t), 0.38 * std::sin(rate * t), 0.40}, {0, 0, 0.06});
  };
}

// A smooth random number: a sum of sines.
class Wave {
 public:
  Wave(double amplitude, std::mt19937_64& random) {
    std::uniform_real_distribution<double> unit(0, 1);
    for (std::size_t k = 0; k < sines_.size(); ++k) {
      const double rate = 0.5 * (0.25 + 0.5 * (static_cast<double>(k) + unit(random)));
      sines_[k] = {amplitude / (1.0 + static_cast<double>(k)), rate, 2 * std::numbers::pi * unit(random)};
    }
  }
  double operator()(double t) const {
    double sum = 0;
    for (const auto& s : sines_) sum += s.amplitude * std::sin(s.rate * t + s.phase);
    return sum;
  }

 private:
  struct Sine {
    double amplitude, rate, phase;
  };
  std::array<Sine, 3> sines_{};
};

Vector3d direction(double yaw, double pitch) {
  return {std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch)};
}

// The paper's first movement: between the middle of the room and one side of it, looking across the room.
Way towards_a_side(std::mt19937_64& random) {
  const Wave x(0.6, random), y(0.8, random), z(0.25, random), yaw(0.25, random), pitch(0.1, random);
  return [=](double t) {
    const Vector3d from(1.2 + x(t), 2.5 + y(t), 1.25 + z(t));
    return looking_at(from, from + direction(yaw(t), pitch(t)));
  };
}

// Its second one: all over the room, looking at what is in it.
Way all_over(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double turned = 2 * std::numbers::pi * unit(random);
  const Wave round(0.8, random), radius(0.4, random), z(0.25, random), yaw(0.2, random), pitch(0.1, random);
  return [=](double t) {
    const double where = turned + 0.25 * t + 0.5 * round(t);
    const Vector3d from(2.5 + (1.7 + radius(t)) * std::cos(where), 2.5 + (1.7 + radius(t)) * std::sin(where),
                        1.25 + z(t));
    return looking_at(from, from + direction(where + std::numbers::pi + yaw(t), pitch(t)));
  };
}

// Not in the paper: amid the LEDs, looking wherever.
Way turning_about(std::mt19937_64& random) {
  const Wave x(0.8, random), y(0.8, random), z(0.25, random), yaw(0.8, random), pitch(0.1, random);
  return [=](double t) {
    const Vector3d from(2.5 + x(t), 2.5 + y(t), 1.25 + z(t));
    return looking_at(from, from + direction(yaw(t), pitch(t)));
  };
}

struct Setting {
  std::vector<Vector3d> leds;
  Way way;
  double fps = 90, noise_px = 1, seconds = 6, warm_up_s = 2;
  int particles = 5000;
  Vector3d room_min{-2, -2, 0}, room_max{2, 2, 2};
  bool near_start =
      false;  // the paper's filter is told the first position, to 0.3 m: 5000 particles do not fill a room
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
  const calib::Camera camera = simulated_camera();
  leds::LedFilterOptions options;
  options.start.leds = setting.leds;
  options.start.room_min = setting.room_min;
  options.start.room_max = setting.room_max;
  options.particle_count = setting.particles;
  options.seed = seed;
  if (paper_filter) {
    options.pixel_noise_px = setting.noise_px;
    options.report_unproven = setting.near_start;
    if (setting.near_start) {
      const Vector3d start = setting.way(0).translation;
      options.start.room_min = start - Vector3d::Constant(0.3);
      options.start.room_max = start + Vector3d::Constant(0.3);
    }
  }
  const auto filter =
      paper_filter ? leds::LedFilter::paper(camera, options) : leds::LedFilter::huetrack(camera, options);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Errors errors;
  const int frames = static_cast<int>(setting.seconds * setting.fps);
  for (int i = 0; i < frames; ++i) {
    const double t = i / setting.fps;
    const calib::Rigid3d truth = setting.way(t);
    leds::LedFrame frame{.at = capture::Timestamp(capture::duration_of(t)),
                         .number = static_cast<std::uint64_t>(i),
                         .lit = static_cast<int>(static_cast<std::size_t>(i) % setting.leds.size()),
                         .dots = {}};
    const auto px = camera.model.project(calib::inverse(truth) * setting.leds[static_cast<std::size_t>(*frame.lit)]);
    if (px && camera.contains(*px)) {
      const double du = normal(random), dv = normal(random);
      frame.dots.push_back(px->px + setting.noise_px * Eigen::Vector2d(du, dv));
    }
    const camera_tracking::CameraEstimate e = filter->update(frame);
    if (t < setting.warm_up_s) continue;
    ++errors.frames;
    if (!e.world_from_camera.translation.allFinite()) continue;
    ++errors.poses;
    const figures::PoseError error = figures::pose_error(e.world_from_camera, truth);
    errors.wrong += e.state == camera_tracking::PoseState::tracking && (error.metres > 0.5 || error.degrees > 20);
    errors.mm.push_back(1e3 * error.metres);
    errors.deg.push_back(error.degrees);
  }
  return errors;
}

// ---- What could be known at all: the posterior Cramer-Rao bound (Tichavsky et al. 1998), linearised at the truth, of
// somebody who knows the noise of the pixels and how lively this way is (acceleration: rms and correlation time of the
// way itself, as LedMotionNoise), but not the way.

leds::LedMotionState motion_at(const Way& way, double t) {
  constexpr double h = 1e-3;
  const auto rates = [&](double at) {
    return calib::Tangent6d(calib::log(calib::inverse(way(at - h)) * way(at + h)) / (2 * h));
  };
  const calib::Tangent6d now = rates(t), change = (rates(t + h) - rates(t - h)) / (2 * h);
  return {way(t), now.tail<3>(), now.head<3>(), change.tail<3>(), change.head<3>()};
}

leds::LedMotionNoise liveliness(const Way& way, double seconds) {
  constexpr double step = 0.05;
  double linear = 0, angular = 0, lagged = 0, all = 0;
  constexpr int lag = 4;
  std::vector<Vector3d> a;
  int n = 0;
  for (double t = 0; t < seconds; t += step, ++n) {
    const leds::LedMotionState s = motion_at(way, t);
    linear += s.acceleration.squaredNorm() / 3, angular += s.angular_acceleration.squaredNorm() / 3;
    a.push_back(s.acceleration);
    all += a.back().squaredNorm();
    if (n >= lag) lagged += a.back().dot(a[static_cast<std::size_t>(n - lag)]);
  }
  const double kept = std::clamp(lagged / all * n / (n - lag), 0.05, 0.95);
  return {std::max(1e-3, std::sqrt(linear / n)), std::max(1e-3, std::sqrt(angular / n)), -lag * step / std::log(kept)};
}

Errors bound(const Setting& setting, std::uint64_t seed) {
  const calib::Camera camera = simulated_camera();
  const leds::LedMotionNoise noise = liveliness(setting.way, setting.seconds);
  leds::LedTangent open;
  open << Vector3d::Constant(2), Vector3d::Constant(2), Vector3d::Constant(1.5), Vector3d::Constant(1.5),
      Vector3d::Constant(noise.acceleration), Vector3d::Constant(noise.angular_acceleration);
  leds::LedGaussian state{motion_at(setting.way, 0), leds::LedCovariance(open.cwiseAbs2().asDiagonal())};
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Errors errors;
  const int frames = static_cast<int>(setting.seconds * setting.fps);
  for (int i = 0; i < frames; ++i) {
    const double t = i / setting.fps;
    if (i > 0) state = leds::predicted(state, 1 / setting.fps, noise);
    state.mean = motion_at(setting.way, t);
    const Vector3d& led = setting.leds[static_cast<std::size_t>(i) % setting.leds.size()];
    leds::LedJacobian j;
    const auto px = leds::led_pixel(camera.model, state.mean, led, 0, &j);
    if (px && camera.contains(calib::RawPixel{*px})) {
      const Eigen::Matrix2d spread =
          j * state.covariance * j.transpose() + setting.noise_px * setting.noise_px * Eigen::Matrix2d::Identity();
      const Eigen::Matrix<double, leds::led_dimensions, 2> gain = state.covariance * j.transpose() * spread.inverse();
      state.covariance -= (gain * j * state.covariance).eval();
      state.covariance = 0.5 * (state.covariance + state.covariance.transpose()).eval();
    }
    if (t < setting.warm_up_s) continue;
    for (int k = 0; k < 4; ++k) {  // errors as they would be
      leds::LedTangent z;
      for (double& x : z) x = normal(random);
      const leds::LedTangent e = state.covariance.llt().matrixL() * z;
      errors.mm.push_back(1e3 * e.head<3>().norm());
      errors.deg.push_back(e.segment<3>(3).norm() * 180 / std::numbers::pi);
    }
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

int beaten = 0, missed = 0, impossible = 0;
void row(const char* what, double paper, double ours, double least) {
  const bool good = ours <= paper / 2, possible = least <= paper / 2;
  (good ? beaten : possible ? missed : impossible) += 1;
  std::printf("  %-40s %8.2f %8.2f %7.1fx %8.2f %7.1fx %9.0f %%%s\n", what, paper, ours, paper / ours, least,
              paper / least, 100 * least / ours,
              good       ? ""
              : possible ? "   NOT twice as good"
                         : "   not twice as good: more than the pixels tell");
}
void rows(const std::string& what, double paper_mm, double paper_deg, const Errors& ours, const Errors& least) {
  row((what + ": position [mm]").c_str(), paper_mm, quantile(ours.mm, 0.9), quantile(least.mm, 0.9));
  row((what + ": angle [deg]").c_str(), paper_deg, quantile(ours.deg, 0.9), quantile(least.deg, 0.9));
}
void info(const Errors& e) {
  std::printf("    %d frames, %.1f %% with a pose; %d wrong ones\n", e.frames,
              e.frames > 0 ? 100.0 * e.poses / e.frames : 0.0, e.wrong);
}

template <typename Simulation>
Errors repeat(Simulation&& simulation, const Setting& setting, int runs) {
  Errors all;
  for (int r = 0; r < runs; ++r) all.add(simulation(setting, static_cast<std::uint64_t>(r) + 1));
  return all;
}

const double rate = std::numbers::pi / 2;

void number_of_leds(int runs) {
  std::printf("Number of LEDs (Fig. 3)\n");
  for (const auto& [count, mm, deg] : {std::tuple{std::size_t{4}, 22.93, 2.85}, {std::size_t{8}, 9.12, 1.71}}) {
    const Setting setting{.leds = small_cluster(count), .way = circle(rate)};
    const Errors e = repeat(simulate, setting, runs);
    rows(std::to_string(count) + " LEDs", mm, deg, e, bound(setting, 1));
    info(e);
  }
  Setting three{.leds = small_cluster(8), .way = circle(rate)};
  three.leds.resize(3);
  const Errors e = repeat(simulate, three, runs);
  std::printf("  3 LEDs: never a pose, as in the paper: %s (%d of %d frames)\n", e.poses == 0 ? "yes" : "NO", e.poses,
              e.frames);
}

void frame_rate(int runs) {
  std::printf("Frame rate (Fig. 4)\n");
  for (const auto& [fps, mm, deg] : {std::tuple{30.0, 31.2, 10.8}, {300.0, 6.03, 0.5}}) {
    const Setting setting{.leds = small_cluster(8), .way = circle(rate), .fps = fps};
    const Errors e = repeat(simulate, setting, runs);
    rows(std::to_string(static_cast<int>(fps)) + " fps", mm, deg, e, bound(setting, 1));
    info(e);
  }
}

void measurement_noise(int runs) {
  std::printf("Measurement noise (Fig. 5; the paper gives no numbers but that of 1 px above)\n");
  for (const double noise : {0.25, 0.5, 1.0, 2.0, 4.0}) {
    const Setting setting{.leds = small_cluster(8), .way = circle(rate), .noise_px = noise};
    const Errors e = repeat(simulate, setting, runs), least = bound(setting, 1);
    std::printf("  %.2f px: %.2f mm, %.2f deg (at least %.2f, %.2f: %.0f %% and %.0f %% efficient)\n", noise,
                quantile(e.mm, 0.9), quantile(e.deg, 0.9), quantile(least.mm, 0.9), quantile(least.deg, 0.9),
                100 * quantile(least.mm, 0.9) / quantile(e.mm, 0.9),
                100 * quantile(least.deg, 0.9) / quantile(e.deg, 0.9));
    info(e);
  }
}

void particle_count(int runs) {
  std::printf("Table II: particles (the paper: measured data, their noise is not given)\n");
  for (const auto& [particles, mm, deg] :
       {std::tuple{1000, 13.0, 3.25}, {5000, 6.65, 2.25}, {10000, 6.4, 1.6}, {20000, 5.0, 1.55}}) {
    for (const double noise : {1.0, 0.5}) {
      const Setting setting{.leds = small_cluster(8), .way = circle(rate), .noise_px = noise, .particles = particles};
      const Errors e = repeat(simulate, setting, std::max(1, runs / 2));
      rows(std::to_string(particles) + (noise < 1 ? " particles, 0.5 px" : " particles, 1 px"), mm, deg, e,
           bound(setting, 1));
    }
  }
}

Setting in_the_room(int leds, const Way& way, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  Setting setting{.leds = {},
                  .way = way,
                  .seconds = 12,
                  .warm_up_s = 3,
                  .room_min = {0, 0, 0},
                  .room_max = {5, 5, 2.5},
                  .near_start = true};
  for (int l = 0; l < leds; ++l) {
    const double x = unit(random), y = unit(random), z = unit(random);
    setting.leds.emplace_back(5 * x, 5 * y, 2.5 * z);
  }
  return setting;
}

// Mean number of LEDs that project into the image.
double in_view(const Setting& setting) {
  const calib::Camera camera = simulated_camera();
  double sum = 0;
  constexpr int steps = 100;
  for (int k = 0; k < steps; ++k) {
    const calib::Rigid3d camera_from_world = calib::inverse(setting.way(setting.seconds * k / steps));
    sum += static_cast<double>(std::ranges::count_if(setting.leds, [&](const Vector3d& led) {
      const auto px = camera.model.project(camera_from_world * led);
      return px && camera.contains(*px);
    }));
  }
  return sum / steps;
}

void room(int runs) {
  std::printf("Table III: a room of 5 x 5 m, by number of LEDs in it; both movements\n");
  const auto run = [runs](int count, std::span<Way (*const)(std::mt19937_64&)> ways, Errors& e, Errors& least) {
    double seen = 0;
    for (int r = 0; r < 2 * runs; ++r) {
      std::mt19937_64 random(static_cast<std::uint64_t>(1000 + r));
      const Way way = ways[static_cast<std::size_t>(r) % ways.size()](random);
      const Setting setting = in_the_room(count, way, random);
      e.add(simulate(setting, static_cast<std::uint64_t>(r) + 1));
      least.add(bound(setting, static_cast<std::uint64_t>(r) + 1));
      seen += in_view(setting) / (2 * runs);
    }
    return seen;
  };
  for (const auto& [count, mm50, mm90, deg50, deg90] :
       {std::tuple{30, 21.5, 61.8, 1.85, 5.78}, {20, 37.8, 83.5, 2.14, 7.53}, {10, 67.4, 172.95, 3.09, 11.05}}) {
    Errors e, least;
    constexpr std::array ways{towards_a_side, all_over};
    const double seen = run(count, ways, e, least);
    const std::string leds = std::to_string(count) + " LEDs: ";
    row((leds + "50 % position [mm]").c_str(), mm50, quantile(e.mm, 0.5), quantile(least.mm, 0.5));
    row((leds + "90 % position [mm]").c_str(), mm90, quantile(e.mm, 0.9), quantile(least.mm, 0.9));
    row((leds + "50 % angle [deg]").c_str(), deg50, quantile(e.deg, 0.5), quantile(least.deg, 0.5));
    row((leds + "90 % angle [deg]").c_str(), deg90, quantile(e.deg, 0.9), quantile(least.deg, 0.9));
    std::printf("    %.1f LEDs in view;", seen);
    info(e);
  }
  std::printf("Harder than the paper's: amid the LEDs, looking wherever, so that few are in view\n");
  for (const int count : {30, 20, 10}) {
    Errors e, least;
    constexpr std::array ways{turning_about};
    const double seen = run(count, ways, e, least);
    std::printf(
        "  %d LEDs, %.1f in view: 50 %% %.1f mm, %.2f deg; 90 %% %.1f mm, %.2f deg (at least %.1f, %.2f; %.1f, %.2f)\n",
        count, seen, quantile(e.mm, 0.5), quantile(e.deg, 0.5), quantile(e.mm, 0.9), quantile(e.deg, 0.9),
        quantile(least.mm, 0.5), quantile(least.deg, 0.5), quantile(least.mm, 0.9), quantile(least.deg, 0.9));
    info(e);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  struct Table {
    const char* name;
    void (*print)(int runs);
  };
  const Table tables[] = {{"leds", number_of_leds},
                          {"rate", frame_rate},
                          {"noise", measurement_noise},
                          {"particles", particle_count},
                          {"room", room}};
  int runs = 4;
  std::vector<Table> chosen;
  for (int i = 1; i < argc; ++i) {
    const auto table = std::ranges::find_if(tables, [&](const Table& t) { return std::strcmp(t.name, argv[i]) == 0; });
    if (table != std::end(tables)) {
      chosen.push_back(*table);
    } else if (std::strcmp(argv[i], "herranz") == 0) {
      paper_filter = true;
    } else if (runs = std::atoi(argv[i]); runs < 1) {
      std::fprintf(stderr, "led_tables: '%s' is no number of runs, nor herranz, leds, rate, noise, particles, room\n",
                   argv[i]);
      return 1;
    }
  }
  if (chosen.empty()) chosen.assign(std::begin(tables), std::end(tables));
  std::printf("%s filter, %d runs; Table I: 1 px, 90 fps, pi/2 rad/s, 5000 particles; 90th percentiles unless said\n",
              paper_filter ? "the paper's" : "our", runs);
  std::printf("  %-40s %8s %8s %8s %8s %8s %11s\n", "", "paper", "here", "ratio", "at least", "ratio", "efficiency");
  for (const Table& table : chosen) table.print(runs);
  std::printf("%d of %d entries are at least twice as good as the paper's", beaten, beaten + missed + impossible);
  if (impossible > 0)
    std::printf("; %d cannot be: by the Cramer-Rao bound (\"at least\") no estimator gets there", impossible);
  std::printf("%s\n", missed > 0 ? "; the others fall short" : "");
  return !paper_filter && missed > 0;
}
