#include "camera_tracking/led_tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "camera_tracking/led_blobs.h"
#include "camera_tracking/led_filter.h"

namespace huetrack {

namespace {

class LedTracker final : public CameraTracker {
 public:
  LedTracker(const Camera& camera, const CameraTrackerOptions& options) : start_(std::get<LedStart>(options.start)) {
    const LedFilterOptions filter{.start = start_, .particle_count = options.particle_count, .seed = options.seed};
    filter_ = options.method == CameraMethod::herranz ? LedFilter::paper(camera, filter)
                                                      : LedFilter::huetrack(camera, filter);
  }

  CameraEstimate update(const Frame& frame) override {
    LedFrame seen{.at = frame.captured_at, .number = frames_++, .lit = lit_led(start_, frame), .dots = {}};
    const bool dark = seen.lit && *seen.lit < 0;
    if (frame.status == FrameStatus::ok && !dark)
      for (const LedBlob& blob : find_led_blobs(frame.pixels, {})) seen.dots.push_back(blob.px);
    return filter_->update(seen);
  }
  CameraTrackerView view() const override { return filter_->view(); }
  std::vector<CameraMapPoint> map() const override {
    std::vector<CameraMapPoint> out;
    for (const Eigen::Vector3d& led : start_.leds)
      out.push_back({.id = static_cast<std::uint32_t>(out.size()), .position = led, .given = true});
    for (const CameraTrackerView::Feature& f : filter_->view().features) {
      if (!f.found_px.allFinite()) continue;  // not lit, perhaps: nobody can say that it was missed
      const auto led = std::ranges::find(out, f.position, &CameraMapPoint::position);
      if (led != out.end()) led->state = CameraMapPoint::State::found;
    }
    return out;
  }
  void save_map(const std::filesystem::path& file) const override {
    throw std::runtime_error("cannot write " + file.string() + ": LED tracking has no map but the given LEDs");
  }

 private:
  LedStart start_;
  std::unique_ptr<LedFilter> filter_;
  std::uint64_t frames_ = 0;
};

}  // namespace

std::unique_ptr<CameraTracker> make_led_tracker(const Camera& camera, const CameraTrackerOptions& options) {
  return std::make_unique<LedTracker>(camera, options);
}

std::optional<int> lit_led(const LedStart& start, const Frame& frame) {
  if (start.schedule.empty()) return std::nullopt;
  const auto slots = static_cast<std::int64_t>(start.schedule.size());
  std::int64_t slot = frame.sequence;
  if (start.slot_s > 0) slot = static_cast<std::int64_t>(std::floor(seconds(frame.captured_at) / start.slot_s));
  return start.schedule[static_cast<std::size_t>(((slot % slots) + slots) % slots)];
}

}  // namespace huetrack
