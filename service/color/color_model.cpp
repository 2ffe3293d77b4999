#include "color/color_model.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <ranges>
#include <stdexcept>
#include <utility>

namespace huetrack::color {

double hue_width_deg(const HsiRange& r) {
  return r.hue_max_deg >= r.hue_min_deg ? r.hue_max_deg - r.hue_min_deg : 360 - r.hue_min_deg + r.hue_max_deg;
}

namespace {

bool whole_circle(const HsiRange& r) {
  return r.hue_min_deg == 0 && r.hue_max_deg == 360;
}

// What u and v add to a pixel of any luma, up to a scale.
Rgb chroma_of(std::uint8_t u, std::uint8_t v) {
  const double du = int{u} - 128, dv = int{v} - 128;
  return {1.402 * dv, -0.344136286 * du - 0.714136286 * dv, 1.772 * du};
}

void require_valid(const HsiRange& range) {
  if (const auto problems = range.problems(); !problems.empty()) throw std::invalid_argument(problems.front());
}

// contains(range, hsi_of(rgb)) for millions of pixels: the same answer without the arc tangent for all but the few
// whose hue is within a rounding error of the range's ends.
class Matcher {
 public:
  explicit Matcher(const HsiRange& range)
      : range_(range), narrow_(hue_width_deg(range) <= 180), any_hue_(whole_circle(range)) {
    const double from = range.hue_min_deg * (std::numbers::pi / 180);
    const double to = range.hue_max_deg * (std::numbers::pi / 180);
    from_ = {std::cos(from), std::sin(from)};
    to_ = {std::cos(to), std::sin(to)};
  }

  // Can a pixel of this chroma match at any luma? The order of r, g and b is that of their chroma, clipped or not, and
  // the order fixes the hue's sextant: from the primary of the largest to the secondary that lacks the smallest.
  bool can_match(const Rgb& chroma) const {
    if (any_hue_) return true;
    const double smallest = std::min({chroma.r, chroma.g, chroma.b}),
                 largest = std::max({chroma.r, chroma.g, chroma.b});
    const double primary_deg = largest == chroma.r ? 0 : largest == chroma.g ? 120 : 240;
    const double secondary_deg = smallest == chroma.r ? 180 : smallest == chroma.g ? 300 : 60;
    const double low_deg = primary_deg == 0 && secondary_deg == 300 ? 300 : std::min(primary_deg, secondary_deg);
    const auto beyond_start_deg = [](double hue_deg, double start_deg) {
      return std::fmod(hue_deg - start_deg + 720, 360);
    };
    return beyond_start_deg(low_deg, range_.hue_min_deg - 1) <=
               hue_width_deg(range_) + 2 ||  // a degree is far above rounding
           beyond_start_deg(range_.hue_min_deg, low_deg - 1) <= 62;
  }

  bool operator()(const Rgb& c) const {
    const double sum = c.r + c.g + c.b;
    if (sum < 3 * range_.intensity_min - slack || sum > 3 * range_.intensity_max + slack) return false;
    const double smallest = std::min({c.r, c.g, c.b});
    if (3 * smallest > (1 - range_.saturation_min) * sum + slack) return false;
    const double alpha = c.r - (c.g + c.b) / 2;
    const double beta = std::numbers::sqrt3 / 2 * (c.g - c.b);
    const double after_from = from_.x * beta - from_.y * alpha;  // > 0: up to 180 degrees counterclockwise of the start
    const double before_to = alpha * to_.y - beta * to_.x;
    const double chroma2 = alpha * alpha + beta * beta;
    if (any_hue_ || chroma2 < slack || std::min(after_from * after_from, before_to * before_to) < slack * chroma2)
      return contains(range_, hsi_of(c));
    if (!(narrow_ ? after_from > 0 && before_to > 0 : after_from > 0 || before_to > 0)) return false;
    const double intensity = sum / 3;
    const double saturation = 1 - smallest / intensity;
    return saturation >= range_.saturation_min && saturation <= range_.saturation_max &&
           intensity >= range_.intensity_min && intensity <= range_.intensity_max;
  }

  // The luma that match at one chroma. As y rises, I rises and S falls, and the hue moves one way only: clipped at 0 it
  // is nearer to the primary of the sextant, clipped at 1 to the secondary. So below one y all are too dark, too
  // saturated or not yet in the range of hues, and above another too bright, too pale or beyond that range. Both are
  // found by bisection, where slack counts as inside; the formula decides at the ends.
  ColorTable::Interval luma_at(std::uint8_t u, std::uint8_t v, capture::ColorRange range) const {
    const auto rgb = [&](int y) { return rgb_of(capture::Yuv{static_cast<std::uint8_t>(y), u, v}, range); };
    int first = 0, last = 255;
    if (const auto way = way_of_hue(chroma_of(u, v))) {
      const auto luma = std::views::iota(0, 256);
      first = int(std::ranges::partition_point(luma, [&](int y) { return is_too_low(rgb(y), *way); }) - luma.begin());
      last =
          int(std::ranges::partition_point(luma, [&](int y) { return !is_too_high(rgb(y), *way); }) - luma.begin()) - 1;
    }
    while (first <= last && !(*this)(rgb(first))) ++first;
    while (first < last && !(*this)(rgb(last))) --last;
    if (first > last) return {255, 0};
    return {static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(last)};
  }

 private:
  static constexpr double slack = 1e-9;  // maths: far above rounding; within it the formula decides
  struct Direction {
    double x, y;
  };
  // Where the range of hues begins and ends on the way from the sextant's primary to its secondary; what lies outside
  // of the sextant is nullopt.
  struct WayOfHue {
    double turns;  // 1: counterclockwise, -1: clockwise
    std::optional<Direction> begin, end;
  };

  // nullopt where bisection fails: a grey, whose hue jumps; a range that contains greys; one without the middle of the
  // sextant.
  std::optional<WayOfHue> way_of_hue(const Rgb& chroma) const {
    const double smallest = std::min({chroma.r, chroma.g, chroma.b}),
                 largest = std::max({chroma.r, chroma.g, chroma.b});
    if (is_grey(chroma) || (any_hue_ && range_.saturation_min == 0)) return std::nullopt;
    if (any_hue_) return WayOfHue{1, {}, {}};
    const double primary_deg = largest == chroma.r ? 0 : largest == chroma.g ? 120 : 240;
    const double secondary_deg = smallest == chroma.r ? 180 : smallest == chroma.g ? 300 : 60;
    const bool is_counterclockwise = std::fmod(secondary_deg - primary_deg + 360, 360) == 60;
    const double turns = is_counterclockwise ? 1 : -1;
    const auto way_to = [&](double hue_deg) { return std::fmod(turns * (hue_deg - primary_deg) + 720, 360); };
    const double begin = way_to(is_counterclockwise ? range_.hue_min_deg : range_.hue_max_deg);
    const double end = way_to(is_counterclockwise ? range_.hue_max_deg : range_.hue_min_deg);
    const bool holds_primary = begin > end || begin == 0;
    if (holds_primary && begin > 0 && begin <= 60) return std::nullopt;
    WayOfHue way{turns, {}, {}};
    if (!holds_primary) way.begin = is_counterclockwise ? from_ : to_;
    if (end < 60) way.end = is_counterclockwise ? to_ : from_;
    return way;
  }

  static bool is_grey(const Rgb& c) { return std::max({c.r, c.g, c.b}) - std::min({c.r, c.g, c.b}) < slack; }
  static double sum_of(const Rgb& c) { return c.r + c.g + c.b; }
  // > 0: the hue lies counterclockwise of the direction by more than slack, < 0: clockwise.
  static double beyond(const Direction& direction, const Rgb& c) {
    const double alpha = c.r - (c.g + c.b) / 2, beta = std::numbers::sqrt3 / 2 * (c.g - c.b);
    const double sine = direction.x * beta - direction.y * alpha;
    return sine * sine < slack * (alpha * alpha + beta * beta) ? 0 : sine;
  }
  bool is_too_low(const Rgb& c, const WayOfHue& way) const {
    if (is_grey(c)) return sum_of(c) < 1.5;
    return sum_of(c) < 3 * range_.intensity_min - slack ||
           3 * std::min({c.r, c.g, c.b}) < (1 - range_.saturation_max) * sum_of(c) - slack ||
           (way.begin && way.turns * beyond(*way.begin, c) < 0);
  }
  bool is_too_high(const Rgb& c, const WayOfHue& way) const {
    if (is_grey(c)) return sum_of(c) >= 1.5;
    return sum_of(c) > 3 * range_.intensity_max + slack ||
           3 * std::min({c.r, c.g, c.b}) > (1 - range_.saturation_min) * sum_of(c) + slack ||
           (way.end && way.turns * beyond(*way.end, c) > 0);
  }

  HsiRange range_;
  bool narrow_, any_hue_;
  Direction from_{}, to_{};
};

}  // namespace

std::vector<std::string> HsiRange::problems() const {
  std::vector<std::string> out;
  const auto inside = [](double v, double lo, double hi) { return v >= lo && v <= hi; };  // false for NaN
  if (!inside(hue_min_deg, 0, 360) || !inside(hue_max_deg, 0, 360))
    out.emplace_back("hue must lie in 0..360 degrees");
  else if (!whole_circle(*this) && hue_width_deg(*this) > 300)
    out.push_back(
        fmt::format("hue must be a range of at most 300 degrees, or 0..360 for any hue; from {:g} on to {:g} "
                    "are {:g} (were [{:g}, {:g}] meant?)",
                    hue_min_deg, hue_max_deg, hue_width_deg(*this), hue_max_deg, hue_min_deg));
  if (!inside(saturation_min, 0, 1) || !inside(saturation_max, 0, 1) || saturation_min > saturation_max)
    out.emplace_back("saturation must be a range min <= max within 0..1");
  if (!inside(intensity_min, 0, 1) || !inside(intensity_max, 0, 1) || intensity_min > intensity_max)
    out.emplace_back("intensity must be a range min <= max within 0..1");
  return out;
}

Rgb rgb_of(capture::Yuv p, capture::ColorRange range) {
  const bool limited = range == capture::ColorRange::limited;
  const double y = limited ? (p.y - 16) / 219.0 : p.y / 255.0;
  const double chroma_scale = limited ? 1 / 224.0 : 1 / 255.0;
  const double u = (p.u - 128) * chroma_scale;
  const double v = (p.v - 128) * chroma_scale;
  return {std::clamp(y + 1.402 * v, 0.0, 1.0), std::clamp(y - 0.344136286 * u - 0.714136286 * v, 0.0, 1.0),
          std::clamp(y + 1.772 * u, 0.0, 1.0)};
}

Rgb rgb_of(capture::Bgr p) {
  return {p.r / 255.0, p.g / 255.0, p.b / 255.0};
}

Hsi hsi_of(Rgb c) {
  const double intensity = (c.r + c.g + c.b) / 3;
  const double smallest = std::min({c.r, c.g, c.b});
  // A spread below 1e-9 is rounding, not colour: 8-bit pixels differ by 1/255 or not at all.
  if (std::max({c.r, c.g, c.b}) - smallest < 1e-9) return {0, 0, intensity, false};
  const double alpha = c.r - (c.g + c.b) / 2;
  const double beta = std::numbers::sqrt3 / 2 * (c.g - c.b);
  double hue_deg = std::atan2(beta, alpha) * (180 / std::numbers::pi);
  if (hue_deg < 0) hue_deg += 360;
  if (hue_deg >= 360) hue_deg = 0;  // a rounding error below 0
  return {hue_deg, 1 - smallest / intensity, intensity, true};
}

bool contains(const HsiRange& r, const Hsi& hsi) {
  if (hsi.saturation < r.saturation_min || hsi.saturation > r.saturation_max) return false;
  if (hsi.intensity < r.intensity_min || hsi.intensity > r.intensity_max) return false;
  if (whole_circle(r)) return true;
  if (!hsi.has_hue) return false;
  if (hsi.hue_deg == 0 && r.hue_max_deg == 360) return true;  // the same angle
  if (r.hue_min_deg <= r.hue_max_deg) return hsi.hue_deg >= r.hue_min_deg && hsi.hue_deg <= r.hue_max_deg;
  return hsi.hue_deg >= r.hue_min_deg || hsi.hue_deg <= r.hue_max_deg;
}

ColorTable::ColorTable(capture::PixelFormat format, capture::ColorRange range)
    : is_bgr_(format == capture::PixelFormat::bgr), range_(range) {
  for (auto& row : luma_of_cells_) row.fill({255, 0});
  if (is_bgr_)
    bgr_bits_.assign((std::size_t{1} << 24) / 64, 0);
  else
    y_of_uv_.assign(65536 + 1, Interval{255, 0});  // one more: window_kernels_avx512 reads two at a time
}

ColorTable::ColorTable(const HsiRange& target, capture::PixelFormat format, capture::ColorRange range)
    : ColorTable(format, range) {
  require_valid(target);
  fill(target, 0, all_parts);
}

void ColorTable::fill(const HsiRange& target, unsigned first, unsigned last) {
  const Matcher matches(target);
  if (is_bgr_) {
    for (unsigned index = 256 * first; index < 256 * last; ++index) {
      const capture::Bgr p{static_cast<std::uint8_t>(index), static_cast<std::uint8_t>(index >> 8),
                           static_cast<std::uint8_t>(index >> 16)};
      if (matches(rgb_of(p))) bgr_bits_[index >> 6] |= std::uint64_t{1} << (index & 63);
    }
    return;
  }
  for (unsigned uv = first; uv < last; ++uv) {
    const auto u = static_cast<std::uint8_t>(uv), v = static_cast<std::uint8_t>(uv >> 8);
    if (!matches.can_match(chroma_of(u, v))) continue;
    const Interval interval = y_of_uv_[uv] = matches.luma_at(u, v, range_);
    if (interval.y_min <= interval.y_max) cells_[v / 4] |= std::uint64_t{1} << u / 4;
    Interval& cell = luma_of_cells_[v / 4][u / 4];
    cell = {std::min(cell.y_min, interval.y_min), std::max(cell.y_max, interval.y_max)};
    for (std::uint8_t* ceiling : {&luma_ceiling_.of_u[u / 4], &luma_ceiling_.of_v[v / 4],
                                  &luma_ceiling_.near_grey_of_u[LumaCeiling::near_grey_step(u)],
                                  &luma_ceiling_.near_grey_of_v[LumaCeiling::near_grey_step(v)]})
      *ceiling = std::max(*ceiling, interval.y_max);
  }
}

ColorTableBuilder::ColorTableBuilder(const HsiRange& target, capture::PixelFormat format, capture::ColorRange range)
    : target_(target), table_(new ColorTable(format, range)) {
  require_valid(target);
}

void ColorTableBuilder::go_on() {
  const unsigned parts = table_->is_bgr_ ? 256 : 4096;
  const unsigned first = std::exchange(next_, std::min(next_ + parts, ColorTable::all_parts));
  table_->fill(target_, first, next_);
}

bool ColorTable::may_contain(const capture::PixelBounds& bounds) const {
  const auto& [y, u, v] = bounds;
  const std::uint64_t columns = ~std::uint64_t{0} >> (63 - u.max / 4) & ~std::uint64_t{0} << u.min / 4;
  for (std::size_t row = v.min / 4; row <= v.max / 4; ++row)
    for (std::uint64_t open = cells_[row] & columns; open != 0; open &= open - 1) {
      const Interval& cell = luma_of_cells_[row][static_cast<std::size_t>(std::countr_zero(open))];
      if (cell.y_min <= y.max && cell.y_max >= y.min) return true;
    }
  return false;
}

bool ColorTable::is_for(capture::PixelFormat format, capture::ColorRange range) const {
  return is_bgr_ ? format == capture::PixelFormat::bgr : format != capture::PixelFormat::bgr && range == range_;
}

}  // namespace huetrack::color
