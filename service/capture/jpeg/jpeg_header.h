// The segments before the entropy-coded bytes of a baseline JPEG.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// As in a DHT segment: the numbers of codes of 1..16 bits, and their symbols in ascending order of the codes.
struct HuffmanCode {
  std::array<std::uint8_t, 16> counts{};
  std::array<std::uint8_t, 256> symbols{};
  bool operator==(const HuffmanCode&) const = default;
};

// The codes of ITU-T T.81, Annex K.3, which motion JPEG may omit; 0: luma, 1: chroma.
const HuffmanCode& standard_dc_code(int table);
const HuffmanCode& standard_ac_code(int table);

struct JpegHeader {
  struct Component {
    int h = 1, v = 1;                      // blocks in an MCU; 1 x 1 in a JPEG of one component
    std::array<std::int16_t, 64> steps{};  // of quantisation, in zigzag order, modulo 2^16 as in libjpeg-turbo
    HuffmanCode dc, ac;
  };
  PixelFormat format = PixelFormat::grey;
  ColorRange range = ColorRange::full;
  int width = 0, height = 0;
  int components = 0;  // 1 or 3
  std::array<Component, 3> component;
  int restart_interval = 0;  // MCUs; 0: none
  std::size_t scan = 0;      // offset of the first entropy-coded byte
  int padding = 0;           // bytes between segments

  int mcu_width() const { return 8 * component[0].h; }  // the first component is not subsampled
  int mcu_height() const { return 8 * component[0].v; }
};

// Webcams pad by a byte or two. JpegDecoder tolerates so many bytes before each marker, JpegIndex in the whole JPEG.
constexpr int most_jpeg_padding = 16;

// Advances `at` behind the next marker and returns it. Adds skipped bytes to `padding` as libjpeg counts them. nullopt:
// no marker, or too much padding.
std::optional<std::uint8_t> next_jpeg_marker(std::span<const std::uint8_t> jpeg, std::size_t& at, int& padding);

// nullopt: see JpegIndex::build().
std::optional<JpegHeader> read_jpeg_header(std::span<const std::uint8_t> jpeg, int width, int height);

}  // namespace huetrack::capture
