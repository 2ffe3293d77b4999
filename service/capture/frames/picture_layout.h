// What a source says of its pictures beside the pixels: how a player turns them, in which order an interlaced camera
// reads the rows, the shape of a pixel. One list for files, network streams and devices. Pure functions; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// How a player shows a stored picture: its column and row, times this matrix of -1, 0 and 1, plus what makes both >= 0.
struct Orientation {
  int column_by_column = 1, row_by_column = 0;  // where a step along a stored row leads
  int column_by_row = 0, row_by_row = 1;        // where a step down a stored column leads
  bool is_upright() const { return column_by_column == 1 && row_by_row == 1; }
  bool swaps_axes() const { return column_by_column == 0; }
  bool operator==(const Orientation&) const = default;
};

struct PictureLayout {
  Orientation orientation = {};
  double turned_deg = 0;       // clockwise, as tagged; what is no multiple of 90 is not applied
  bool is_mirrored = false;    // as tagged, besides
  bool is_interlaced = false;  // at least one picture
  double pixel_aspect = 1;     // width of a pixel / its height
  bool operator==(const PictureLayout&) const = default;
};

// What a user must know of it, and do; empty: nothing. One sentence each, as "is interlaced: ...".
std::vector<std::string> notes_on(const PictureLayout& layout);

// The picture as a player shows it. An exact permutation; only 4:2:2 chroma is repeated, to 4:4:4, where axes are
// swapped.
Image turned(const Image& image, const Orientation& orientation);

enum class FirstField : std::uint8_t { top, bottom };  // of an interlaced picture: that of row 0, or of row 1

// The picture of the first field of an interlaced one, in full size: the other field's rows are interpolated. So all
// rows are of one moment, and stay where they were.
Image first_field(const Image& image, FirstField first);

// 1 to 8, as EXIF and TIFF number them.
std::optional<Orientation> orientation_of_tag(unsigned tag);

}  // namespace huetrack::capture
