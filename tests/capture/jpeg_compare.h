// What JpegIndex makes of a JPEG beside what JpegDecoder makes of it.
#pragma once

#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "capture/jpeg/jpeg_index.h"

namespace huetrack::capture {

// An image whose MCUs were decoded on demand, in the order and in the runs that `run` says (MCUs).
struct IndexedImage {
  std::array<std::vector<std::uint8_t>, 3> planes;
  Image image;
};
inline IndexedImage decode_all(const JpegIndex& index, int run = 7) {
  IndexedImage decoded;
  decoded.image = {.format = index.format(),
                   .range = index.range(),
                   .width = index.width(),
                   .height = index.height(),
                   .planes = {},
                   .owner = {}};
  const int width = index.mcu_columns() * index.mcu_width(), height = index.mcu_rows() * index.mcu_height();
  std::array<std::uint8_t*, 3> data{};
  std::array<std::ptrdiff_t, 3> strides{};
  for (std::size_t i = 0; i < 3; ++i) {
    const int plane = static_cast<int>(i);
    const std::size_t bytes = plane_row_bytes(index.format(), plane, width);
    if (bytes == 0) continue;
    decoded.planes[i].resize(bytes * static_cast<std::size_t>(plane_rows(index.format(), plane, height)), 77);
    data[i] = decoded.planes[i].data();
    strides[i] = static_cast<std::ptrdiff_t>(bytes);
    decoded.image.planes[i] = {data[i], strides[i]};
  }
  for (int v = index.mcu_rows() - 1; v >= 0; --v)
    for (int u = 0; u < index.mcu_columns(); u += run)
      index.decode(v, u, std::min(u + run, index.mcu_columns()), data, strides);
  return decoded;
}

// Whether all pixels lie within the bounds of their MCUs, of which those of chroma are narrowed.
inline bool is_within_bounds(const JpegIndex& index, const Image& image) {
  std::vector<PixelBounds> bounds = index.bounds();
  for (std::size_t mcu = 0; mcu < bounds.size(); ++mcu) {
    const PixelBounds wide = bounds[mcu];
    index.narrow_chroma(mcu, bounds[mcu]);
    const auto is_narrower = [](SampleBounds a, SampleBounds b) { return a.min >= b.min && a.max <= b.max; };
    if (!is_narrower(bounds[mcu].u, wide.u) || !is_narrower(bounds[mcu].v, wide.v)) return false;
  }
  const auto is_in = [](std::uint8_t value, SampleBounds bounds) { return value >= bounds.min && value <= bounds.max; };
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) {
      const auto mcu = static_cast<std::size_t>(v / index.mcu_height() * index.mcu_columns() + u / index.mcu_width());
      const Yuv p = yuv_at(image, u, v);
      if (!is_in(p.y, bounds[mcu].y) || !is_in(p.u, bounds[mcu].u) || !is_in(p.v, bounds[mcu].v)) return false;
    }
  return true;
}

enum class Indexed { refused_by_both, left_to_decoder, same, otherwise };

// "otherwise": the index accepts what the decoder refuses, or sees something else in it; `difference` says what.
inline Indexed compare_with_decoder(JpegDecoder& decoder, const std::vector<std::uint8_t>& jpeg, JpegIndexPool* pool,
                                    std::string& difference) {
  const auto index = JpegIndex::build(std::make_shared<const std::vector<std::uint8_t>>(jpeg), 0, 0, pool);
  const JpegResult whole = decoder.decode(jpeg);
  if (!index) return whole.image ? Indexed::left_to_decoder : Indexed::refused_by_both;
  if (!whole.image) {
    difference = "only the index takes it: " + whole.problem;
    return Indexed::otherwise;
  }
  const IndexedImage parts = decode_all(*index);
  const Image &a = *whole.image, &b = parts.image;
  if (a.format != b.format || a.range != b.range || a.width != b.width || a.height != b.height) {
    difference = "another format, range or size";
    return Indexed::otherwise;
  }
  for (int plane = 0; plane < 3; ++plane)
    for (int v = 0; v < plane_rows(a.format, plane, a.height); ++v) {
      const auto row = [&](const Image& image) {
        const Plane& p = image.planes[static_cast<std::size_t>(plane)];
        return p.data + v * p.stride;
      };
      if (std::memcmp(row(a), row(b), plane_row_bytes(a.format, plane, a.width)) == 0) continue;
      difference = "other pixels in plane " + std::to_string(plane) + ", row " + std::to_string(v);
      return Indexed::otherwise;
    }
  if (!is_within_bounds(*index, a)) {
    difference = "pixels outside of their bounds";
    return Indexed::otherwise;
  }
  return Indexed::same;
}

}  // namespace huetrack::capture
