#include "capture/jpeg/jpeg_header.h"

#include <algorithm>
#include <numeric>
#include <string_view>
#include <utility>

namespace huetrack::capture {
namespace {

constexpr int most_size = 65500;               // libjpeg's JPEG_MAX_DIMENSION
constexpr std::int64_t most_pixels = 1 << 26;  // as JpegDecoder
constexpr int most_blocks_in_mcu = 10;         // libjpeg's D_MAX_BLOCKS_IN_MCU

HuffmanCode code_of(std::array<std::uint8_t, 16> counts, std::span<const std::uint8_t> symbols) {
  HuffmanCode code{.counts = counts};
  std::ranges::copy(symbols, code.symbols.begin());
  return code;
}

// The rest of a segment. Reading beyond it gives zeros, and is_valid is false from then on.
class Segment {
 public:
  explicit Segment(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  int byte() {
    if (bytes_.empty()) {
      is_valid = false;
      return 0;
    }
    const int value = bytes_[0];
    bytes_ = bytes_.subspan(1);
    return value;
  }
  int word() {
    const int high = byte();
    return high << 8 | byte();
  }
  std::span<const std::uint8_t> bytes(std::size_t n) {
    if (n > bytes_.size()) {
      is_valid = false;
      return {};
    }
    const auto first = bytes_.first(n);
    bytes_ = bytes_.subspan(n);
    return first;
  }
  std::size_t left() const { return bytes_.size(); }
  bool is_read() const { return is_valid && bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool is_valid = true;
};

// Reads segments in the order of the file. Each of_*() is false where the JPEG is left to libjpeg.
class HeaderReader {
 public:
  bool read(std::uint8_t marker, Segment segment) {
    switch (marker) {
      case 0xC0:  // baseline
      case 0xC1:  // extended: of 8 bits, it only has more tables
        return of_frame(segment);
      case 0xC4:
        return of_huffman_codes(segment);
      case 0xDA:
        return of_scan(segment);
      case 0xDB:
        return of_quantisation(segment);
      case 0xDD:
        header.restart_interval = segment.word();
        return segment.is_read();
      case 0xE0: {
        constexpr std::string_view jfif{"JFIF\0", 5};
        if (segment.left() >= 14 && std::ranges::equal(segment.bytes(jfif.size()), jfif)) is_jfif_ = true;
        return true;
      }
      case 0xEE: {
        constexpr std::string_view adobe = "Adobe";
        if (segment.left() >= 12 && std::ranges::equal(segment.bytes(adobe.size()), adobe))
          adobe_transform_ = segment.bytes(7)[6];
        return true;
      }
      case 0xFE: {
        constexpr std::string_view limited = "CS=ITU601";  // FFmpeg's marker for limited range
        if (segment.left() >= limited.size() && std::ranges::equal(segment.bytes(limited.size()), limited))
          header.range = ColorRange::limited;
        return true;
      }
      default:
        return marker >= 0xE1 && marker <= 0xEF;
    }
  }

  JpegHeader header;

 private:
  bool of_frame(Segment& segment) {
    if (header.components != 0 || segment.byte() != 8) return false;
    header.height = segment.word();
    header.width = segment.word();
    header.components = segment.byte();
    if (header.components != 1 && header.components != 3) return false;
    for (int i = 0; i < header.components; ++i) {
      const auto c = static_cast<std::size_t>(i);
      ids_[c] = segment.byte();
      const int factors = segment.byte();
      header.component[c].h = factors >> 4;
      header.component[c].v = factors & 15;
      quantisation_[c] = segment.byte();
    }
    return segment.is_read() && header.width > 0 && header.height > 0 && header.width <= most_size &&
           header.height <= most_size && std::int64_t{header.width} * header.height <= most_pixels;
  }

  bool of_quantisation(Segment& segment) {
    while (segment.left() > 0) {
      const int kind = segment.byte();
      if (kind >> 4 > 1 || (kind & 15) > 3) return false;
      auto& steps = steps_[static_cast<std::size_t>(kind & 15)].emplace();
      for (auto& step : steps) step = static_cast<std::int16_t>(kind >> 4 ? segment.word() : segment.byte());
    }
    return segment.is_read();
  }

  bool of_huffman_codes(Segment& segment) {
    while (segment.left() > 0) {
      const int kind = segment.byte();
      const auto counts = segment.bytes(16);
      if (counts.empty() || kind >> 4 > 1 || (kind & 15) > 3) return false;
      const std::size_t n = std::accumulate(counts.begin(), counts.end(), std::size_t{0});
      if (n > 256 || n > segment.left()) return false;
      HuffmanCode& code = (kind >> 4 ? ac_ : dc_)[static_cast<std::size_t>(kind & 15)].emplace();
      std::ranges::copy(counts, code.counts.begin());
      std::ranges::copy(segment.bytes(n), code.symbols.begin());
    }
    return segment.is_read();
  }

  // All components interleaved, in the order of the frame.
  bool of_scan(Segment& segment) {
    if (header.components == 0 || segment.byte() != header.components) return false;
    for (int i = 0; i < header.components; ++i) {
      const auto c = static_cast<std::size_t>(i);
      if (segment.byte() != ids_[c]) return false;
      const int tables = segment.byte();
      JpegHeader::Component& component = header.component[c];
      const auto q = static_cast<std::size_t>(quantisation_[c]);
      if (q >= steps_.size() || !steps_[q] || !take_code(component.dc, dc_, tables >> 4, standard_dc_code) ||
          !take_code(component.ac, ac_, tables & 15, standard_ac_code))
        return false;
      component.steps = *steps_[q];
    }
    return segment.byte() == 0 && segment.byte() == 63 && segment.byte() == 0 && segment.is_read() && find_format();
  }

  bool take_code(HuffmanCode& code, const std::array<std::optional<HuffmanCode>, 4>& codes, int table,
                 const HuffmanCode& (*standard)(int)) const {
    if (table > 3) return false;
    const auto& given = codes[static_cast<std::size_t>(table)];
    if (!given && table > 1) return false;
    code = given ? *given : standard(table);
    return true;
  }

  bool find_format() {
    auto& c = header.component;
    for (const auto& component : std::span(c).first(static_cast<std::size_t>(header.components)))
      if (component.h < 1 || component.h > 4 || component.v < 1 || component.v > 4) return false;
    if (header.components == 1) {
      c[0].h = c[0].v = 1;  // a scan of one component is not interleaved, whatever its factors
      header.format = PixelFormat::grey;
      return true;
    }
    const bool is_rgb = is_jfif_           ? false
                        : adobe_transform_ ? *adobe_transform_ != 1
                                           : ids_ == std::array{int{'R'}, int{'G'}, int{'B'}};
    if (is_rgb || ids_[0] == ids_[1] || ids_[0] == ids_[2] || ids_[1] == ids_[2]) return false;
    if (c[1].h != c[2].h || c[1].v != c[2].v || c[0].h % c[1].h != 0 || c[0].v % c[1].v != 0 ||
        c[0].h * c[0].v + 2 * c[1].h * c[1].v > most_blocks_in_mcu)
      return false;
    const std::pair shared{c[0].h / c[1].h, c[0].v / c[1].v};
    if (shared == std::pair{1, 1})
      header.format = PixelFormat::i444;
    else if (shared == std::pair{2, 1})
      header.format = PixelFormat::i422;
    else if (shared == std::pair{2, 2})
      header.format = PixelFormat::i420;
    else
      return false;
    return !(needs_even_width(header.format) && header.width % 2 != 0) &&
           !(needs_even_height(header.format) && header.height % 2 != 0);
  }

  std::array<int, 3> ids_{}, quantisation_{};
  std::array<std::optional<std::array<std::int16_t, 64>>, 4> steps_;
  std::array<std::optional<HuffmanCode>, 4> dc_, ac_;
  bool is_jfif_ = false;
  std::optional<int> adobe_transform_;
};

}  // namespace

const HuffmanCode& standard_dc_code(int table) {
  constexpr std::array<std::uint8_t, 12> symbols{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  static const std::array codes{code_of({0, 1, 5, 1, 1, 1, 1, 1, 1}, symbols),
                                code_of({0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1}, symbols)};
  return codes[static_cast<std::size_t>(table)];
}

const HuffmanCode& standard_ac_code(int table) {
  // clang-format off
  constexpr std::array<std::uint8_t, 162> luma{
      0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71,
      0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72,
      0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37,
      0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59,
      0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83,
      0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3,
      0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3,
      0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2,
      0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa};
  constexpr std::array<std::uint8_t, 162> chroma{
      0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13, 0x22,
      0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0, 0x15, 0x62, 0x72, 0xd1,
      0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25, 0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x35, 0x36,
      0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58,
      0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a,
      0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a,
      0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba,
      0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda,
      0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa};
  // clang-format on
  static const std::array codes{code_of({0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125}, luma),
                                code_of({0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119}, chroma)};
  return codes[static_cast<std::size_t>(table)];
}

std::optional<std::uint8_t> next_jpeg_marker(std::span<const std::uint8_t> jpeg, std::size_t& at, int& padding) {
  while (padding <= most_jpeg_padding) {
    while (at < jpeg.size() && jpeg[at] != 0xFF && padding <= most_jpeg_padding) {
      ++at;
      ++padding;
    }
    while (at < jpeg.size() && jpeg[at] == 0xFF) ++at;  // fill bytes: as many as there are
    if (at == jpeg.size()) break;
    const std::uint8_t marker = jpeg[at++];
    if (marker != 0) return padding <= most_jpeg_padding ? std::optional(marker) : std::nullopt;
    padding += 2;
  }
  return std::nullopt;
}

std::optional<JpegHeader> read_jpeg_header(std::span<const std::uint8_t> jpeg, int width, int height) {
  if (jpeg.size() < 4 || jpeg[0] != 0xFF || jpeg[1] != 0xD8) return std::nullopt;
  HeaderReader reader;
  std::size_t at = 2;
  for (;;) {
    const auto marker = next_jpeg_marker(jpeg, at, reader.header.padding);
    if (!marker || jpeg.size() - at < 2) return std::nullopt;
    const std::size_t length = std::size_t{jpeg[at]} << 8 | jpeg[at + 1];
    if (length < 2 || length > jpeg.size() - at) return std::nullopt;
    if (!reader.read(*marker, Segment(jpeg.subspan(at + 2, length - 2)))) return std::nullopt;
    at += length;
    if (*marker != 0xDA) continue;
    reader.header.scan = at;
    if (width > 0 && (reader.header.width != width || reader.header.height != height)) return std::nullopt;
    return std::move(reader.header);
  }
}

}  // namespace huetrack::capture
