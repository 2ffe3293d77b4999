#include "color_teaching/hsi_image.h"

#include "color/image_color.h"

namespace huetrack::color_teaching {

HsiImage hsi_image(const capture::Image& image) {
  return hsi_image(image, {0, 0, image.width - 1, image.height - 1});
}

HsiImage hsi_image(const capture::Image& image, const color::PixelBox& box) {
  HsiImage out{box.u_max - box.u_min + 1, box.v_max - box.v_min + 1, {}};
  out.pixels.reserve(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  for (int v = box.v_min; v <= box.v_max; ++v)
    for (int u = box.u_min; u <= box.u_max; ++u) out.pixels.push_back(color::hsi_of(color::rgb_at(image, u, v)));
  return out;
}

Eigen::Vector2d chroma(const color::Hsi& pixel) {
  if (!pixel.has_hue) return Eigen::Vector2d::Zero();
  const double angle = pixel.hue_deg * (std::numbers::pi / 180);
  return pixel.saturation * Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

PixelMask matching(const HsiImage& image, const color::HsiRange& range, const std::vector<color::PixelBox>& ignored) {
  PixelMask mask(image.width, image.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    mask.pixels[i] = color::contains(range, image.pixels[i]) ? 1 : 0;
  for (const color::PixelBox& box : ignored) fill(mask, box, 0);
  return mask;
}

void fill(PixelMask& mask, const color::PixelBox& box, std::uint8_t value) {
  for (int v = std::max(0, box.v_min); v <= std::min(box.v_max, mask.height - 1); ++v)
    for (int u = std::max(0, box.u_min); u <= std::min(box.u_max, mask.width - 1); ++u) mask.at(u, v) = value;
}

std::vector<MaskRegion> regions_of(const PixelMask& mask, int min_area) {
  std::vector<MaskRegion> regions;
  PixelMask left = mask;
  std::vector<color::PixelAt> open;
  for (int v0 = 0; v0 < mask.height; ++v0) {
    for (int u0 = 0; u0 < mask.width; ++u0) {
      if (left.at(u0, v0) == 0) continue;
      MaskRegion region{.box = {u0, v0, u0, v0}};
      left.at(u0, v0) = 0;
      open.assign(1, {u0, v0});
      while (!open.empty()) {
        const auto [u, v] = open.back();
        open.pop_back();
        ++region.area;
        region.centre += Eigen::Vector2d(u, v);
        region.box = {std::min(region.box.u_min, u), std::min(region.box.v_min, v), std::max(region.box.u_max, u),
                      std::max(region.box.v_max, v)};
        for (int y = std::max(0, v - 1); y <= std::min(v + 1, mask.height - 1); ++y) {
          for (int x = std::max(0, u - 1); x <= std::min(u + 1, mask.width - 1); ++x) {
            if (left.at(x, y) == 0) continue;
            left.at(x, y) = 0;
            open.push_back({x, y});
          }
        }
      }
      if (region.area < min_area) continue;
      region.centre /= region.area;
      regions.push_back(region);
    }
  }
  std::ranges::stable_sort(regions, std::greater{}, &MaskRegion::area);
  return regions;
}

PixelMask grown(const PixelMask& mask, int px) {
  PixelMask rows(mask.width, mask.height), out(mask.width, mask.height);
  for (int v = 0; v < mask.height; ++v) {
    for (int u = 0; u < mask.width; ++u) {
      if (mask.at(u, v) == 0) continue;
      for (int x = std::max(0, u - px); x <= std::min(u + px, mask.width - 1); ++x) rows.at(x, v) = 1;
    }
  }
  for (int v = 0; v < mask.height; ++v) {
    for (int u = 0; u < mask.width; ++u) {
      if (rows.at(u, v) == 0) continue;
      for (int y = std::max(0, v - px); y <= std::min(v + px, mask.height - 1); ++y) out.at(u, y) = 1;
    }
  }
  return out;
}

}  // namespace huetrack::color_teaching
