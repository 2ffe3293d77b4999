// From a pixel to the region of its colour, and from a region to ranges of hue, saturation and intensity. Pure
// functions.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "color_teaching/hsi_image.h"

namespace huetrack::color_teaching {

// The region around the pixel whose chroma is like its own: grown with ever larger tolerances, the one around which its
// area changes least (maximally stable regions, Matas et al. 2002, over distance in chroma). nullopt: the pixel is
// grey, too dark, or the region never settles. within: only these pixels, of the image's size; null: all.
std::optional<PixelMask> grow_region(const HsiImage& image, color::PixelAt seed, const PixelMask* within = nullptr);

// Ranges that hold the region with a margin, and as much more for other light as the background leaves free.
// background: pixels that must not match (1). steps: > 0 widens further, < 0 narrows.
color::HsiRange fit_range(const HsiImage& image, const PixelMask& region, const PixelMask& background, int steps);
// The same for an object that was seen in several places or moments, each with its pixels; one in twenty of them may be
// something else.
color::HsiRange fit_range(std::span<const std::vector<color::Hsi>> seen, const HsiImage& image,
                          const PixelMask& background, int steps);

// The pixels of a region.
std::vector<color::Hsi> pixels_of(const HsiImage& image, const PixelMask& region);

}  // namespace huetrack::color_teaching
