#include "recordings/comb_watch.h"

#include <cstdlib>
#include <utility>

namespace huetrack::recordings {
namespace {

struct CombTuning {
  std::int64_t one_in = 4;  // pictures that are compared with the one before: evidence comes within seconds
  int moving = 20;          // levels, from one picture to the next: four times the noise of a webcam
  // Pixels. In noise the ratio of so many scatters by 0.05: a film is never taken for combs.
  std::int64_t enough = 400;
  double combed = 1.2;           // ratio(): between noise (1) and the weakest combs of ours (1.27)
  std::int64_t settled = 4'000;  // pixels, after which a film is progressive: ten times the least evidence
};
constexpr CombTuning tuning{};

// Brightness, or what is nearest to it.
struct Brightness {
  const std::uint8_t* data;
  std::ptrdiff_t stride;
  int step;
};
Brightness brightness_of(const capture::Image& image) {
  const capture::Plane& plane = image.planes[0];
  switch (image.format) {
    case capture::PixelFormat::bgr:
      return {plane.data + 1, plane.stride, 3};
    case capture::PixelFormat::yuyv:
      return {plane.data, plane.stride, 2};
    default:
      return {plane.data, plane.stride, 1};
  }
}

void add(const capture::Image& before, const capture::Image& image, CombEvidence& evidence) {
  capture::require_all(before);
  capture::require_all(image);
  const Brightness old_pixels = brightness_of(before), pixels = brightness_of(image);
  std::int64_t rows = 0, fields = 0, tops = 0, bottoms = 0;
  for (int y = 2; y + 2 < image.height; ++y) {
    const std::uint8_t *p = pixels.data + y * pixels.stride, *old = old_pixels.data + y * old_pixels.stride;
    std::int64_t& of_field = y % 2 == 0 ? tops : bottoms;
    for (int x = 0; x < image.width; ++x, p += pixels.step, old += pixels.step) {
      if (std::abs(*p - *old) <= tuning.moving) continue;
      ++evidence.moving;
      rows += std::abs(p[-pixels.stride] + p[pixels.stride] - 2 * *p);
      fields += std::abs(p[-2 * pixels.stride] + p[2 * pixels.stride] - 2 * *p);
      of_field += std::abs(old[-old_pixels.stride] + old[old_pixels.stride] - 2 * *p);
    }
  }
  evidence.row_curvature += static_cast<double>(rows), evidence.field_curvature += static_cast<double>(fields);
  evidence.top_after_bottom += static_cast<double>(tops), evidence.bottom_after_top += static_cast<double>(bottoms);
}

}  // namespace

void CombWatch::see(const capture::Image& picture) {
  if (is_known_ || !capture::has_pixels(picture)) return;
  const capture::Image before = std::exchange(before_, {});
  const bool is_alike =
      before.width == picture.width && before.height == picture.height && before.format == picture.format;
  if (capture::has_pixels(before) && is_alike) add(before, picture, evidence_);
  if (++pictures_ % tuning.one_in == 0) before_ = picture;
  if (evidence_.moving < tuning.enough) return;
  has_problem_ = evidence_.ratio() > tuning.combed;
  is_known_ = has_problem_ || evidence_.moving >= tuning.settled;
}

std::optional<std::string> CombWatch::take_problem() {
  if (!std::exchange(has_problem_, false)) return std::nullopt;
  // The field that was taken first follows the other one of the picture before.
  const bool is_top_first = evidence_.top_after_bottom < evidence_.bottom_after_top;
  return std::string(
             "is interlaced, but does not say so: every picture holds two moments, and positions are wrong where "
             "the target moves: use a progressive mode of the camera, or add fields: ") +
         (is_top_first ? "top (or bottom, if that field was" : "bottom (or top, if that field was") +
         " taken first) to play the first field of every picture";
}

}  // namespace huetrack::recordings
