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

constexpr capture::Duration enough = 60s;  // of the recording, beyond the clicked frame
constexpr capture::Duration near = 250ms;  // a search needs two sets, up to 0.1 s each
constexpr double sigmas = 3;
constexpr double rarely = 0.1;  // of the sets: positions are uncertain until the timing is learnt

// Compares the track with the clicked point.
class TrialWatch final : public pipeline::Output {
 public:
  TrialWatch(const calib::CameraRig& rig, double radius_m, double acceleration_m_s2, const SeenAt& seen,
             std::stop_source& done)
      : rig_(rig),
        camera_(rig.cameras[std::size_t(seen.point.camera)]),
        radius_m_(radius_m),
        acceleration_m_s2_(acceleration_m_s2),
        seen_(seen),
        done_(done) {}

  void on_set(const pipeline::TrackedSet& set) override {
    ++trial_.sets;
    std::vector<const object_tracking::ObjectEstimate*> tracked;
    for (const object_tracking::ObjectEstimate& estimate : set.estimates)
      if (estimate.state == object_tracking::TrackState::tracking) tracked.push_back(&estimate);
    trial_.tracking += tracked.empty() ? 0 : 1;
    const bool is_taken = !tracked.empty() && is_taken_for_it(set);
    for (const object_tracking::ObjectEstimate* const estimate : tracked) {
      sigmas_m_.push_back(std::sqrt(estimate->covariance.trace()));
      in_pictures_.push_back(sigma_in_pictures(*estimate));
      if (!is_taken) hold_to_point(*estimate, std::chrono::abs(set.frames.at - seen_.at));
    }
    if (set.frames.at - seen_.at > enough) done_.request_stop();
  }

  ColorTrial trial() {
    if (sigmas_m_.empty()) return trial_;
    trial_.sigma_m = calib::median_in_place(std::span(sigmas_m_));
    trial_.rare_sigma_m = calib::quantile_in_place(std::span(sigmas_m_), 1 - rarely);
    trial_.is_sure = sigmas * calib::median_in_place(std::span(in_pictures_)) <= 1 &&
                     calib::quantile_in_place(std::span(in_pictures_), 1 - rarely) <= 1;
    return trial_;
  }

 private:
  // In radii: 1 sigma of an axis in the picture in which it is largest, of those that show the object.
  double sigma_in_pictures(const object_tracking::ObjectEstimate& estimate) const {
    double largest = 0;
    for (const calib::Camera& camera : rig_.cameras) {
      const auto there = object_tracking::project_ball(camera, estimate.position, radius_m_);
      if (!there || !camera.contains({there->px})) continue;
      const double variance = (there->jacobian * estimate.covariance * there->jacobian.transpose()).trace() / 2;
      largest = std::max(largest, std::sqrt(variance) / there->radius_px);
    }
    return largest;
  }

  // In the set of the clicked frame, the object's region counts, independent of the cameras' timing.
  bool is_taken_for_it(const pipeline::TrackedSet& set) {
    const auto& frame = set.frames.frames[std::size_t(seen_.point.camera)];
    if (!frame || frame->captured_at != seen_.at) return false;
    for (const object_tracking::SeenRegion& region : set.trackers.front().regions()) {
      if (!region.is_target || region.camera != seen_.point.camera) continue;
      const ColorTrial::Distance distance{.px = (region.px - seen_.point.px).norm(), .limit_px = region.radius_px};
      if (distance.px > distance.limit_px) continue;
      nearest_ = capture::Duration{0};
      trial_.at_point = distance;
      return true;
    }
    return false;
  }

  // Otherwise the position in the set nearest in time, of the object nearest to the point.
  void hold_to_point(const object_tracking::ObjectEstimate& estimate, capture::Duration apart) {
    if (apart > std::min(near, nearest_)) return;
    // Exposure time of the frame's row, with the timing learnt by then.
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
    // A larger uncertainty does not distinguish the object from its surroundings.
    const double open_px = std::min(sigmas * sigma_px + swerve_px, 3 * there->radius_px);
    const ColorTrial::Distance distance{.px = (there->px - seen_.point.px).norm(),
                                        .limit_px = there->radius_px + open_px};
    if (apart == nearest_ && trial_.at_point && trial_.at_point->px <= distance.px) return;
    nearest_ = apart;
    trial_.at_point = distance;
  }

  const calib::CameraRig& rig_;
  const calib::Camera& camera_;
  const double radius_m_, acceleration_m_s2_;
  const SeenAt seen_;
  std::stop_source& done_;
  ColorTrial trial_;
  std::vector<double> sigmas_m_, in_pictures_;
  capture::Duration nearest_ = capture::Duration::max();
};

}  // namespace

ColorTrial try_color(config::ServiceConfig config, std::span<const std::string> words,
                     const object_tracking::TargetOptions& target, const SeenAt& seen, const std::stop_token& stop) {
  config.targets = {target};
  // An uncertain rig moves the object and its surroundings alike: the pictures distinguish them.
  config.rig.uncertainty.reset();
  const recordings::Recording recording = recordings::read_recording(words);
  auto source = std::make_unique<recordings::ReplaySource>(
      recording, config.rig.camera_names(),
      recordings::ReplayOptions{.timing = config::frame_timing(config.rig), .takes_matches = true});
  pipeline::SessionSources sources = pipeline::recorded_cameras(recording, *source);
  sources.sources.push_back(std::move(source));
  pipeline::Session session(config, std::move(sources), {});
  std::stop_source done;
  const std::stop_callback forward(stop, [&done] { done.request_stop(); });
  TrialWatch watch(config.rig, target.radius_m, config.object_tracking.acceleration_m_s2, seen, done);
  session.add(watch);
  session.run(done.get_token());
  return watch.trial();
}

std::string words_of(const ColorTrial& trial, const std::string& camera) {
  if (trial.tracking == 0)
    return fmt::format("tried on the recording, nothing is tracked in any of {} sets", trial.sets);
  const std::string how_often = fmt::format(
      "`tracking` in {} of {} sets, with a sigma of {:.1f} mm by the pictures, and in every tenth over {:.1f}",
      trial.tracking, trial.sets, 1e3 * trial.sigma_m, 1e3 * trial.rare_sigma_m);
  if (!trial.at_point)
    return fmt::format("tried on the recording, it is {}, but not at the time of the point in {}", how_often, camera);
  if (!trial.is_found())
    return fmt::format("tried on the recording, it is {}, but {:.0f} px away from the point in {}", how_often,
                       trial.at_point->px, camera);
  const std::string where = fmt::format("{}, {:.1f} px from the point in {}", how_often, trial.at_point->px, camera);
  if (!trial.is_sure)
    return fmt::format("tried on the recording, it is {}, too uncertain to be the object for sure", where);
  return fmt::format("tried on the recording, it is {}", where);
}

}  // namespace huetrack::page
