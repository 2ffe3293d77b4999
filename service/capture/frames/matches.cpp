#include "capture/frames/matches.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "capture/frames/image_copy.h"
#include "capture/frames/sample_code.h"

namespace huetrack::capture {
namespace {

constexpr std::uint8_t version = 1, version_with_patches = 3, runs_follow = 0, bits_follow = 1;
constexpr int planes = 3;
constexpr std::size_t formats = 7, numbers_of_color = 6;
// Pixels times colours: 32 colours of 4096x2160, and 35 MB.
constexpr std::size_t most_bits = std::size_t{32} * 4096 * 2160;
static_assert(static_cast<int>(PixelFormat::yuyv) == 0 && static_cast<int>(PixelFormat::bgr) == 5 &&
              static_cast<int>(PixelFormat::grey) == 6);

std::array<double, numbers_of_color> numbers_of(const MatchedColor& color) {
  return {color.hue_min_deg,    color.hue_max_deg,   color.saturation_min,
          color.saturation_max, color.intensity_min, color.intensity_max};
}

// ---- Writing

template <typename T>
void put(std::vector<std::uint8_t>& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void put_number(std::vector<std::uint8_t>& out, std::size_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
  out.push_back(static_cast<std::uint8_t>(value));
}

// Calls run(begin, end) for every run of matches in pixel order; a run may span rows.
template <typename F>
void for_each_run(const std::vector<std::uint64_t>& tiles, int width, int height, F&& run) {
  constexpr unsigned all = 0xff;
  const std::size_t across = tiles_across(width), columns = static_cast<std::size_t>(width);
  std::size_t begin = 0, end = 0;  // of the open run; equal: none
  const auto match = [&](std::size_t from, std::size_t to) {
    if (from != end || begin == end) {
      if (begin != end) run(begin, end);
      begin = from;
    }
    end = to;
  };
  const auto match_row = [&](std::span<const std::uint64_t> row, std::size_t v) {
    for (std::size_t t = 0; t < across; ++t) {
      unsigned bits = row[t] >> (8 * (v % Matches::tile_size)) & all;
      const std::size_t at = v * columns + t * Matches::tile_size;
      for (unsigned u = 0; bits != 0;) {
        const unsigned gap = static_cast<unsigned>(std::countr_zero(bits));
        const unsigned length = static_cast<unsigned>(std::countr_one(bits >> gap));
        match(at + u + gap, at + u + gap + length);
        u += gap + length;
        bits = bits >> gap >> length;
      }
    }
  };
  const auto rows = static_cast<std::size_t>(height);
  for (std::size_t first = 0; first < rows; first += Matches::tile_size) {
    const auto row = std::span(tiles).subspan(first / Matches::tile_size * across, across);
    if (std::ranges::all_of(row, [](std::uint64_t tile) { return tile == 0; })) continue;
    for (std::size_t v = first; v < std::min(first + Matches::tile_size, rows); ++v) match_row(row, v);
  }
  if (begin != end) run(begin, end);
}

void put_matches(const std::vector<std::uint64_t>& tiles, int width, int height, std::vector<std::uint8_t>& out) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const std::size_t as_bits = (pixels + 7) / 8;
  const std::size_t length_at = out.size();
  put(out, std::uint32_t{0});
  const std::size_t from = out.size();
  out.push_back(runs_follow);
  std::size_t last = 0;
  for_each_run(tiles, width, height, [&](std::size_t begin, std::size_t end) {
    if (out.size() - from > as_bits + 1) return;  // bits are shorter
    put_number(out, begin - last);
    put_number(out, end - begin);
    last = end;
  });
  if (out.size() - from > as_bits + 1) {
    out.resize(from);
    out.push_back(bits_follow);
    out.resize(from + 1 + as_bits, 0);
    for_each_run(tiles, width, height, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) out[from + 1 + i / 8] |= static_cast<std::uint8_t>(1U << i % 8);
    });
  }
  const auto length = static_cast<std::uint32_t>(out.size() - from);
  for (std::size_t i = 0; i < 4; ++i) out[length_at + i] = static_cast<std::uint8_t>(length >> (8 * i));
}

void put_patch(const Image& image, const PatchPlace& at, std::vector<std::uint8_t>& out) {
  require(image, at.u, at.v, at.u + at.width, at.v + at.height);
  for (const int number : {at.u, at.v, at.width, at.height}) put(out, static_cast<std::uint16_t>(number));
  std::vector<std::uint8_t> samples;
  for (int p = 0; p < planes; ++p) {
    const auto left = static_cast<std::ptrdiff_t>(plane_row_bytes(image.format, p, at.u));
    const auto length = static_cast<std::ptrdiff_t>(plane_row_bytes(image.format, p, at.width));
    const Plane& plane = image.planes[static_cast<std::size_t>(p)];
    const int top = plane_rows(image.format, p, at.v);
    samples.clear();
    for (int row = 0; row < plane_rows(image.format, p, at.height); ++row) {
      const std::uint8_t* const from = plane.data + (top + row) * plane.stride + left;
      samples.insert(samples.end(), from, from + length);
    }
    put_samples(samples, static_cast<std::size_t>(length), out);
  }
}

// ---- Reading

// Reads 0 beyond the end; is_sound() is false then.
class Bytes {
 public:
  explicit Bytes(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  template <typename T>
  T take() {
    T value = 0;
    if (rest_.size() < sizeof(T)) return fail(), value;
    for (std::size_t i = 0; i < sizeof(T); ++i) value = static_cast<T>(value | static_cast<T>(rest_[i]) << (8 * i));
    rest_ = rest_.subspan(sizeof(T));
    return value;
  }
  std::span<const std::uint8_t> take_span(std::size_t length) {
    if (rest_.size() < length) return fail(), std::span<const std::uint8_t>();
    const auto taken = rest_.first(length);
    rest_ = rest_.subspan(length);
    return taken;
  }
  std::size_t take_number() {
    std::size_t value = 0;
    for (unsigned shift = 0; shift < 35; shift += 7) {  // 2^35 pixels: no image has as many
      const auto byte = take<std::uint8_t>();
      value |= static_cast<std::size_t>(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    return fail(), 0;
  }
  std::span<const std::uint8_t>& left() { return rest_; }
  bool is_sound() const { return is_sound_; }
  bool is_empty() const { return rest_.empty(); }

 private:
  void fail() {
    is_sound_ = false;
    rest_ = {};
  }
  std::span<const std::uint8_t> rest_;
  bool is_sound_ = true;
};

void set(std::vector<std::uint64_t>& tiles, std::size_t width, std::size_t begin, std::size_t end) {
  constexpr std::size_t size = Matches::tile_size;
  const std::size_t across = tiles_across(static_cast<int>(width));
  for (std::size_t at = begin; at < end;) {
    const std::size_t v = at / width, u = at % width;
    const std::size_t row_end = std::min(width, u + (end - at));
    std::uint64_t* const row = &tiles[v / size * across];
    for (std::size_t from = u; from < row_end;) {
      const std::size_t to = std::min(row_end, from / size * size + size);
      const std::uint64_t bits = ((std::uint64_t{1} << (to - from)) - 1) << from % size;
      row[from / size] |= bits << size * (v % size);
      from = to;
    }
    at += row_end - u;
  }
}

// False: invalid.
bool read_matches(std::span<const std::uint8_t> bytes, int width, int height, std::vector<std::uint64_t>& tiles) {
  const std::size_t columns = static_cast<std::size_t>(width), pixels = columns * static_cast<std::size_t>(height);
  if (bytes.empty()) return false;
  const std::uint8_t kind = bytes.front();
  bytes = bytes.subspan(1);
  if (kind == bits_follow) {
    if (bytes.size() != (pixels + 7) / 8) return false;
    tiles.assign(tiles_of(width, height), 0);
    for (std::size_t i = 0; i < bytes.size(); ++i)
      for (unsigned bits = bytes[i]; bits != 0;) {
        const unsigned gap = static_cast<unsigned>(std::countr_zero(bits));
        const unsigned length = static_cast<unsigned>(std::countr_one(bits >> gap));
        const std::size_t begin = 8 * i + gap;
        if (begin + length > pixels) return false;
        set(tiles, columns, begin, begin + length);
        bits &= ~(((1U << length) - 1) << gap);
      }
    return true;
  }
  if (kind != runs_follow) return false;
  tiles.assign(tiles_of(width, height), 0);
  std::size_t at = 0;
  for (Bytes rest(bytes); !rest.is_empty();) {
    const std::size_t gap = rest.take_number(), length = rest.take_number();
    if (!rest.is_sound() || length == 0 || gap > pixels - at || length > pixels - at - gap) return false;
    set(tiles, columns, at + gap, at + gap + length);
    at += gap + length;
  }
  return true;
}

bool is_within(const PatchPlace& at, int width, int height) {
  return at.width > 0 && at.height > 0 && at.u % 2 == 0 && at.v % 2 == 0 && at.width % 2 == 0 && at.height % 2 == 0 &&
         at.u + at.width <= width && at.v + at.height <= height;
}

// False: invalid.
bool read_patch(Bytes& rest, const Image& source, Matches::Patch& out) {
  out.at.u = rest.take<std::uint16_t>(), out.at.v = rest.take<std::uint16_t>();
  out.at.width = rest.take<std::uint16_t>(), out.at.height = rest.take<std::uint16_t>();
  if (!rest.is_sound() || !is_within(out.at, source.width, source.height)) return false;
  out.image = {.format = source.format,
               .range = source.range,
               .width = out.at.width,
               .height = out.at.height,
               .planes = {},
               .owner = {}};
  const std::size_t all = packed_bytes(out.image);
  if (rest.left().size() < all / most_samples_per_byte) return false;  // before allocating
  const auto bytes = std::make_shared<std::vector<std::uint8_t>>(all);
  set_packed(out.image, bytes->data(), bytes);
  std::span<std::uint8_t> to(*bytes);
  for (int p = 0; !to.empty(); ++p) {
    const std::size_t row_bytes = plane_row_bytes(source.format, p, out.at.width);
    const std::size_t count = row_bytes * static_cast<std::size_t>(plane_rows(source.format, p, out.at.height));
    if (!take_samples(rest.left(), row_bytes, to.first(count))) return false;
    to = to.subspan(count);
  }
  return true;
}

}  // namespace

const Matches::OfColor* Matches::of(const MatchedColor& color) const {
  const auto found = std::ranges::find(colors, color, &OfColor::color);
  return found == colors.end() ? nullptr : &*found;
}

void encode_matches(const Image& source, std::span<const Matches::OfColor> colors, std::span<const std::uint8_t> jpeg,
                    std::vector<std::uint8_t>& out, std::span<const PatchPlace> patches) {
  out.clear();
  out.push_back(patches.empty() ? version : version_with_patches);
  out.push_back(static_cast<std::uint8_t>(source.format));
  out.push_back(source.range == ColorRange::full ? 1 : 0);
  put(out, static_cast<std::uint16_t>(source.width));
  put(out, static_cast<std::uint16_t>(source.height));
  out.push_back(static_cast<std::uint8_t>(colors.size()));
  for (const Matches::OfColor& color : colors) {
    for (const double number : numbers_of(color.color)) put(out, std::bit_cast<std::uint64_t>(number));
    put_matches(color.tiles, source.width, source.height, out);
  }
  put(out, static_cast<std::uint32_t>(jpeg.size()));
  out.insert(out.end(), jpeg.begin(), jpeg.end());
  if (patches.empty()) return;
  out.push_back(static_cast<std::uint8_t>(patches.size()));
  for (const PatchPlace& patch : patches) put_patch(source, patch, out);
}

std::optional<DecodedMatches> decode_matches(std::span<const std::uint8_t> bytes, JpegDecoder& decoder, Image& latest,
                                             int expected_width, int expected_height) {
  Bytes rest(bytes);
  const auto its_version = rest.take<std::uint8_t>();
  if (its_version != version && its_version != version_with_patches) return std::nullopt;
  const auto format = rest.take<std::uint8_t>(), range = rest.take<std::uint8_t>();
  const int width = rest.take<std::uint16_t>(), height = rest.take<std::uint16_t>();
  const std::size_t count = rest.take<std::uint8_t>();
  if (!rest.is_sound() || format >= formats || range > 1 || width == 0 || height == 0 || count > Matches::most ||
      count * static_cast<std::size_t>(width) * static_cast<std::size_t>(height) > most_bits)
    return std::nullopt;
  if (expected_width > 0 && (width != expected_width || height != expected_height)) return std::nullopt;
  DecodedMatches out{.source = {.format = static_cast<PixelFormat>(format),
                                .range = range == 1 ? ColorRange::full : ColorRange::limited,
                                .width = width,
                                .height = height,
                                .planes = {},
                                .owner = {}},
                     .matches = std::make_shared<Matches>()};
  out.matches->colors.resize(count);
  for (Matches::OfColor& color : out.matches->colors) {
    std::array<double, numbers_of_color> n{};
    for (double& number : n) number = std::bit_cast<double>(rest.take<std::uint64_t>());
    color.color = {n[0], n[1], n[2], n[3], n[4], n[5]};
    const auto coded = rest.take_span(rest.take<std::uint32_t>());
    if (!rest.is_sound() || !read_matches(coded, width, height, color.tiles)) return std::nullopt;
  }
  const auto jpeg = rest.take_span(rest.take<std::uint32_t>());
  if (its_version == version_with_patches) {
    const std::size_t patches = rest.take<std::uint8_t>();
    if (patches > Matches::most_patches) return std::nullopt;
    out.matches->patches.resize(patches);
    for (Matches::Patch& patch : out.matches->patches)
      if (!read_patch(rest, out.source, patch)) return std::nullopt;
  }
  if (!rest.is_sound() || !rest.is_empty()) return std::nullopt;
  if (!jpeg.empty()) {
    JpegResult picture = decoder.decode(jpeg, width, height);
    if (!picture.image) return std::nullopt;
    latest = std::move(*picture.image);
    out.matches->has_own_picture = true;
  }
  if (latest.width == width && latest.height == height) out.matches->picture = latest;
  return out;
}

}  // namespace huetrack::capture
