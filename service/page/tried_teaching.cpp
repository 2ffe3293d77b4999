#include "page/tried_teaching.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <stdexcept>
#include <utility>

#include "config/view_volume.h"

namespace huetrack::page {
namespace {

// A measured radius replaces the default, unless it is based on unconfirmed places; it replaces a configured radius
// only with --radius.
std::optional<double> radius_to_write(const color_teaching::Lesson& lesson, const TeachCommand& command,
                                      bool is_sized) {
  if (command.radius && !lesson.radius.radius_m)
    throw std::runtime_error("nothing is saved: --radius: " + color_teaching::radius_words(lesson.radius, {}));
  const bool is_taken = command.radius || (!is_sized && lesson.unconfirmed.empty());
  return is_taken ? lesson.radius.radius_m : std::nullopt;
}

// Why no range of the colour can pass the trial, and what to do; empty: another one may. lesson: has the tried radius.
std::string other_reason(const color_teaching::Lesson& lesson, const calib::Camera& camera, const Eigen::Vector2d& px,
                         const object_tracking::Volume& volume) {
  constexpr double mm = 1e3;
  if (!config::meets_volume(camera, px, volume))
    return fmt::format(
        "the point in {} is outside of object_tracking.volume, min: [{:g}], max: [{:g}]: extend the volume, in the "
        "rig's world frame, to where the object is",
        camera.name, fmt::join(volume.min, ", "), fmt::join(volume.max, ", "));
  if (color_teaching::differs_clearly(lesson.radius, lesson.target.radius_m))
    return fmt::format(
        "the search accepts only objects of about the configured radius, {:g} mm, but the pictures show {:.0f} mm: use "
        "that with --radius, or correct radius_m",
        mm * lesson.target.radius_m, mm * *lesson.radius.radius_m);
  return "";
}

// Another such object is at least a diameter away; nearer, it is a part of the clicked one.
bool is_elsewhere(const ColorTrial& trial, const color_teaching::Lesson& lesson) {
  return trial.is_sure && trial.at_point && trial.at_point->px > 2 * trial.at_point->limit_px &&
         lesson.target.count == 1;
}

// cameras: of the rig. is_sized: the radius is configured.
std::string what_to_try(const color_teaching::Lesson& lesson, const ColorTrial& trial, std::size_t cameras,
                        bool is_sized) {
  if (!lesson.why_doubtful.empty()) return lesson.why_doubtful;
  return std::string(is_elsewhere(trial, lesson) ? "if that is another such object, raise the target's count; else "
                                                 : "") +
         "give its place " + (cameras > 1 ? "in every camera (--at), or " : "") +
         "where it is larger, or in another frame" +
         (is_sized ? fmt::format("; or radius_m, {:g} mm, is wrong{}", 1e3 * lesson.target.radius_m,
                                 lesson.radius.radius_m ? ": --radius uses the measured one" : "")
                   : std::string());
}

}  // namespace

TriedTeaching::TriedTeaching(const TeachCommand& command, const config::ServiceConfig& config,
                             const object_tracking::TargetOptions& target, const color_teaching::ColorTeacher& teacher,
                             const color_teaching::TeachRequestOptions& request, capture::Timestamp clicked_at)
    : command_(command),
      config_(config),
      target_(target),
      teacher_(teacher),
      request_(request),
      seen_{.point = request.points.front(), .at = clicked_at} {}

color_teaching::Lesson TriedTeaching::learn() const {
  return color_teaching::learn(teacher_, request_, config_.targets, target_, config_.object_tracking.volume);
}

TriedLesson TriedTeaching::untried(color_teaching::Lesson lesson) const {
  TriedLesson out{.lesson = std::move(lesson), .radius_m = {}};
  out.radius_m = radius_to_write(out.lesson, command_, is_sized());
  out.lesson.target.ignored = request_.ignored;
  out.lesson.target.radius_m = out.radius_m.value_or(target_.radius_m);
  return out;
}

void TriedTeaching::try_it(TriedLesson& tried, const std::stop_token& stop) const {
  tried.trial = try_color(config_, command_.recording, tried.lesson.target, seen_, stop);
  if (stop.stop_requested()) throw std::runtime_error("stopped during the trial: nothing is saved");
}

bool TriedTeaching::passes(TriedLesson& tried, const std::stop_token& stop) const {
  try_it(tried, stop);
  const std::string other = other_reason(tried.lesson, camera(), seen_.point.px, config_.object_tracking.volume);
  const bool depends_on_width = other.empty() && command_.wider == 0 && !is_elsewhere(tried.trial, tried.lesson);
  if (depends_on_width) {
    fmt::print("With the learnt colour, {}: wider and narrower ranges are tried\n", words(tried));
    tried = best_width(std::move(tried), stop);
  }
  const bool may_be_forced = tried.lesson.is_all_clicked;
  // A wide range tracks also by a radius that the pictures contradict, at wrong distances.
  const bool is_contradicted = !other.empty() && !may_be_forced;
  if ((tried.is_found() && !is_contradicted) || (command_.force && may_be_forced)) {
    if (depends_on_width && tried.is_found() && !tried.is_of_other_width)
      fmt::print("No other range is better\n");
    else
      fmt::print("{} the learnt colour, {}\n", tried.is_found() ? "With" : "Warning: with", words(tried));
    return true;
  }
  fmt::print(stderr, "huetrackd: nothing is saved: with the learnt colour, {}{}: {}{}\n", words(tried),
             depends_on_width ? ", nor with other ranges" : "",
             other.empty() ? what_to_try(tried.lesson, tried.trial, config_.rig.cameras.size(), is_sized()) : other,
             may_be_forced ? "; --force saves it anyway" : "");
  return false;
}

TriedLesson TriedTeaching::best_width(TriedLesson best, const std::stop_token& stop) const {
  constexpr int furthest = 3;  // steps; further away the range is another colour's
  const color_teaching::Lesson learnt = best.lesson;
  std::optional<int> used;
  for (const int direction : {1, -1}) {
    for (int step = 1; step <= furthest; ++step) {
      color_teaching::TeachRequestOptions request = request_;
      const int wider = request.wider = step * direction;
      color_teaching::Lesson lesson = color_teaching::with_width(learnt, teacher_, request, config_.targets);
      if (!lesson.why_useless.empty()) break;
      TriedLesson next = untried(std::move(lesson));
      try_it(next, stop);
      // Once it is found: tracked as often at least, and surer.
      const bool is_better =
          next.precision() > best.precision() && (!best.is_found() || next.trial.tracking >= best.trial.tracking);
      if (!is_better && best.is_found()) break;
      if (!is_better) continue;
      fmt::print("  --wider {}: {}\n", wider, words(next));
      best = std::move(next), best.is_of_other_width = true, used = wider;
    }
    if (used) break;  // wider ones are better: narrower ones are not
  }
  if (used) fmt::print("So the ranges of --wider {} are used:\n", *used);
  return best;
}

}  // namespace huetrack::page
