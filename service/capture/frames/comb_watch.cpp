#include "capture/frames/comb_watch.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "capture/frames/brightness.h"

namespace huetrack::capture {
namespace {

struct CombTuning {
  std::int64_t one_in = 4;  // pictures that are compared with the one before: evidence comes within seconds
  // While nothing moves: twice as many each time, up to those of two seconds. Compared pictures are decoded whole.
  std::int64_t most_in = 64;
  int moving = 20;  // levels, from one picture to the next: four times the noise of a webcam
  // Pixels. In noise the ratio of so many scatters by 0.05: a film is never taken for combs.
  std::int64_t enough = 400;
  double combed = 1.2;           // ratio(): between noise (1) and the weakest combs of ours (1.27)
  double whole = 0.7;            // ratio(): between all films of ours (0.55) and noise
  double ordered = 1.2;          // order_ratio(): a field is wrong only beyond the scatter of so many pixels
  std::int64_t settled = 4'000;  // pixels, after which a film is progressive: ten times the least evidence
};
constexpr CombTuning tuning{};

// Both images have this plane of colours in every second row. step: bytes from one sample to the next
void add_colors(const Image& before, const Image& image, int plane, int offset, int step, CombEvidence& evidence) {
  const Plane &now = image.planes[static_cast<std::size_t>(plane)],
              &then = before.planes[static_cast<std::size_t>(plane)];
  const int rows = plane_rows(image.format, plane, image.height), columns = (image.width + 1) / 2;
  std::int64_t by_row = 0, by_field = 0;
  for (int y = 2; y + 2 < rows; ++y) {
    const std::uint8_t *p = now.data + y * now.stride + offset, *old = then.data + y * then.stride + offset;
    for (int x = 0; x < columns; ++x, p += step, old += step) {
      if (std::abs(*p - *old) <= tuning.moving) continue;
      ++evidence.color_moving;
      by_row += std::abs(p[-now.stride] + p[now.stride] - 2 * *p);
      by_field += std::abs(p[-2 * now.stride] + p[2 * now.stride] - 2 * *p);
    }
  }
  evidence.color_row_curvature += static_cast<double>(by_row);
  evidence.color_field_curvature += static_cast<double>(by_field);
}

void add(const Image& before, const Image& image, CombEvidence& evidence) {
  require_all(before);
  require_all(image);
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
  for (const int color : {0, 1}) {
    if (image.format == PixelFormat::i420) add_colors(before, image, 1 + color, 0, 1, evidence);
    if (image.format == PixelFormat::nv12) add_colors(before, image, 1, color, 2, evidence);
  }
}

}  // namespace

void CombWatch::see(const Image& picture, std::optional<StatedFields> stated) {
  if (is_known_ || !has_pixels(picture)) return;
  stated_ = stated;
  const Image before = std::exchange(before_, {});
  const bool is_alike =
      before.width == picture.width && before.height == picture.height && before.format == picture.format;
  if (has_pixels(before) && is_alike) {
    const std::int64_t moving = evidence_.moving;
    add(before, picture, evidence_);
    const bool is_still = 10 * (evidence_.moving - moving) < tuning.enough;
    wait_ = is_still ? std::clamp(2 * wait_, tuning.one_in, tuning.most_in) : tuning.one_in;
  }
  if (++pictures_ >= std::max(wait_, tuning.one_in)) before_ = picture, pictures_ = 0;
  if (evidence_.moving < tuning.enough) return;
  has_problem_ = is_contradicted();
  is_known_ = has_problem_ || evidence_.moving >= tuning.settled;
}

bool CombWatch::has_mixed_colors() const {
  // Separate rows of colours are as combed as the others are; in mixed ones the curvature is that of a film.
  return evidence_.ratio() > tuning.combed && evidence_.color_moving >= tuning.enough &&
         evidence_.color_ratio() < tuning.whole;
}

bool CombWatch::is_contradicted() const {
  const bool is_combed = evidence_.ratio() > tuning.combed;
  if (!stated_) return is_combed;
  if (has_mixed_colors()) return true;
  // Films of one moment are often tagged as interlaced; half of their rows are enough.
  const bool is_whole = evidence_.moving >= tuning.settled && evidence_.ratio() < tuning.whole;
  if (is_whole && !stated_->is_tagged) return true;
  return is_combed && evidence_.is_top_first() != (stated_->first == FirstField::top) &&
         evidence_.order_ratio() > tuning.ordered;
}

std::optional<std::string> CombWatch::take_problem() {
  if (!std::exchange(has_problem_, false)) return std::nullopt;
  const std::string mixed =
      "its colours are mixed from both fields, as by a program that took it for progressive (4:2:0), so positions stay "
      "wrong where the target moves: record 4:2:2, or with the interlaced flag (ffmpeg: -flags +ildct+ilme)";
  const std::string first = evidence_.is_top_first() ? "top" : "bottom", second = first == "top" ? "bottom" : "top";
  if (!stated_)
    return "is interlaced: every picture holds two moments, and positions are wrong where "
           "the target moves: use a progressive mode of the camera, or add fields: " +
           first + " (or " + second + ", if that field was taken first) to play the first field of every picture" +
           (has_mixed_colors() ? "; " + mixed : std::string());
  if (evidence_.ratio() < tuning.whole)
    return "is not interlaced: all rows of a picture are of one moment, so fields: loses half of them: leave fields "
           "out";
  if (evidence_.is_top_first() == (stated_->first == FirstField::top)) return "is interlaced, and " + mixed;
  return (stated_->is_tagged ? "is tagged as if the " + second + " field was taken first" : "says fields: " + second) +
         ", but where something moves the pictures say that the " + first +
         " field was: the times are wrong by half a period: " + (stated_->is_tagged ? "add" : "write") +
         " fields: " + first;
}

}  // namespace huetrack::capture
