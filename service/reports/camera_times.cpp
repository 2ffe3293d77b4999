#include "reports/camera_times.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "calib/model/rig_yaml.h"

namespace huetrack::reports {
namespace {

using object_tracking::CameraTimingEstimate;

// 1 sigma below which timing is known: it then costs some millimetres at usual speeds, and is worth writing to a rig.
constexpr double known_latency_s = 0.002, known_readout_s = 0.003;
// A value is logged again after a change of this many of the sigmas that were logged.
constexpr double news_sigmas = 4;
constexpr int averaged_intervals = 100;  // between frames: some seconds
// m/s; above this speed, unknown timing dominates the position error.
constexpr double moving_m_s = 0.3;

bool is_known(const CameraTimingEstimate& t) {
  return t.latency_sigma_s <= known_latency_s && t.readout_sigma_s <= known_readout_s;
}

std::string timing_text(const std::string& camera, const CameraTimingEstimate& t, bool is_reference) {
  const std::string latency =
      is_reference ? fmt::format("latency {:.1f} ms (reference: the others are relative to it)", 1e3 * t.latency_s)
                   : fmt::format("latency {:.1f} ms +- {:.1f}", 1e3 * t.latency_s, 1e3 * t.latency_sigma_s);
  return fmt::format("{}: {}, readout {:.1f} ms +- {:.1f}", camera, latency, 1e3 * t.readout_s,
                     1e3 * t.readout_sigma_s);
}

// With `timing: fixed`. Without timing in the rig, latency and readout are 0.
std::string fixed_timing_text(const calib::Camera& camera, const CameraTimingEstimate& t) {
  const bool is_in_rig = camera.timing.latency_s && camera.timing.readout_s;
  return fmt::format("{}: latency {:.1f} ms, readout {:.1f} ms (timing: fixed{})", camera.name, 1e3 * t.latency_s,
                     1e3 * t.readout_s, is_in_rig ? "" : "; 0 because the rig has none");
}

}  // namespace

CameraTimes::CameraTimes(const config::ServiceConfig& config, std::filesystem::path rig_file, bool is_logging,
                         const RigReport* calibration)
    : rig_file_(std::move(rig_file)), is_logging_(is_logging), calibration_(calibration), rig_(config.rig) {
  if (std::filesystem::exists(rig_file_))
    throw std::runtime_error(rig_file_.string() + " exists, and --write-rig replaces no file: give another name");
  on_config(config);
}

void CameraTimes::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  is_learning_ = config.object_tracking.timing == object_tracking::TimingMode::learn;
  if (!is_learning_) warning_.reset();
}

// Of several targets, each camera's most certain estimate: all targets are seen in the same frames.
void CameraTimes::on_set(const pipeline::TrackedSet& set) {
  Estimates best;
  bool is_moving = false;
  for (const auto& estimate : set.estimates) {
    if (estimate.times.empty()) continue;
    is_moving = is_moving || (estimate.has_position() && estimate.velocity.norm() > moving_m_s);
    if (best.empty()) best = estimate.times;
    for (std::size_t c = 0; c < best.size(); ++c) {
      const CameraTimingEstimate& t = estimate.times[c];
      if (t.latency_sigma_s + t.readout_sigma_s < best[c].latency_sigma_s + best[c].readout_sigma_s) best[c] = t;
    }
  }
  if (best.empty()) return;
  {
    const std::scoped_lock lock(mutex_);
    timing_ = best;
    note_periods(set.frames);
    uneven_s_.resize(best.size(), 0);
    for (const auto& of_target : set.mistakes)
      for (const view_watch::Mistake& mistake : of_target)
        if (mistake.kind == view_watch::MistakeKind::uneven_times)
          for (const int c : mistake.cameras)
            uneven_s_[std::size_t(c)] = std::max(uneven_s_[std::size_t(c)], std::abs(mistake.size));
    best = stated();
    std::vector<std::string> cameras;
    for (std::size_t c = 0; c < best.size(); ++c) {
      if (best[c].latency_sigma_s > known_latency_s)
        cameras.push_back(fmt::format("{} (+- {:.0f} ms)", rig_.cameras[c].name, 1e3 * best[c].latency_sigma_s));
    }
    warning_.reset();
    if (is_learning_ && is_moving && !cameras.empty())
      warning_ = fmt::format(
          "the latency is not known yet of {}: positions of moving objects are less certain until it is estimated from "
          "their motion: keep moving the object, or run huetrack-calibrate time beforehand",
          fmt::join(cameras, ", "));
    if (!is_learning_) return;
  }
  if (is_logging_) log_changes(best);
}

void CameraTimes::log_changes(const Estimates& now) {
  if (logged_.empty())
    logged_.assign(now.size(), {.latency_sigma_s = std::numeric_limits<double>::infinity(), .readout_sigma_s = 0});
  for (std::size_t c = 0; c < now.size(); ++c) {
    if (!is_known(now[c])) continue;
    CameraTimingEstimate& before = logged_[c];
    const bool is_first = std::isinf(before.latency_sigma_s);
    const bool has_moved =
        std::abs(now[c].latency_s - before.latency_s) > news_sigmas * std::max(before.latency_sigma_s, 5e-4) ||
        std::abs(now[c].readout_s - before.readout_s) > news_sigmas * std::max(before.readout_sigma_s, 1e-3);
    if (!is_first && !has_moved) continue;
    spdlog::info("{}", timing_text(rig_.cameras[c].name, now[c], c == 0));
    before = now[c];
  }
}

std::vector<std::string> CameraTimes::warnings() const {
  const std::scoped_lock lock(mutex_);
  return warning_ ? std::vector{*warning_} : std::vector<std::string>{};
}

std::vector<CameraTimingEstimate> CameraTimes::timing() const {
  const std::scoped_lock lock(mutex_);
  return stated();
}

void CameraTimes::note_periods(const capture::FrameSet& frames) {
  periods_.resize(rig_.cameras.size());
  for (std::size_t c = 0; c < periods_.size() && c < frames.frames.size(); ++c) {
    if (!frames.frames[c]) continue;
    Period& period = periods_[c];
    const auto before = std::exchange(period.last, frames.frames[c]->captured_at);
    if (!before) continue;
    period.intervals = std::min(period.intervals + 1, averaged_intervals);
    period.mean_s += (capture::seconds(*period.last - *before) - period.mean_s) / period.intervals;
  }
}

// A readout lasts a frame period at most. The filter's prior is a Gaussian, which excludes nothing: where wrong poses
// or stamps drive an estimate beyond that, its covariance, which assumes them right, is too small by at least the
// excess.
CameraTimes::Estimates CameraTimes::stated() const {
  Estimates times = timing_;
  for (std::size_t c = 0; c < times.size(); ++c) {
    const bool has_period = is_learning_ && periods_[c].intervals == averaged_intervals;
    const double excess_s = has_period ? std::max(0.0, std::abs(times[c].readout_s) - periods_[c].mean_s) : 0;
    times[c].readout_sigma_s = std::hypot(times[c].readout_sigma_s, excess_s);
    times[c].latency_sigma_s = std::hypot(times[c].latency_sigma_s, uneven_s_[c], excess_s);
  }
  return times;
}

std::vector<std::string> CameraTimes::summary() const {
  std::vector<std::string> out;
  const Estimates times = stated();
  for (std::size_t c = 0; c < times.size(); ++c) {
    const calib::Camera& camera = rig_.cameras[c];
    const char* const doubt = uneven_s_[c] > 0 ? " (its time stamps are uneven)" : " (not known yet)";
    out.push_back(is_learning_ ? timing_text(camera.name, times[c], c == 0) + (is_known(times[c]) ? "" : doubt)
                               : fixed_timing_text(camera, times[c]));
  }
  return out;
}

calib::CameraRig CameraTimes::rig() const {
  calib::CameraRig rig = rig_;
  if (!is_learning_) return rig;
  const Estimates times = stated();
  for (std::size_t c = 0; c < times.size(); ++c) {
    if (!is_known(times[c])) continue;
    rig.cameras[c].timing = {.latency_s = times[c].latency_s,
                             .latency_sigma_s = times[c].latency_sigma_s,
                             .readout_s = times[c].readout_s,
                             .readout_sigma_s = times[c].readout_sigma_s};
  }
  return rig;
}

void CameraTimes::flush() {
  if (rig_file_.empty()) return;
  calib::CameraRig learnt = rig();
  const int moved = calibration_ != nullptr ? calibration_->mend(learnt) : 0;
  const auto known = is_learning_ ? std::ranges::count_if(stated(), is_known) : 0;
  calib::write_rig(learnt, rig_file_);
  spdlog::info("{}: wrote the rig, with the estimated timing of {} of {} cameras and the corrected pose of {}",
               rig_file_.string(), known, rig_.cameras.size(), moved);
}

}  // namespace huetrack::reports
