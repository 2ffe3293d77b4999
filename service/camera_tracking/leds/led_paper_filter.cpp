// LedFilter::paper(): Herranz et al., section III.
#include <algorithm>
#include <cmath>

#include "camera_tracking/leds/led_filter.h"

namespace huetrack::leds {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace std::chrono_literals;

// While the cloud converges, the Gaussian is widened until this share of the particles survives, with this jitter (in
// units of the cloud's standard deviation); with less of either 5000 particles converge to a wrong place. The paper's
// Gaussian is used once enough_share survives it.
constexpr double gathering_share = 0.4, gathering_jitter = 0.2;
constexpr double enough_share = 0.05, gathered_jitter = 0.03;
// Unidentified LEDs: LedParticles::anneal() in each frame until all dots are explained; then the Gaussian is narrowed
// to the paper's within each frame, so that the still unknown velocities do not move the cloud away.
constexpr std::size_t least_dots = 5;
constexpr double annealed_rms = 2;  // of the sightings' sigma
constexpr double narrowing_share = 0.1, narrowing_jitter = 0.3;
constexpr int narrowing_steps = 6;
constexpr double least_sigma_px = 1;  // Table I; a narrower Gaussian leaves too few of 5000
constexpr double own_motion = 0.25;   // of LedFilterOptions::motion
constexpr double narrow = 1.5;        // largest widening of a converged cloud
constexpr int gathered_frames = 12;
constexpr double small_sigma_m = 0.05, small_sigma_rad = 0.06;
constexpr double explained_px = 6;  // largest residual of a LED that supports the pose
constexpr capture::Duration gathered_length = 400ms;

class PaperLedFilter final : public LedFilter {
 public:
  PaperLedFilter(const calib::Camera& camera, const LedFilterOptions& options)
      : camera_(camera),
        options_(options),
        motion_{.acceleration = own_motion * options.motion.acceleration,
                .angular_acceleration = own_motion * options.motion.angular_acceleration,
                .correlation_s = options.motion.correlation_s},
        particles_(options.particle_count, particle_filter::Rng(options.seed)) {
    scatter();
  }

  CameraEstimate update(const LedFrame& frame) override {
    // "the prediction phase ... sampling from the state transition distribution"
    if (number_ > 0) particles_.predict(std::max(1e-6, capture::seconds(frame.at - last_at_)), motion_);
    last_at_ = frame.at;
    ++number_;

    // "the PF compares the fake image of each particle with the real image ... and uses a gaussian function"
    const std::vector<LedSighting> sightings = sightings_of(frame);
    if (!frame.lit && to_gather_) {
      gather(frame, sightings);
      return estimate(frame, 1);
    }
    const double share = frame.lit ? gathering_share : narrowing_share;
    const double enough = frame.lit ? enough_share : narrowing_share;
    if (!sightings.empty()) widening_ = weigh(sightings, share, enough);
    for (int k = 1; !frame.lit && !sightings.empty() && widening_ > 1 && k < narrowing_steps; ++k) {
      particles_.resample(narrowing_jitter);
      widening_ = weigh(sightings, share, enough);
    }
    pose_ = particles_.moments();
    const double ess = particles_.effective_sample_size();
    judge(frame, sightings);

    // "Finally, the resampling step is executed."
    if (!sightings.empty())
      particles_.resample(!frame.lit ? narrowing_jitter : widening_ > 1 ? gathering_jitter : gathered_jitter);
    return estimate(frame, ess);
  }

  CameraTrackerInside inside() const override {
    return inside_of(camera_, options_.start.leds, pose_, Eigen::Matrix2d::Zero(), found_, particles_);
  }

 private:
  void scatter() { particles_.scatter(options_.start.room_min, options_.start.room_max, options_.start_velocity); }

  double miss_px() const { return std::hypot(camera_.image_size.width, camera_.image_size.height); }
  double weigh(const std::vector<LedSighting>& sightings, double least_share, double enough) {
    return particles_.weigh(camera_.model, options_.start.leds, sightings, least_share, enough, miss_px());
  }

  void gather(const LedFrame& frame, const std::vector<LedSighting>& sightings) {
    evidence_.clear();
    found_.clear();
    gathered_ = 0;
    if (sightings.size() < least_dots) return;
    const double rms_px = particles_.anneal(camera_.model, options_.start.leds, sightings, options_.start.room_min,
                                            options_.start.room_max, options_.start_velocity, miss_px());
    pose_ = particles_.moments();
    to_gather_ = rms_px > annealed_rms * sightings.front().sigma_px;
    explained_at_ = frame.at;
  }

  std::vector<LedSighting> sightings_of(const LedFrame& frame) const {
    std::vector<LedSighting> sightings;
    if (!frame.lit) {
      for (const Vector2d& px : frame.dots)
        sightings.push_back({-1, px, 0, std::max(least_sigma_px, options_.pixel_noise_px)});
    } else if (*frame.lit >= 0 && !frame.dots.empty()) {
      sightings.push_back(
          {*frame.lit, frame.dots.front(), 0, std::max(least_sigma_px, options_.pixel_noise_px)});  // the brightest
    }
    return sightings;
  }

  // Valid (which the paper does not define): the cloud is small, and the LEDs are near their projections.
  void judge(const LedFrame& frame, const std::vector<LedSighting>& sightings) {
    found_.clear();
    const auto check = [&](int led) {
      const auto px =
          led_pixel(camera_.model, pose_.mean, options_.start.leds[static_cast<std::size_t>(led)], 0, nullptr);
      if (!px || !camera_.contains(calib::RawPixel{*px})) return;
      bool near = false;
      for (const LedSighting& s : sightings)
        if ((s.led < 0 || s.led == led) && (s.px - *px).norm() < std::max(explained_px, 5 * options_.pixel_noise_px)) {
          near = true;
          found_.emplace_back(led, s.px);
        }
      evidence_.add(frame.at, led, near);
    };
    if (!frame.lit) {
      for (std::size_t l = 0; l < options_.start.leds.size(); ++l) check(static_cast<int>(l));
    } else if (*frame.lit >= 0) {
      check(*frame.lit);
    }
    evidence_.forget(frame.at - gathered_length);
    const Vector2d sigma = largest_sigmas(pose_.covariance);
    small_ = sigma.x() < small_sigma_m && sigma.y() < small_sigma_rad;
    const bool explained = evidence_.distinct() >= 4 && 4 * evidence_.matched() > 3 * evidence_.in_view();
    // For some frames: a converging cloud may only pass through this place.
    gathered_ = widening_ < narrow ? gathered_ + static_cast<int>(!sightings.empty()) : 0;
    if (explained) explained_at_ = frame.at;
    if (small_ && explained && gathered_ >= gathered_frames) {
      state_ = PoseState::tracking;
    } else if (state_ == PoseState::tracking || state_ == PoseState::coasting) {
      // One unidentified dot may lie near a LED by chance.
      const capture::Timestamp supported =
          frame.lit ? evidence_.last_match().value_or(capture::Timestamp{}) : explained_at_;
      state_ = small_ && frame.at - supported < gathered_length ? PoseState::coasting : PoseState::lost;
    }
    if (!frame.lit && sightings.size() >= least_dots && frame.at - explained_at_ > gathered_length) to_gather_ = true;
    // A small cloud without support: start again from the whole room.
    if (small_ && evidence_.in_view() >= 12 && evidence_.matched() == 0) {
      evidence_.clear();
      scatter();
    }
  }

  CameraEstimate estimate(const LedFrame& frame, double ess) const {
    CameraEstimate e;
    e.at = frame.at;
    e.frame_number = frame.number;
    e.state = state_;
    e.map_points = static_cast<int>(options_.start.leds.size());
    e.particle_count = options_.particle_count;
    e.effective_sample_size = ess;
    if (!e.has_pose() && !options_.report_unproven) return e;
    e.world_from_camera = pose_.mean.world_from_camera;
    e.covariance = pose_.covariance.topLeftCorner<6, 6>();
    const auto [in_view, matched] = evidence_.leds();
    e.features_in_view = in_view;
    e.features_matched = matched;
    e.confidence = e.features_in_view > 0 ? static_cast<double>(e.features_matched) / e.features_in_view : 0;
    return e;
  }

  calib::Camera camera_;
  LedFilterOptions options_;
  LedMotionNoise motion_;
  LedParticles particles_;
  LedGaussian pose_;
  LedEvidence evidence_;
  std::vector<FoundLed> found_;
  PoseState state_ = PoseState::searching;
  double widening_ = 1;
  bool small_ = false, to_gather_ = true;  // to_gather_: unidentified LEDs
  capture::Timestamp explained_at_{};
  int gathered_ = 0;  // frames in a row
  std::uint64_t number_ = 0;
  capture::Timestamp last_at_{};
};

}  // namespace

std::unique_ptr<LedFilter> LedFilter::paper(const calib::Camera& camera, const LedFilterOptions& options) {
  return std::make_unique<PaperLedFilter>(camera, options);
}

}  // namespace huetrack::leds
