// What `huetrack-calibrate wave` makes of a ball that is held in a hand, beside the truth, and which part of what it
// measures costs how much: parts are replaced by the truth one by one.
//   build/release/tests/benchmark/wave_hands [--parts] FOLDER...     FOLDER: of ../shared/tools/scenes' hand_wave or
//   webcams_wave
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "benchmark/rig_figures.h"
#include "benchmark/wave_recording.h"
#include "calib/report/advice.h"
#include "calib/report/wave_report.h"
#include "calib/wave/wave.h"
#include "calib/wave/wave_adjustment.h"
#include "drawn.h"
#include "object_tracking/sighting.h"

using namespace huetrack;

namespace {

struct TrueFrame {
  double stamp_s = 0, row_s = 0, visible = 0;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
};

struct Recording : figures::WaveRecording {
  std::vector<TrueFrame> of_frames;  // per frame
  std::vector<Eigen::Vector3d> path;
};

// Per camera, by the number of its frame.
std::map<std::string, std::vector<TrueFrame>> true_frames(const std::filesystem::path& file) {
  std::map<std::string, std::vector<TrueFrame>> out;
  std::ifstream in(file);
  std::string line, cell;
  std::vector<std::string> head;
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    std::vector<std::string> row;
    while (std::getline(cells, cell, ',')) row.push_back(cell);
    if (head.empty()) {
      head = row;
      continue;
    }
    const auto at = [&](const char* name) {
      return std::stod(row[static_cast<std::size_t>(std::ranges::find(head, name) - head.begin())]);
    };
    out[row[0]].push_back({at("stamp_s"), at("t_ball_row_s"), at("visible"), {at("x"), at("y"), at("z")}});
  }
  return out;
}

Recording recorded(const std::filesystem::path& folder) {
  Recording r{figures::wave_recording(folder), {}, {}};
  const std::vector<std::string> names = r.truth.camera_names();
  const auto truth = true_frames(folder / "frames.csv");
  for (std::size_t f = 0; f < r.frames.size(); ++f) {
    const TrueFrame& is = truth.at(names[static_cast<std::size_t>(r.frames[f].camera)]).at(r.number[f]);
    r.of_frames.push_back(is);
    if (is.visible > 0.3) r.path.push_back(is.place);
  }
  return r;
}

struct TrueBall {
  Eigen::Vector2d px;
  double radius_px;
};
std::optional<TrueBall> true_ball(const Recording& r, std::size_t f) {
  const calib::Camera& camera = r.truth.cameras[static_cast<std::size_t>(r.frames[f].camera)];
  const auto px = wave::outline_centre(camera.model, camera.cam_from_world * r.of_frames[f].place, r.target.radius_m);
  const auto at = object_tracking::project_ball(camera, r.of_frames[f].place, r.target.radius_m);
  if (!px || !at) return std::nullopt;
  return TrueBall{*px, at->radius_px};
}

// The region nearest to the ball, within a radius.
int ball_of(const Recording& r, std::size_t f, const TrueBall& ball) {
  int best = -1;
  double least = 1.2 * ball.radius_px;
  for (std::size_t k = 0; k < r.frames[f].regions.size(); ++k) {
    const double d = (r.frames[f].regions[k].centre - ball.px).norm();
    if (d < least) least = d, best = static_cast<int>(k);
  }
  return best;
}

double median(std::vector<double> v) {
  if (v.empty()) return 0;
  std::ranges::sort(v);
  return v[v.size() / 2];
}

void print_outlines(const Recording& r) {
  std::printf(
      "  outlines: visible share, frames, found, error px per axis: rms, median; size over the true one: 10 50 90 "
      "%%\n");
  constexpr std::array bins{0.05, 0.3, 0.5, 0.7, 0.85, 0.99, 1.01};
  for (std::size_t b = 0; b + 1 < bins.size(); ++b) {
    int count = 0;
    double sum2 = 0;
    std::vector<double> off, size;
    for (std::size_t f = 0; f < r.frames.size(); ++f) {
      const double v = r.of_frames[f].visible;
      if (v < bins[b] || v >= bins[b + 1]) continue;
      const auto ball = true_ball(r, f);
      if (!ball) continue;
      ++count;
      const int k = ball_of(r, f, *ball);
      if (k < 0) continue;
      const color::ColorRegion& region = r.frames[f].regions[static_cast<std::size_t>(k)];
      const double d = (region.centre - ball->px).norm();
      sum2 += d * d / 2, off.push_back(d / std::sqrt(2.0));
      size.push_back(2 * std::pow(region.spread.determinant(), 0.25) / ball->radius_px);
    }
    std::ranges::sort(size);
    const auto q = [&](double share) {
      return size.empty() ? 0 : size[static_cast<std::size_t>(share * static_cast<double>(size.size() - 1))];
    };
    std::printf("    %.2f to %.2f: %4d %4zu  %.2f %.2f  %.2f %.2f %.2f\n", bins[b], bins[b + 1], count, off.size(),
                std::sqrt(sum2 / std::max(1.0, static_cast<double>(off.size()))), median(off), q(.1), q(.5), q(.9));
  }
}

color::ColorRegion disc(const TrueBall& ball) {
  color::ColorRegion out;
  out.centre = ball.px;
  out.spread = ball.radius_px * ball.radius_px / 4 * Eigen::Matrix2d::Identity();
  out.area = static_cast<int>(3.14159 * ball.radius_px * ball.radius_px);
  return out;
}

// What is changed of frame f. false: its ball was not seen.
using Change = std::function<bool(const Recording&, std::size_t f, wave::BallFrame&)>;

void calibrate(const Recording& r, const char* name, bool poses, const Change& change, bool hold = false) {
  std::vector<wave::BallFrame> frames;
  for (std::size_t f = 0; f < r.frames.size(); ++f) {
    wave::BallFrame frame = r.frames[f];
    if (!change(r, f, frame)) frame.regions.clear();
    frames.push_back(std::move(frame));
  }
  wave::WaveOptions options;
  options.radius_m = r.target.radius_m;
  options.volume = r.volume;
  options.has_poses = poses || hold;
  options.hold_poses = hold;
  if (!hold)
    options.camera_distance =
        wave::CameraDistance{0, 1, (r.truth.cameras[0].centre() - r.truth.cameras[1].centre()).norm()};
  try {
    const wave::WaveResult found = wave::calibrate_wave(hold ? r.truth : r.start, frames, options);
    const figures::RigFigures is = figures::compare(r.truth, found.rig, r.path);
    const report::WaveReport told = report::report_on(found);
    std::printf("  %-34s %6.2f (stated %5.2f) path %5.2f (%5.2f) mm, %.2f px, halves %.1f (%.1f), used", name,
                1e3 * is.volume_m, 1e3 * std::hypot(found.expected_in_volume_m.value_or(0), found.by_scale_in_volume_m),
                1e3 * is.path_m, 1e3 * std::hypot(found.expected_m, found.by_scale_m), found.rms_px,
                1e3 * found.halves_m, 1e3 * found.halves_sigma_m);
    for (const auto& c : found.cameras) std::printf(" %d/%d", c.used, c.seen);
    std::printf("; jerk %.0f size %.2f; readouts", found.jerk_m_s3, found.size_ratio);
    for (const auto& c : found.rig.cameras)
      std::printf(" %.1f+-%.1f", 1e3 * c.timing.readout_s.value_or(0), 1e3 * c.timing.readout_sigma_s.value_or(0));
    std::printf("; latencies");
    for (const auto& c : found.rig.cameras)
      std::printf(" %.1f+-%.1f", 1e3 * c.timing.latency_s.value_or(0), 1e3 * c.timing.latency_sigma_s.value_or(0));
    std::printf("; wander");
    for (const auto& c : found.cameras) std::printf(" %.1f (%.1f)", 1e3 * c.wander_s, c.wander_sigmas);
    std::printf("; %s\n", told.verdict == report::Verdict::usable ? "usable" : "doubtful");
    for (const auto& doubt : told.doubts) std::printf("      %s\n", doubt.c_str());
  } catch (const std::exception& error) {
    std::printf("  %-34s %s\n", name, error.what());
  }
  std::fflush(stdout);
}

// Only the ball, of these outlines.
Change ball_only(double least_visible) {
  return [least_visible](const Recording& r, std::size_t f, wave::BallFrame& frame) {
    const auto ball = true_ball(r, f);
    const int k = ball ? ball_of(r, f, *ball) : -1;
    if (k < 0 || r.of_frames[f].visible < least_visible) return false;
    frame.regions = {r.frames[f].regions[static_cast<std::size_t>(k)]};
    return true;
  };
}

// Only outlines that are right to so many pixels.
Change right_to(double px) {
  return [px](const Recording& r, std::size_t f, wave::BallFrame& frame) {
    const auto ball = true_ball(r, f);
    const int k = ball ? ball_of(r, f, *ball) : -1;
    if (k < 0) return false;
    frame.regions = {r.frames[f].regions[static_cast<std::size_t>(k)]};
    frame.regions.front().spread = disc(*ball).spread;
    return (frame.regions.front().centre - ball->px).norm() < px;
  };
}

bool true_outline(const Recording& r, std::size_t f, wave::BallFrame& frame) {
  const auto ball = true_ball(r, f);
  if (!ball || ball_of(r, f, *ball) < 0) return false;
  frame.regions = {disc(*ball)};
  return true;
}

Change noisy(double sigma_px, std::mt19937_64& rng) {
  return [sigma_px, &rng](const Recording& r, std::size_t f, wave::BallFrame& frame) {
    if (!true_outline(r, f, frame)) return false;
    std::normal_distribution<double> normal(0, sigma_px);
    frame.regions.front().centre += drawn<2>(rng, normal);
    return true;
  };
}

Change at_true_times(Change inner) {
  return [inner = std::move(inner)](const Recording& r, std::size_t f, wave::BallFrame& frame) {
    frame.t_s = r.of_frames[f].row_s;
    return inner(r, f, frame);
  };
}

}  // namespace

int main(int argc, char** argv) {
  const bool parts = argc > 1 && std::string_view(argv[1]) == "--parts";
  for (int i = parts ? 2 : 1; i < argc; ++i) {
    try {
      const Recording r = recorded(argv[i]);
      std::printf("%s: radius %g\n", argv[i], r.target.radius_m);
      print_outlines(r);
      const Change as_found = [](const Recording&, std::size_t, wave::BallFrame&) { return true; };
      std::mt19937_64 rng(1);
      calibrate(r, "as found, rig_off", true, as_found);
      calibrate(r, "as found, no poses", false, as_found);
      calibrate(r, "time", true, as_found, true);
      if (!parts) continue;
      calibrate(r, "only the ball", true, ball_only(0));
      calibrate(r, "only 85 % visible", true, ball_only(0.85));
      calibrate(r, "only 99 % visible", true, ball_only(0.99));
      calibrate(r, "only those right to 3 px", true, right_to(3));
      calibrate(r, "the ball, true times", true, at_true_times(ball_only(0)));
      calibrate(r, "99 % visible, true times", true, at_true_times(ball_only(0.99)));
      calibrate(r, "true outlines", true, true_outline);
      calibrate(r, "true outlines + 0.3 px", true, noisy(0.3, rng));
      calibrate(r, "true outlines, true times", true, at_true_times(true_outline));
    } catch (const std::exception& error) {
      std::printf("%s: %s\n", argv[i], error.what());
    }
  }
}
