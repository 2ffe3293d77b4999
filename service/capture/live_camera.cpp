#include "capture/live_camera.h"

namespace huetrack::capture {

std::string_view name(CaptureState state) {
  static constexpr std::string_view names[] = {"waiting", "delivering", "stalled", "absent"};
  return names[std::size_t(state)];
}

void DamageWatch::add(bool is_damaged) {
  constexpr double weight = 0.01, high = 0.10, low = 0.05;
  share_ += weight * ((is_damaged ? 1.0 : 0.0) - share_);
  is_high_ = share_ > (is_high_ ? low : high);
}

}  // namespace huetrack::capture
