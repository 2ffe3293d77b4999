#include "color_teaching/lesson.h"

#include <algorithm>

namespace huetrack::color_teaching {

Lesson learn(const ColorTeacher& teacher, const TeachRequestOptions& request,
             const std::vector<object_tracking::TargetOptions>& targets, const object_tracking::TargetOptions& target,
             const object_tracking::Box& volume) {
  Lesson lesson;
  lesson.taught = teacher.teach(request, volume);
  lesson.target = target;
  if (request.accepts_suggestions && lesson.taught.any()) {
    TeachRequestOptions confirmed = request;
    for (std::size_t c = 0; c < lesson.taught.views.size(); ++c) {
      const TaughtView& view = lesson.taught.views[c];
      if (!view.pointed && view.region && view.problem.empty())
        confirmed.points.push_back({int(c), view.region->centre});
    }
    lesson.taught = teacher.teach(confirmed, volume);
  }
  const Taught& taught = lesson.taught;
  if (taught.any()) lesson.target = with_taught_color(target, teacher.rig(), taught);
  lesson.unconfirmed = unconfirmed(taught, teacher.rig());
  lesson.namesakes = teacher.namesakes(taught, targets, target.name);
  lesson.radius_hint = radius_hint(taught, target);
  lesson.why_useless = why_useless(taught, teacher.rig());
  lesson.is_faint = std::ranges::any_of(
      taught.views, [](const TaughtView& view) { return view.pointed && view.object_share < least_object_share; });
  return lesson;
}

void add_ignored(object_tracking::IgnoredRegions& regions, const std::string& camera,
                 const object_tracking::PixelBox& box) {
  auto it = std::ranges::find(regions, camera, &object_tracking::IgnoredRegions::value_type::first);
  if (it == regions.end()) it = regions.insert(regions.end(), {camera, {}});
  it->second.push_back(box);
}

}  // namespace huetrack::color_teaching
