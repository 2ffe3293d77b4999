#include "color/room_colors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

namespace huetrack::color {
namespace {

struct RoomColorsTuning {
  double outside_range = 0.05;  // share of a target's pixels that its range leaves out: it is their 1 to 99 % per axis
  double hidden = 0.3;          // share of an object's pixels that something hides
  double disturbed = 0.1;       // share of the pixels with a known usual value that show it disturbed: noise, shadows
  double least = -4, most = 6;  // evidence of a pixel, natural logarithm: none is certain
  double independent_px = 60;   // of a disc, at most: neighbours' colours are not independent
  double independence = 0.35;   // of what these count (recipes/pixel_likelihood.py)
  double around_weight = 0.5;   // of the ring around a disc, in which nothing should stand out
  double ring_from = 1.15, ring_to = 1.5;  // radii
};
constexpr RoomColorsTuning room_colors{};

constexpr double half_side = 0.886;                 // maths: of a square with the area of a disc of radius 1
constexpr double scale_step = std::numbers::sqrt2;  // layout: between radii that are tried

std::int16_t fixed(double evidence) {
  return static_cast<std::int16_t>(
      std::lround(std::clamp(evidence, room_colors.least, room_colors.most) * RoomColors::evidence_unit));
}

// Calls see(u, v) for the matching pixels of a box in the image.
template <class See>
void for_each_match(MatchBits& view, const PixelBox& box, See see) {
  constexpr int at_once = 56;  // layout: of the 57 bits of row()
  view.look(box);
  for (int v = box.v_min; v <= box.v_max; ++v) {
    for (int first = box.u_min; first <= box.u_max; first += at_once) {
      const int count = std::min(at_once, box.u_max - first + 1);
      for (std::uint64_t bits = view.row(first, v) & ((std::uint64_t{1} << count) - 1); bits != 0; bits &= bits - 1)
        see(first + std::countr_zero(bits), v);
    }
  }
}

using Raw = std::array<std::uint8_t, 3>;

constexpr int coarse = 4;  // layout: finer than a bin
// Every fourth of the raw colours that match, per channel.
template <class See>
void for_each_color(const ColorTable& table, capture::PixelFormat format, See see) {
  for (int a = coarse / 2; a < 256; a += coarse) {
    for (int b = coarse / 2; b < 256; b += coarse) {
      const auto first = std::uint8_t(a), second = std::uint8_t(b);
      if (format == capture::PixelFormat::bgr) {
        for (int r = coarse / 2; r < 256; r += coarse)
          if (table.contains(capture::Bgr{first, second, std::uint8_t(r)})) see(Raw{first, second, std::uint8_t(r)});
        continue;
      }
      const ColorTable::Interval& y = table.intervals()[first | second << 8];
      for (int at = y.y_min; at <= y.y_max; at += coarse) see(Raw{std::uint8_t(at), first, second});
    }
  }
}

// As likely in one of the places of so many pixels as in none.
double least_odds(double pixels, double radius_px) {
  return std::log(std::max(std::numbers::e, pixels / (std::numbers::pi * radius_px * radius_px)));
}

}  // namespace

// A pixel of the target that does not match is hidden, or outside of its range.
std::int16_t RoomColors::evidence_of_no_match() {
  return fixed(std::log(room_colors.hidden + (1 - room_colors.hidden) * room_colors.outside_range));
}

// A disturbed usual value is distributed like exp(-|change|) in each channel, in units of twice its noise.
std::int16_t RoomColors::evidence(const MatchBits& view, int u, int v) const {
  const std::int16_t by_color = evidence_[bin(view.values_at(u, v))];
  const double change = view.change_at(u, v);
  if (!std::isfinite(change)) return by_color;
  const auto& gate = view.light().gate;
  const double of_usual = double(gate[0]) * double(gate[1]) * double(gate[2]);
  return std::min(by_color, fixed(std::log(of_usual / (room_colors.disturbed * colors_)) + change));
}

std::size_t RoomColors::bin(const Raw& raw) const {
  std::size_t out = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const int at = (int(std::clamp(raw[c], least_[c], most_[c])) - least_[c]) * steps / (most_[c] - least_[c] + 1);
    out = out * steps + std::size_t(at);
  }
  return out;
}

void RoomColors::learn(MatchBits& view, const ColorTable& table, capture::PixelFormat format,
                       std::span<const Disc> objects, int memory_samples) {
  std::array<std::uint8_t, 3> least{255, 255, 255}, most{0, 0, 0};
  for_each_color(table, format, [&](const Raw& raw) {
    for (std::size_t c = 0; c < 3; ++c) least[c] = std::min(least[c], raw[c]), most[c] = std::max(most[c], raw[c]);
  });
  if (least != least_ || most != most_) {
    least_ = least, most_ = most;
    if (least[0] > most[0]) least_ = most_ = {};  // the table matches nothing
    samples_ = 0;
  }
  std::vector<float> of_target_bin(bins, 0);
  double colors = 0;
  for_each_color(table, format, [&](const Raw& raw) { of_target_bin[bin(raw)] += 1, colors += 1; });
  colors_ = std::max(1.0, colors * coarse * coarse * coarse);

  now_.assign(bins, 0);
  for_each_match(view, {0, 0, view.width() - 1, view.height() - 1}, [&](int u, int v) {
    const bool is_object = std::ranges::any_of(objects, [&](const Disc& disc) {
      return (Eigen::Vector2d(u, v) - disc.px).squaredNorm() < disc.radius_px * disc.radius_px;
    });
    if (!is_object) now_[bin(view.values_at(u, v))] += 1;
  });
  samples_ = std::min(samples_ + 1, double(memory_samples));
  if (samples_ == 1) seen_.assign(bins, 0);
  const double pixels = double(view.width()) * view.height();
  evidence_.resize(bins);
  for (std::size_t b = 0; b < bins; ++b) {
    seen_[b] += (now_[b] - seen_[b]) / float(samples_);
    // Half a pixel, and half a colour: what was not seen yet is not impossible.
    const double of_target = (1 - room_colors.outside_range) * (double(of_target_bin[b]) + 0.5) / (colors + 0.5 * bins);
    const double of_room = (double(seen_[b]) + 0.5) / (pixels + 0.5 * bins);
    evidence_[b] = fixed(std::log(of_target / of_room));
  }
}

std::int16_t RoomColors::evidence_near_object(const MatchBits& view, int u, int v, bool matches, double as_background) {
  const RoomColors* const room = view.room();
  const double of_match = !matches          ? 0.0
                          : room != nullptr ? double(room->evidence(view, u, v)) / evidence_unit
                                            : room_colors.most;
  return fixed(of_match - as_background);
}

double RoomColors::hidden_share() {
  return room_colors.hidden;
}

void DiscFinder::weigh(MatchBits& view, const PixelBox& box) {
  const RoomColors& room = *view.room();
  box_ = {std::max(0, box.u_min), std::max(0, box.v_min), std::min(view.width() - 1, box.u_max),
          std::min(view.height() - 1, box.v_max)};
  width_ = std::max(0, box_.u_max - box_.u_min + 1), height_ = std::max(0, box_.v_max - box_.v_min + 1);
  if (width_ == 0 || height_ == 0) return;
  evidence_.assign(std::size_t(width_ * height_), RoomColors::evidence_of_no_match());
  for_each_match(view, box_, [&](int u, int v) {
    evidence_[std::size_t((v - box_.v_min) * width_ + u - box_.u_min)] = room.evidence(view, u, v);
  });
  sum_up();
}

void DiscFinder::sum_up() {
  sums_.assign(std::size_t((width_ + 1) * (height_ + 1)), 0);
  for (int v = 0; v < height_; ++v) {
    const std::int32_t* const above = &sums_[std::size_t(v * (width_ + 1))];
    std::int32_t* const here = &sums_[std::size_t((v + 1) * (width_ + 1))];
    std::int32_t sum = 0;
    for (int u = 0; u < width_; ++u) {
      sum += evidence_[std::size_t(v * width_ + u)];
      here[u + 1] = above[u + 1] + sum;
    }
  }
}

double DiscFinder::sum(double u0, double v0, double u1, double v1) const {
  const auto clip = [](double at, int size) { return std::size_t(std::clamp(int(std::lround(at)), 0, size)); };
  const std::size_t left = clip(u0, width_), right = clip(u1, width_);
  const std::size_t top = clip(v0, height_), bottom = clip(v1, height_), stride = std::size_t(width_ + 1);
  return double(sums_[bottom * stride + right] - sums_[bottom * stride + left] - sums_[top * stride + right] +
                sums_[top * stride + left]) /
         RoomColors::evidence_unit;
}

// Natural logarithm of the odds that a disc is here. Beyond the picture there is no evidence.
double DiscFinder::score(double u, double v, double radius_px) const {
  const auto square = [&](double radii) {
    const double a = half_side * radii * radius_px;
    return sum(u - a, v - a, u + a, v + a);
  };
  const double area = std::numbers::pi * radius_px * radius_px;
  const double ring_area =
      area * (room_colors.ring_to * room_colors.ring_to - room_colors.ring_from * room_colors.ring_from);
  const double ring = (square(room_colors.ring_to) - square(room_colors.ring_from)) / ring_area;
  return room_colors.independence * std::min(area, room_colors.independent_px) *
         (square(1) / area - room_colors.around_weight * std::max(ring, -1.0));
}

double DiscFinder::most_score(double radius_px) {
  const double area = std::numbers::pi * radius_px * radius_px;
  return room_colors.independence * std::min(area, room_colors.independent_px) *
         (room_colors.most + room_colors.around_weight);
}

// Local maxima over a grid of a third of the radius.
void DiscFinder::find_peaks(double radius_px, double least) {
  const double step = std::max(1.0, radius_px / 3);
  const int columns = int(width_ / step) + 1, rows = int(height_ / step) + 1;
  scores_.resize(std::size_t(columns * rows));
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      scores_[std::size_t(j * columns + i)] = float(score(i * step, j * step, radius_px));
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const float here = scores_[std::size_t(j * columns + i)];
      if (double(here) < least) continue;
      bool is_peak = true;
      for (int y = std::max(0, j - 1); y <= std::min(rows - 1, j + 1) && is_peak; ++y)
        for (int x = std::max(0, i - 1); x <= std::min(columns - 1, i + 1); ++x)
          is_peak = is_peak && scores_[std::size_t(y * columns + x)] <= here;
      if (is_peak) peaks_.push_back({double(here), {{i * step - 0.5, j * step - 0.5}, radius_px}});
    }
  }
}

double DiscFinder::of_disc(const Disc& disc) const {
  const double r2 = disc.radius_px * disc.radius_px;
  double out = 0;
  for (int v = std::max(0, int(std::ceil(disc.px.y() - disc.radius_px)));
       v < height_ && v <= disc.px.y() + disc.radius_px; ++v) {
    const double dv = v - disc.px.y(), half = std::sqrt(std::max(0.0, r2 - dv * dv));
    out += sum(disc.px.x() - half + 0.5, v, disc.px.x() + half + 0.5, v + 1);
  }
  return room_colors.independence * std::min(1.0, room_colors.independent_px / (std::numbers::pi * r2)) * out;
}

// Mean and covariance of the centre, by the likelihood on a grid that closes in on it.
ColorRegion DiscFinder::measured(Disc disc) const {
  constexpr int reach = 4;
  ColorRegion out;
  double step = disc.radius_px / reach;
  for (;;) {
    std::array<double, (2 * reach + 1) * (2 * reach + 1)> weight;
    std::size_t n = 0;
    double most = -std::numeric_limits<double>::infinity();
    for (int j = -reach; j <= reach; ++j) {
      for (int i = -reach; i <= reach; ++i) {
        weight[n] = of_disc({disc.px + step * Eigen::Vector2d(i, j), disc.radius_px});
        most = std::max(most, weight[n++]);
      }
    }
    double all = 0;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
    n = 0;
    for (int j = -reach; j <= reach; ++j) {
      for (int i = -reach; i <= reach; ++i) {
        const double w = std::exp(weight[n++] - most);
        const Eigen::Vector2d d(i, j);
        all += w, mean += w * d, square += w * d * d.transpose();
      }
    }
    mean /= all;
    out.of_disc = step * step * (square / all - mean * mean.transpose() + Eigen::Matrix2d::Identity() / 12);
    disc.px += step * mean;
    const double sigma = std::sqrt(out.of_disc.trace() / 2);
    if (step <= 1 || sigma > step) break;
    step = std::max({1.0, step / 2, 3 * sigma / reach});
  }
  const double r2 = disc.radius_px * disc.radius_px;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  for (int v = std::max(0, int(std::ceil(disc.px.y() - disc.radius_px)));
       v < height_ && v <= disc.px.y() + disc.radius_px; ++v) {
    for (int u = std::max(0, int(std::ceil(disc.px.x() - disc.radius_px)));
         u < width_ && u <= disc.px.x() + disc.radius_px; ++u) {
      const Eigen::Vector2d d = Eigen::Vector2d(u, v) - disc.px;
      if (d.squaredNorm() > r2 || evidence_[std::size_t(v * width_ + u)] <= 0) continue;
      ++out.area, mean += d, square += d * d.transpose();
    }
  }
  if (out.area == 0) return out;
  mean /= out.area;
  out.spread = square / out.area - mean * mean.transpose() + Eigen::Matrix2d::Identity() / 12;
  out.centre = disc.px + Eigen::Vector2d(box_.u_min, box_.v_min);
  out.box = {int(std::floor(out.centre.x() - disc.radius_px)), int(std::floor(out.centre.y() - disc.radius_px)),
             int(std::ceil(out.centre.x() + disc.radius_px)), int(std::ceil(out.centre.y() + disc.radius_px))};
  return out;
}

ColorRegion DiscFinder::measure(PixelBox box, std::span<const std::int16_t> evidence, const Disc& start) {
  box_ = box, width_ = box.u_max - box.u_min + 1, height_ = box.v_max - box.v_min + 1;
  evidence_.assign(evidence.begin(), evidence.end());
  sum_up();
  return measured({start.px - Eigen::Vector2d(box.u_min, box.v_min), start.radius_px});
}

double DiscFinder::ring_to() {
  return room_colors.ring_to;
}

bool DiscFinder::is_in_ring(const Disc& disc, const Eigen::Vector2d& px) {
  const double radii2 = (px - disc.px).squaredNorm() / (disc.radius_px * disc.radius_px);
  return radii2 >= room_colors.ring_from * room_colors.ring_from && radii2 <= room_colors.ring_to * room_colors.ring_to;
}

const std::vector<ColorRegion>& DiscFinder::find(MatchBits& view, PixelBox box, double smallest_px, double largest_px) {
  regions_.clear(), peaks_.clear();
  weigh(view, box);
  if (width_ == 0 || height_ == 0) return regions_;
  for (double radius = std::max(1.0, smallest_px); radius < scale_step * std::max(1.0, largest_px);
       radius *= scale_step) {
    const double r = std::min(radius, std::max(1.0, largest_px));
    find_peaks(r, least_odds(double(width_) * height_, r));
  }
  std::ranges::stable_sort(peaks_, [](const Peak& a, const Peak& b) { return a.score > b.score; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < peaks_.size(); ++i) {
    const Peak peak = peaks_[i];
    const bool is_new = std::none_of(peaks_.begin(), peaks_.begin() + std::ptrdiff_t(kept), [&](const Peak& better) {
      return (better.disc.px - peak.disc.px).norm() < better.disc.radius_px + peak.disc.radius_px;
    });
    if (is_new) peaks_[kept++] = peak;
  }
  peaks_.resize(kept);
  for (const Peak& peak : peaks_) {
    ColorRegion region = measured(peak.disc);
    const double chance = least_odds(double(view.width()) * view.height(), peak.disc.radius_px);
    region.evidence = {std::max(0.0, peak.score - chance), std::max(0.0, most_score(peak.disc.radius_px) - chance)};
    if (region.area > 0) regions_.push_back(region);
  }
  return regions_;
}

}  // namespace huetrack::color
