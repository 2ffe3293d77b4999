#include "capture/frames/picture_tags.h"

#include <algorithm>
#include <string_view>

namespace huetrack::capture {
namespace {

using Bytes = std::span<const std::uint8_t>;

bool has(Bytes bytes, std::size_t at, std::string_view text) {
  return at <= bytes.size() && text.size() <= bytes.size() - at &&
         std::equal(text.begin(), text.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
                    [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
}

std::size_t number(Bytes bytes, std::size_t at, std::size_t size, bool is_little) {
  std::size_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value = value << 8 | bytes[at + (is_little ? size - 1 - i : i)];
  return value;
}

bool begins_as_tiff(Bytes bytes, std::size_t at) {
  return has(bytes, at, "II*") || has(bytes, at, std::string_view("MM\0*", 4));
}

// The first directory of a TIFF, which EXIF data are, too. at: where it begins in the whole.
void read_directory(Bytes whole, std::size_t at, std::size_t size, PictureTags& tags) {
  constexpr std::size_t header_bytes = 8, orientation_tag = 0x0112, entry_bytes = 12;
  if (size < header_bytes || !begins_as_tiff(whole, at)) return;
  const Bytes tiff = whole.subspan(at, size);
  const bool is_little = tiff[0] == 'I';
  const std::size_t directory = number(tiff, 4, 4, is_little);
  if (directory > tiff.size() || tiff.size() - directory < 2) return;
  std::size_t entry = directory + 2;
  for (std::size_t i = number(tiff, directory, 2, is_little); i > 0 && tiff.size() - entry >= entry_bytes; --i) {
    if (number(tiff, entry, 2, is_little) == orientation_tag) {
      const std::size_t value = entry + 8;
      tags.orientation = orientation_of_tag(static_cast<unsigned>(number(tiff, value, 2, is_little)));
      if (tags.orientation) tags.orientation_at = at + value + (is_little ? 0 : 1);
      return;
    }
    entry += entry_bytes;
  }
}

// EXIF data: a TIFF, some with this text before it.
void read_exif(Bytes whole, std::size_t at, std::size_t size, PictureTags& tags) {
  constexpr std::string_view before("Exif\0\0", 6);
  const std::size_t left_out = size >= before.size() && has(whole, at, before) ? before.size() : 0;
  if (!tags.orientation) read_directory(whole, at + left_out, size - left_out, tags);
}

void read_jpeg(Bytes jpeg, PictureTags& tags) {
  std::size_t at = 2;
  while (at + 4 <= jpeg.size() && jpeg[at] == 0xFF && jpeg[at + 1] >= 0xC0 && jpeg[at + 1] != 0xDA) {
    const std::size_t size = number(jpeg, at + 2, 2, false);
    if (size < 2 || size > jpeg.size() - at - 2) return;
    if (jpeg[at + 1] == 0xE1 && has(jpeg, at + 4, "Exif")) read_exif(jpeg, at + 4, size - 2, tags);
    at += 2 + size;
  }
}

// Chunks may stand before or behind the pixels.
void read_png(Bytes png, PictureTags& tags) {
  constexpr std::size_t signature = 8, before_data = 8, checksum = 4;
  for (std::size_t at = signature; at < png.size() && png.size() - at > before_data;) {
    const std::size_t size = number(png, at, 4, false), data = at + before_data;
    if (size > png.size() - data) return;
    if (has(png, at + 4, "sBIT") && size > 0) tags.significant_bits = *std::max_element(&png[data], &png[data] + size);
    if (has(png, at + 4, "eXIf")) read_exif(png, data, size, tags);
    at = data + size + checksum;
  }
}

void read_webp(Bytes webp, PictureTags& tags) {
  constexpr std::size_t header = 12, before_data = 8;
  for (std::size_t at = header; at < webp.size() && webp.size() - at > before_data;) {
    const std::size_t size = number(webp, at + 4, 4, true), data = at + before_data;
    if (size > webp.size() - data) return;
    if (has(webp, at, "EXIF")) read_exif(webp, data, size, tags);
    at = data + size + size % 2;
  }
}

}  // namespace

PictureTags tags_of(Bytes encoded) {
  PictureTags tags;
  if (has(encoded, 0, "\xff\xd8")) read_jpeg(encoded, tags);
  if (has(encoded, 0, "\x89PNG")) read_png(encoded, tags);
  if (has(encoded, 0, "RIFF") && has(encoded, 8, "WEBP")) read_webp(encoded, tags);
  if (begins_as_tiff(encoded, 0)) read_directory(encoded, 0, encoded.size(), tags);
  return tags;
}

}  // namespace huetrack::capture
