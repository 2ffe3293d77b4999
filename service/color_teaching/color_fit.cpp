#include "color_teaching/color_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calib/model/median.h"

namespace huetrack::color_teaching {
namespace {

constexpr double least_intensity = 0.04;  // darker: chroma is noise
constexpr double least_saturation = 0.12;
constexpr double largest_share = 0.25;  // of the image: a region larger than that is background
constexpr int least_area = 6;           // pixels

double hue_difference(double a, double b) {  // -180..180
  return std::remainder(a - b, 360.0);
}

double quantile(std::vector<double>& values, double share) {
  return calib::quantile_in_place(std::span(values), share);
}

PixelMask flood(const HsiImage& image, color::PixelAt seed, const Eigen::Vector2d& like, double tolerance,
                std::size_t most, const PixelMask* within) {
  PixelMask mask(image.width, image.height);
  std::vector<color::PixelAt> open{seed};
  mask.at(seed.u, seed.v) = 1;
  std::size_t count = 1;
  while (!open.empty() && count <= most) {
    const auto [u, v] = open.back();
    open.pop_back();
    for (int y = std::max(0, v - 1); y <= std::min(v + 1, image.height - 1); ++y) {
      for (int x = std::max(0, u - 1); x <= std::min(u + 1, image.width - 1); ++x) {
        if (mask.at(x, y) != 0 || (within != nullptr && within->at(x, y) == 0)) continue;
        const color::Hsi& p = image.at(x, y);
        if (p.intensity < least_intensity || (chroma(p) - like).squaredNorm() > tolerance * tolerance) continue;
        mask.at(x, y) = 1;
        ++count;
        open.push_back({x, y});
      }
    }
  }
  return mask;
}

// Hue as an offset from the region's own, so that ranges do not wrap while they are fitted.
struct Fit {
  double hue_deg;               // of the region
  std::array<double, 6> bound;  // hue -, hue +, saturation -, +, intensity -, +
  color::HsiRange range() const {
    const auto wrapped = [](double hue) { return std::fmod(hue + 720, 360); };
    return {.hue_min_deg = wrapped(hue_deg + bound[0]),
            .hue_max_deg = wrapped(hue_deg + bound[1]),
            .saturation_min = bound[2],
            .saturation_max = bound[3],
            .intensity_min = bound[4],
            .intensity_max = bound[5]};
  }
  bool contains(const color::Hsi& p) const {
    const double hue = hue_difference(p.hue_deg, hue_deg);
    return p.has_hue && hue >= bound[0] && hue <= bound[1] && p.saturation >= bound[2] && p.saturation <= bound[3] &&
           p.intensity >= bound[4] && p.intensity <= bound[5];
  }
};

// To whole steps, of which `per_unit` make 1: the quotient is the shortest decimal, 0.35 and not 0.35000000000000003.
double rounded(double value, double per_unit, bool up) {
  return (up ? std::ceil(value * per_unit - 1e-9) : std::floor(value * per_unit + 1e-9)) / per_unit;
}

}  // namespace

std::optional<PixelMask> grow_region(const HsiImage& image, color::PixelAt seed, const PixelMask* within) {
  if (seed.u < 0 || seed.v < 0 || seed.u >= image.width || seed.v >= image.height) return std::nullopt;
  // The median of the nearest pixels stands for the colour: one noisy pixel decides nothing.
  std::vector<double> x, y;
  for (int v = std::max(0, seed.v - 1); v <= std::min(seed.v + 1, image.height - 1); ++v) {
    for (int u = std::max(0, seed.u - 1); u <= std::min(seed.u + 1, image.width - 1); ++u) {
      const Eigen::Vector2d c = chroma(image.at(u, v));
      x.push_back(c.x());
      y.push_back(c.y());
    }
  }
  Eigen::Vector2d like(quantile(x, 0.5), quantile(y, 0.5));
  if (like.norm() < least_saturation || image.at(seed.u, seed.v).intensity < least_intensity) return std::nullopt;
  const auto most = static_cast<std::size_t>(largest_share * image.width * image.height);

  std::vector<PixelMask> masks;
  std::vector<double> areas;
  constexpr double first = 0.10, ratio = 1.13;  // of the chroma itself: tolerances from 10 % on
  for (double tolerance = first; tolerance < 0.75; tolerance *= ratio) {
    PixelMask mask = flood(image, seed, like, tolerance * like.norm(), most, within);
    const std::size_t area = mask.count();
    if (area > most) break;
    if (area >= 30 && masks.size() < 6) {  // the region's own mean is a better reference than the seed
      Eigen::Vector2d sum(0, 0);
      for (std::size_t i = 0; i < mask.pixels.size(); ++i)
        if (mask.pixels[i] != 0) sum += chroma(image.pixels[i]);
      like = sum / static_cast<double>(area);
    }
    masks.push_back(std::move(mask));
    areas.push_back(static_cast<double>(area));
  }
  std::optional<std::size_t> best;
  double least_change = 0;
  for (std::size_t i = 1; i + 1 < areas.size(); ++i) {
    if (areas[i] < least_area) continue;
    const double change = (areas[i + 1] - areas[i - 1]) / areas[i];
    if (!best || change <= least_change) best = i, least_change = change;
  }
  if (!best) return std::nullopt;
  return std::move(masks[*best]);
}

std::vector<color::Hsi> pixels_of(const HsiImage& image, const PixelMask& region) {
  std::vector<color::Hsi> pixels;
  for (std::size_t i = 0; i < region.pixels.size(); ++i)
    if (region.pixels[i] != 0) pixels.push_back(image.pixels[i]);
  return pixels;
}

color::HsiRange fit_range(const HsiImage& image, const PixelMask& region, const PixelMask& background, int steps) {
  const std::vector<color::Hsi> seen = pixels_of(image, region);
  return fit_range(std::span(&seen, 1), image, background, steps);
}

color::HsiRange fit_range(std::span<const std::vector<color::Hsi>> seen, const HsiImage& image,
                          const PixelMask& background, int steps) {
  double sine = 0, cosine = 0;
  for (const auto& pixels : seen) {
    for (const color::Hsi& p : pixels) {
      if (!p.has_hue) continue;
      sine += p.saturation * std::sin(p.hue_deg * (std::numbers::pi / 180));
      cosine += p.saturation * std::cos(p.hue_deg * (std::numbers::pi / 180));
    }
  }
  Fit fit{std::atan2(sine, cosine) * (180 / std::numbers::pi), {}};
  std::array<std::vector<double>, 6> bounds;  // of each
  std::vector<double> saturations, intensities;
  for (const auto& pixels : seen) {
    std::vector<double> hue, saturation, intensity;
    for (const color::Hsi& p : pixels) {
      if (!p.has_hue) continue;
      hue.push_back(hue_difference(p.hue_deg, fit.hue_deg));
      saturation.push_back(p.saturation);
      intensity.push_back(p.intensity);
    }
    if (hue.empty()) continue;
    saturations.insert(saturations.end(), saturation.begin(), saturation.end());
    intensities.insert(intensities.end(), intensity.begin(), intensity.end());
    // Without the few pixels of the edge or a highlight, and with a margin for noise.
    constexpr double least_hue = 0.02, least_rest = 0.03, hue_margin_deg = 4, margin = 0.04;
    const auto from = [](std::vector<double>& of, double share, double by) { return quantile(of, share) - by; };
    const auto to = [](std::vector<double>& of, double share, double by) { return quantile(of, 1 - share) + by; };
    const std::array<double, 6> own = {from(hue, least_hue, hue_margin_deg), to(hue, least_hue, hue_margin_deg),
                                       from(saturation, least_rest, margin), to(saturation, least_rest, margin),
                                       from(intensity, least_rest, margin),  to(intensity, least_rest, margin)};
    for (std::size_t b = 0; b < own.size(); ++b) bounds[b].push_back(own[b]);
  }
  if (saturations.empty()) return {};
  const double middle_saturation = quantile(saturations, 0.5), middle_intensity = quantile(intensities, 0.5);
  constexpr double something_else = 0.05;  // of what was seen, beyond either bound
  for (std::size_t b = 0; b < bounds.size(); ++b) {
    std::ranges::sort(bounds[b]);
    if (b % 2 == 1) std::ranges::reverse(bounds[b]);
    fit.bound[b] = bounds[b][static_cast<std::size_t>(something_else * static_cast<double>(bounds[b].size()))];
  }
  // As far as light may reasonably change the colour. A range never becomes wider than this by itself.
  const std::array<double, 6> furthest = {std::min(fit.bound[0], -25.0),
                                          std::max(fit.bound[1], 25.0),
                                          std::min(fit.bound[2], std::max(0.15, 0.5 * middle_saturation)),
                                          1.0,
                                          std::min(fit.bound[4], std::max(0.06, 0.35 * middle_intensity)),
                                          std::max(fit.bound[5], 0.97)};

  // Only background that the furthest ranges would take in can be in the way.
  std::vector<color::Hsi> rivals;
  Fit wide = fit;
  wide.bound = furthest;
  std::size_t background_count = 0;
  for (std::size_t i = 0; i < background.pixels.size(); ++i) {
    if (background.pixels[i] == 0) continue;
    ++background_count;
    if (wide.contains(image.pixels[i])) rivals.push_back(image.pixels[i]);
  }
  const auto in_the_way = [&](const Fit& f) {
    return static_cast<double>(std::ranges::count_if(rivals, [&](const color::Hsi& p) { return f.contains(p); }));
  };
  // In tenths of the way, every bound in turn, as long as it costs almost no background: 1 in 5000 pixels in all.
  double free = in_the_way(fit) + static_cast<double>(background_count) / 5000;
  std::array<bool, 6> done{};
  const std::array<double, 6> from = fit.bound;
  for (int step = 1; step <= 10; ++step) {
    for (std::size_t b = 0; b < 6; ++b) {
      if (done[b]) continue;
      Fit wider = fit;
      wider.bound[b] = from[b] + (furthest[b] - from[b]) * step / 10;
      done[b] = in_the_way(wider) > free;
      if (!done[b]) fit = wider;
    }
  }

  const double more = steps;
  fit.bound[0] = std::clamp(fit.bound[0] - 3 * more, -149.0, -2.0);
  fit.bound[1] = std::clamp(fit.bound[1] + 3 * more, 2.0, 149.0);
  const auto spread = [](double& low, double& high, double by, double middle) {
    low = std::min(low - by, middle - 0.02);
    high = std::max(high + by, middle + 0.02);
    low = std::clamp(low, 0.0, 0.98);
    high = std::clamp(high, low + 0.02, 1.0);
  };
  spread(fit.bound[2], fit.bound[3], 0.04 * more, middle_saturation);
  spread(fit.bound[4], fit.bound[5], 0.04 * more, middle_intensity);

  color::HsiRange range = fit.range();  // in digits that people like to read
  range.hue_min_deg = std::fmod(rounded(range.hue_min_deg, 1, false), 360);
  range.hue_max_deg = std::fmod(rounded(range.hue_max_deg, 1, true), 360);
  range.saturation_min = rounded(range.saturation_min, 100, false);
  range.saturation_max = std::min(1.0, rounded(range.saturation_max, 100, true));
  range.intensity_min = rounded(range.intensity_min, 100, false);
  range.intensity_max = std::min(1.0, rounded(range.intensity_max, 100, true));
  return range;
}

}  // namespace huetrack::color_teaching
