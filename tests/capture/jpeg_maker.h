// JPEGs of every kind that libjpeg writes, of random content.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <vector>

// clang-format off
#include <jpeglib.h>
// clang-format on

namespace huetrack::capture {

struct MadeJpeg {
  int width = 64, height = 48;
  int components = 3;
  int luma_h = 2, luma_v = 2, chroma_h = 1, chroma_v = 1;
  int quality = 90;
  int restart_interval = 0;       // MCUs
  bool optimised = false;         // Huffman codes of its own
  bool one_code_for_all = false;  // chroma by luma's Huffman codes
  bool progressive = false;
  bool rgb = false;         // not converted
  double noise = 10;        // sigma; smooth waves below it
  double chroma_noise = 1;  // times that of luma
  bool is_flat = false;     // half of the image
  unsigned seed = 1;
};

inline std::vector<std::uint8_t> make_jpeg(const MadeJpeg& made) {
  std::mt19937 random(made.seed);
  std::normal_distribution<double> noise(0, 1);
  const double wave_u = 0.02 + 0.05 * static_cast<double>(made.seed % 7),
               wave_v = 0.03 * static_cast<double>(made.seed % 5);
  std::vector<std::uint8_t> pixels;
  for (int v = 0; v < made.height; ++v)
    for (int u = 0; u < made.width; ++u)
      for (int c = 0; c < made.components; ++c) {
        const double wave = made.is_flat && 2 * v < made.height ? 0 : 90 * std::sin(wave_u * u + wave_v * v + c);
        const double of_component = c == 0 ? made.noise : made.chroma_noise * made.noise;
        const double sigma = made.is_flat && 2 * v < made.height ? 0 : of_component;
        pixels.push_back(static_cast<std::uint8_t>(std::clamp(128 + wave + sigma * noise(random), 0.0, 255.0)));
      }
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &bytes, &size);
  info.image_width = static_cast<JDIMENSION>(made.width);
  info.image_height = static_cast<JDIMENSION>(made.height);
  info.input_components = made.components;
  info.in_color_space = made.components == 1 ? JCS_GRAYSCALE : made.rgb ? JCS_RGB : JCS_YCbCr;
  jpeg_set_defaults(&info);
  if (made.rgb) jpeg_set_colorspace(&info, JCS_RGB);
  jpeg_set_quality(&info, made.quality, TRUE);
  info.optimize_coding = made.optimised ? TRUE : FALSE;
  info.restart_interval = static_cast<unsigned>(made.restart_interval);
  for (int c = 0; c < made.components; ++c) {
    info.comp_info[c].h_samp_factor = c == 0 ? made.luma_h : made.chroma_h;
    info.comp_info[c].v_samp_factor = c == 0 ? made.luma_v : made.chroma_v;
    if (made.one_code_for_all) info.comp_info[c].dc_tbl_no = info.comp_info[c].ac_tbl_no = 0;
  }
  if (made.progressive) jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  const auto stride = static_cast<std::size_t>(made.width * made.components);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = pixels.data() + info.next_scanline * stride;
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  std::vector<std::uint8_t> jpeg(bytes, bytes + size);
  jpeg_destroy_compress(&info);
  std::free(bytes);
  return jpeg;
}

// Luma (or grey) at 1/8 size, as libjpeg decodes it.
struct Eighth {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
};
inline Eighth eighth_of(std::span<const std::uint8_t> jpeg) {
  jpeg_decompress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, jpeg.data(), static_cast<unsigned long>(jpeg.size()));
  jpeg_read_header(&info, TRUE);
  info.out_color_space = JCS_GRAYSCALE;
  info.scale_num = 1;
  info.scale_denom = 8;
  jpeg_start_decompress(&info);
  Eighth eighth{
      .width = static_cast<int>(info.output_width), .height = static_cast<int>(info.output_height), .pixels = {}};
  eighth.pixels.resize(std::size_t{info.output_width} * info.output_height);
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = eighth.pixels.data() + std::size_t{info.output_scanline} * info.output_width;
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
  return eighth;
}

}  // namespace huetrack::capture
