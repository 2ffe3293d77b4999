#include "page/color_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "calib/model/median.h"
#include "object_tracking/sighting.h"
#include "pipeline/output.h"
#include "pipeline/recorded_cameras.h"
#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::page {
namespace {

using namespace std::chrono_literals;

constexpr capture::Duration enough = 60s;  // of the recording, beyond the moment: no more is learnt of the colour
constexpr capture::Duration near = 250ms;  // a search needs two sets, and a slow camera a tenth of a second for each
constexpr double sigmas = 3;
constexpr double rarely = 0.1;  // of the sets: until the cameras' times are learnt every colour is unsure

// What is told of the object near the moment at which it was seen.
class TrialWatch final : public pipeline::Output {
 public:
  TrialWatch(const calib::Camera& camera, double radius_m, double acceleration_m_s2, const SeenAt& seen,
             std::stop_source& done)
      : camera_(camera), radius_m_(radius_m), acceleration_m_s2_(acceleration_m_s2), seen_(seen), done_(done) {}

  void on_set(const pipeline::TrackedSet& set) override {
    ++trial_.sets;
    std::vector<const object_tracking::ObjectEstimate*> tracked;
    for (const object_tracking::ObjectEstimate& estimate : set.estimates)
      if (estimate.state == object_tracking::TrackState::tracking) tracked.push_back(&estimate);
    trial_.tracking += tracked.empty() ? 0 : 1;
    const bool is_taken = !tracked.empty() && is_taken_for_it(set);
    for (const object_tracking::ObjectEstimate* const estimate : tracked) {
      sigmas_m_.push_back(std::sqrt(estimate->covariance.trace()));
      if (!is_taken) hold_to_point(*estimate, std::chrono::abs(set.frames.at - seen_.at));
    }
    if (set.frames.at - seen_.at > enough) done_.request_stop();
  }

  ColorTrial trial() {
    if (sigmas_m_.empty()) return trial_;
    trial_.sigma_m = calib::median_in_place(std::span(sigmas_m_));
    trial_.rare_sigma_m = calib::quantile_in_place(std::span(sigmas_m_), 1 - rarely);
    trial_.is_sure = sigmas * trial_.sigma_m <= radius_m_ && trial_.rare_sigma_m <= radius_m_;
    return trial_;
  }

 private:
  // In the set of that very frame: what was taken for the object in its picture counts, whatever the cameras' times
  // are.
  bool is_taken_for_it(const pipeline::TrackedSet& set) {
    const auto& frame = set.frames.frames[std::size_t(seen_.point.camera)];
    if (!frame || frame->captured_at != seen_.at) return false;
    for (const object_tracking::SeenRegion& region : set.trackers.front().regions()) {
      if (!region.is_target || region.camera != seen_.point.camera) continue;
      const ColorTrial::Beside beside{.off_px = (region.px - seen_.point.px).norm(), .allowed_px = region.radius_px};
      if (beside.off_px > beside.allowed_px) continue;
      nearest_ = capture::Duration{0};
      trial_.at_point = beside;
      return true;
    }
    return false;
  }

  // Otherwise where it is told: the set that is nearest in time counts, and of several objects in it the one that is
  // nearest to the point.
  void hold_to_point(const object_tracking::ObjectEstimate& estimate, capture::Duration apart) {
    if (apart > std::min(near, nearest_)) return;
    // When the frame's row was exposed, as the motion has told by then.
    double at_s = capture::seconds(seen_.at - estimate.at), at_sigma_s = 0;
    const auto c = std::size_t(seen_.point.camera);
    if (c < estimate.times.size()) {
      const object_tracking::CameraTimingEstimate& time = estimate.times[c];
      const double below_middle = seen_.point.px.y() / std::max(1, camera_.image_size.height - 1) - 0.5;
      at_s += below_middle * time.readout_s - time.latency_s;
      at_sigma_s = std::hypot(time.latency_sigma_s, below_middle * time.readout_sigma_s);
    }
    const auto there = object_tracking::project_ball(camera_, estimate.position + at_s * estimate.velocity, radius_m_);
    if (!there) return;
    const Eigen::Vector2d of_time = at_sigma_s * there->jacobian * estimate.velocity;
    const double sigma_px = std::sqrt((there->jacobian * estimate.covariance * there->jacobian.transpose()).trace() +
                                      of_time.squaredNorm());
    const double swerve_px = 0.5 * acceleration_m_s2_ * at_s * at_s * there->radius_px / radius_m_;
    // What may be anywhere within two of its diameters is not told from what is beside it.
    const double open_px = std::min(sigmas * sigma_px + swerve_px, 3 * there->radius_px);
    const ColorTrial::Beside beside{.off_px = (there->px - seen_.point.px).norm(),
                                    .allowed_px = there->radius_px + open_px};
    if (apart == nearest_ && trial_.at_point && trial_.at_point->off_px <= beside.off_px) return;
    nearest_ = apart;
    trial_.at_point = beside;
  }

  const calib::Camera& camera_;
  const double radius_m_, acceleration_m_s2_;
  const SeenAt seen_;
  std::stop_source& done_;
  ColorTrial trial_;
  std::vector<double> sigmas_m_;
  capture::Duration nearest_ = capture::Duration::max();
};

}  // namespace

ColorTrial try_color(config::ServiceConfig config, std::span<const std::string> words,
                     const object_tracking::TargetOptions& target, const SeenAt& seen, const std::stop_token& stop) {
  config.targets = {target};
  const recordings::Recording recording = recordings::read_recording(words);
  auto source = std::make_unique<recordings::ReplaySource>(
      recording, config.rig.camera_names(),
      recordings::ReplayOptions{.timing = config::frame_timing(config.rig), .takes_matches = true});
  pipeline::SessionSources sources = pipeline::recorded_cameras(recording, *source);
  sources.sources.push_back(std::move(source));
  pipeline::Session session(config, std::move(sources), {});
  std::stop_source done;
  const std::stop_callback forward(stop, [&done] { done.request_stop(); });
  TrialWatch watch(config.rig.cameras[std::size_t(seen.point.camera)], target.radius_m,
                   config.object_tracking.acceleration_m_s2, seen, done);
  session.add(watch);
  session.run(done.get_token());
  return watch.trial();
}

std::string words_of(const ColorTrial& trial, const std::string& camera) {
  if (trial.tracking == 0)
    return fmt::format("tried on the recording, nothing is tracked in any of {} sets", trial.sets);
  const std::string how_often =
      fmt::format("`tracking` in {} of {} sets, stated to {:.1f} mm and in every tenth to {:.1f}", trial.tracking,
                  trial.sets, 1e3 * trial.sigma_m, 1e3 * trial.rare_sigma_m);
  if (!trial.at_point)
    return fmt::format("tried on the recording, it is {}, but not when it was pointed at in {}", how_often, camera);
  if (!trial.is_found())
    return fmt::format("tried on the recording, it is {}, but {:.0f} px away from where it was pointed at in {}",
                       how_often, trial.at_point->off_px, camera);
  const std::string where =
      fmt::format("{}, {:.1f} px from where it was pointed at in {}", how_often, trial.at_point->off_px, camera);
  if (!trial.is_sure) return fmt::format("tried on the recording, it is {}, which may be beside the object", where);
  return fmt::format("tried on the recording, it is {}", where);
}

}  // namespace huetrack::page
