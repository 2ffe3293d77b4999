#include "capture/field_source.h"

#include <utility>

#include "capture/timing/capture_clock.h"

namespace huetrack::capture {

FieldSource::FieldSource(std::unique_ptr<FrameSource> source, std::map<int, FirstField> fields)
    : source_(std::move(source)), fields_(std::move(fields)) {}

std::optional<Frame> FieldSource::next(std::stop_token stop) {
  auto frame = source_->next(std::move(stop));
  if (!frame || frame->status != FrameStatus::ok || frame->matches || !has_pixels(frame->pixels)) return frame;
  const auto field = fields_.find(frame->camera);
  CombWatch& watch = watches_[frame->camera];
  watch.see(frame->pixels, field == fields_.end() ? std::nullopt : std::optional(StatedFields{.first = field->second}));
  if (auto problem = watch.take_problem()) {
    const std::scoped_lock lock(mutex_);
    warnings_[frame->camera] = *problem;
    new_events_[frame->camera].push_back({unix_now(), CaptureState::delivering, true, std::move(*problem)});
  }
  if (field == fields_.end()) return frame;
  frame->pixels = first_field(frame->pixels, field->second);
  frame->encoded = nullptr;
  return frame;
}

std::string FieldSource::warning(int camera) const {
  const std::scoped_lock lock(mutex_);
  const auto found = warnings_.find(camera);
  return found == warnings_.end() ? std::string() : found->second;
}

std::vector<CameraEvent> FieldSource::take_events(int camera) {
  const std::scoped_lock lock(mutex_);
  return std::exchange(new_events_[camera], {});
}

void watch_fields(LiveCamera& camera, std::vector<LiveCamera*> others, std::map<int, FirstField> fields) {
  auto owned = std::make_unique<FieldSource>(std::move(camera.source), std::move(fields));
  FieldSource* const source = owned.get();
  camera.source = std::move(owned);
  others.push_back(&camera);
  for (LiveCamera* const one : others) {
    one->health = [source, index = one->camera, asked = std::move(one->health)] {
      CameraHealth health = asked();
      if (health.warning.empty()) health.warning = source->warning(index);
      return health;
    };
    one->take_events = [source, index = one->camera, asked = std::move(one->take_events)] {
      std::vector<CameraEvent> events = asked();
      for (CameraEvent& event : source->take_events(index)) events.push_back(std::move(event));
      return events;
    };
  }
}

}  // namespace huetrack::capture
