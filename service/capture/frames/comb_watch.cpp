#include "capture/frames/comb_watch.h"

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
  double combed = 1.2;               // ratio(): between noise (1) and the weakest combs of ours (1.27)
  double whole = 0.7;                // ratio(): between all films of ours (0.55) and noise
  double ordered = 1.2;              // order_ratio(): a field is wrong only beyond the scatter of so many pixels
  std::int64_t settled = 4'000;      // pixels, after which a film is progressive: ten times the least evidence
  int color_moving = 6;              // levels: beyond what codecs leave where nothing is coloured
  std::int64_t enough_colors = 150;  // samples: the ratio of so many scatters by 0.08
  double mixed =
      0.65;  // color_ratio(): between mixed colours (to 0.55) and those of fields (from 0.75), to x264's crf 28
};
constexpr CombTuning tuning{};

struct Curvature {
  std::int64_t row = 0, field = 0;
};

Curvature curvature(const std::uint8_t* p, std::ptrdiff_t stride) {
  return {std::abs(p[-stride] + p[stride] - 2 * *p), std::abs(p[-2 * stride] + p[2 * stride] - 2 * *p)};
}

// Of the two by two moving pixels of one sample of colours. Where they are no combs, the colours are none either.
bool is_combed(const Brightness& before, const Brightness& now, int x, int y) {
  Curvature sum;
  for (const int v : {y, y + 1})
    for (const int u : {x, x + 1}) {
      const std::uint8_t *p = now.data + v * now.stride + u * now.step,
                         *old = before.data + v * before.stride + u * before.step;
      if (std::abs(*p - *old) <= tuning.moving) continue;
      const Curvature of = curvature(p, now.stride);
      sum.row += of.row, sum.field += of.field;
    }
  return static_cast<double>(sum.row) > tuning.combed * static_cast<double>(sum.field);
}

// Both images have this plane of colours in every second row. step: bytes from one sample to the next
void add_colors(const Image& before, const Image& image, int plane, int offset, int step, CombEvidence& evidence) {
  const Plane &now = image.planes[static_cast<std::size_t>(plane)],
              &then = before.planes[static_cast<std::size_t>(plane)];
  const Brightness old_pixels = brightness_of(before), pixels = brightness_of(image);
  const int rows = plane_rows(image.format, plane, image.height), columns = image.width / 2;
  Curvature sum;
  for (int y = 2; y + 2 < rows; ++y) {
    const std::uint8_t *p = now.data + y * now.stride + offset, *old = then.data + y * then.stride + offset;
    for (int x = 0; x < columns; ++x, p += step, old += step) {
      if (std::abs(*p - *old) <= tuning.color_moving || !is_combed(old_pixels, pixels, 2 * x, 2 * y)) continue;
      ++evidence.color_combed;
      const Curvature of = curvature(p, now.stride);
      sum.row += of.row, sum.field += of.field;
    }
  }
  evidence.color_row_curvature += static_cast<double>(sum.row);
  evidence.color_field_curvature += static_cast<double>(sum.field);
}

void add(const Image& before, const Image& image, CombEvidence& evidence) {
  require_all(before);
  require_all(image);
  const Brightness old_pixels = brightness_of(before), pixels = brightness_of(image);
  Curvature sum, columns;
  std::int64_t tops = 0, bottoms = 0;
  for (int y = 2; y + 2 < image.height; ++y) {
    const std::uint8_t *p = pixels.data + y * pixels.stride, *old = old_pixels.data + y * old_pixels.stride;
    std::int64_t& of_field = y % 2 == 0 ? tops : bottoms;
    for (int x = 0; x < image.width; ++x, p += pixels.step, old += pixels.step) {
      if (std::abs(*p - *old) <= tuning.moving) continue;
      ++evidence.moving;
      const Curvature of = curvature(p, pixels.stride);
      sum.row += of.row, sum.field += of.field;
      if (x >= 2 && x + 2 < image.width) {
        const Curvature along = curvature(p, pixels.step);
        columns.row += along.row, columns.field += along.field;
      }
      of_field += std::abs(old[-old_pixels.stride] + old[old_pixels.stride] - 2 * *p);
    }
  }
  evidence.row_curvature += static_cast<double>(sum.row), evidence.field_curvature += static_cast<double>(sum.field);
  evidence.column_curvature += static_cast<double>(columns.row);
  evidence.second_column_curvature += static_cast<double>(columns.field);
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
  shares_colors_ = picture.format == PixelFormat::i420 || picture.format == PixelFormat::nv12;
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
  // Separate rows of colours are combed where the others are; in mixed ones the curvature is that of a film.
  return evidence_.ratio() > tuning.combed && evidence_.color_combed >= tuning.enough_colors &&
         evidence_.color_ratio() < tuning.mixed;
}

bool CombWatch::is_mosaic() const {
  return evidence_.ratio() > tuning.combed && evidence_.column_ratio() > tuning.combed;
}

bool CombWatch::is_contradicted() const {
  if (is_mosaic()) return true;
  const bool is_combed = evidence_.ratio() > tuning.combed;
  // What to do depends on the colours, of which there are fewer.
  const bool waits = shares_colors_ && evidence_.color_combed < tuning.enough_colors;
  if (!stated_) return is_combed && (!waits || evidence_.moving >= 2 * tuning.enough);
  if (has_mixed_colors()) return true;
  // Films of one moment are often tagged as interlaced; half of their rows are enough.
  const bool is_whole = evidence_.moving >= tuning.settled && evidence_.ratio() < tuning.whole;
  if (is_whole && !stated_->is_tagged) return true;
  return is_combed && evidence_.is_top_first() != (stated_->first == FirstField::top) &&
         evidence_.order_ratio() > tuning.ordered;
}

std::optional<std::string> CombWatch::take_problem() {
  if (!std::exchange(has_problem_, false)) return std::nullopt;
  if (is_mosaic())
    return "is a raw mosaic of colours (Bayer) that is stored as a picture: neighbouring pixels alternate along rows "
           "and columns: store pictures in colour; in a ROS bag give their real encoding, as bayer_rggb8";
  const std::string mixed =
      "its colours are mixed from both fields, as by a program that took it for progressive (4:2:0), so positions stay "
      "wrong where the target moves: record 4:2:2, or with the interlaced flag (ffmpeg: -flags +ildct+ilme)";
  const std::string first = evidence_.is_top_first() ? "top" : "bottom", second = first == "top" ? "bottom" : "top";
  const std::string combed =
      "is interlaced: every picture holds two moments, and positions are wrong where the target moves: use a "
      "progressive mode of the camera";
  if (!stated_ && has_mixed_colors()) return combed + "; fields: is no remedy, for " + mixed;
  if (!stated_)
    return combed + ", or add fields: " + first + " (or " + second +
           ", if that field was taken first) to play the first field of every picture";
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
