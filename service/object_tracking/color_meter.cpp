#include "object_tracking/color_meter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace huetrack::object_tracking {

void ColorMeter::set_largest(std::size_t camera, double radius_px, calib::ImageSize size) {
  shares_[camera].of_target = std::min(1.0, std::numbers::pi * radius_px * radius_px / (size.width * size.height));
}

void ColorMeter::look(const std::vector<TargetView>& views, capture::Timestamp set_at) {
  constexpr double every_s = 0.5;
  constexpr int step_px = 8;
  if (views.empty() || std::abs(capture::seconds(set_at - last_at_)) < every_s / static_cast<double>(views.size()))
    return;
  last_at_ = set_at;
  const TargetView& view = views[next_++ % views.size()];
  hits_.clear();
  view.matches->grid(step_px, hits_);
  const double probed = std::max(1.0, std::floor((view.image->width + step_px / 2.0) / step_px) *
                                          std::floor((view.image->height + step_px / 2.0) / step_px));
  shares_[static_cast<std::size_t>(view.index)].of_picture = std::min(1.0, static_cast<double>(hits_.size()) / probed);
}

}  // namespace huetrack::object_tracking
