#include "capture/frames/crop.h"

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <utility>

namespace huetrack::capture {
namespace {

// The same rows and columns of an image at 1/8, or of the image itself.
void move_planes(Image& part, const Crop& crop) {
  part.width = crop.width;
  part.height = crop.height;
  for (int p = 0; p < static_cast<int>(part.planes.size()); ++p) {
    Plane& plane = part.planes[static_cast<std::size_t>(p)];
    if (plane.data == nullptr) continue;
    // A plane's rows and bytes before the part are those of an image of that size.
    plane.data += plane_rows(part.format, p, crop.v) * plane.stride +
                  static_cast<std::ptrdiff_t>(plane_row_bytes(part.format, p, crop.u));
  }
}

// The pixels of a part: decoded by the whole image, in whose planes they lie. Units of the part may begin anywhere in
// those of the whole.
class CroppedPixels final : public PixelsOnDemand {
 public:
  CroppedPixels(Image whole, const Crop& crop)
      : PixelsOnDemand(crop.width, crop.height, whole.on_demand->column_shift(), whole.on_demand->row_shift()),
        whole_(std::move(whole)),
        crop_(crop) {}

  // The blocks that lie wholly in the part.
  Image eighth() const override {
    Image image = whole_.on_demand->eighth();
    if (!has_pixels(image)) return {};
    // layout: pixels of a sample of chroma at 1/8
    const int columns = needs_even_width(image.format) ? 16 : 8, rows = needs_even_height(image.format) ? 16 : 8;
    const auto up = [](int n, int unit) { return (n + unit - 1) / unit * (unit / 8); };
    const auto down = [](int n, int unit) { return n / unit * (unit / 8); };
    const Crop of{up(crop_.u, columns), up(crop_.v, rows), down(crop_.u + crop_.width, columns) - up(crop_.u, columns),
                  down(crop_.v + crop_.height, rows) - up(crop_.v, rows)};
    if (of.width <= 0 || of.height <= 0) return {};
    move_planes(image, of);
    return image;
  }

  void narrow_chroma(std::size_t unit, PixelBounds& bounds) const override {
    PixelBounds all{.y = bounds.y, .u = no_sample, .v = no_sample};
    for_each_below(unit, [&](std::size_t below, PixelBounds of_below) {
      whole_.on_demand->narrow_chroma(below, of_below);
      all.u.include(of_below.u);
      all.v.include(of_below.v);
    });
    bounds = all;
  }

 private:
  void decode(int row, int first, int count) const override {
    const auto u = [&](int column) { return crop_.u + std::min(column << column_shift(), crop_.width); };
    const auto v = [&](int of_row) { return crop_.v + std::min(of_row << row_shift(), crop_.height); };
    whole_.on_demand->require(u(first), v(row), u(first + count), v(row + 1));
  }

  std::vector<PixelBounds> find_bounds() const override {
    if (whole_.on_demand->bounds().empty()) return {};
    std::vector<PixelBounds> out(units(), {.y = no_sample, .u = no_sample, .v = no_sample});
    for (std::size_t unit = 0; unit < out.size(); ++unit)
      for_each_below(unit, [&](std::size_t, const PixelBounds& below) {
        out[unit].y.include(below.y);
        out[unit].u.include(below.u);
        out[unit].v.include(below.v);
      });
    return out;
  }

  // Calls of(unit of the whole, its bounds) for those that a unit of the part touches: up to four.
  template <typename Of>
  void for_each_below(std::size_t unit, Of&& of) const {
    const PixelsOnDemand& whole = *whole_.on_demand;
    const auto bounds = whole.bounds();
    const int column = static_cast<int>(unit) % columns(), row = static_cast<int>(unit) / columns();
    const auto first_of = [](int i, int shift, int begin) { return (begin + (i << shift)) >> shift; };
    const auto last_of = [](int i, int shift, int begin, int size) {
      return (begin + std::min((i + 1) << shift, size) - 1) >> shift;
    };
    for (int v = first_of(row, row_shift(), crop_.v); v <= last_of(row, row_shift(), crop_.v, crop_.height); ++v)
      for (int u = first_of(column, column_shift(), crop_.u);
           u <= last_of(column, column_shift(), crop_.u, crop_.width); ++u) {
        const auto below = static_cast<std::size_t>(v * whole.columns() + u);
        of(below, bounds[below]);
      }
  }

  const Image whole_;
  const Crop crop_;
};

}  // namespace

std::string text_of(const Crop& crop) {
  return "[" + std::to_string(crop.u) + ", " + std::to_string(crop.v) + ", " + std::to_string(crop.width) + ", " +
         std::to_string(crop.height) + "]";
}

std::string problem_of(const Crop& crop, PixelFormat format, int width, int height) {
  if (crop.u < 0 || crop.v < 0 || crop.width < 1 || crop.height < 1 || crop.width > width - crop.u ||
      crop.height > height - crop.v)
    return "crop " + text_of(crop) + " (u, v, width, height) is no part of the picture, which is " +
           std::to_string(width) + "x" + std::to_string(height);
  const bool needs_columns = needs_even_width(format), needs_rows = needs_even_height(format);
  if ((needs_columns && (crop.u % 2 != 0 || crop.width % 2 != 0)) ||
      (needs_rows && (crop.v % 2 != 0 || crop.height % 2 != 0)))
    return "crop " + text_of(crop) + " must have even columns" + (needs_rows ? " and rows" : "") +
           ": the pictures are " + std::string(name(format)) + ", in which neighbours share their colour";
  return {};
}

Image cropped(const Image& image, const Crop& crop) {
  if (const auto problem = problem_of(crop, image.format, image.width, image.height); !problem.empty())
    throw std::invalid_argument(problem);
  Image part = image;
  move_planes(part, crop);
  if (image.on_demand) {
    const auto pixels = std::make_shared<const CroppedPixels>(image, crop);
    part.owner = pixels;
    part.on_demand = pixels;
  }
  return part;
}

}  // namespace huetrack::capture
