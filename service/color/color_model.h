// The target's colour in HSI, as in the paper (section 2.2): ranges of hue, saturation and intensity. A table makes it
// one look-up per raw pixel; tests/color/color_model_test.cpp compares every entry with the formula.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::color {

// Degrees and shares, inclusive on both ends.
struct HsiRange {
  // [0, 360]; min > max: through 0, as in 340..20 for red. At most 300 degrees wide, or the whole circle 0..360.
  double hue_min_deg = 0, hue_max_deg = 360;
  double saturation_min = 0.3, saturation_max = 1;   // [0, 1]
  double intensity_min = 0.1, intensity_max = 0.95;  // [0, 1]
  std::vector<std::string> problems() const;         // empty when valid; one sentence per violated constraint
  bool operator==(const HsiRange&) const = default;
};

// Counterclockwise from hue_min_deg to hue_max_deg.
double hue_width_deg(const HsiRange& range);

struct Rgb {
  double r, g, b;
};  // [0, 1]

struct Hsi {
  double hue_deg;     // [0, 360); 0 when !has_hue
  double saturation;  // [0, 1]
  double intensity;   // [0, 1]
  bool has_hue;       // false for greys (r = g = b)
};

// The definitions. Pure.
Rgb rgb_of(capture::Yuv pixel, capture::ColorRange range);  // ITU-R BT.601, clamped to [0, 1]
Rgb rgb_of(capture::Bgr pixel);
// Gonzalez and Woods: I = (r+g+b)/3, S = 1 - min/I, H = the angle of the chroma, by atan2, which is exact near the
// axis.
Hsi hsi_of(Rgb rgb);
bool contains(const HsiRange& range, const Hsi& hsi);  // a grey matches only the whole circle of hues

// Which raw pixels of one format match a range. Immutable; safe from any thread.
//
// YUV family: at one (u, v) the pixels that match are an interval of y. Away from the gamut's edge hue does not depend
// on y at all, S falls and I rises with it; where r, g or b clip, the hue moves one way only, towards a primary below
// and a secondary above. So a table of 65536 intervals (128 kB, of which a scene touches little) answers for all 2^24
// pixels. BGR has no such order and takes one bit per pixel value (2 MB).
class ColorTable {
 public:
  struct Interval {
    std::uint8_t y_min, y_max;
  };  // empty: y_min 255, y_max 0
  // A pixel brighter than of_u[u / 4] or than of_v[v / 4] does not match: a quick test that rejects most of a
  // background.
  struct LumaCeiling {
    std::array<std::uint8_t, 64> of_u{}, of_v{};
    // layout: in as many steps as one byte shuffle looks up: as fine near grey, where most of a background is; the
    // first and the last step include all beyond.
    static constexpr int first_near_grey = 96, last_near_grey = 159;
    static constexpr std::size_t near_grey_step(int chroma) {
      return static_cast<std::size_t>(std::clamp(chroma, first_near_grey, last_near_grey) - first_near_grey) / 4;
    }
    std::array<std::uint8_t, 16> near_grey_of_u{}, near_grey_of_v{};
  };

  // throws std::invalid_argument. Some 5 ms; for BGR some 100.
  ColorTable(const HsiRange& target, capture::PixelFormat format, capture::ColorRange range);

  bool contains(capture::Yuv p) const {
    const Interval& i = y_of_uv_[static_cast<std::size_t>(p.u) | static_cast<std::size_t>(p.v) << 8];
    return p.y >= i.y_min && p.y <= i.y_max;
  }
  bool contains(capture::Bgr p) const {
    const std::size_t index =
        static_cast<std::size_t>(p.b) | static_cast<std::size_t>(p.g) << 8 | static_cast<std::size_t>(p.r) << 16;
    return (bgr_bits_[index >> 6] >> (index & 63) & 1) != 0;
  }

  // False: no pixel within the bounds matches. For the YUV family and grey.
  bool may_contain(const capture::PixelBounds& bounds) const;

  bool is_for(capture::PixelFormat format, capture::ColorRange range) const;  // which images it can read
  const Interval* intervals() const { return y_of_uv_.data(); }               // [u | v << 8]; YUV family and grey
  const LumaCeiling& luma_ceiling() const { return luma_ceiling_; }           // of the intervals

 private:
  friend class ColorTableBuilder;
  ColorTable(capture::PixelFormat format, capture::ColorRange range);  // matches nothing
  void fill(const HsiRange& target, unsigned first, unsigned last);    // parts first .. last - 1 of all_parts
  static constexpr unsigned all_parts = 65536;                         // a (u, v), or 256 BGR values

  bool is_bgr_;
  capture::ColorRange range_;
  std::vector<Interval> y_of_uv_;
  LumaCeiling luma_ceiling_;
  std::array<std::uint64_t, 64> cells_{};  // bit u / 4 of cells_[v / 4]: one of these 16 (u, v) has an interval
  std::array<std::array<Interval, 64>, 64> luma_of_cells_;  // [v / 4][u / 4]: from the lowest to the highest of these
  std::vector<std::uint64_t> bgr_bits_;
};

// Builds a ColorTable in small pieces, so that no frame is delayed. thread-compatible.
class ColorTableBuilder {
 public:
  // throws std::invalid_argument
  ColorTableBuilder(const HsiRange& target, capture::PixelFormat format, capture::ColorRange range);

  // Some 0.3 ms of work, one of 16 times; for BGR 0.5, one of 256.
  void go_on();
  bool is_done() const { return next_ == ColorTable::all_parts; }
  std::shared_ptr<const ColorTable> table() const { return table_; }  // when it is done

 private:
  HsiRange target_;
  std::shared_ptr<ColorTable> table_;
  unsigned next_ = 0;
};

}  // namespace huetrack::color
