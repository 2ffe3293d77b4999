// The cameras' timing is the rig's: what one object shows of it holds for all objects of all targets. Each object's
// filter keeps the timing in its state. Given the timing the objects are independent, so their joint posterior is
//   p(timing | all) ~ prior(timing) * product over objects of p(its measurements | timing)
// and each filter adds what the others have shown since the last set (federated filter; Carlson 1990).
#pragma once

#include <span>

#include "object_tracking/trackers/object_filter.h"

namespace huetrack::object_trackers {

struct TimesHolder {
  ObjectFilter* filter;
  bool is_sure;  // it is an object: what it shows is passed on. Others may be clutter, and only learn
};

// After a set, or before the next one. Every filter then knows what the sure ones have shown.
void share_times(std::span<const TimesHolder> holders);

}  // namespace huetrack::object_trackers
