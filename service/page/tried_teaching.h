// Teaches from pictures of a recording, and tracks the recording with what was learnt before it is saved: the trial
// decides which width of the ranges is used. For `huetrackd teach`; prints its progress.
#pragma once

#include <optional>
#include <stop_token>
#include <string>

#include "color_teaching/lesson.h"
#include "page/color_trial.h"
#include "page/teach.h"

namespace huetrack::page {

struct TriedLesson {
  color_teaching::Lesson lesson;
  std::optional<double> radius_m;  // to be written
  ColorTrial trial = {};
  bool is_of_other_width = false;  // than what was learnt first

  bool is_found() const { return trial.is_sure && trial.is_found(); }  // tracked where it was clicked
  double precision() const { return is_found() ? trial.precision() : 0; }
};

// Keeps references to all that it is made from.
class TriedTeaching {
 public:
  // clicked_at: time of the frame with the request's first point
  TriedTeaching(const TeachCommand& command, const config::ServiceConfig& config,
                const object_tracking::TargetOptions& target, const color_teaching::ColorTeacher& teacher,
                const color_teaching::TeachRequestOptions& request, capture::Timestamp clicked_at);

  color_teaching::Lesson learn() const;

  // With the radius that would be written. throws std::runtime_error: --radius, but none was measured
  TriedLesson untried(color_teaching::Lesson lesson) const;

  // Prints the trials' results, and returns whether the lesson may be saved. Wider ranges are tried as well, or
  // narrower ones if the first wider one tracks no better, and the best replaces the lesson. What was learnt in views
  // without a click is not saved either where the measured radius contradicts the configured one. throws
  // std::runtime_error: stopped
  bool passes(TriedLesson& tried, const std::stop_token& stop) const;

 private:
  bool is_sized() const { return !target_.is_radius_assumed; }
  const calib::Camera& camera() const { return config_.rig.cameras[std::size_t(seen_.point.camera)]; }
  std::string words(const TriedLesson& tried) const { return words_of(tried.trial, camera().name); }
  void try_it(TriedLesson& tried, const std::stop_token& stop) const;
  // The width with the highest precision, step by step from the given one as long as it rises.
  TriedLesson best_width(TriedLesson best, const std::stop_token& stop) const;

  const TeachCommand& command_;
  const config::ServiceConfig& config_;
  const object_tracking::TargetOptions& target_;
  const color_teaching::ColorTeacher& teacher_;
  const color_teaching::TeachRequestOptions& request_;
  const SeenAt seen_;
};

}  // namespace huetrack::page
