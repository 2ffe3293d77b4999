// Matches replace a frame's pixels: which pixels have the colours that trackers requested. A camera host sends them for
// a camera with `send: matches` (service/hosts/README.md), and recordings store them.
//
// As bytes; integers little-endian, doubles IEEE 754:
//   1  version: 1; 3 with patches
//   1  pixel format of the source image: 0 yuyv, 1 nv12, 2 i420, 3 i422, 4 i444, 5 bgr, 6 grey
//   1  its range: 0 limited, 1 full
//   2  width, 2 height, pixels
//   1  number of colours; for each
//      48  the colour: hue_min_deg, hue_max_deg, saturation_min, saturation_max, intensity_min, intensity_max
//      4   number of bytes that follow; the first is 0 or 1, and the others are
//          0: run lengths over the pixels, row by row from the top left: non-matching, matching, non-matching, ...;
//             each a varint (groups of seven bits, lowest first, the high bit set except in the last). Nothing matches
//             after the last run.
//          1: a bit per pixel in that order, lowest bit of a byte first; used where runs would be longer
//   4  number of bytes that follow: none, or the JPEG of this frame
//   Version 3 continues:
//   1  number of patches; for each
//      2  column, 2 row of its first pixel, 2 width, 2 height: pixels, even numbers
//      its planes one after the other, in the source's pixel format, coded as in sample_code.h
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// A colour range in HSI, color::HsiRange as numbers.
struct MatchedColor {
  double hue_min_deg = 0, hue_max_deg = 0;
  double saturation_min = 0, saturation_max = 0;
  double intensity_min = 0, intensity_max = 0;
  bool operator==(const MatchedColor&) const = default;
};

// A tracker's prediction of an object's outline in one frame, and its image velocity. Pixels, seconds.
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
  // The latest full picture of the camera, for display and for the colour and room watches; not for measurements.
  // Without planes: none has come yet.
  Image picture;
  bool has_own_picture = false;  // it came with this frame
  // The frame's own pixels around expected outlines.
  struct Patch {
    PatchPlace at;
    Image image;  // of that size
  };
  std::vector<Patch> patches;

  const OfColor* of(const MatchedColor& color) const;  // nullptr: not requested when the frame was sent
};

inline std::size_t tiles_across(int width) {
  return static_cast<std::size_t>((width + Matches::tile_size - 1) / Matches::tile_size);
}
inline std::size_t tiles_of(int width, int height) {
  return tiles_across(width) * tiles_across(height);
}

// source: its format, range and size are coded, and its pixels in the patches. jpeg: of the frame, or empty. patches:
// within the image, at most Matches::most_patches. Replaces the content of `out`.
void encode_matches(const Image& source, std::span<const Matches::OfColor> colors, std::span<const std::uint8_t> jpeg,
                    std::vector<std::uint8_t>& out, std::span<const PatchPlace> patches = {});

struct DecodedMatches {
  Image source;  // format, range and size; no planes
  std::shared_ptr<Matches> matches;
};
// The bytes are untrusted: nullopt when they are invalid, or the JPEG does not decode to that size. Needs at most some
// 35 MB plus sixteen times the bytes plus the JPEG's memory. latest: in and out, the camera's latest picture. width,
// height: the size that the frame must have; 0: any.
std::optional<DecodedMatches> decode_matches(std::span<const std::uint8_t> bytes, JpegDecoder& decoder, Image& latest,
                                             int width = 0, int height = 0);

}  // namespace huetrack::capture
