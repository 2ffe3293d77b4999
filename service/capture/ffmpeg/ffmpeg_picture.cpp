#include "capture/ffmpeg/ffmpeg_picture.h"

extern "C" {
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

#include "capture/ffmpeg/color_matrix.h"

namespace huetrack::capture {

void FreeScaler::operator()(SwsContext* p) const {
  sws_freeContext(p);
}

namespace {

// Ours, FFmpeg's, and its older name for a picture of full range.
struct KnownFormat {
  PixelFormat ours;
  AVPixelFormat theirs, full_range = theirs;
};
constexpr std::array<KnownFormat, 7> known_formats{{{PixelFormat::i420, AV_PIX_FMT_YUV420P, AV_PIX_FMT_YUVJ420P},
                                                    {PixelFormat::i422, AV_PIX_FMT_YUV422P, AV_PIX_FMT_YUVJ422P},
                                                    {PixelFormat::i444, AV_PIX_FMT_YUV444P, AV_PIX_FMT_YUVJ444P},
                                                    {PixelFormat::yuyv, AV_PIX_FMT_YUYV422},
                                                    {PixelFormat::nv12, AV_PIX_FMT_NV12},
                                                    {PixelFormat::grey, AV_PIX_FMT_GRAY8},
                                                    {PixelFormat::bgr, AV_PIX_FMT_BGR24}}};

std::optional<PixelFormat> pixel_format_of(AVPixelFormat format, int width, int height) {
  for (const auto& [ours, theirs, full_range] : known_formats) {
    if (format != theirs && format != full_range) continue;
    const bool is_odd = (needs_even_width(ours) && width % 2 != 0) || (needs_even_height(ours) && height % 2 != 0);
    return is_odd ? std::nullopt : std::optional(ours);
  }
  return std::nullopt;
}

// The nearest of our formats, for a format or an odd size that ours cannot hold.
AVPixelFormat nearest_format(const AVPixFmtDescriptor& source, int width, int height) {
  if ((source.flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BAYER)) != 0)
    return AV_PIX_FMT_BGR24;
  if (source.nb_components <= 2) return AV_PIX_FMT_GRAY8;
  if (width % 2 != 0 || source.log2_chroma_w == 0) return AV_PIX_FMT_YUV444P;
  if (height % 2 != 0 || source.log2_chroma_h == 0) return AV_PIX_FMT_YUV422P;
  return AV_PIX_FMT_YUV420P;
}

bool is_grey(const AVFrame& frame) {
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  return format && format->nb_components <= 2;
}

ColorRange range_of(const AVFrame& frame, AVCodecID codec) {
  if (frame.color_range == AVCOL_RANGE_JPEG) return ColorRange::full;
  if (frame.color_range == AVCOL_RANGE_MPEG) return ColorRange::limited;
  switch (frame.format) {
    case AV_PIX_FMT_YUVJ420P:
    case AV_PIX_FMT_YUVJ422P:
    case AV_PIX_FMT_YUVJ444P:
    case AV_PIX_FMT_YUVJ440P:
    case AV_PIX_FMT_YUVJ411P:
      return ColorRange::full;
    default:
      break;
  }
  // Grey images without a stated range are full range, as in FFmpeg.
  return is_grey(frame) || codec == AV_CODEC_ID_MJPEG || codec == AV_CODEC_ID_JPEGLS ? ColorRange::full
                                                                                     : ColorRange::limited;
}

// to_bgr: by the frame's own matrix. nullptr when FFmpeg cannot convert it.
FramePtr converted(const AVFrame& source, ColorRange range, ScalerPtr& scaler, bool to_bgr = false) {
  const auto format = static_cast<AVPixelFormat>(source.format);
  const AVPixFmtDescriptor* described = av_pix_fmt_desc_get(format);
  if (!described || sws_isSupportedInput(format) == 0) return nullptr;
  FramePtr target(not_null(av_frame_alloc()));
  target->format = to_bgr ? AV_PIX_FMT_BGR24 : nearest_format(*described, source.width, source.height);
  target->width = source.width;
  target->height = source.height;
  if (av_frame_get_buffer(target.get(), 0) < 0) return nullptr;

  // SWS_POINT: pixels share their colour as in our YUV formats; SWS_BILINEAR shifts the colour by half a row.
  scaler.reset(
      sws_getCachedContext(scaler.release(), source.width, source.height, format, source.width, source.height,
                           static_cast<AVPixelFormat>(target->format),
                           SWS_POINT | SWS_ACCURATE_RND | SWS_BITEXACT | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP,
                           nullptr, nullptr, nullptr));
  if (!scaler) return nullptr;
  // The matrix matters only from YUV to BGR; the range is kept.
  const int is_full = range == ColorRange::full ? 1 : 0;
  const int matrix = to_bgr ? static_cast<int>(source.colorspace) : SWS_CS_ITU601;
  sws_setColorspaceDetails(scaler.get(), sws_getCoefficients(matrix), is_full, sws_getCoefficients(SWS_CS_ITU601),
                           is_full, 0, 1 << 16, 1 << 16);
  if (sws_scale(scaler.get(), source.data, source.linesize, 0, source.height, target->data, target->linesize) !=
      source.height)
    return nullptr;
  return target;
}

// False: there is no memory to change the samples in.
bool fit_samples(AVFrame& frame, SampleDepth& depth) {
  const auto format = static_cast<AVPixelFormat>(frame.format);
  const AVPixFmtDescriptor* described = av_pix_fmt_desc_get(format);
  const std::uint64_t others = AV_PIX_FMT_FLAG_FLOAT | AV_PIX_FMT_FLAG_BITSTREAM | AV_PIX_FMT_FLAG_HWACCEL;
  if (!described || described->comp[0].depth != 16 || (described->flags & others) != 0) return true;
  if (av_frame_make_writable(&frame) < 0) return false;
  std::vector<SampleRows> planes;
  const bool has_alpha = (described->flags & AV_PIX_FMT_FLAG_ALPHA) != 0;
  const int count = av_pix_fmt_count_planes(format), components = described->nb_components;
  for (int i = 0; i < (has_alpha && count == components ? count - 1 : count); ++i)
    planes.push_back(
        {.data = frame.data[i],
         .stride = frame.linesize[i],
         .samples = static_cast<std::size_t>(std::max(0, av_image_get_linesize(format, frame.width, i))) / 2,
         .rows = i == 0 ? frame.height : AV_CEIL_RSHIFT(frame.height, described->log2_chroma_h),
         .order = (described->flags & AV_PIX_FMT_FLAG_BE) != 0 ? std::endian::big : std::endian::little,
         .alpha_every = has_alpha && count == 1 ? static_cast<std::size_t>(components) : 0});
  depth.fit(planes);
  return true;
}

Image wrapped(FramePtr frame, PixelFormat format, ColorRange range) {
  Image image{.format = format,
              .range = format == PixelFormat::bgr ? ColorRange::full : range,
              .width = frame->width,
              .height = frame->height,
              .planes = {},
              .owner = {}};
  for (std::size_t i = 0; i < image.planes.size(); ++i)
    if (plane_rows(format, static_cast<int>(i), frame->height) > 0)
      image.planes[i] = {frame->data[i], frame->linesize[i]};  // a negative stride: bottom-up rows
  image.owner = std::shared_ptr<const AVFrame>(std::move(frame));
  return image;
}

// A display matrix: how players show the picture (libavutil/display.h).
void read_orientation(const std::uint8_t* side_data, PictureLayout& layout) {
  std::array<std::int32_t, 9> matrix{};
  std::memcpy(matrix.data(), side_data, sizeof(matrix));
  const double along_row = matrix[0], down_row = matrix[1], along_column = matrix[3], down_column = matrix[4];
  layout.turned_deg = std::atan2(down_row, along_row) * 180 / std::numbers::pi;
  layout.is_mirrored = along_row * down_column - down_row * along_column < 0;
  const auto sign = [](double of, double beside) { return std::abs(of) < std::abs(beside) ? 0 : of < 0 ? -1 : 1; };
  const double quarter_turns = layout.turned_deg / 90;
  if (std::abs(quarter_turns - std::round(quarter_turns)) < 0.01 && (along_row != 0 || down_row != 0))
    layout.orientation = {sign(along_row, down_row), sign(down_row, along_row), sign(along_column, down_column),
                          sign(down_column, along_column)};
}

}  // namespace

AVPixelFormat av_format_of(PixelFormat format) {
  return std::ranges::find(known_formats, format, &KnownFormat::ours)->theirs;
}

void PictureMaker::set_stream(const AVStream& stream) {
  layout_ = {};
  taken_notes_.clear();
  if (const std::uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr))
    read_orientation(matrix, layout_);
  const AVRational shape =
      stream.sample_aspect_ratio.num > 0 ? stream.sample_aspect_ratio : stream.codecpar->sample_aspect_ratio;
  if (shape.num > 0 && shape.den > 0) layout_.pixel_aspect = av_q2d(shape);
  stream_layout_ = layout_;
}

void PictureMaker::tag(const PictureTags& tags) {
  depth_.tag(tags.significant_bits);
  const bool is_interlaced = layout_.is_interlaced;
  layout_ = stream_layout_;
  layout_.is_interlaced = is_interlaced;
  if (!tags.orientation) return;
  const Orientation& own = layout_.orientation = *tags.orientation;
  layout_.turned_deg = std::atan2(own.row_by_column, own.column_by_column) * 180 / std::numbers::pi;
  layout_.is_mirrored = own.column_by_column * own.row_by_row - own.row_by_column * own.column_by_row < 0;
}

std::vector<std::string> PictureMaker::take_notes() {
  std::vector<std::string> notes = notes_on(layout_);
  std::erase_if(notes, [&](const std::string& note) { return std::ranges::count(taken_notes_, note) > 0; });
  taken_notes_.insert(taken_notes_.end(), notes.begin(), notes.end());
  return notes;
}

std::optional<Image> PictureMaker::image_of(FramePtr frame, AVCodecID codec) {
  if ((frame->flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame->decode_error_flags != 0) return std::nullopt;
  if (frame->width < 1 || frame->height < 1) return std::nullopt;
  if (const AVFrameSideData* tag = av_frame_get_side_data(frame.get(), AV_FRAME_DATA_DISPLAYMATRIX))
    read_orientation(tag->data, layout_);
  // A PNG's interlacing is the order of its bytes, not of the exposure.
  const bool is_interlaced = frame->interlaced_frame != 0 && codec != AV_CODEC_ID_PNG && codec != AV_CODEC_ID_APNG;
  const bool stays_whole = keeps_fields_ && layout_.orientation.is_upright();
  const FirstField first = frame->top_field_first != 0 ? FirstField::top : FirstField::bottom;
  layout_.is_interlaced = layout_.is_interlaced || (is_interlaced && !fields_are_stated_);
  tagged_field_ = is_interlaced && stays_whole ? std::optional(first) : std::nullopt;
  const ColorRange range = range_of(*frame, codec);
  auto ours = pixel_format_of(static_cast<AVPixelFormat>(frame->format), frame->width, frame->height);
  const AVColorSpace matrix = frame->colorspace;
  const bool has_other = has_other_matrix(*frame), has_fields = is_interlaced || fields_are_stated_;
  const bool is_shuffled = ours == PixelFormat::yuyv || ours == PixelFormat::nv12;
  // Measured: small balls in real films are tracked by BGR (recordings/EXPERIMENTS.md). In it, rows of two fields would
  // share colours.
  const bool to_bgr = has_other && !has_fields && !is_grey(*frame);
  if (!ours || to_bgr || (is_shuffled && has_other)) {
    if (!fit_samples(*frame, depth_)) return std::nullopt;
    frame = converted(*frame, range, scaler_, to_bgr);
    if (!frame) return std::nullopt;
    ours = pixel_format_of(static_cast<AVPixelFormat>(frame->format), frame->width, frame->height);
  }
  const bool is_planar = ours == PixelFormat::i420 || ours == PixelFormat::i422 || ours == PixelFormat::i444;
  if (is_planar && !to_bt601(*frame, matrix, *ours, range, has_fields)) return std::nullopt;
  const Image image = wrapped(std::move(frame), *ours, range);
  return turned(is_interlaced && !stays_whole ? first_field(image, first) : image, layout_.orientation);
}

}  // namespace huetrack::capture
