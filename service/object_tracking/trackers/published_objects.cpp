#include "object_tracking/trackers/published_objects.h"

#include <algorithm>

#include "object_tracking/trackers/estimate_report.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

void PublishedObjects::report(const capture::FrameSet& set, const TargetViews& views, const ViewConsistency& agreement,
                              const ObjectFilter& times, TrackedObjects& objects, std::vector<ObjectEstimate>& out) {
  out.clear();
  for (const std::uint32_t number : ended_) {
    out.push_back(without_position(set, views, times, agreement, TrackState::lost));
    out.back().object = number;
    out.back().is_end = true;
  }
  ended_.clear();
  std::optional<Eigen::Vector3d> further_at;
  auto published = std::ranges::count_if(
      objects, [](const auto& object) { return object->is_published && object->state != TrackState::lost; });
  for (const auto& object : objects) {
    const bool is_inside = inside(options_.volume, object->filter.motion(), target_.radius_m);
    if (is_inside) object->last_inside = set.at;
    const bool is_birth = !object->is_published;
    if (is_birth && !(is_inside && is_to_publish(*object, agreement, published, further_at))) continue;
    if (object->is_out_of_picture && target_.count == 1) continue;  // it may come back, as from a bounce
    const bool is_end =
        object->state == TrackState::lost || capture::seconds(set.at - object->last_inside) > options_.coast_s;
    const TrackState state = is_end ? TrackState::lost : is_inside ? object->state : TrackState::coasting;
    out.push_back(object_trackers::report({.set = set,
                                           .views = views,
                                           .radius_m = target_.radius_m,
                                           .options = options_,
                                           .state = state,
                                           .filter = object->filter,
                                           .agreement = agreement,
                                           .sightings = object->sightings,
                                           .seen = object->seen,
                                           .hidden_radii = object->hidden_radii},
                                          object->rig_error, object->last_published));
    out.back().object = object->number;
    out.back().is_birth = is_birth;
    out.back().is_end = is_end;
    if (is_end) object->is_published = false;  // outside it is still followed; when it comes in it gets a new number
  }
  further_.note(set.at, further_at);
  std::ranges::sort(out, {}, &ObjectEstimate::object);
  if (out.empty())  // of the target itself
    out.push_back(without_position(set, views, times, agreement,
                                   last_number_ != number_before_ ? TrackState::lost : TrackState::searching));
  if (target_.count > 1) return;
  out.front() = out.back();  // the newest one
  out.resize(1);
  out.front().object = 0;
  out.front().is_birth = out.front().is_end = false;
}

bool PublishedObjects::is_to_publish(TrackedObject& object, const ViewConsistency& agreement, std::ptrdiff_t& published,
                                     std::optional<Eigen::Vector3d>& further_at) {
  if (object.state == TrackState::lost || !object.existence.is_sure()) return false;
  if (object.state == TrackState::coasting && agreement.no_consistent_pair()) return false;
  if (published >= target_.count) {
    further_at = object.filter.motion().position();
    return false;
  }
  ++published;
  object.is_published = true;
  object.number = ++last_number_;
  return true;
}

void PublishedObjects::end_all(const TrackedObjects& objects) {
  note_ended(objects);
  number_before_ = last_number_;
}

// Subscribers know objects by their numbers alone, so a number ends with its tracker and is not used again.
void PublishedObjects::take_over_from(const PublishedObjects& before, const TrackedObjects& objects) {
  number_before_ = last_number_ = before.last_number_;
  ended_ = before.ended_;
  note_ended(objects);
}

// One object has no number, and goes on.
void PublishedObjects::note_ended(const TrackedObjects& objects) {
  if (target_.count == 1) return;
  for (const auto& object : objects)
    if (object->is_published) ended_.push_back(object->number);
}

}  // namespace huetrack::object_trackers
