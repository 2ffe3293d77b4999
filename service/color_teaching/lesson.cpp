#include "color_teaching/lesson.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace huetrack::color_teaching {

namespace {

constexpr double most_elsewhere = 0.01;  // of a picture: of so much a search finds the object in nearly every set
constexpr double furthest_hue_deg = 35;  // from one camera to the next: more than white balance does

double middle_hue(const color::HsiRange& range) {
  return range.hue_min_deg + std::fmod(range.hue_max_deg - range.hue_min_deg + 720, 360) / 2;
}

std::string suggested_in(const calib::CameraRig& rig, std::size_t camera) {
  return "what was suggested in camera " + rig.cameras[camera].name;
}

// Why suggestions must not be accepted unseen. Empty: they may be.
std::string why_not_accepted(const Taught& taught, const calib::CameraRig& rig, std::size_t first,
                             const std::vector<std::size_t>& accepted) {
  for (const std::size_t c : accepted) {
    const TaughtView& view = taught.views[c];
    const std::string where = suggested_in(rig, c);
    if (!view.pointed) return where + " is no region of one colour: point at the object there";
    const double off = std::remainder(middle_hue(view.color) - middle_hue(taught.views[first].color), 360.0);
    if (std::abs(off) > furthest_hue_deg)
      return fmt::format(
          "{} has another hue, by {:.0f} degrees, than what was pointed at in {}: point at the object there", where,
          std::abs(off), rig.cameras[first].name);
  }
  return "";
}

// Why only a trial shows whether the suggestions are right. Empty: their pictures show it.
std::string why_doubtful(const Taught& taught, const calib::CameraRig& rig, const std::vector<std::size_t>& accepted) {
  for (const std::size_t c : accepted) {
    const TaughtView& view = taught.views[c];
    if (view.background_share > most_elsewhere)
      return fmt::format(
          "the colour of {} covers {:.1f} % of its picture outside the object: point at the object there, narrow the "
          "ranges, or ignore a rectangle",
          suggested_in(rig, c), 100 * view.background_share);
  }
  return "";
}

// The narrowing that leaves a patch in no camera; nullopt: no camera needs or has one.
std::optional<int> narrower_steps(const Taught& taught) {
  std::optional<int> steps;
  for (const TaughtView& view : taught.views)
    if (view.narrower) steps = std::min(steps.value_or(view.narrower->wider), view.narrower->wider);
  return steps;
}

// All that follows from the ranges of lesson.taught.
void judge(Lesson& lesson, const ColorTeacher& teacher, const TeachRequestOptions& request,
           const std::vector<object_tracking::TargetOptions>& targets) {
  const Taught& taught = lesson.taught;
  lesson.why_useless.clear(), lesson.why_doubtful.clear();
  if (!lesson.accepted.empty()) {
    const auto is_taught = [&](const TeachPoint& p) { return taught.views[std::size_t(p.camera)].pointed; };
    const auto first = std::size_t(std::ranges::find_if(request.points, is_taught)->camera);
    lesson.why_useless = why_not_accepted(taught, teacher.rig(), first, lesson.accepted);
    lesson.why_doubtful = why_doubtful(taught, teacher.rig(), lesson.accepted);
  }
  if (taught.any()) lesson.target = with_taught_color(lesson.target, teacher.rig(), taught);
  lesson.namesakes = teacher.namesakes(taught, targets, lesson.target.name);
  if (lesson.why_useless.empty()) lesson.why_useless = why_useless(taught, teacher.rig());
  lesson.is_faint = std::ranges::any_of(
      taught.views, [](const TaughtView& view) { return view.pointed && view.object_share < least_object_share; });
}

}  // namespace

Lesson learn(const ColorTeacher& teacher, const TeachRequestOptions& requested,
             const std::vector<object_tracking::TargetOptions>& targets, const object_tracking::TargetOptions& target,
             const object_tracking::Volume& volume) {
  TeachRequestOptions request = requested;
  if (!target.is_radius_assumed) request.radius_m = target.radius_m;
  Lesson lesson;
  lesson.target = target;
  lesson.taught = teacher.held_elsewhere(teacher.teach(request, volume), request, volume, target.count > 1);
  if (request.accepts_suggestions && lesson.taught.any()) {
    const auto is_clicked = [&](std::size_t c) {
      return std::ranges::find(request.points, int(c), &TeachPoint::camera) != request.points.end();
    };
    for (std::size_t c = 0; c < lesson.taught.views.size(); ++c) {
      if (!lesson.taught.views[c].pointed || is_clicked(c)) continue;
      lesson.is_all_clicked = false;
      // What was found only at other moments is no suggestion.
      if (lesson.taught.views[c].region) lesson.accepted.push_back(c);
    }
    // No user checks what else has the colour: narrower ranges that leave it out are used, unless a width is requested,
    // or a trial shows whether the tracker distinguishes the two.
    if (const auto steps = narrower_steps(lesson.taught); steps && request.wider == 0 && !request.is_tried) {
      request.wider = *steps;
      lesson.taught = teacher.fitted(std::move(lesson.taught), request);
      lesson.narrowed_to = *steps;
    }
  }
  lesson.unconfirmed = unconfirmed(lesson.taught, teacher.rig());
  if (lesson.taught.any()) lesson.radius = teacher.radius(lesson.taught);
  judge(lesson, teacher, request, targets);
  return lesson;
}

Lesson with_width(Lesson lesson, const ColorTeacher& teacher, const TeachRequestOptions& request,
                  const std::vector<object_tracking::TargetOptions>& targets) {
  lesson.taught = teacher.fitted(std::move(lesson.taught), request);
  judge(lesson, teacher, request, targets);
  return lesson;
}

std::string radius_words(const RadiusProposal& proposal, std::optional<double> configured_m) {
  constexpr double mm = 1e3;
  if (!proposal.radius_m) {
    const std::string why = "Its radius cannot be measured: " + proposal.why_not + ".";
    if (configured_m) return why;
    return why +
           fmt::format(" Until radius_m is set, {:g} mm is assumed.", mm * object_tracking::TargetOptions().radius_m);
  }
  // Two sigmas, and no more digits than they allow.
  const double off_mm = 2 * mm * proposal.sigma_m;
  std::string text = fmt::format("It has a radius of {:.{}f} mm, give or take {:.{}f} (by {} {} of {} cameras",
                                 mm * *proposal.radius_m, off_mm < 2 ? 1 : 0, off_mm, off_mm < 2 ? 1 : 0,
                                 proposal.moments, proposal.moments == 1 ? "moment" : "moments", proposal.cameras);
  if (proposal.is_rough) text += "; roughly, by its coloured regions alone: better measure it";
  if (!configured_m) return text + "), as far as the rig's scale is right.";
  if (!differs_clearly(proposal, *configured_m))
    return text + fmt::format("), which agrees with the configured {:g} mm.", mm * *configured_m);
  return text + fmt::format(
                    "), but the configured radius is {:g} mm: take the one that is right; where a ruler says {:g} mm, "
                    "the rig's distances are wrong.",
                    mm * *configured_m, mm * *configured_m);
}

std::string unsaved_radius_words() {
  constexpr double mm = 1e3;
  return fmt::format("The radius is not saved, because not all places are confirmed: {:g} mm is assumed.",
                     mm * object_tracking::TargetOptions().radius_m);
}

void add_ignored(object_tracking::IgnoredRegions& regions, const std::string& camera, const color::PixelBox& box) {
  auto it = std::ranges::find(regions, camera, &object_tracking::IgnoredRegions::value_type::first);
  if (it == regions.end()) it = regions.insert(regions.end(), {camera, {}});
  it->second.push_back(box);
}

}  // namespace huetrack::color_teaching
