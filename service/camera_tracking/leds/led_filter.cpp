#include "camera_tracking/leds/led_filter.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace huetrack::leds {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace std::chrono_literals;

constexpr std::size_t window_sightings = 20;  // of the search: more than two rounds of the paper's 8 LEDs
constexpr capture::Duration window_length = 600ms;
constexpr capture::Duration evidence_length = 400ms;
constexpr capture::Duration longest_coasting = 500ms;
constexpr double gate = 20;    // chi-square, 2 dof, 99.995 %
constexpr int confirming = 3;  // matches that confirm a new pose
constexpr double tracking_sigma_m = 0.1, tracking_sigma_rad = 0.1;
constexpr int misses_in_a_row = 3;  // of identified LEDs: the pose is wrong
// Four LEDs give only two redundant equations: a wrongly measured LED shows in the estimated noise only.
constexpr double tracking_sigma_of_four_m = 0.04;
constexpr double lost_sigma_m = 0.3, lost_sigma_rad = 0.3;

class HuetrackLedFilter final : public LedFilter {
 public:
  HuetrackLedFilter(const calib::Camera& camera, const LedFilterOptions& options)
      : camera_(camera),
        options_(options),
        search_(camera,
                {.leds = options.start.leds,
                 .room_min = options.start.room_min,
                 .room_max = options.start.room_max,
                 .particle_count = options.particle_count,
                 .start_velocity = options.start_velocity,
                 .motion = options.motion},
                particle_filter::Rng(options.seed, 0)),
        particles_(options.particle_count, particle_filter::Rng(options.seed, 1)) {}

  CameraEstimate update(const LedFrame& frame) override {
    found_.clear();
    if (pose_) {
      track(frame);
    } else {
      find_pose(frame);
    }
    last_at_ = frame.at;
    return estimate(frame);
  }

  double start_noise_px() const override { return search_.noise_scale() * options_.pixel_noise_px; }
  void forget() override { forget_pose(); }
  bool is_ambiguous() const override { return !pose_ && search_.is_ambiguous(); }

  CameraTrackerInside inside() const override {
    if (pose_) return inside_of(camera_, leds(), {pose_->mean, prior_covariance_}, noise(), found_, particles_);
    CameraTrackerInside out;
    out.particles.assign(search_.candidates().begin(), search_.candidates().end());
    return out;
  }

 private:
  const std::vector<Vector3d>& leds() const { return options_.start.leds; }
  Eigen::Matrix2d noise() const {
    const double sigma_px = (models_ ? models_->pixel_scale() : 1) * options_.pixel_noise_px;
    return sigma_px * sigma_px * Eigen::Matrix2d::Identity();
  }

  // Exposure of a row relative to the middle row, whose time is the frame's.
  double row_dt_s(double row) const {
    return camera_.timing.readout_s.value_or(0) * (row / (camera_.image_size.height - 1) - 0.5);
  }

  void find_pose(const LedFrame& frame) {
    std::vector<LedSighting> sightings;
    if (!frame.lit) {
      for (const Vector2d& px : frame.dots) sightings.push_back({-1, px, 0, options_.pixel_noise_px});
      pose_ = search_.find_unidentified(sightings);
    } else {
      if (*frame.lit >= 0 && !frame.dots.empty()) window_.push_back({frame.at, *frame.lit, frame.dots.front()});
      while (!window_.empty() && (window_.size() > window_sightings || frame.at - window_.front().at > window_length))
        window_.pop_front();
      for (const auto& w : window_)
        sightings.push_back(
            {w.led, w.px, capture::seconds(w.at - frame.at) + row_dt_s(w.px.y()), options_.pixel_noise_px});
      pose_ = search_.find(sightings);
    }
    if (!pose_) return;
    models_.emplace(*pose_, options_.motion);
    confirmed_ = 0;
    explained_once_ = false;
    evidence_.clear();
    found_at_ = frame.at;
    prior_covariance_ = pose_->covariance;
    particles_.draw(*pose_);
  }

  // Prediction, data association, update.
  void track(const LedFrame& frame) {
    const double dt_s = std::max(0.0, capture::seconds(frame.at - last_at_));
    models_->predict(dt_s);
    const LedGaussian prior = models_->state();
    prior_covariance_ = prior.covariance;
    const std::vector<LedSighting> sightings = match(frame, prior);
    particles_.draw(prior);
    LedMotionState start = prior.mean;
    if (!sightings.empty()) {
      const double miss_px = std::hypot(camera_.image_size.width, camera_.image_size.height);
      particles_.weigh(camera_.model, leds(), at_frame_time(sightings, prior.mean), 0.02, 0.02, miss_px);
      start = particles_.mean();
      models_->update(camera_.model, leds(), sightings, start);
    }
    pose_ = models_->state();
    confirmed_ += static_cast<int>(sightings.size());
    evidence_.forget(frame.at - evidence_length);

    const Vector2d sigma = largest_sigmas(pose_->covariance);
    const capture::Timestamp last = evidence_.last_match().value_or(found_at_);
    const bool contradicted = evidence_.in_view() >= 6 && 3 * evidence_.matched() < evidence_.in_view();
    const bool too_long = frame.at - last > longest_coasting;
    if (contradicted || too_long || !(sigma.x() < lost_sigma_m) || !(sigma.y() < lost_sigma_rad)) {
      forget_pose();
    }
  }

  // The sightings as if all rows were exposed at the frame's time, for particles, which have no velocities.
  std::vector<LedSighting> at_frame_time(std::vector<LedSighting> sightings, const LedMotionState& state) const {
    for (LedSighting& s : sightings) {
      const Vector3d& led = leds()[static_cast<std::size_t>(s.led)];
      const auto then = led_pixel(camera_.model, state, led, s.dt_s, nullptr),
                 now = led_pixel(camera_.model, state, led, 0, nullptr);
      if (then && now) s.px += *now - *then;
      s.dt_s = 0;
    }
    return sightings;
  }

  void forget_pose() {
    pose_.reset();
    models_.reset();
    window_.clear();
    evidence_.clear();
  }

  // Nearest-neighbour association within the gate.
  std::vector<LedSighting> match(const LedFrame& frame, const LedGaussian& prior) {
    std::vector<LedSighting> sightings;
    std::vector<bool> used(frame.dots.size(), false);
    const auto associate = [&](int led) {
      LedJacobian j;
      const Vector3d& position = leds()[static_cast<std::size_t>(led)];
      auto px = led_pixel(camera_.model, prior.mean, position, 0, &j);
      if (px) px = led_pixel(camera_.model, prior.mean, position, row_dt_s(px->y()), &j);
      // An identified LED that is seen although it should be out of view is a miss.
      const bool is_seen = frame.lit && !frame.dots.empty();
      if (!is_seen && (!px || !camera_.contains(calib::RawPixel{*px}))) return;
      if (!px) {
        evidence_.add(frame.at, led, false);
        return;
      }
      const Eigen::Matrix2d information = (j * prior.covariance * j.transpose() + noise()).inverse();
      double nearest = gate;
      std::size_t best = frame.dots.size();
      for (std::size_t d = 0; d < frame.dots.size(); ++d) {
        const Vector2d innovation = frame.dots[d] - *px;
        const double distance = innovation.dot(information * innovation);
        if (!used[d] && distance < nearest) nearest = distance, best = d;
      }
      const bool matched = best < frame.dots.size();
      evidence_.add(frame.at, led, matched);
      if (!matched) return;
      used[best] = true;
      sightings.push_back({led, frame.dots[best], row_dt_s(frame.dots[best].y()), options_.pixel_noise_px});
      found_.emplace_back(led, frame.dots[best]);
    };
    if (!frame.lit) {
      for (std::size_t l = 0; l < leds().size(); ++l) associate(static_cast<int>(l));
    } else if (*frame.lit >= 0) {
      associate(*frame.lit);
    }
    return sightings;
  }

  CameraEstimate estimate(const LedFrame& frame) {
    CameraEstimate e;
    e.at = frame.at;
    e.frame_number = frame.number;
    e.map_points = static_cast<int>(leds().size());
    e.particle_count = options_.particle_count;
    e.effective_sample_size = pose_ ? particles_.effective_sample_size() : 1;
    const bool confirmed = pose_ && confirmed_ >= confirming;
    if (!confirmed) {
      e.state = was_found_ ? PoseState::lost : PoseState::searching;
      return e;
    }
    const Vector2d sigma = largest_sigmas(pose_->covariance);
    const auto [in_view, matched] = evidence_.leds();
    e.features_in_view = in_view;
    e.features_matched = matched;
    const bool explained = 2 * evidence_.matched() > evidence_.in_view() && evidence_.distinct() >= 4 &&
                           (!frame.lit || evidence_.missed_in_a_row() < misses_in_a_row);
    const double enough_m = evidence_.distinct() > 4 ? tracking_sigma_m : tracking_sigma_of_four_m;
    const bool sure = sigma.x() < enough_m && sigma.y() < tracking_sigma_rad;
    // A new pose is published only after it was explained and certain once,
    if (explained && sure) {
      explained_once_ = true;
      last_explained_ = frame.at;
    }
    // and not if that was long ago: chance matches could keep it alive.
    if (!explained_once_ || frame.at - last_explained_ > longest_coasting) {
      e.state = was_found_ ? PoseState::lost : PoseState::searching;
      e.features_in_view = e.features_matched = 0;
      if (explained_once_) forget_pose();
      return e;
    }
    was_found_ = true;
    e.state = explained && sure ? PoseState::tracking : PoseState::coasting;
    e.world_from_camera = pose_->mean.world_from_camera;
    e.covariance = pose_->covariance.topLeftCorner<6, 6>();
    e.confidence = e.features_in_view > 0 ? static_cast<double>(e.features_matched) / e.features_in_view : 0;
    return e;
  }

  struct LedDot {
    capture::Timestamp at;
    int led;
    Vector2d px;
  };

  calib::Camera camera_;
  LedFilterOptions options_;
  LedSearch search_;
  LedParticles particles_;
  std::deque<LedDot> window_;
  std::optional<LedModels> models_;  // while there is a pose
  std::optional<LedGaussian> pose_;  // at last_at_
  LedCovariance prior_covariance_ = LedCovariance::Zero();
  LedEvidence evidence_;
  std::vector<FoundLed> found_;  // in the last frame
  capture::Timestamp last_at_{}, found_at_{}, last_explained_{};
  int confirmed_ = 0;
  bool was_found_ = false, explained_once_ = false;
};

}  // namespace

std::unique_ptr<LedFilter> LedFilter::huetrack(const calib::Camera& camera, const LedFilterOptions& options) {
  return std::make_unique<HuetrackLedFilter>(camera, options);
}

int LedEvidence::distinct() const {
  std::set<int> leds;
  for (const Flash& s : flashes_)
    if (s.matched) leds.insert(s.led);
  return static_cast<int>(leds.size());
}

int LedEvidence::missed_in_a_row() const {
  return static_cast<int>(std::find_if(flashes_.rbegin(), flashes_.rend(), [](const Flash& s) { return s.matched; }) -
                          flashes_.rbegin());
}

LedEvidence::Leds LedEvidence::leds() const {
  std::map<int, bool> last;
  for (const Flash& s : flashes_) last[s.led] = s.matched;
  return {static_cast<int>(last.size()),
          static_cast<int>(std::ranges::count_if(last, [](const auto& l) { return l.second; }))};
}

std::optional<capture::Timestamp> LedEvidence::last_match() const {
  for (auto s = flashes_.rbegin(); s != flashes_.rend(); ++s)
    if (s->matched) return s->at;
  return std::nullopt;
}

CameraTrackerInside inside_of(const calib::Camera& camera, const std::vector<Vector3d>& leds, const LedGaussian& pose,
                              const Eigen::Matrix2d& noise, const std::vector<FoundLed>& found,
                              const LedParticles& particles) {
  constexpr std::size_t most = 300;
  CameraTrackerInside out;
  for (std::size_t l = 0; l < leds.size(); ++l) {
    LedJacobian j;
    const auto px = led_pixel(camera.model, pose.mean, leds[l], 0, &j);
    if (!px || !camera.contains(calib::RawPixel{*px})) continue;
    CameraTrackerInside::Feature f;
    f.px = px->cast<float>();
    f.found_px = Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN());
    for (const auto& [led, at] : found)
      if (led == static_cast<int>(l)) f.found_px = at.cast<float>();
    f.search = (j * pose.covariance * j.transpose() + noise).cast<float>();
    f.position = leds[l];
    f.covariance.setZero();
    f.given = true;
    out.features.push_back(f);
  }
  const auto states = particles.states();
  for (std::size_t i = 0; i < states.size(); i += std::max<std::size_t>(1, states.size() / most))
    out.particles.push_back(states[i].world_from_camera);
  return out;
}

Vector2d largest_sigmas(const LedCovariance& covariance) {
  const auto largest = [](const Eigen::Matrix3d& m) {
    return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues().maxCoeff()));
  };
  return {largest(covariance.topLeftCorner<3, 3>()), largest(covariance.block<3, 3>(3, 3))};
}

}  // namespace huetrack::leds
