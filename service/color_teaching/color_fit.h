// From a pixel to the region of its colour, and from a region to ranges of hue, saturation and intensity. Pure
// functions.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "color_teaching/hsi_image.h"

namespace huetrack::color_teaching {

// The region around the pixel whose colour is like its own. How alike it must be is not a parameter: it is grown with
// ever larger tolerances, and the one is taken around which its area changes least (the idea of maximally stable
// regions, Matas et al. 2002, here over distance in chroma). nullopt: the pixel is grey, too dark, or the region never
// settles. within: nothing but these pixels, of the image's size; null: all of them.
std::optional<PixelMask> grow_region(const HsiImage& image, color::PixelAt seed, const PixelMask* within = nullptr);

// Ranges that hold the region with a margin, and then as much more as the rest of the image leaves free: what is taught
// on one frame has to hold under other light. background: pixels that must not match (1); steps > 0 widens them
// further, < 0 narrows them.
color::HsiRange fit_range(const HsiImage& image, const PixelMask& region, const PixelMask& background, int steps);
// The ranges that hold an object as it was seen in several places, or at several moments: each one's pixels. One in
// twenty may be something else.
color::HsiRange fit_range(std::span<const std::vector<color::Hsi>> seen, const HsiImage& image,
                          const PixelMask& background, int steps);

// The pixels of a region.
std::vector<color::Hsi> pixels_of(const HsiImage& image, const PixelMask& region);

}  // namespace huetrack::color_teaching
