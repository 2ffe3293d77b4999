// What `huetrack-calibrate wave` makes of rendered sequences with exact truth, from camera poses that are wrong by 10
// cm and 3 degrees, for many seeds, and from no poses at all:   build/release/tests/benchmark/wave_figures [seeds] Exit
// status 1 when a figure misses what it must reach.
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numbers>
#include <random>
#include <string_view>

#include "benchmark/rig_figures.h"
#include "benchmark/sequence.h"
#include "calib/report/advice.h"
#include "calib/report/wave_report.h"
#include "calib/wave/wave.h"
#include "calib/wave/wave_adjustment.h"
#include "drawn.h"

using namespace huetrack;

namespace {

bool all_reached = true;

Eigen::Vector3d direction(std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  return drawn<3>(rng, normal).normalized();
}

calib::CameraRig spoilt(const calib::CameraRig& truth, double metres, double degrees, std::uint64_t seed) {
  calib::CameraRig rig = truth;
  std::mt19937_64 rng(seed);
  for (calib::Camera& camera : rig.cameras) {
    const Eigen::Vector3d centre = camera.centre() + metres * direction(rng);
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(degrees * std::numbers::pi / 180, direction(rng)));
    camera.cam_from_world.rotation = (turn * camera.cam_from_world.rotation).normalized();
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
  }
  return rig;
}

// How far the outlines are from where the truth has them, of balls wholly in view: per axis, rms; pixels.
double outline_noise(const figures::Sequence& sequence, const object_tracking::TargetOptions& target,
                     const std::vector<wave::BallFrame>& frames) {
  std::vector<double> off2;
  std::vector<std::vector<std::pair<double, Eigen::Vector2d>>> errors(sequence.rig.cameras.size());
  std::vector<Eigen::Vector2d> sum(sequence.rig.cameras.size(), Eigen::Vector2d::Zero());
  std::vector<int> count(sequence.rig.cameras.size(), 0);
  for (const wave::BallFrame& frame : frames) {
    const std::optional<figures::TruthRow> row =
        sequence.row(target.name, capture::Timestamp(capture::duration_of(frame.t_s)));
    const auto c = static_cast<std::size_t>(frame.camera);
    if (!row || row->visible[c] < 0.99) continue;
    const calib::Camera& camera = sequence.rig.cameras[c];
    const auto px = wave::outline_centre(camera.model, camera.cam_from_world * row->position, target.radius_m);
    if (!px) continue;
    for (const color::ColorRegion& region : frame.regions) {
      const Eigen::Vector2d off = region.centre - *px;
      if (off.norm() > 3) continue;
      off2.push_back(off.squaredNorm() / 2);
      errors[c].emplace_back(frame.t_s, off);
      sum[c] += off;
      ++count[c];
      break;
    }
  }
  double all = 0;
  for (const double o : off2) all += o / static_cast<double>(off2.size());
  std::printf("  %s: %zu outlines wholly in view, %.3f px rms per axis from the truth; bias per camera",
              target.name.c_str(), off2.size(), std::sqrt(all));
  for (std::size_t c = 0; c < count.size(); ++c) {
    if (count[c] > 0) std::printf("  %+.3f %+.3f", sum[c].x() / count[c], sum[c].y() / count[c]);
  }
  // How like the errors at one time are to those some time later: not at all, were they independent.
  std::printf("\n   ");
  for (const double later_s : {0.033, 0.067, 0.133, 0.267, 0.533, 1.067, 2.133}) {
    double product = 0;
    int pairs = 0;
    for (const auto& of_camera : errors) {
      for (const auto& [t, off] : of_camera) {
        for (const auto& [u, other] : of_camera) {
          if (std::abs(u - t - later_s) > 0.01) continue;
          product += off.dot(other) / 2;
          ++pairs;
        }
      }
    }
    if (pairs > 20) std::printf(" %.2f after %.3f s,", product / pairs / all, later_s);
  }
  std::printf(" correlated\n");
  return std::sqrt(all);
}

// What such outlines allow at best (Cramer-Rao): the figures of rigs that are wrong as the covariance of the adjustment
// says, for independent noise in every frame in which half the ball or more is in view; the true path, the scale exact.
void print_bound(const figures::Sequence& sequence, const std::vector<object_tracking::TargetOptions>& targets,
                 double noise_px) {
  std::vector<wave::BallObservation> observations;
  std::vector<std::pair<double, Eigen::Vector3d>> path;
  wave::WaveState state;
  for (const calib::Camera& camera : sequence.rig.cameras) state.cam_from_world.push_back(camera.cam_from_world);
  double later = 0, step = 1;
  for (const object_tracking::TargetOptions& target : targets) {
    double last = -1;
    for (const figures::TruthRow& row : sequence.truth.at(target.name)) {
      const double t = capture::seconds(row.at);
      if (last >= 0) step = std::min(step, t - last);
      last = t;
      path.emplace_back(t + later, row.position);
      for (std::size_t c = 0; c < sequence.rig.cameras.size(); ++c) {
        const calib::Camera& camera = sequence.rig.cameras[c];
        const auto px = wave::outline_centre(camera.model, camera.cam_from_world * row.position, target.radius_m);
        if (row.visible[c] < 0.5 || !px || sequence.rig.cameras.empty()) continue;
        observations.push_back(
            {static_cast<int>(c), t + later, *px, noise_px * noise_px * Eigen::Matrix2d::Identity()});
      }
    }
    later += last + 2;
  }
  state.path = wave::BallPath::over(path.front().first, path.back().first, step);
  for (std::size_t k = 0; k < state.path.control.size(); ++k) {
    const double t = state.path.start_s + (static_cast<double>(k) - 1) * step;
    state.path.control[k] =
        std::ranges::min_element(path, {}, [t](const auto& p) { return std::abs(p.first - t); })->second;
  }
  wave::WaveAdjustmentOptions options;
  options.radius_m = targets.front().radius_m;
  options.loss = 1000;
  options.correlation = {.constant_share = 0, .slow_share = 0};
  options.with_covariance = true;
  const wave::WaveFit fit = wave::adjust_wave(sequence.rig, observations, state, options);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(fit.covariance);
  std::mt19937_64 rng(1);
  std::normal_distribution<double> normal;
  constexpr int samples = 60;
  double volume2 = 0, centre2 = 0;
  for (int i = 0; i < samples; ++i) {
    Eigen::VectorXd error(fit.covariance.rows());
    for (double& e : error) e = normal(rng);
    error = axes.eigenvectors() * axes.eigenvalues().cwiseMax(0).cwiseSqrt().cwiseProduct(error);
    calib::CameraRig rig = sequence.rig;
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      calib::Rigid3d& pose = rig.cameras[c].cam_from_world;
      const Eigen::Vector3d centre = rig.cameras[c].centre() + error.segment<3>(6 * static_cast<Eigen::Index>(c));
      const Eigen::Vector3d turn = error.segment<3>(6 * static_cast<Eigen::Index>(c) + 3);
      if (turn.norm() > 0)
        pose.rotation = pose.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
      pose.translation = -(pose.rotation * centre);
    }
    const figures::RigFigures f = figures::compare(sequence.rig, rig, {});
    volume2 += f.volume_m * f.volume_m / samples;
    centre2 += f.centre_m * f.centre_m / samples;
  }
  std::printf(
      "  bound: independent noise of %.3f px allows centres (worst camera) of %.2f mm, the volume %.2f mm rms\n",
      noise_px, 1e3 * std::sqrt(centre2), 1e3 * std::sqrt(volume2));
}

void print_column(const char* what, std::vector<double> values, double factor, const char* unit, double at_most) {
  std::ranges::sort(values);
  const double worst = factor * values.back();
  std::printf("    %-44s median %7.2f  worst %7.2f %s", what, factor * values[values.size() / 2], worst, unit);
  if (at_most > 0) {
    const bool reached = worst <= at_most;
    all_reached = all_reached && reached;
    std::printf("  at most %g  %s", at_most, reached ? "reached" : "MISSED");
  }
  std::printf("\n");
}

struct Case {
  const char* folder;
  std::vector<object_tracking::TargetOptions> targets;
  int every;

  // Where the figures have to be reached.
  bool must() const { return std::string_view(folder) != "rendered/fast_60fps"; }
};

// What cameras saw of the balls, waved one after the other.
struct Waved {
  std::string names;
  std::vector<wave::BallFrame> frames;
  double noise_px = 0;
  std::vector<Eigen::Vector3d> path;  // the truth
};

Waved look_at(const figures::Sequence& sequence, const Case& c) {
  Waved out;
  wave::BackgroundSamples background(sequence.rig.cameras.size());
  for (const capture::FrameSet& set : sequence.sets) {
    for (const auto& frame : set.frames) {
      if (frame) background.add(*frame);
    }
  }
  std::vector<std::vector<wave::BallFrame>> of_balls;
  double noise2 = 0;
  for (const object_tracking::TargetOptions& target : c.targets) {
    wave::BallFinder finder(sequence.rig, target);
    out.names += (out.names.empty() ? "" : " and ") + target.name;
    of_balls.emplace_back();
    for (const capture::FrameSet& set : sequence.sets) {
      for (const auto& frame : set.frames) {
        if (!frame) continue;
        if (auto found = finder.detect(*frame)) of_balls.back().push_back(std::move(*found));
      }
    }
    wave::refine_outlines(of_balls.back(), background, sequence.rig);
    const double noise = outline_noise(sequence, target, of_balls.back());
    noise2 += noise * noise / static_cast<double>(c.targets.size());
    for (const figures::TruthRow& row : sequence.truth.at(target.name)) out.path.push_back(row.position);
  }
  out.noise_px = std::sqrt(noise2);
  out.frames = wave::one_after_the_other(std::move(of_balls), sequence.rig.cameras.size());
  return out;
}

// By which the scale becomes known.
struct Scales {
  wave::WaveOptions tape, marks, rig_only;

  Scales(const figures::Sequence& sequence, const object_tracking::TargetOptions& ball) {
    for (wave::WaveOptions* options : {&tape, &marks, &rig_only}) {
      options->radius_m = ball.radius_m;
      options->volume = solver::WorldBox{{-1, -1, 0.1}, {1, 1, 2.1}};
    }
    const double baseline = (sequence.rig.cameras[0].centre() - sequence.rig.cameras[1].centre()).norm();
    tape.camera_distance = wave::CameraDistance{0, 1, baseline};
    // Five moments at which every camera (of two or more) sees all of the ball, spread over the recording.
    std::vector<const figures::TruthRow*> clear;
    for (const figures::TruthRow& row : sequence.truth.at(ball.name)) {
      if (std::ranges::all_of(row.visible, [](double share) { return share > 0.99; })) clear.push_back(&row);
    }
    for (std::size_t i = 0; i < 5; ++i) {
      const figures::TruthRow& row = *clear[(2 * i + 1) * clear.size() / 10];
      marks.marks.push_back({capture::seconds(row.at), row.position});
    }
  }
};

struct Mode {
  const char* name;
  wave::WaveOptions options;
  bool scale_known;
};

// Of many wrong rigs, by one mode.
struct Columns {
  std::vector<double> volume, on_path, centre, turned, scale, stated_volume, stated_path, stated_centre, halves,
      halves_sigma;

  void add(const wave::WaveResult& r, const figures::RigFigures& f) {
    volume.push_back(f.volume_m), centre.push_back(f.centre_m), turned.push_back(f.turned_deg);
    scale.push_back(std::abs(f.scale - 1)), on_path.push_back(f.path_m);
    halves.push_back(r.halves_m), halves_sigma.push_back(r.halves_sigma_m);
    stated_path.push_back(r.expected_m), stated_volume.push_back(r.expected_in_volume_m.value_or(0));
    double worst = 0;
    for (const wave::WaveCamera& camera : r.cameras) worst = std::max(worst, camera.centre_sigma_m.norm());
    stated_centre.push_back(worst);
  }

  void print(bool judged) const {
    print_column("camera centres, worst camera", centre, 1e3, "mm", judged ? 10 : 0);
    print_column("camera rotations, worst camera", turned, 1, "deg", judged ? 0.3 : 0);
    print_column("2x2x2 m volume, rms", volume, 1e3, "mm", judged ? 3 : 0);
    print_column("scale off by", scale, 100, "%", 0);
    print_column("positions where the ball was, rms", on_path, 1e3, "mm", 0);
    print_column("stated: camera centres, worst camera", stated_centre, 1e3, "mm", 0);
    print_column("stated: 2x2x2 m volume", stated_volume, 1e3, "mm", 0);
    print_column("stated: positions where the ball was", stated_path, 1e3, "mm", 0);
    print_column("the halves differ by", halves, 1e3, "mm", 0);
    print_column("stated: what they should differ by", halves_sigma, 1e3, "mm", 0);
  }
};

void from_wrong_rigs(const figures::Sequence& sequence, const Waved& waved, const Mode& mode, int seeds, bool must) {
  Columns columns;
  int failed = 0, doubtful = 0;
  double slowest = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    try {
      const auto start = std::chrono::steady_clock::now();
      const wave::WaveResult r = wave::calibrate_wave(spoilt(sequence.rig, 0.1, 3, static_cast<std::uint64_t>(seed)),
                                                      waved.frames, mode.options);
      slowest = std::max(slowest, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
      columns.add(r, figures::compare(sequence.rig, r.rig, waved.path));
      const report::WaveReport told = report::report_on(r);
      doubtful += told.verdict == report::Verdict::usable ? 0 : 1;
      if (seed == 1 && mode.scale_known && std::getenv("WAVE_FIGURES_VERBOSE") != nullptr)
        std::printf("%s", report::to_text(told, r).c_str());
    } catch (const solver::CalibrationError& error) {
      ++failed;
      std::printf("    seed %d: %s\n", seed, report::with_advice(error).c_str());
    }
  }
  std::printf("  %s: %d seeds, %d failed, %d doubtful, slowest %.2f s\n", mode.name, seeds, failed, doubtful, slowest);
  if (must && failed > 0) all_reached = false;
  if (!columns.volume.empty()) columns.print(must && mode.scale_known);
}

// Lenses only.
void from_nothing(const figures::Sequence& sequence, const Waved& waved, wave::WaveOptions options, bool must) {
  options.has_poses = false;
  std::printf("  no poses to start from, scale from %s\n",
              options.camera_distance ? "the distance of two cameras" : "the radius");
  try {
    const wave::WaveResult r = wave::calibrate_wave(sequence.rig, waved.frames, options);
    const figures::RigFigures f = figures::compare(sequence.rig, r.rig, waved.path);
    std::printf("    centres %.1f mm, rotations %.3f deg, volume %.2f mm rms, scale off by %.2f %%\n", 1e3 * f.centre_m,
                f.turned_deg, 1e3 * f.volume_m, 100 * std::abs(f.scale - 1));
    if (must && options.camera_distance && (f.centre_m > 0.01 || f.turned_deg > 0.3 || f.volume_m > 0.003)) {
      all_reached = false;
      std::printf("    MISSED\n");
    }
  } catch (const solver::CalibrationError& error) {
    std::printf("    failed: %s\n", report::with_advice(error).c_str());
    if (must) all_reached = false;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 10;
  if (seeds < 1) {
    std::fprintf(stderr, "usage: wave_figures [number of seeds >= 1]\n");
    return 2;
  }
  for (const Case& c :
       {Case{"rendered/two_cams", {figures::lime_ball()}, 1},
        Case{"rendered/occlusion", {figures::pink_ball(), figures::lime_ball()}, 1},
        Case{"rendered/occlusion", {figures::pink_ball()}, 1}, Case{"rendered/occlusion", {figures::lime_ball()}, 1},
        Case{"rendered/fast_60fps", {figures::pink_ball()}, 1},
        Case{"rendered/fast_60fps", {figures::pink_ball()}, 2}}) {
    if (!figures::have(c.folder)) {
      std::fprintf(stderr, "wave_figures: no recordings in %s\n", figures::shared_data().c_str());
      return 2;
    }
    std::printf("\n");
    const figures::Sequence sequence = figures::load_sequence(figures::shared_data() / c.folder, c.every);
    const Waved waved = look_at(sequence, c);
    const Scales scales(sequence, c.targets.front());
    std::printf("%s, %s: %zu frames\n", sequence.name.c_str(), waved.names.c_str(), waved.frames.size());
    print_bound(sequence, c.targets, waved.noise_px);
    for (const Mode& mode : {Mode{"scale from the distance of two cameras", scales.tape, true},
                             Mode{"scale and world from five marked points", scales.marks, true},
                             Mode{"scale from the spoilt rig alone", scales.rig_only, false}})
      from_wrong_rigs(sequence, waved, mode, seeds, c.must());
    for (const wave::WaveOptions& options : {scales.tape, scales.rig_only})
      from_nothing(sequence, waved, options, c.must());
  }
  std::printf("\n%s\n", all_reached ? "every figure is reached" : "NOT every figure is reached");
  return all_reached ? 0 : 1;
}
