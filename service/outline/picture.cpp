#include "outline/picture.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

// unit: steps of the limited range, its black, and the byte of no colour
constexpr float limited_light = 255.f / 219, limited_chroma = 255.f / 224, limited_black = 16, no_chroma = 128;

// A byte less `zero`, times `by`, is a grey value.
struct Scale {
  float zero, by;
};
Scale scale_of_light(const Picture& picture) {
  return picture.is_limited ? Scale{limited_black, limited_light} : Scale{0.f, 1.f};
}
Scale scale_of_chroma(const Picture& picture) {
  return {no_chroma, picture.is_limited ? limited_chroma : 1.f};
}

float luma(const std::uint8_t* bgr) {
  return y_blue * bgr[0] + y_green * bgr[1] + y_red * bgr[2];
}
struct Chroma {
  float blue, red;
};
Chroma chroma(const std::uint8_t* bgr) {
  const float y = luma(bgr);
  return {by_blue * (bgr[0] - y), by_red * (bgr[2] - y)};
}

std::int16_t whole(float grey_values) {
  return static_cast<std::int16_t>(std::lround(grey_values * units));
}

// (byte - zero) * scale in units, rounded, as the product of 16-bit numbers that vectorises (pmulhrsw).
struct WholeScale {
  std::int16_t zero, by;
  explicit WholeScale(Scale of)
      : zero(static_cast<std::int16_t>(of.zero)),
        by(static_cast<std::int16_t>(std::lround(of.by * units * (1 << 15 >> before)))) {}
  static constexpr int before = 7;  // layout: bits
  std::int16_t operator()(int byte) const {
    const auto from_zero = static_cast<std::int16_t>((byte - zero) * (1 << before));
    return static_cast<std::int16_t>(((from_zero * by >> 14) + 1) >> 1);
  }
};

// Rows of a tile, of bytes that lie `step` apart. Copied first, because no byte beyond the last one may be read.
template <int step, int across>
inline __attribute__((always_inline)) void read_tile_rows(const std::uint8_t* from, std::ptrdiff_t row_bytes, int down,
                                                          WholeScale scale, int stride, std::int16_t* __restrict out) {
  constexpr int most_down = 16;  // layout: a tile
  alignas(64) std::uint8_t bytes[most_down][across * step];
  for (int j = 0; j < down; ++j) std::memcpy(bytes[j], from + j * row_bytes, (across - 1) * step + 1);
  for (int j = 0; j < down; ++j)
    for (int k = 0; k < across; ++k) out[j * stride + k] = scale(bytes[j][k * step]);
}

HUETRACK_CLONES void read_rows(const std::uint8_t* from, std::ptrdiff_t row_bytes, int step, const Rows& rows,
                               WholeScale scale, std::int16_t* __restrict out) {
  if (rows.down <= 16 && rows.across == 16 && step == 1)
    return read_tile_rows<1, 16>(from, row_bytes, rows.down, scale, rows.stride, out);
  if (rows.down <= 16 && rows.across == 16 && step == 2)
    return read_tile_rows<2, 16>(from, row_bytes, rows.down, scale, rows.stride, out);
  if (rows.down <= 16 && rows.across == 8 && step == 1)
    return read_tile_rows<1, 8>(from, row_bytes, rows.down, scale, rows.stride, out);
  if (rows.down <= 16 && rows.across == 8 && step == 2)
    return read_tile_rows<2, 8>(from, row_bytes, rows.down, scale, rows.stride, out);
  if (rows.down <= 16 && rows.across == 8 && step == 4)
    return read_tile_rows<4, 8>(from, row_bytes, rows.down, scale, rows.stride, out);
  for (int j = 0; j < rows.down; ++j)
    for (int k = 0; k < rows.across; ++k) out[j * rows.stride + k] = scale(from[j * row_bytes + k * step]);
}

// columns, rows: of pixels that share a sample.
void require(const Picture& picture, const Rows& of, int columns, int rows) {
  if (picture.on_demand == nullptr) return;
  picture.on_demand->require(of.u * columns, of.v * rows, (of.u + of.across) * columns, (of.v + of.down) * rows);
}

void require(const Picture& picture, const Places& at, int columns, int rows) {
  if (picture.on_demand == nullptr || at.n == 0) return;
  const auto [left, right] = std::minmax_element(at.u, at.u + at.n);
  const auto [top, bottom] = std::minmax_element(at.v, at.v + at.n);
  picture.on_demand->require(*left * columns, *top * rows, (*right + 1) * columns, (*bottom + 1) * rows);
}

void read(const Samples& samples, const Rows& rows, Scale scale, std::int16_t* out) {
  read_rows(samples.at(rows.u, rows.v), samples.row_bytes, static_cast<int>(samples.step), rows, WholeScale(scale),
            out);
}

HUETRACK_CLONES void to_grey_values(const std::int16_t* __restrict bytes, int n, Scale scale, float* __restrict out) {
  for (int i = 0; i < n; ++i) out[i] = (static_cast<float>(bytes[i]) - scale.zero) * scale.by;
}

void read(const Samples& samples, const Places& at, Scale scale, float* out) {
  constexpr int at_once = 64;  // layout
  alignas(64) std::int16_t bytes[at_once];
  const std::uint8_t* const first = samples.at(0, 0);
  const std::ptrdiff_t row_bytes = samples.row_bytes, step = samples.step;
  for (int from = 0; from < at.n; from += at_once) {
    const int n = std::min(at_once, at.n - from);
    const int *u = at.u + from, *v = at.v + from;
    for (int i = 0; i < n; ++i) bytes[i] = first[v[i] * row_bytes + u[i] * step];
    to_grey_values(bytes, n, scale, out + from);
  }
}

}  // namespace

void read_light(const Picture& picture, const Rows& rows, std::int16_t* light) {
  require(picture, rows, 1, 1);
  if (!picture.is_bgr) return read(picture.light, rows, scale_of_light(picture), light);
  for (int j = 0; j < rows.down; ++j) {
    const std::uint8_t* p = picture.light.at(rows.u, rows.v + j);
    for (int i = 0; i < rows.across; ++i, p += picture.light.step) light[j * rows.stride + i] = whole(luma(p));
  }
}

void read_chroma(const Picture& picture, const Rows& rows, std::int16_t* blue, std::int16_t* red) {
  require(picture, rows, picture.columns, picture.rows);
  if (!picture.is_bgr && !picture.is_grey) {
    read(picture.blue, rows, scale_of_chroma(picture), blue);
    return read(picture.red, rows, scale_of_chroma(picture), red);
  }
  for (int j = 0; j < rows.down; ++j) {
    if (picture.is_grey) {
      std::fill_n(blue + j * rows.stride, rows.across, std::int16_t{0});
      std::fill_n(red + j * rows.stride, rows.across, std::int16_t{0});
      continue;
    }
    const std::uint8_t* p = picture.light.at(rows.u, rows.v + j);
    for (int i = 0; i < rows.across; ++i, p += picture.light.step) {
      const Chroma of = chroma(p);
      blue[j * rows.stride + i] = whole(of.blue), red[j * rows.stride + i] = whole(of.red);
    }
  }
}

void read_light(const Picture& picture, const Places& at, float* light) {
  require(picture, at, 1, 1);
  if (picture.is_bgr) {
    for (int i = 0; i < at.n; ++i) light[i] = luma(picture.light.at(at.u[i], at.v[i]));
    return;
  }
  read(picture.light, at, scale_of_light(picture), light);
}

void read_chroma(const Picture& picture, const Places& at, float* blue, float* red) {
  require(picture, at, picture.columns, picture.rows);
  if (picture.is_bgr || picture.is_grey) {
    for (int i = 0; i < at.n; ++i) {
      const Chroma of = picture.is_grey ? Chroma{0, 0} : chroma(picture.light.at(at.u[i], at.v[i]));
      blue[i] = of.blue, red[i] = of.red;
    }
    return;
  }
  read(picture.blue, at, scale_of_chroma(picture), blue);
  read(picture.red, at, scale_of_chroma(picture), red);
}

}  // namespace huetrack::outline
