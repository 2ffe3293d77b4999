#include "capture/ffmpeg/color_matrix.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

namespace huetrack::capture {
namespace {

// R' = Y + red_u U + red_v V, ...; U, V: from -0.5 to 0.5, whatever the standard calls them.
struct ToRgb {
  double red_u, red_v, green_u, green_v, blue_u, blue_v;
};

// Shares of red and blue in luma.
struct LumaShares {
  double red, blue;
  double green() const { return 1 - red - blue; }
  ToRgb to_rgb() const {
    const double u = 2 * (1 - blue), v = 2 * (1 - red);
    return {0, v, -blue * u / green(), -red * v / green(), u, 0};
  }
};
constexpr LumaShares bt601{0.299, 0.114};  // ITU-R BT.601, 2.5.1

std::optional<ToRgb> to_rgb_of(AVColorSpace matrix) {
  switch (matrix) {
    case AVCOL_SPC_BT709:
      return LumaShares{0.2126, 0.0722}.to_rgb();  // ITU-R BT.709, 3.2
    case AVCOL_SPC_SMPTE240M:
      return LumaShares{0.212, 0.087}.to_rgb();  // SMPTE 240M, 2.2
    case AVCOL_SPC_BT2020_NCL:
      return LumaShares{0.2627, 0.0593}.to_rgb();  // ITU-R BT.2020, table 4
    case AVCOL_SPC_YCGCO:
      return ToRgb{-1, 1, 1, 0, -1, -1};  // ITU-T H.273, matrix 8
    default:
      return std::nullopt;  // BT.601's, within a percent (FCC), or no matrix
  }
}

// Y' = Y + y_u U + y_v V, and U', V' of U, V: in units of 1 / one, between 8-bit samples.
constexpr int shift = 14, one = 1 << shift;
struct Change {
  int y_u, y_v, u_u, u_v, v_u, v_v;
};

Change change_of(const ToRgb& from, ColorRange range) {
  const auto luma = [&](double r, double g, double b) { return bt601.red * r + bt601.green() * g + bt601.blue * b; };
  const double y_u = luma(from.red_u, from.green_u, from.blue_u), y_v = luma(from.red_v, from.green_v, from.blue_v);
  const double blue = 2 * (1 - bt601.blue), red = 2 * (1 - bt601.red);
  const double luma_levels = range == ColorRange::full ? 1 : 219. / 224;  // a luma level for one of colour
  const auto units = [](double factor) { return static_cast<int>(std::lround(factor * one)); };
  return {units(y_u * luma_levels),          units(y_v * luma_levels),        units((from.blue_u - y_u) / blue),
          units((from.blue_v - y_v) / blue), units((from.red_u - y_u) / red), units((from.red_v - y_v) / red)};
}

int mixed(int u_factor, int v_factor, int u, int v) {
  return (u_factor * (u - 128) + v_factor * (v - 128) + one / 2) >> shift;
}

std::uint8_t sample(int level) {
  return static_cast<std::uint8_t>(std::clamp(level, 0, 255));
}

// The row of i420's colours that row y of a picture shares.
int color_row(int y, bool by_fields) {
  return by_fields ? y / 4 * 2 + y % 2 : y / 2;
}

}  // namespace

bool has_other_matrix(const AVFrame& frame) {
  return to_rgb_of(frame.colorspace).has_value();
}

bool to_bt601(AVFrame& frame, AVColorSpace matrix, PixelFormat format, ColorRange range, bool by_fields) {
  const auto from = to_rgb_of(matrix);
  if (!from) return true;
  if (av_frame_make_writable(&frame) < 0) return false;
  const Change change = change_of(*from, range);
  const int width = static_cast<int>(plane_row_bytes(format, 1, frame.width));
  const int rows = plane_rows(format, 1, frame.height), repeats = frame.width / width;
  const auto row = [&](int plane, int y) { return frame.data[plane] + std::ptrdiff_t{y} * frame.linesize[plane]; };
  std::vector<int> added(static_cast<std::size_t>(width));  // to luma, by a row of colours
  for (int y = 0; y < frame.height; ++y) {
    const int shared = rows == frame.height ? y : std::min(color_row(y, by_fields), rows - 1);
    const std::uint8_t *u = row(1, shared), *v = row(2, shared);
    for (int x = 0; x < width; ++x) added[static_cast<std::size_t>(x)] = mixed(change.y_u, change.y_v, u[x], v[x]);
    std::uint8_t* luma = row(0, y);
    for (int x = 0; x < frame.width; ++x)
      luma[x] = sample(luma[x] + added[static_cast<std::size_t>(repeats == 2 ? x / 2 : x)]);
  }
  for (int y = 0; y < rows; ++y) {
    std::uint8_t *u = row(1, y), *v = row(2, y);
    for (int x = 0; x < width; ++x) {
      const int old_u = u[x], old_v = v[x];
      u[x] = sample(128 + mixed(change.u_u, change.u_v, old_u, old_v));
      v[x] = sample(128 + mixed(change.v_u, change.v_v, old_u, old_v));
    }
  }
  return true;
}

}  // namespace huetrack::capture
