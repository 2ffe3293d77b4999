#include "reports/camera_times.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calib/model/rig_yaml.h"

namespace huetrack::reports {
namespace {

using object_tracking::CameraTimingEstimate;

// Better known than this, a time costs a position some millimetres at the usual speeds, and is worth keeping in a rig.
constexpr double known_latency_s = 0.002, known_readout_s = 0.003;
// What was said is said again when it has moved by this many of its standard deviations of then.
constexpr double news_sigmas = 4;
// An object at this speed is farther from where it is said to be by its cameras' unknown times than by all else.
constexpr double moving_m_s = 0.3;

bool is_known(const CameraTimingEstimate& t) {
  return t.latency_sigma_s <= known_latency_s && t.readout_sigma_s <= known_readout_s;
}

std::string words(const std::string& camera, const CameraTimingEstimate& t, bool is_reference) {
  const std::string latency =
      is_reference ? fmt::format("latency {:.1f} ms (held: the other cameras' hang on it)", 1e3 * t.latency_s)
                   : fmt::format("latency {:.1f} ms +- {:.1f}", 1e3 * t.latency_s, 1e3 * t.latency_sigma_s);
  return fmt::format("{}: {}, readout {:.1f} ms +- {:.1f}", camera, latency, 1e3 * t.readout_s,
                     1e3 * t.readout_sigma_s);
}

// With `timing: fixed`. A camera of which the rig says nothing is taken for one that is never late and has no rows.
std::string fixed_words(const calib::Camera& camera, const CameraTimingEstimate& t) {
  const bool is_in_rig = camera.timing.latency_s && camera.timing.readout_s;
  return fmt::format("{}: latency {:.1f} ms, readout {:.1f} ms (timing: fixed{})", camera.name, 1e3 * t.latency_s,
                     1e3 * t.readout_s, is_in_rig ? "" : "; 0 where the rig says nothing");
}

}  // namespace

CameraTimes::CameraTimes(const config::ServiceConfig& config, std::filesystem::path rig_file, bool is_logging,
                         const RigReport* calibration)
    : rig_file_(std::move(rig_file)), is_logging_(is_logging), calibration_(calibration), rig_(config.rig) {
  if (std::filesystem::exists(rig_file_))
    throw std::runtime_error(rig_file_.string() + " exists: --write-rig writes no file anew; name another one");
  on_config(config);
}

void CameraTimes::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  is_learning_ = config.object_tracking.timing == object_tracking::TimingMode::learn;
  if (!is_learning_) open_.reset();
}

// Of several targets, what the surest one says of a camera: they see the same frames.
void CameraTimes::on_set(const pipeline::TrackedSet& set) {
  Estimates told;
  bool is_moving = false;
  for (const auto& estimate : set.estimates) {
    if (estimate.times.empty()) continue;
    is_moving = is_moving || (estimate.has_position() && estimate.velocity.norm() > moving_m_s);
    if (told.empty()) told = estimate.times;
    for (std::size_t c = 0; c < told.size(); ++c) {
      const CameraTimingEstimate& t = estimate.times[c];
      if (t.latency_sigma_s + t.readout_sigma_s < told[c].latency_sigma_s + told[c].readout_sigma_s) told[c] = t;
    }
  }
  if (told.empty()) return;
  {
    const std::scoped_lock lock(mutex_);
    times_ = told;
    std::vector<std::string> cameras;
    for (std::size_t c = 0; c < told.size(); ++c) {
      if (told[c].latency_sigma_s > known_latency_s)
        cameras.push_back(fmt::format("{} (+- {:.0f} ms)", rig_.cameras[c].name, 1e3 * told[c].latency_sigma_s));
    }
    open_.reset();
    if (is_learning_ && is_moving && !cameras.empty())
      open_ = fmt::format(
          "how late the time stamps are is not known yet of {}: moving objects are less sure until their motion has "
          "told it; huetrack-calibrate time finds it beforehand",
          fmt::join(cameras, ", "));
    if (!is_learning_) return;
  }
  if (is_logging_) tell(told);
}

void CameraTimes::tell(const Estimates& told) {
  if (logged_.empty())
    logged_.assign(told.size(), {.latency_sigma_s = std::numeric_limits<double>::infinity(), .readout_sigma_s = 0});
  for (std::size_t c = 0; c < told.size(); ++c) {
    if (!is_known(told[c])) continue;
    CameraTimingEstimate& before = logged_[c];
    const bool is_first = std::isinf(before.latency_sigma_s);
    const bool has_moved =
        std::abs(told[c].latency_s - before.latency_s) > news_sigmas * std::max(before.latency_sigma_s, 5e-4) ||
        std::abs(told[c].readout_s - before.readout_s) > news_sigmas * std::max(before.readout_sigma_s, 1e-3);
    if (!is_first && !has_moved) continue;
    spdlog::info("{}", words(rig_.cameras[c].name, told[c], c == 0));
    before = told[c];
  }
}

std::vector<std::string> CameraTimes::warnings() const {
  const std::scoped_lock lock(mutex_);
  return open_ ? std::vector{*open_} : std::vector<std::string>{};
}

std::vector<CameraTimingEstimate> CameraTimes::told() const {
  const std::scoped_lock lock(mutex_);
  return times_;
}

std::vector<std::string> CameraTimes::summary() const {
  std::vector<std::string> out;
  for (std::size_t c = 0; c < times_.size(); ++c) {
    const calib::Camera& camera = rig_.cameras[c];
    out.push_back(is_learning_ ? words(camera.name, times_[c], c == 0) + (is_known(times_[c]) ? "" : " (not known yet)")
                               : fixed_words(camera, times_[c]));
  }
  return out;
}

calib::CameraRig CameraTimes::rig() const {
  calib::CameraRig rig = rig_;
  if (!is_learning_) return rig;
  for (std::size_t c = 0; c < times_.size(); ++c) {
    if (!is_known(times_[c])) continue;
    rig.cameras[c].timing = {.latency_s = times_[c].latency_s,
                             .latency_sigma_s = times_[c].latency_sigma_s,
                             .readout_s = times_[c].readout_s,
                             .readout_sigma_s = times_[c].readout_sigma_s};
  }
  return rig;
}

void CameraTimes::flush() {
  if (rig_file_.empty()) return;
  calib::CameraRig learnt = rig();
  const int moved = calibration_ != nullptr ? calibration_->mend(learnt) : 0;
  const auto known = is_learning_ ? std::ranges::count_if(times_, is_known) : 0;
  calib::write_rig(learnt, rig_file_);
  spdlog::info("{}: the rig, with the times of {} of {} cameras as learnt, and {} where they stand now",
               rig_file_.string(), known, rig_.cameras.size(), moved);
}

}  // namespace huetrack::reports
