// One lesson, for whoever asks for it, at a terminal or on a page: from pictures of one moment, and where somebody
// points in them, to a target's new colour and what people should know before it is saved.
//
//   pictures of a moment -> ColorTeacher   the caller has them: from a recording, from cameras, or frozen for a page
//   what is pointed at   -> TeachRequestOptions
//   learn(), again where suggestions count as pointed at -> Lesson: what matches, what else matches, suggestions
//   save                 -> the caller writes Lesson::target, unless why_useless speaks against it
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "color_teaching/color_teacher.h"

namespace huetrack::color_teaching {

struct Lesson {
  Taught taught;                          // per camera: the region, its ranges, what else has them, suggestions
  object_tracking::TargetOptions target;  // with the colours that were learnt
  std::vector<std::size_t> accepted;      // cameras in which a suggestion counts as pointed at
  std::optional<int> narrowed_to;         // TeachRequestOptions::wider, as accepted ranges held something else, too
  std::vector<std::string> unconfirmed;   // cameras into which nobody pointed, though the object probably is there
  std::vector<std::string> namesakes;     // other targets whose colour the object has, too
  RadiusProposal radius;                  // how large the object is, where that can be told
  std::string why_useless;                // why it must not be saved; empty: it may be
  bool is_faint = false;                  // in some camera the ranges hold less than half of the object
};

// targets: all of the configuration. volume: where a suggested object may be. Pure.
Lesson learn(const ColorTeacher& teacher, const TeachRequestOptions& request,
             const std::vector<object_tracking::TargetOptions>& targets, const object_tracking::TargetOptions& target,
             const object_tracking::Volume& volume);

// What people should know of the object's size, a sentence or two. said_m: what the configuration says, if it does.
std::string radius_words(const RadiusProposal& proposal, std::optional<double> said_m);

// Adds a rectangle to those of a camera.
void add_ignored(object_tracking::IgnoredRegions& regions, const std::string& camera, const color::PixelBox& box);

}  // namespace huetrack::color_teaching
