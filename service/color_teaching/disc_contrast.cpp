#include "color_teaching/disc_contrast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "calib/model/median.h"

namespace huetrack::color_teaching {
namespace {

constexpr double usual_hue_deg = 10;
const double usual_saturation = std::log(1.5);
constexpr double grey = 1e-3;
constexpr double turn = 360 / usual_hue_deg;
constexpr double usual_gap = 0.15;  // 1 sigma of the true disc's gaps, and of its colour around it, as shares
constexpr double middle = 0.6;      // of the radius: what gives the colour

float hue_between(float a, float b) {
  return float(std::remainder(double(a - b), turn));
}

// Of the inner part; hues relative to that of its middle pixel, as they are on a circle.
std::optional<Tint> middle_tint(const TintImage& image, const TintDisc& disc) {
  const double radius = std::max(1.0, middle * disc.radius);
  const int u = int(std::lround(disc.centre.x())), v = int(std::lround(disc.centre.y()));
  if (u < 0 || v < 0 || u >= image.width || v >= image.height) return std::nullopt;
  const float first = image.at(u, v).hue;
  std::vector<float> hues, saturations;
  visit_disc(image.width, image.height, {disc.centre, radius}, [&](int x, int y, double) {
    hues.push_back(hue_between(image.at(x, y).hue, first));
    saturations.push_back(image.at(x, y).saturation);
  });
  if (hues.empty()) return std::nullopt;
  return Tint{first + calib::median_in_place(std::span(hues)), calib::median_in_place(std::span(saturations))};
}

}  // namespace

Tint tint_of(const Eigen::Vector2d& chroma) {
  return {float(std::atan2(chroma.y(), chroma.x()) * 180 / std::numbers::pi / usual_hue_deg),
          float(std::log(std::max(grey, chroma.norm())) / usual_saturation)};
}

double distance(const Tint& a, const Tint& b) {
  return std::hypot(double(hue_between(a.hue, b.hue)), double(a.saturation - b.saturation));
}

TintImage::TintImage(const HsiImage& image) : width(image.width), height(image.height) {
  pixels.reserve(image.pixels.size());
  for (const color::Hsi& pixel : image.pixels) pixels.push_back(tint_of(chroma(pixel)));
}

std::optional<DiscContrast> contrast_of(const TintImage& image, const TintDisc& disc, double least) {
  const auto tint = middle_tint(image, disc);
  if (!tint) return std::nullopt;
  DiscContrast out{.tint = *tint, .cost = std::numeric_limits<double>::max()};
  constexpr std::size_t steps = 32;
  constexpr double step = most_distance / steps;
  std::array<int, steps> in{}, ring{};
  int in_all = 0, ring_all = 0;
  const double inner = std::max(1.0, 0.85 * disc.radius), edge = disc.radius + std::max(1.5, 0.3 * disc.radius),
               outer = edge + std::max(2.0, 0.5 * disc.radius);
  visit_disc(image.width, image.height, {disc.centre, outer}, [&](int u, int v, double d) {
    const bool is_inside = d <= inner;
    if (!is_inside && d <= edge) return;
    ++(is_inside ? in_all : ring_all);
    const auto bin = std::size_t(distance(image.at(u, v), out.tint) / step);
    if (bin < steps) ++(is_inside ? in : ring)[bin];
  });
  if (in_all == 0) return std::nullopt;
  int in_set = 0, ring_set = 0;
  for (std::size_t i = 0; i < steps; ++i) {
    in_set += in[i], ring_set += ring[i];
    const double tolerance = double(i + 1) * step;
    if (tolerance < least && i + 1 < steps) continue;
    const double gaps = 1 - double(in_set) / in_all, around = double(ring_set) / std::max(1, ring_all);
    const double cost = (gaps * gaps + around * around) / (usual_gap * usual_gap);
    if (cost >= out.cost) continue;
    out.cost = cost, out.inside = 1 - gaps, out.around = around, out.tolerance = tolerance;
  }
  return out;
}

MaskRegion region_of(const TintImage& image, const TintDisc& disc, const DiscContrast& contrast, PixelMask* pixels) {
  MaskRegion region{.centre = {0, 0}, .box = {image.width, image.height, -1, -1}};
  visit_disc(image.width, image.height, {disc.centre, region_reach * disc.radius}, [&](int u, int v, double) {
    if (distance(image.at(u, v), contrast.tint) >= contrast.tolerance) return;
    ++region.area;
    region.centre += Eigen::Vector2d(u, v);
    region.box = {std::min(region.box.u_min, u), std::min(region.box.v_min, v), std::max(region.box.u_max, u),
                  std::max(region.box.v_max, v)};
    if (pixels != nullptr) pixels->at(u, v) = 1;
  });
  if (region.area > 0) region.centre /= region.area;
  return region;
}

}  // namespace huetrack::color_teaching
