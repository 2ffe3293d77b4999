// One lesson, at a terminal or on a page: from pictures of one moment and points in them to a target's new colour, and
// what the user should know before it is saved.
//
//   pictures of a moment -> ColorTeacher   from a recording, from cameras, or frozen for a page
//   points               -> TeachRequestOptions
//   learn()              -> Lesson
//   save                 -> the caller writes Lesson::target, unless why_useless says why not; where why_doubtful
//                           is not empty, only after a trial on a recording
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "color_teaching/color_teacher.h"

namespace huetrack::color_teaching {

struct Lesson {
  Taught taught;                          // per camera
  object_tracking::TargetOptions target;  // with the learnt colours
  std::vector<std::size_t> accepted;      // cameras in which a suggestion counts as pointed at
  bool is_all_clicked = true;      // false: also learnt from views without a click, by suggestions or at other moments
  std::optional<int> narrowed_to;  // TeachRequestOptions::wider that keeps accepted ranges free of a patch
  std::vector<std::string> unconfirmed;  // cameras without a point, in which the object probably is
  std::vector<std::string> namesakes;    // other targets whose colour the object has, too
  RadiusProposal radius;                 // the object's size
  std::string why_useless;               // why it must not be saved; empty: it may be
  std::string why_doubtful;              // why it must not be saved without a trial on a recording; empty: it may be
  bool is_faint = false;                 // in some camera the ranges hold less than half of the object
};

// targets: all of the configuration. volume: where a suggested object may be. Pure.
Lesson learn(const ColorTeacher& teacher, const TeachRequestOptions& request,
             const std::vector<object_tracking::TargetOptions>& targets, const object_tracking::TargetOptions& target,
             const object_tracking::Volume& volume);

// The same lesson with ranges of another width (request.wider). The size was measured with those of the lesson.
Lesson with_width(Lesson lesson, const ColorTeacher& teacher, const TeachRequestOptions& request,
                  const std::vector<object_tracking::TargetOptions>& targets);

// What the user should know of the object's size, one or two sentences. configured_m: nullopt: not configured.
std::string radius_words(const RadiusProposal& proposal, std::optional<double> configured_m);

// Of a measured radius of a target without one, which is not saved while places are not confirmed.
std::string unsaved_radius_words();

// Adds a rectangle to those of a camera.
void add_ignored(object_tracking::IgnoredRegions& regions, const std::string& camera, const color::PixelBox& box);

}  // namespace huetrack::color_teaching
