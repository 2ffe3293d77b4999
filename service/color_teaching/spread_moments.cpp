#include "color_teaching/spread_moments.h"

#include <algorithm>
#include <numeric>

#include "capture/frames/image_copy.h"
#include "color_teaching/color_teacher.h"

namespace huetrack::color_teaching {

SpreadMoments::SpreadMoments(std::size_t cameras) : bytes_(cameras, 0), sets_(0) {
  newest_.frames.resize(cameras);
}

void SpreadMoments::add(const capture::Frame& frame) {
  const auto camera = static_cast<std::size_t>(frame.camera);
  if (const std::size_t bytes = capture::packed_bytes(frame.pixels); bytes > bytes_[camera]) {
    bytes_[camera] = bytes;
    const std::size_t of_set = std::reduce(bytes_.begin(), bytes_.end());
    const std::size_t taken = std::min(ColorTeacher::most_moments, ColorTeacher::most_moment_bytes / of_set);
    sets_.bound(taken > 0 ? taken - 1 : 0);  // one is that of the points
  }
  if (camera == 0 && newest_.frames[0]) sets_.add(newest_);
  newest_.frames[camera] = frame;
}

}  // namespace huetrack::color_teaching
