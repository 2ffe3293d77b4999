// A bar with two balls of one colour: which two of the objects that were tracked are its ends, moment by moment.
// Objects of a colour are told apart by their motion alone (service/object_tracking, trackers/many_tracker.h). A length
// is the same from either end, so that two objects that are taken for one another do no harm; a third object that is
// taken for an end does. Pure; nothing throws.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "calib/certify/length_test.h"

namespace huetrack::certify {

struct OneColorBar {
  // What two objects were apart while it was not the bar's length: one of them is none of its balls, or the rig is far
  // off. An error is counted as one up to a fifth of the length.
  struct Other {
    double from_s = 0, to_s = 0;
    double least_m = 0, most_m = 0;
    std::size_t sets = 0;
  };
  static constexpr double other_share = 0.2;

  std::vector<MeasuredLength> lengths;  // of sets in which two objects were tracked, and these are the bar's
  // Frame sets in which anything was tracked and that give no length, by why.
  std::size_t only_one = 0;    // one object alone was tracked: a ball is hidden, or both lie within one another
  std::size_t with_third = 0;  // there was a third object
  std::vector<Other> others;   // ascending
};

// objects: each one's track. sets_with_third: in which one object more than two was seen; its own track is not known.
OneColorBar one_color_bar(std::span<const BallTrack> objects, const std::set<std::uint64_t>& sets_with_third,
                          double length_m, const calib::CameraRig& rig);

}  // namespace huetrack::certify
