// Access to the bytes of a picture in any format: light per pixel, and chroma that 1 or 2 columns and rows share.
// Values: light 0..255 (0 is black), chroma about 0 (grey), in grey values of the full range.
#pragma once

#include <cstddef>
#include <cstdint>

#include "capture/frames/pixels_on_demand.h"

namespace huetrack::outline {

// maths: ITU-R BT.601. Luma of R' G' B', and the factors of B' - Y and R' - Y in chroma.
inline constexpr float y_red = 0.299f, y_green = 0.587f, y_blue = 0.114f, by_blue = 0.564f, by_red = 0.713f;

// Bytes in a grid.
struct Samples {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t row_bytes = 0, step = 1;  // from a row to the next, from a sample to the next
  int first_u = 0, first_v = 0;            // the sample at `data`

  const std::uint8_t* at(int u, int v) const { return data + (v - first_v) * row_bytes + (u - first_u) * step; }
};

// Read-only view; the caller keeps the bytes alive. They are read by the functions below only, which decode them first.
struct Picture {
  int width = 0, height = 0;  // pixels
  Samples light, blue, red;   // one sample of chroma for so many columns and rows:
  int columns = 1, rows = 1;  // 1 or 2
  bool is_bgr = false;        // then `light` is the blue byte of packed B G R, and the others are not used
  bool is_grey = false;       // without chroma
  bool is_limited = false;    // light 16..235, chroma 16..240; otherwise 0..255
  // Of a partial picture: its first pixel (even numbers) and its size; otherwise 0.
  int part_u = 0, part_v = 0, part_width = 0, part_height = 0;
  const capture::PixelsOnDemand* on_demand = nullptr;  // nullptr: all pixels are there

  bool is_whole() const { return part_width == 0; }
  int end_u() const { return is_whole() ? width : part_u + part_width; }
  int end_v() const { return is_whole() ? height : part_v + part_height; }
};

inline constexpr int units = 64;  // layout: fixed-point steps of a grey value in 16 bits
// Rows of pixels, or of samples of chroma, inside the picture, as fixed-point numbers; the output has `stride` values
// from a row to the next.
struct Rows {
  int u, v, across, down, stride;
};
void read_light(const Picture& picture, const Rows& rows, std::int16_t* light);
void read_chroma(const Picture& picture, const Rows& rows, std::int16_t* blue, std::int16_t* red);

// Scattered pixels, or samples of chroma, of a picture.
struct Places {
  const int *u, *v;
  int n;
};
void read_light(const Picture& picture, const Places& at, float* light);
void read_chroma(const Picture& picture, const Places& at, float* blue, float* red);

}  // namespace huetrack::outline
