// What `huetrack-calibrate wave` says of webcams that are not as it believes, beside how wrong it is:
//   build/release/tests/benchmark/time_faults [folder...]
// A folder is one of ../shared/tools/scenes' webcams_wave; default: that of the shared data. Every fault is put into
// what was found in the pictures: stamps, regions. Exit status 1: something is called usable that is wrong by more than
// three times what is stated, or the webcams without a fault are not good enough.
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "benchmark/rig_figures.h"
#include "benchmark/wave_recording.h"
#include "calib/report/advice.h"
#include "calib/report/wave_report.h"
#include "calib/wave/wave.h"
#include "capture/timing/camera_clock.h"

using namespace huetrack;

namespace {

// One camera's frames, with the stamps as the driver gave them.
struct Seen {
  std::vector<double> stamp_s;
  std::vector<double> row_s;  // by which the ball was exposed later than by its row
  std::vector<wave::BallFrame> frames;
};
using Scene = std::vector<Seen>;

struct Recording {
  calib::CameraRig truth, start;
  object_tracking::TargetOptions target;
  solver::WorldBox volume;
  Scene scene;
};

Recording recorded(const std::filesystem::path& folder) {
  figures::WaveRecording found = figures::wave_recording(folder);
  Recording r{found.truth, found.start, found.target, found.volume, {}};
  r.scene.resize(r.truth.cameras.size());
  for (std::size_t i = 0; i < found.frames.size(); ++i) {
    Seen& of = r.scene[static_cast<std::size_t>(found.frames[i].camera)];
    of.stamp_s.push_back(found.stamp_s[i]);
    of.row_s.push_back(0);
    of.frames.push_back(std::move(found.frames[i]));
  }
  return r;
}

// As the stamps come out of a camera's clock.
std::vector<wave::BallFrame> frames_of(const Scene& scene) {
  std::vector<wave::BallFrame> frames;
  for (const Seen& of : scene) {
    capture::CameraClock clock;
    for (std::size_t i = 0; i < of.frames.size(); ++i) {
      frames.push_back(of.frames[i]);
      const capture::Timestamp stamp(capture::duration_of(of.stamp_s[i]));
      frames.back().t_s = capture::seconds(clock.smoothed(stamp)) + of.row_s[i];
    }
  }
  return frames;
}

struct Fault {
  std::string name;
  std::function<void(Scene&, const calib::CameraRig&)> put;
};

constexpr std::size_t faulty = 1;  // the camera that has it

// by(t): seconds by which the stamps are late.
Fault late(std::string name, std::function<double(double)> by) {
  return {std::move(name), [by = std::move(by)](Scene& scene, const calib::CameraRig&) {
            for (double& t : scene[faulty].stamp_s) t += by(t);
          }};
}

Fault repeats(const char* name, double share) {
  return {name, [share](Scene& scene, const calib::CameraRig&) {
            std::mt19937_64 rng(1);
            auto& frames = scene[faulty].frames;
            for (std::size_t i = frames.size() - 1; i > 0; --i) {
              if (std::uniform_real_distribution<double>(0, 1)(rng) < share) frames[i].regions = frames[i - 1].regions;
            }
          }};
}

// Of the stamps, `share` comes late, by up to `by_s`.
Fault late_stamps(const char* name, double share, double by_s) {
  return {name, [share, by_s](Scene& scene, const calib::CameraRig&) {
            std::mt19937_64 rng(2);
            std::uniform_real_distribution<double> uniform(0, 1);
            for (double& t : scene[faulty].stamp_s) {
              if (uniform(rng) < share) t += by_s * uniform(rng);
            }
          }};
}

// The recording says a rate instead of stamps: what was dropped does not show.
Fault rate_for_stamps(const char* name, double rate_error) {
  return {name, [rate_error](Scene& scene, const calib::CameraRig&) {
            auto& t = scene[faulty].stamp_s;
            std::vector<double> gaps;
            for (std::size_t i = 1; i < t.size(); ++i) gaps.push_back(t[i] - t[i - 1]);
            std::ranges::nth_element(gaps, gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2));
            const double first = t.front(), period = gaps[gaps.size() / 2] * (1 + rate_error);
            for (std::size_t i = 0; i < t.size(); ++i) t[i] = first + static_cast<double>(i) * period;
          }};
}

// Its focal length swings by this share, once in so many seconds.
Fault breathes(const char* name, double share, double period_s) {
  return {name, [share, period_s](Scene& scene, const calib::CameraRig& rig) {
            const calib::CameraModel& model = rig.cameras[faulty].model;
            Seen& of = scene[faulty];
            for (std::size_t i = 0; i < of.frames.size(); ++i) {
              const double by = 1 + share * std::sin(2 * std::numbers::pi * of.stamp_s[i] / period_s);
              for (color::ColorRegion& region : of.frames[i].regions) {
                const Eigen::Vector2d middle(model.cx(), model.cy());
                region.centre = middle + by * (region.centre - middle);
                region.spread *= by * by;
              }
            }
          }};
}

std::vector<Fault> faults() {
  constexpr double pi = std::numbers::pi;
  return {
      {"none", [](Scene&, const calib::CameraRig&) {}},
      late("latency 150 ms more", [](double) { return 0.15; }),
      late("latency 4 ms more from the middle on", [](double t) { return t > 6.5 ? 0.004 : 0; }),
      late("latency 15 ms more from the middle on", [](double t) { return t > 6.5 ? 0.015 : 0; }),
      late("latency 40 ms more from the middle on", [](double t) { return t > 6.5 ? 0.04 : 0; }),
      late("stamps wander by 3 ms", [](double t) { return 0.003 * std::sin(2 * pi * t / 3); }),
      late("stamps wander by 10 ms", [](double t) { return 0.01 * std::sin(2 * pi * t / 3); }),
      late("clock 0.1 % fast", [](double t) { return 0.001 * t; }),
      late("clock 1 % fast", [](double t) { return 0.01 * t; }),
      late_stamps("a tenth of the stamps up to 30 ms late", 0.1, 0.03),
      late_stamps("half of the stamps up to 20 ms late", 0.5, 0.02),
      late_stamps("all stamps up to 30 ms late", 1, 0.03),
      repeats("repeats 2 % of its frames", 0.02),
      repeats("repeats 10 % of its frames", 0.1),
      repeats("repeats 30 % of its frames", 0.3),
      repeats("repeats every other frame or so", 0.5),
      rate_for_stamps("a rate instead of stamps, dropped frames", 0),
      rate_for_stamps("the same, rate 0.3 % wrong", 0.003),
      breathes("focal length breathes by 0.3 %", 0.003, 4),
      breathes("focal length breathes by 1 %", 0.01, 4),
      breathes("focal length breathes by 3 %", 0.03, 7),
      {"rows are read sideways",
       [](Scene& scene, const calib::CameraRig& rig) {
         Seen& of = scene[faulty];
         for (std::size_t i = 0; i < of.frames.size(); ++i) {
           if (of.frames[i].regions.empty()) continue;
           const double u = of.frames[i].regions.front().centre.x() / rig.cameras[faulty].image_size.width - 0.5;
           of.row_s[i] = 0.025 * u;
         }
       }},
      {"two cameras swapped",
       [](Scene& scene, const calib::CameraRig&) {
         std::swap(scene[0], scene[1]);
         for (const std::size_t c : {0u, 1u}) {
           for (wave::BallFrame& frame : scene[c].frames) frame.camera = static_cast<int>(c);
         }
       }},
  };
}

bool is_ok = true;

void print_faults(const std::filesystem::path& folder) {
  const Recording r = recorded(folder);
  std::printf("%s\n  %-42s %9s %9s %6s  verdict\n", folder.c_str(), "fault (of the second camera)", "error mm",
              "stated", "ratio");
  wave::WaveOptions options{.radius_m = r.target.radius_m, .volume = r.volume};
  options.camera_distance =
      wave::CameraDistance{0, 1, (r.truth.cameras[0].centre() - r.truth.cameras[1].centre()).norm()};
  for (const Fault& fault : faults()) {
    Scene scene = r.scene;
    fault.put(scene, r.truth);
    try {
      const wave::WaveResult found = wave::calibrate_wave(r.start, frames_of(scene), options);
      const report::WaveReport report = report::report_on(found);
      const double error = figures::compare(r.truth, found.rig, {}).volume_m, stated = *found.expected_in_volume_m;
      const bool is_wrong = report.verdict == report::Verdict::usable && error > 3 * stated;
      is_ok = is_ok && !is_wrong;
      std::printf("  %-42s %9.2f %9.2f %6.1f  %s%s%s\n", fault.name.c_str(), 1e3 * error, 1e3 * stated, error / stated,
                  std::string(report::name(report.verdict)).c_str(), is_wrong ? "  WRONG" : "",
                  report.doubts.empty() ? "" : (": " + report.doubts.front()).c_str());
    } catch (const solver::CalibrationError& error) {
      std::printf("  %-42s %9s %9s %6s  failed: %s\n", fault.name.c_str(), "", "", "",
                  report::with_advice(error).c_str());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> folders(argv + 1, argv + argc);
  if (folders.empty()) folders.push_back(std::filesystem::path(HUETRACK_SHARED_DATA) / "rendered/webcams_wave");
  try {
    for (const auto& folder : folders) print_faults(folder);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "time_faults: %s\n", e.what());
    return 2;
  }
  return is_ok ? 0 : 1;
}
