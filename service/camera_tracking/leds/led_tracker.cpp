#include "camera_tracking/leds/led_tracker.h"

#include <algorithm>
#include <deque>
#include <set>
#include <stdexcept>

#include "camera_tracking/leds/led_blobs.h"
#include "camera_tracking/leds/led_filter.h"
#include "camera_tracking/leds/led_schedule.h"

namespace huetrack::leds {

namespace {

class LedTracker final : public CameraTracker {
 public:
  LedTracker(const calib::Camera& camera, const CameraTrackerOptions& options)
      : start_(std::get<LedStart>(options.start)) {
    LedFilterOptions filter{.start = start_, .seed = options.seed};
    if (options.particle_count > 0) filter.particle_count = options.particle_count;
    filter_ = options.method == CameraMethod::herranz ? LedFilter::paper(camera, filter)
                                                      : LedFilter::huetrack(camera, filter);
    if (options.method == CameraMethod::huetrack && !start_.schedule.empty())
      offset_search_.emplace(camera, start_, filter.particle_count, particle_filter::Rng(options.seed, 2));
  }

  CameraEstimate update(const capture::Frame& frame) override {
    const LedMoment moment = moment_of(frame);
    std::vector<Eigen::Vector2d> dots;
    if (frame.status == capture::FrameStatus::ok)
      for (const LedBlob& blob : find_led_blobs(frame.pixels)) dots.push_back(blob.px);
    LedFrame seen{.at = frame.captured_at, .number = frames_++, .lit = lit_led(start_, moment, offset_), .dots = {}};
    const bool dark = seen.lit && *seen.lit < 0;
    if (!dark) seen.dots = dots;
    CameraEstimate estimate = filter_->update(seen);
    if (offset_search_) {
      // A wrong offset fits only with a larger noise.
      if (estimate.has_pose() && !offset_is_proven_ && filter_->start_noise_px() < proving_noise_px)
        offset_is_proven_ = true;
      if (estimate.has_pose() && offset_is_proven_) {
        offset_search_->forget();
      } else {
        search_offset(moment, dots);
        if (estimate.has_pose()) estimate = without_pose(estimate);
      }
    }
    has_pose_ = estimate.has_pose();
    had_pose_ |= has_pose_;
    if (!had_pose_) estimate.state = PoseState::searching;
    remember(frame.captured_at, dots.size(), seen.lit);
    return estimate;
  }

  void begin_anew() override {
    filter_->forget();
    if (offset_search_) offset_search_->forget();
    offset_is_proven_ = has_pose_ = false;
    recent_.clear();
  }

  std::string why_no_pose() const override {
    if (has_pose_ || recent_.empty()) return {};
    if (std::ranges::all_of(recent_, [](const Recent& r) { return r.dots == 0; }))
      return "no LED was seen in the last 2 s: bright dots on a dark ground, up to 40 px across, are looked for";
    if (start_.schedule.empty()) {
      const std::size_t most = std::ranges::max(recent_, {}, &Recent::dots).dots;
      if (most < 5)
        return count_of(most, "bright dot is", "bright dots are") +
               " seen at once, and without led_schedule 5 are needed to identify the LEDs";
      if (filter_->is_ambiguous()) return ambiguous;
      return "bright dots are seen, but no pose explains them as LEDs: check the LEDs' positions, the room "
             "(led_room_min, led_room_max) and the rig; is every dot a LED?";
    }
    std::set<int> lit;
    for (const Recent& r : recent_)
      if (r.dots > 0 && r.lit >= 0 && recent_.back().at - r.at < together) lit.insert(r.lit);
    if (lit.size() < 4)
      return count_of(lit.size(), "LED was", "different LEDs were") + " seen in the last 0.6 s, and 4 are needed";
    if (filter_->is_ambiguous()) return ambiguous;
    return "LEDs are seen, but no pose explains them: check led_schedule, the LEDs' positions, the room (led_room_min, "
           "led_room_max) and the rig";
  }
  CameraTrackerInside inside() const override { return filter_->inside(); }
  std::vector<CameraMapPoint> map() const override {
    std::vector<CameraMapPoint> out;
    for (const Eigen::Vector3d& led : start_.leds)
      out.push_back({.id = static_cast<std::uint32_t>(out.size()), .position = led, .given = true});
    for (const CameraTrackerInside::Feature& f : filter_->inside().features) {
      if (!f.found_px.allFinite()) continue;  // it may not be lit
      const auto led = std::ranges::find(out, f.position, &CameraMapPoint::position);
      if (led != out.end()) led->state = CameraMapPoint::State::found;
    }
    return out;
  }
  void save_map(const std::filesystem::path& file) const override {
    throw std::runtime_error("cannot write " + file.string() + ": LED tracking has no map but the given LEDs");
  }

 private:
  static constexpr const char* ambiguous =
      "more than one pose explains the LEDs that are seen: more LEDs are needed, or not all in one plane";
  static constexpr double proving_noise_px = 0.3;
  static constexpr capture::Duration together = std::chrono::milliseconds(600);  // the search's window

  static std::string count_of(std::size_t n, const char* one, const char* many) {
    return n == 1 ? "only 1 " + std::string(one) : "only " + std::to_string(n) + " " + many;
  }
  void search_offset(const LedMoment& moment, const std::vector<Eigen::Vector2d>& dots) {
    const auto offset = offset_search_->update(moment, dots.empty() ? std::nullopt : std::optional(dots.front()));
    if (!offset) return;
    offset_is_proven_ = true;
    if (*offset == offset_) return;
    offset_ = *offset;
    filter_->forget();
  }
  static CameraEstimate without_pose(const CameraEstimate& estimate) {
    CameraEstimate e;
    e.at = estimate.at;
    e.frame_number = estimate.frame_number;
    e.map_points = estimate.map_points;
    e.particle_count = estimate.particle_count;
    e.effective_sample_size = estimate.effective_sample_size;
    return e;
  }
  void remember(capture::Timestamp at, std::size_t dots, std::optional<int> lit) {
    recent_.push_back({at, dots, lit.value_or(-1)});
    while (at - recent_.front().at > std::chrono::seconds(2)) recent_.pop_front();
  }

  struct Recent {
    capture::Timestamp at;
    std::size_t dots;
    int lit;  // -1: none, or unknown
  };

  LedStart start_;
  std::unique_ptr<LedFilter> filter_;
  std::optional<LedOffsetSearch> offset_search_;  // ours only, with a schedule
  bool offset_is_proven_ = false;
  int offset_ = 0;             // see lit_led()
  std::deque<Recent> recent_;  // the last 2 s
  bool has_pose_ = false, had_pose_ = false;
  std::uint64_t frames_ = 0;
};

}  // namespace

std::unique_ptr<CameraTracker> make_led_tracker(const calib::Camera& camera, const CameraTrackerOptions& options) {
  return std::make_unique<LedTracker>(camera, options);
}

}  // namespace huetrack::leds
