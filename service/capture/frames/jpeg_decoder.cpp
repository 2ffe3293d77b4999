// libjpeg-turbo through libjpeg's interface with longjmp(). Why not TurboJPEG: EXPERIMENTS.md.
#include "capture/frames/jpeg_decoder.h"

#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include "capture/frames/recycler.h"

namespace huetrack::capture {
namespace {

// Logitech's and other webcams pad by a byte or two; lost data shows as more, or as an early end.
constexpr int most_padding_bytes = 16;
constexpr std::size_t most_pixels = std::size_t{1} << 26;  // a damaged header must not make us allocate gigabytes

struct Errors {
  jpeg_error_mgr manager{};  // first: libjpeg hands us a pointer to it
  std::jmp_buf on_error{};
  std::array<char, JMSG_LENGTH_MAX> text{};
  bool is_damaged = false;
};

Errors& errors_of(j_common_ptr info) {
  return *reinterpret_cast<Errors*>(info->err);
}

void note(j_common_ptr info) {
  Errors& errors = errors_of(info);
  if (!errors.is_damaged) (*info->err->format_message)(info, errors.text.data());
  errors.is_damaged = true;
}

[[noreturn]] void on_error(j_common_ptr info) {
  note(info);
  std::longjmp(errors_of(info).on_error, 1);
}

void on_message(j_common_ptr info, int level) {
  if (level >= 0) return;  // a trace
  const int code = info->err->msg_code;
  const bool is_padding = code == JWRN_EXTRANEOUS_DATA && info->err->msg_parm.i[0] <= most_padding_bytes;
  if (!is_padding && code != JWRN_JFIF_MAJOR) note(info);
}

void print_nothing(j_common_ptr) {}

std::optional<PixelFormat> format_of(const jpeg_decompress_struct& info) {
  if (info.jpeg_color_space == JCS_GRAYSCALE && info.num_components == 1) return PixelFormat::grey;
  if (info.jpeg_color_space != JCS_YCbCr || info.num_components != 3) return std::nullopt;
  const auto* c = info.comp_info;
  if (c[1].h_samp_factor != c[2].h_samp_factor || c[1].v_samp_factor != c[2].v_samp_factor ||
      c[0].h_samp_factor != info.max_h_samp_factor || c[0].v_samp_factor != info.max_v_samp_factor ||
      c[0].h_samp_factor % c[1].h_samp_factor != 0 || c[0].v_samp_factor % c[1].v_samp_factor != 0)
    return std::nullopt;
  const std::pair shared{c[0].h_samp_factor / c[1].h_samp_factor, c[0].v_samp_factor / c[1].v_samp_factor};
  if (shared == std::pair{1, 1}) return PixelFormat::i444;
  if (shared == std::pair{2, 1}) return PixelFormat::i422;
  if (shared == std::pair{2, 2}) return PixelFormat::i420;
  return std::nullopt;
}

// FFmpeg's marker for limited-range video in a JPEG.
bool says_limited_range(const jpeg_decompress_struct& info) {
  constexpr std::string_view text = "CS=ITU601";
  for (const auto* marker = info.marker_list; marker; marker = marker->next)
    if (marker->marker == JPEG_COM && marker->data_length >= text.size() &&
        std::memcmp(marker->data, text.data(), text.size()) == 0)
      return true;
  return false;
}

}  // namespace

struct JpegDecoder::Impl {
  Impl() {
    info.err = jpeg_std_error(&errors.manager);
    errors.manager.error_exit = on_error;
    errors.manager.emit_message = on_message;
    errors.manager.output_message = print_nothing;
    create();
  }
  ~Impl() { jpeg_destroy_decompress(&info); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void create() {
    jpeg_create_decompress(&info);
    jpeg_save_markers(&info, JPEG_COM, 32);
  }

  // Separate functions, because no object with a destructor may be alive where libjpeg jumps out.
  bool read_header(std::span<const std::uint8_t> jpeg) {
    if (setjmp(errors.on_error) != 0) return false;
    // libjpeg reuses tables for a later picture without any: those of a damaged picture would spoil all that follow.
    jpeg_destroy_decompress(&info);
    create();
    jpeg_mem_src(&info, jpeg.data(), static_cast<unsigned long>(jpeg.size()));
    jpeg_read_header(&info, TRUE);
    info.raw_data_out = TRUE;
    info.do_fancy_upsampling = FALSE;
    info.dct_method = JDCT_ISLOW;  // exact to the bit, with SIMD or without
    return true;
  }

  bool read_planes() {
    if (setjmp(errors.on_error) != 0) return false;
    jpeg_start_decompress(&info);
    std::array<JSAMPARRAY, 3> planes{};
    while (info.output_scanline < info.output_height) {
      for (int i = 0; i < info.num_components; ++i) {
        const int row =
            static_cast<int>(info.output_scanline) / info.max_v_samp_factor * info.comp_info[i].v_samp_factor;
        planes[static_cast<std::size_t>(i)] = rows[static_cast<std::size_t>(i)].data() + row;
      }
      jpeg_read_raw_data(&info, planes.data(), static_cast<JDIMENSION>(info.max_v_samp_factor * DCTSIZE));
    }
    jpeg_finish_decompress(&info);
    return true;
  }

  Errors errors;
  jpeg_decompress_struct info{};
  Recycler<FrameMemory> memory;               // of images
  std::array<std::vector<JSAMPROW>, 3> rows;  // of each plane, into the image being decoded
};

JpegDecoder::JpegDecoder() : impl_(std::make_unique<Impl>()) {}
JpegDecoder::~JpegDecoder() = default;

JpegResult JpegDecoder::decode(std::span<const std::uint8_t> jpeg, int width, int height) {
  auto& info = impl_->info;
  auto& errors = impl_->errors;
  errors.is_damaged = false;
  const auto end_with = [&](std::string problem, bool is_unsupported) {
    jpeg_abort_decompress(&info);
    return JpegResult{.image = {}, .is_unsupported = is_unsupported, .problem = std::move(problem)};
  };
  if (jpeg.empty()) return end_with("it is empty", false);
  if (!impl_->read_header(jpeg)) return end_with(errors.text.data(), false);

  const auto format = format_of(info);
  const std::string size = std::to_string(info.image_width) + "x" + std::to_string(info.image_height);
  if (!format) return end_with("its colour space or chroma subsampling is not supported", true);
  if ((needs_even_width(*format) && info.image_width % 2 != 0) ||
      (needs_even_height(*format) && info.image_height % 2 != 0))
    return end_with("its size " + size + " is odd", true);
  if (width > 0 &&
      (info.image_width != static_cast<JDIMENSION>(width) || info.image_height != static_cast<JDIMENSION>(height)))
    return end_with("its size is " + size, false);
  if (std::size_t{info.image_width} * info.image_height > most_pixels) return end_with("its size is " + size, true);

  // libjpeg writes whole blocks: the planes are padded to them.
  Image image{.format = *format,
              .range = says_limited_range(info) ? ColorRange::limited : ColorRange::full,
              .width = static_cast<int>(info.image_width),
              .height = static_cast<int>(info.image_height),
              .planes = {},
              .owner = {}};
  const auto planes = static_cast<std::size_t>(info.num_components);
  const auto whole = [](std::size_t n, std::size_t unit) { return (n + unit - 1) / unit; };
  const std::size_t row_groups = whole(info.image_height, static_cast<std::size_t>(info.max_v_samp_factor * DCTSIZE));
  const std::size_t column_groups = whole(info.image_width, static_cast<std::size_t>(info.max_h_samp_factor * DCTSIZE));
  std::array<std::size_t, 3> strides{};
  std::array<std::size_t, 3> heights{};
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < planes; ++i) {
    strides[i] = column_groups * static_cast<std::size_t>(info.comp_info[i].h_samp_factor * DCTSIZE);
    heights[i] = row_groups * static_cast<std::size_t>(info.comp_info[i].v_samp_factor * DCTSIZE);
    bytes += strides[i] * heights[i];
  }
  auto memory = impl_->memory.take();
  std::uint8_t* next = memory->bytes(bytes);
  for (std::size_t i = 0; i < planes; ++i) {
    image.planes[i] = {next, static_cast<std::ptrdiff_t>(strides[i])};
    impl_->rows[i].resize(heights[i]);
    for (auto& row : impl_->rows[i]) {
      row = next;
      next += strides[i];
    }
  }
  image.owner = std::move(memory);

  if (!impl_->read_planes() || errors.is_damaged) return end_with(errors.text.data(), false);
  return {.image = std::move(image), .is_unsupported = false, .problem = {}};
}

}  // namespace huetrack::capture
