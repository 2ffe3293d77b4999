// How much of each camera's picture has the target's colour, a view at a time.
#pragma once

#include <vector>

#include "calib/model/camera_rig.h"
#include "object_tracking/color_window.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/target_views.h"

namespace huetrack::object_tracking {

// thread-compatible.
class ColorMeter {
 public:
  explicit ColorMeter(std::size_t cameras) : shares_(cameras) {}

  // The target covers no more of this camera's picture than a disc of this radius.
  void set_largest(std::size_t camera, double radius_px, calib::ImageSize size);
  // One view after the other, each about once in half a second.
  void look(const std::vector<TargetView>& views, capture::Timestamp set_at);

  const std::vector<ColorShare>& shares() const { return shares_; }  // per camera of the rig

 private:
  std::vector<PixelAt> hits_;
  std::vector<ColorShare> shares_;
  std::size_t next_ = 0;  // the camera whose share is measured next
  capture::Timestamp last_at_ = capture::Timestamp::min();
};

}  // namespace huetrack::object_tracking
