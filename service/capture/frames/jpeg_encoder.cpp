// libjpeg-turbo through libjpeg's interface, which takes a picture in strips of 16 rows. Why not TurboJPEG:
// EXPERIMENTS.md.
#include "capture/frames/jpeg_encoder.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdlib>

// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

namespace huetrack::capture {
namespace {

struct Errors {
  jpeg_error_mgr manager{};  // first: libjpeg hands us a pointer to it
  std::jmp_buf on_error{};
};

[[noreturn]] void on_error(j_common_ptr info) {
  std::longjmp(reinterpret_cast<Errors*>(info->err)->on_error, 1);
}

// Memory layout of one component: column u, row v at data[(u >> u_shift) * step + (v >> v_shift) * stride].
struct Component {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;
  int step = 1, u_shift = 0, v_shift = 0;
  int offset(int u) const { return (u >> u_shift) * step; }
  const std::uint8_t* row(int v) const { return data + (v >> v_shift) * stride; }
};

std::array<Component, 3> components_of(const Image& image) {
  require_all(image);
  const auto at = [&](std::size_t plane, int offset, int step, int u_shift, int v_shift) {
    return Component{image.planes[plane].data + offset, image.planes[plane].stride, step, u_shift, v_shift};
  };
  switch (image.format) {
    case PixelFormat::yuyv:
      return {at(0, 0, 2, 0, 0), at(0, 1, 4, 1, 0), at(0, 3, 4, 1, 0)};
    case PixelFormat::nv12:
      return {at(0, 0, 1, 0, 0), at(1, 0, 2, 1, 1), at(1, 1, 2, 1, 1)};
    case PixelFormat::i420:
      return {at(0, 0, 1, 0, 0), at(1, 0, 1, 1, 1), at(2, 0, 1, 1, 1)};
    case PixelFormat::i422:
      return {at(0, 0, 1, 0, 0), at(1, 0, 1, 1, 0), at(2, 0, 1, 1, 0)};
    case PixelFormat::i444:
      return {at(0, 0, 1, 0, 0), at(1, 0, 1, 0, 0), at(2, 0, 1, 0, 0)};
    case PixelFormat::bgr:  // as they are: B, G, R
      return {at(0, 0, 3, 0, 0), at(0, 1, 3, 0, 0), at(0, 2, 3, 0, 0)};
    case PixelFormat::grey:
      break;
  }
  return {at(0, 0, 1, 0, 0)};
}

using Levels = std::array<std::uint8_t, 256>;

Levels levels(double black, double scale, double to) {
  Levels table{};
  for (int i = 0; i < 256; ++i)
    table[std::size_t(i)] = static_cast<std::uint8_t>(std::clamp((i - black) * scale + to + 0.5, 0.0, 255.0));
  return table;
}

// The two source columns (or rows) that a picture's column averages; the same one twice where it covers only one.
std::vector<std::array<int, 2>> samples(int from, int to) {
  std::vector<std::array<int, 2>> out(static_cast<std::size_t>(to));
  for (int i = 0; i < to; ++i) {
    const int first = static_cast<int>(std::int64_t(i) * from / to);
    const int end = std::max(first + 1, static_cast<int>(std::int64_t(i + 1) * from / to));
    const int quarter = (end - first) / 4;
    out[std::size_t(i)] = {first + quarter, end - 1 - quarter};
  }
  return out;
}

// One component at a picture's size, row by row: each value is the mean of four samples. Offsets are computed once per
// picture, because this loop is most of a preview's cost.
class ScaledComponent {
 public:
  // columns, rows: as of samples().
  ScaledComponent(const Component& component, const std::vector<std::array<int, 2>>& columns,
                  const std::vector<std::array<int, 2>>& rows, const Levels& levels)
      : component_(component), rows_(rows), levels_(levels) {
    for (const auto [a, b] : columns) offsets_.push_back({component.offset(a), component.offset(b)});
  }
  void read(int row, std::uint8_t* to, int step = 1) const {
    const auto [c, d] = rows_[std::size_t(row)];
    const std::uint8_t* const upper = component_.row(c);
    const std::uint8_t* const lower = component_.row(d);
    for (const auto [a, b] : offsets_) {
      *to = levels_[std::size_t(upper[a] + upper[b] + lower[a] + lower[b] + 2) / 4];
      to += step;
    }
  }
  int rows() const { return int(rows_.size()); }
  int columns() const { return int(offsets_.size()); }

 private:
  const Component component_;
  std::vector<std::array<int, 2>> offsets_, rows_;
  const Levels& levels_;
};

// For a component at half the picture's width and height: one sample from each pair of columns (or rows).
std::vector<std::array<int, 2>> halved(const std::vector<std::array<int, 2>>& full) {
  std::vector<std::array<int, 2>> half;
  for (std::size_t i = 0; i + 1 < full.size(); i += 2)
    half.push_back({(full[i][0] + full[i][1]) / 2, (full[i + 1][0] + full[i + 1][1]) / 2});
  return half;
}

// Rows of one component for libjpeg: whole blocks, with the border repeated.
struct Block {
  Block(const ScaledComponent& from, int rows) : stride((std::size_t(from.columns()) + 15) / 16 * 16) {
    bytes.resize(stride * std::size_t(rows));
    for (int i = 0; i < rows; ++i) pointers.push_back(bytes.data() + stride * std::size_t(i));
  }
  void read(const ScaledComponent& from, int first) {
    for (std::size_t i = 0; i < pointers.size(); ++i) {
      from.read(std::min(first + int(i), from.rows() - 1), pointers[i]);
      std::fill(pointers[i] + from.columns(), pointers[i] + stride, pointers[i][from.columns() - 1]);
    }
  }
  std::size_t stride;
  std::vector<std::uint8_t> bytes;
  std::vector<JSAMPROW> pointers;
};

}  // namespace

PictureSize picture_size(const Image& image, int width) {
  const int w = std::max(2, std::min(image.width, width) & ~1);
  const int h = static_cast<int>(std::int64_t(image.height) * w / std::max(1, image.width)) & ~1;
  return {w, std::max(2, h)};
}

std::vector<std::uint8_t> encode_picture(const Image& image, PictureSize size, int quality) {
  static const Levels full_luma = levels(0, 1, 0), limited_luma = levels(16, 255.0 / 219, 0);
  static const Levels full_chroma = full_luma, limited_chroma = levels(128, 255.0 / 224, 128);
  const bool is_limited = image.range == ColorRange::limited && image.format != PixelFormat::bgr;
  const Levels& luma = is_limited ? limited_luma : full_luma;
  const Levels& chroma = is_limited ? limited_chroma : full_chroma;
  const bool is_bgr = image.format == PixelFormat::bgr, is_grey = image.format == PixelFormat::grey;
  const auto parts = components_of(image);
  const auto columns = samples(image.width, size.width), rows = samples(image.height, size.height);
  const auto half_columns = halved(columns), half_rows = halved(rows);
  std::vector<ScaledComponent> components;
  std::vector<Block> blocks;  // of 16 rows of the picture; not for BGR
  for (std::size_t c = 0; c < (is_grey ? 1 : 3); ++c) {
    const bool is_half = c > 0 && !is_bgr;
    components.emplace_back(parts[c], is_half ? half_columns : columns, is_half ? half_rows : rows,
                            is_half ? chroma : luma);
    blocks.emplace_back(components.back(), is_half ? 8 : 16);
  }
  std::vector<std::uint8_t> line(is_bgr ? std::size_t(size.width) * 3 : 0);
  std::vector<std::uint8_t> jpeg;

  jpeg_compress_struct info{};
  Errors errors;
  unsigned char* bytes = nullptr;
  unsigned long byte_count = 0;  // NOLINT(google-runtime-int): libjpeg's type
  info.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = on_error;
  if (setjmp(errors.on_error) != 0) {
    jpeg_destroy_compress(&info);
    std::free(bytes);
    return {};
  }
  jpeg_create_compress(&info);
  jpeg_mem_dest(&info, &bytes, &byte_count);
  info.image_width = static_cast<JDIMENSION>(size.width);
  info.image_height = static_cast<JDIMENSION>(size.height);
  info.input_components = is_grey ? 1 : 3;
  info.in_color_space = is_grey ? JCS_GRAYSCALE : is_bgr ? JCS_EXT_BGR : JCS_YCbCr;
  jpeg_set_defaults(&info);  // chroma at half width and height
  jpeg_set_quality(&info, quality, TRUE);
  info.dct_method = JDCT_IFAST;
  info.raw_data_in = is_bgr ? FALSE : TRUE;
  jpeg_start_compress(&info, TRUE);
  if (is_bgr) {
    for (int row = 0; row < size.height; ++row) {
      for (std::size_t c = 0; c < 3; ++c) components[c].read(row, line.data() + c, 3);
      JSAMPROW pointer = line.data();
      jpeg_write_scanlines(&info, &pointer, 1);
    }
  } else {
    std::array<JSAMPARRAY, 3> planes{};
    for (std::size_t c = 0; c < blocks.size(); ++c) planes[c] = blocks[c].pointers.data();
    for (int row = 0; row < size.height; row += info.max_v_samp_factor * DCTSIZE) {
      for (std::size_t c = 0; c < blocks.size(); ++c) blocks[c].read(components[c], c == 0 ? row : row / 2);
      jpeg_write_raw_data(&info, planes.data(), JDIMENSION(info.max_v_samp_factor) * DCTSIZE);
    }
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  jpeg.assign(bytes, bytes + byte_count);
  std::free(bytes);
  return jpeg;
}

}  // namespace huetrack::capture
