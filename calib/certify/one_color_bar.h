// Bar with two balls of one colour: associates tracked objects with its ends. Objects of one colour are distinguished
// by their motion only (service/object_tracking/trackers). Exchanged ends do no harm; a third object in place of an end
// does. Pure; nothing throws.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "calib/certify/length_test.h"

namespace huetrack::certify {

struct OneColorBar {
  // A period in which the distance of two objects was not the bar's length, by more than other_share of it: one of them
  // is no ball of the bar, or the rig is wrong.
  struct Other {
    double from_s = 0, to_s = 0;
    double least_m = 0, most_m = 0;
    std::size_t sets = 0;
  };
  static constexpr double other_share = 0.2;

  std::vector<MeasuredLength> lengths;  // of frame sets in which exactly the bar's two objects were tracked
  // Frame sets with tracked objects but without a length, by cause.
  std::size_t only_one = 0;    // one object: a ball is hidden, or both overlap
  std::size_t with_third = 0;  // three or more
  std::vector<Other> others;   // ascending
};

// objects: their tracks. sets_with_third: frame sets with a third object whose track is not known.
OneColorBar one_color_bar(std::span<const BallTrack> objects, const std::set<std::uint64_t>& sets_with_third,
                          double length_m, const calib::CameraRig& rig);

}  // namespace huetrack::certify
