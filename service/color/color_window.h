// Which pixels of an image have the target's colour, evaluated only where asked: the paper's 5x5 windows (section 2.2)
// and larger boxes.
//
// The image is cut into tiles of 8x8 pixels. A tile is classified by table look-up when it is first touched, and kept
// as the 64 bits of one word, so that overlapping windows look up no pixel twice. The words lie in bands, columns of
// bytes: a byte is eight pixels of one row, the byte after it those of the row below. Bands overlap by half, so that
// every 5x5 window lies within one of them: its count is one load, one shift and the popcount of 25 bits. The cost does
// not grow with the image's size. tests/benchmark/speed measures it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/frames/pixel_format.h"
#include "color/color_model.h"
#include "color/window_kernels.h"

namespace huetrack::color {

// Inclusive pixel bounds.
struct PixelBox {
  int u_min, v_min, u_max, v_max;
  bool empty() const { return u_min > u_max || v_min > v_max; }
  bool operator==(const PixelBox&) const = default;
};

// Usual values of a tile's pixels, row by row: Y U V, or B G R.
using UsualPixels = std::array<std::array<std::uint8_t, 3>, 64>;
// Expected value of a channel: gain * (usual - zero) + zero + shift, where zero is 128 for chroma and 0 otherwise. A
// pixel shows its usual values if no channel differs from that by more than `gate`.
struct LightChange {
  float gain = 1;
  std::array<float, 3> shift{}, gate{};
};

std::array<float, 3> expected_values(const LightChange& light, const std::array<std::uint8_t, 3>& usual,
                                     capture::PixelFormat format);
inline bool shows(const LightChange& light, const std::array<float, 3>& expected,
                  const std::array<std::uint8_t, 3>& now) {
  return std::abs(float(now[0]) - expected[0]) <= light.gate[0] &&
         std::abs(float(now[1]) - expected[1]) <= light.gate[1] &&
         std::abs(float(now[2]) - expected[2]) <= light.gate[2];
}

class RoomColors;

// thread-compatible. One per camera and target; lives as long as the tracker, so that a frame costs no allocation.
class MatchBits {
 public:
  // layout: bits around the image that are always 0, so that no window needs clipping
  static constexpr int margin = 8;

  MatchBits(int width, int height, const WindowKernels& kernels = best_window_kernels());  // pixels, >= 1

  // Pixels in these boxes (which may reach beyond the image) match nothing from the next frame on.
  void ignore(const std::vector<PixelBox>& boxes);

  // Pixels of a tile (counted row by row, tile_stride() a row, margin included; bit 8 r + c) that match nothing in what
  // is classified from now on, besides the boxes, while they show their usual values: what stands before them matches.
  // usual: nullptr, always; else lives until leave_out_nothing(). A frame without pixels counts as showing them.
  void leave_out(std::size_t tile, std::uint64_t pixels, const UsualPixels* usual = nullptr);
  void leave_out_nothing();
  // The room's colours, if it shares the target's; nullptr: it does not, or the frame has no pixels.
  void set_room(std::shared_ptr<const RoomColors> room) { room_ = std::move(room); }
  const RoomColors* room() const { return has_pixels() ? room_.get() : nullptr; }
  // How the light differs in this frame from that of all usual values.
  void set_light(const LightChange& light) { light_ = light; }
  // Raw values of a pixel, as in UsualPixels. The frame has pixels.
  std::array<std::uint8_t, 3> values_at(int u, int v) const;
  bool has_pixels() const { return found_ == nullptr; }
  // Sum over the channels of how far a pixel is from its usual value, in halves of `gate`; infinite where none is
  // known.
  double change_at(int u, int v) const;
  const LightChange& light() const { return light_; }
  // Matches with leave_out() ignored: of one tile, and of a grid of pixels like grid().
  std::uint64_t tile_with_left_out(TileAt tile) const;
  void grid_with_left_out(int step, std::vector<PixelAt>& hits) const;

  // The next frame. The image must have the size that the constructor was given, and `table` must be for its format;
  // both must live until the next call. The last frame's bits are forgotten.
  void look_at(const capture::Image& image, const ColorTable& table);
  // The next frame, given as its matches (match_tiles.h) instead of pixels; they must live until the next call.
  void look_at(const capture::Matches::OfColor& matches);
  // The frame of the last call again, with nothing classified yet.
  void look_anew();

  // k of eq. (6) for n windows: how many of the 5x5 pixels around the pixel that (u, v) rounds to have the target's
  // colour, 0..25; pixels of the window beyond the border count as not matching. `outside` where (u, v) is not in the
  // image.
  static constexpr std::uint8_t outside = 255;
  void count_5x5(const float* u, const float* v, std::size_t n, std::uint8_t* k);

  bool at(int u, int v);  // inside the image

  // The 57 (or more) match bits of row v from pixel u on: bit i is pixel u + i. u in [-margin, width), v in the image.
  // Pixels that look(box) has not covered, and those beyond the border, are 0.
  std::uint64_t row(int u, int v) const;
  // Whether row() may give any bit here or in the rows of the same tiles: whether one of these tiles has a match.
  bool has_any(int u, int v) const;
  void look(const PixelBox& box);  // classifies all tiles that the box touches; clipped

  // The matching pixels among those of a grid of step pixels over the whole image: (step/2 + i step, step/2 + j step).
  void grid(int step, std::vector<PixelAt>& hits) const;

  int width() const { return width_; }
  int height() const { return height_; }
  int tile_stride() const { return tile_stride_; }
  int tile_rows() const { return tile_rows_; }
  std::uint64_t tiles_looked_at() const { return tiles_looked_at_; }  // since the start: the cost

 private:
  // Band b has the columns 4 b .. 4 b + 7 (margin included), bit c of a byte is column 4 b + c. Even bands are the
  // tiles themselves; a nibble of an odd band is as new as its tile.
  std::uint8_t* band(int b, int padded_row) { return &bands_[static_cast<std::size_t>(b * band_rows_ + padded_row)]; }
  const std::uint8_t* band(int b, int padded_row) const {
    return &bands_[static_cast<std::size_t>(b * band_rows_ + padded_row)];
  }
  void look_at_tile(int tile_u, int tile_v) {
    std::uint32_t& frame = tile_frame_[static_cast<std::size_t>(tile_v * tile_stride_ + tile_u)];
    if (frame == frame_) return;
    frame = frame_;
    const TileAt tile{static_cast<std::uint16_t>(tile_u), static_cast<std::uint16_t>(tile_v)};
    fill({&tile, 1});
  }
  std::uint8_t* marked() { return &mark_[static_cast<std::size_t>(mark_front + cell_stride_)]; }  // of the first cell
  void look_at_marked(int cell_u_min, int cell_v_min, int cell_u_max, int cell_v_max);
  void fill(std::span<const TileAt> tiles);
  std::size_t without_impossible(std::span<TileAt> tiles, const PixelBox& box);
  void fill_inside(std::span<const TileAt> tiles);  // of tiles that lie wholly inside the image
  void store(std::span<const TileAt> tiles, const std::uint64_t* bits);
  void fetch(std::span<const TileAt> tiles) const;
  void fetch_row(int v) const;
  bool is_inside(TileAt tile) const {  // wholly inside the image
    return tile.u > 0 && tile.v > 0 && tile.pixel_u() + TileAt::size <= width_ &&
           tile.pixel_v() + TileAt::size <= height_;
  }
  void classify(std::span<const TileAt> tiles, std::uint64_t* bits) const;  // inside the image
  std::uint64_t classify_edge(int u, int v) const;
  // Of the matching pixels `bits` of a tile, those that leave_out() leaves out now.
  std::uint64_t left_out(TileAt tile, std::uint64_t bits) const;
  // The given matches of the tile with this top left pixel.
  std::uint64_t found(int u, int v) const { return found_[v / TileAt::size * found_stride_ + u / TileAt::size]; }

  static constexpr int mark_front = 64;  // layout: bytes that the kernels may read before and behind the cells

  const WindowKernels& kernels_;
  int width_, height_;
  int tile_stride_, tile_rows_;  // tiles per row, and rows of them; a margin tile on each side
  int band_rows_;                // bytes per band
  int cell_stride_;              // cells per row
  std::uint32_t frame_ = 0;
  std::uint64_t tiles_looked_at_ = 0;
  capture::Image image_;                                // without owner and on_demand
  const capture::PixelsOnDemand* on_demand_ = nullptr;  // of the image; nullptr: all pixels are there
  int bytes_per_pixel_ = 1;                             // of its first plane
  const ColorTable* table_ = nullptr;
  const std::uint64_t* found_ = nullptr;  // in place of image and table
  std::ptrdiff_t found_stride_ = 0;
  std::vector<std::uint32_t> tile_frame_;  // that the tile was classified for
  std::vector<std::uint8_t> bands_;
  void scan_grid(int step, std::vector<PixelAt>& hits) const;

  std::vector<std::uint64_t> ignored_;     // per tile, bits that never match; empty: none
  std::vector<std::uint64_t> in_boxes_;    // of them, those that are in boxes
  std::vector<const UsualPixels*> usual_;  // per tile; empty: none
  LightChange light_;
  std::shared_ptr<const RoomColors> room_;
  // Per cell of 4x4 pixels: whether a window begins in it; all 0 between calls, but for cell 0.
  std::vector<std::uint8_t> mark_;
  std::vector<std::int32_t> where_;  // work space of count_5x5
  std::vector<TileAt> unknown_;      // work space of count_5x5
};

}  // namespace huetrack::color
