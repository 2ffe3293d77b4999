// Which pixels of a frame have colours that somebody looks for, in place of its pixels: what a camera host sends of a
// camera with `send: matches` (service/hosts/README.md), and what is recorded of it.
//
// As bytes, integers little-endian, doubles as IEEE 754 has them:
//   1  version: 1; 3 where patches follow
//   1  format of the pixels that were looked at: 0 yuyv, 1 nv12, 2 i420, 3 i422, 4 i444, 5 bgr, 6 grey
//   1  their range: 0 limited, 1 full
//   2  width, 2 height, pixels
//   1  number of colours; of each
//      48  the colour: hue_min_deg, hue_max_deg, saturation_min, saturation_max, intensity_min, intensity_max
//      4   how many bytes follow: the first is 0 or 1, the others
//          0: runs over the pixels row by row from the top left: so many that do not match, so many that do, and so on;
//             each number in groups of seven bits, the lowest first, the high bit set but in the last. After the last
//             run nothing matches.
//          1: a bit per pixel in that order, the lowest of a byte first: where runs would be longer
//   4  how many bytes follow: none, or the JPEG of this frame
//   Of version 3, further:
//   1  number of patches; of each
//      2  column, 2 row of its first pixel, 2 width, 2 height: pixels, even numbers
//      its planes one after the other, in the format of the pixels that were looked at, as sample_code.h has them
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// A range of colour in HSI, color::HsiRange as numbers: it names what has matched.
struct MatchedColor {
  double hue_min_deg = 0, hue_max_deg = 0;
  double saturation_min = 0, saturation_max = 0;
  double intensity_min = 0, intensity_max = 0;
  bool operator==(const MatchedColor&) const = default;
};

// Where an object's outline will be seen, as who follows it expects: in a frame, by its number, and how it moves from
// there. Pixels, seconds.
struct ExpectedOutline {
  float u = 0, v = 0, u_per_s = 0, v_per_s = 0;
  float radius_px = 0;
};

// A rectangle of an image; even numbers, so that chroma is not cut.
struct PatchPlace {
  int u = 0, v = 0, width = 0, height = 0;
};

// Immutable once it is in a frame; safe from any thread.
struct Matches {
  static constexpr int tile_size = 8;      // pixels, each way
  static constexpr std::size_t most = 32;  // colours of one frame
  static constexpr std::size_t most_patches = 16;
  struct OfColor {
    MatchedColor color;
    // Row by row from the top left, tiles_across() a row: bit 8 r + c is the pixel in the tile's row r and column c.
    // Bits beyond the image are 0.
    std::vector<std::uint64_t> tiles;
  };
  std::vector<OfColor> colors;
  // The latest full picture that came with one of the camera's frames: for people, and for what watches colour and
  // room, never for where an object is. Without planes: there was none yet.
  Image picture;
  bool has_own_picture = false;  // it came with this frame
  // The frame's own pixels where outlines were expected, as they were looked at.
  struct Patch {
    PatchPlace at;
    Image image;  // of that size
  };
  std::vector<Patch> patches;

  const OfColor* of(const MatchedColor& color) const;  // nullptr: nobody asked for it when the frame was sent
};

inline std::size_t tiles_across(int width) {
  return static_cast<std::size_t>((width + Matches::tile_size - 1) / Matches::tile_size);
}
inline std::size_t tiles_of(int width, int height) {
  return tiles_across(width) * tiles_across(height);
}

// looked_at: whose format, range and size are told, and with patches its pixels. jpeg: of the frame, or empty. patches:
// within it, at most Matches::most_patches. Replaces what is in `out`.
void encode_matches(const Image& looked_at, std::span<const Matches::OfColor> colors,
                    std::span<const std::uint8_t> jpeg, std::vector<std::uint8_t>& out,
                    std::span<const PatchPlace> patches = {});

struct DecodedMatches {
  Image looked_at;  // format, range and size; no planes
  std::shared_ptr<Matches> matches;
};
// Anybody may have made the bytes: nullopt where they make no sense, or the JPEG does not decode to that size. Takes no
// more memory than some 35 MB, sixteen times the bytes and the JPEG's. latest: the picture of the camera's frames
// before, if there was one of that size; and after this. width, height: what the camera's frames must have, or nothing
// is decoded; 0: any.
std::optional<DecodedMatches> decode_matches(std::span<const std::uint8_t> bytes, JpegDecoder& decoder, Image& latest,
                                             int width = 0, int height = 0);

}  // namespace huetrack::capture
