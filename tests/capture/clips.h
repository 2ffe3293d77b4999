// Small videos and images of a known content, written with FFmpeg for the tests to read back.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
}

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/temporary_folder.h"

namespace huetrack::capture {

inline std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

struct Clip {
  std::string codec = "ffv1";
  AVPixelFormat format = AV_PIX_FMT_YUV422P;
  AVColorRange range = AVCOL_RANGE_UNSPECIFIED;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  int width = 64;
  int height = 48;
  int frames = 12;
  int fps = 10;
  int key_frame_every = 1;
  int b_frames = 0;
  // The second field of frame k shows level_of_frame(k) + second_field.
  enum class Fields { none, top_first, bottom_first };
  Fields fields = Fields::none;
  bool has_sound = false;  // AAC, whose first packet primes its decoder
  double turned_deg = 0;   // clockwise, as a tag of the container
  AVRational pixel_shape{1, 1};
  bool standard_huffman = false;                  // mjpeg: the tables that webcams use, and leave out
  std::function<void(AVFrame&, int)> paint = {};  // instead of the levels
  // Sees every coded packet before it goes into the file; false leaves it out.
  std::function<bool(int, AVPacket&)> tamper = {};
};

constexpr int second_field = 60;

// Frame k is flat but for noise in its outer part (so that damage shows): its middle says which frame it is.
constexpr int level_of_frame(int k) {
  return 40 + 8 * k;
}
inline int frame_of_level(int level) {
  return (level - 40 + 4) / 8;
}
inline int frame_shown_by(const Image& image) {
  const int u = image.width / 2;
  const int v = image.height / 2;
  return frame_of_level(image.format == PixelFormat::bgr ? bgr_at(image, u, v).g : yuv_at(image, u, v).y);
}

inline void check(int error, const char* what) {
  if (error < 0) throw std::runtime_error(std::string("clip: ") + what);
}

// For 8-bit planar formats and packed RGB; other formats get the level in every byte.
inline void paint(AVFrame& frame, int k) {
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  for (int plane = 0; plane < av_pix_fmt_count_planes(static_cast<AVPixelFormat>(frame.format)); ++plane) {
    const bool is_chroma = plane > 0 && (format->flags & AV_PIX_FMT_FLAG_RGB) == 0;
    const int rows = is_chroma ? -(-frame.height >> format->log2_chroma_h) : frame.height;
    const bool is_other = frame.interlaced_frame != 0 && !is_chroma;
    const int bytes = av_image_get_linesize(static_cast<AVPixelFormat>(frame.format), frame.width, plane);
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < bytes; ++x) {
        const bool is_outer = x < bytes / 4 || y < rows / 4;
        const unsigned noise = is_outer ? (static_cast<unsigned>((x * 7 + 3) * (y * 13 + 5) * (k + 11)) >> 4) % 16 : 0;
        const bool is_second = is_other && (y % 2 == 0) != (frame.top_field_first != 0);
        const int level = is_chroma ? 100 + 20 * plane : level_of_frame(k) + (is_second ? second_field : 0);
        frame.data[plane][y * frame.linesize[plane] + x] = static_cast<std::uint8_t>(level + static_cast<int>(noise));
      }
  }
}

inline void write_clip(const std::filesystem::path& file, const Clip& clip) {
  std::filesystem::create_directories(file.parent_path());
  AVFormatContext* opened = nullptr;
  check(avformat_alloc_output_context2(&opened, nullptr, nullptr, file.c_str()), "no such container");
  const std::unique_ptr<AVFormatContext, void (*)(AVFormatContext*)> output(opened, avformat_free_context);
  const AVCodec* encoder = avcodec_find_encoder_by_name(clip.codec.c_str());
  if (!encoder) throw std::runtime_error("clip: no encoder " + clip.codec);
  const std::unique_ptr<AVCodecContext, void (*)(AVCodecContext*)> codec(
      avcodec_alloc_context3(encoder), [](AVCodecContext* c) { avcodec_free_context(&c); });
  codec->width = clip.width;
  codec->height = clip.height;
  codec->pix_fmt = clip.format;
  codec->color_range = clip.range;
  codec->colorspace = clip.matrix;
  codec->time_base = {1, clip.fps};
  codec->framerate = {clip.fps, 1};
  codec->gop_size = clip.key_frame_every;
  codec->max_b_frames = clip.b_frames;
  codec->thread_count = 1;
  codec->flags |= AV_CODEC_FLAG_QSCALE | AV_CODEC_FLAG_BITEXACT;
  codec->global_quality = 2 * FF_QP2LAMBDA;
  if (clip.codec == "mpeg4")  // key frames only where asked for, not where the picture changes
    av_opt_set_int(codec.get(), "sc_threshold", 1'000'000'000, AV_OPT_SEARCH_CHILDREN);
  if (clip.codec == "ffv1") {
    codec->level = 3;  // with a checksum per slice
    codec->slices = 4;
    av_opt_set_int(codec->priv_data, "slicecrc", 1, 0);
  }
  codec->sample_aspect_ratio = clip.pixel_shape;
  if (clip.fields != Clip::Fields::none) codec->flags |= AV_CODEC_FLAG_INTERLACED_DCT | AV_CODEC_FLAG_INTERLACED_ME;
  if (clip.standard_huffman) av_opt_set(codec->priv_data, "huffman", "default", 0);
  codec->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;
  if ((output->oformat->flags & AVFMT_GLOBALHEADER) != 0) codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  check(avcodec_open2(codec.get(), encoder, nullptr), "the encoder does not open");
  AVStream* stream = avformat_new_stream(output.get(), nullptr);
  check(avcodec_parameters_from_context(stream->codecpar, codec.get()), "parameters");
  stream->time_base = codec->time_base;
  stream->avg_frame_rate = codec->framerate;
  stream->sample_aspect_ratio = clip.pixel_shape;
  if (clip.turned_deg != 0) {
    auto* matrix = reinterpret_cast<std::int32_t*>(
        av_stream_new_side_data(stream, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(std::int32_t)));
    av_display_rotation_set(matrix, clip.turned_deg);
  }
  AVStream* sound = clip.has_sound ? avformat_new_stream(output.get(), nullptr) : nullptr;
  if (sound != nullptr) {
    sound->codecpar->codec_type = AVMEDIA_TYPE_AUDIO, sound->codecpar->codec_id = AV_CODEC_ID_AAC;
    sound->codecpar->sample_rate = 44'100;
    sound->codecpar->ch_layout = AV_CHANNEL_LAYOUT_MONO;
    sound->codecpar->extradata = static_cast<std::uint8_t*>(av_mallocz(2 + AV_INPUT_BUFFER_PADDING_SIZE));
    sound->codecpar->extradata[0] = 0x12, sound->codecpar->extradata[1] = 0x08, sound->codecpar->extradata_size = 2;
    sound->time_base = {1, 44'100};
  }
  if ((output->oformat->flags & AVFMT_NOFILE) == 0)
    check(avio_open(&output->pb, file.c_str(), AVIO_FLAG_WRITE), "file");
  output->flags |= AVFMT_FLAG_BITEXACT;
  check(avformat_write_header(output.get(), nullptr), "header");

  const std::unique_ptr<AVPacket, void (*)(AVPacket*)> packet(av_packet_alloc(),
                                                              [](AVPacket* p) { av_packet_free(&p); });
  for (int k = 0; sound != nullptr && k < 2; ++k) {
    check(av_new_packet(packet.get(), 8), "packet");
    packet->pts = packet->dts = 1024 * (k - 1), packet->duration = 1024;
    packet->stream_index = sound->index, packet->flags = AV_PKT_FLAG_KEY;
    av_packet_rescale_ts(packet.get(), {1, 44'100}, sound->time_base);
    check(av_write_frame(output.get(), packet.get()), "packet");
    av_packet_unref(packet.get());
  }
  int packets = 0;
  const auto write_packets = [&] {
    while (avcodec_receive_packet(codec.get(), packet.get()) == 0) {
      packet->duration = 1;
      check(av_packet_make_writable(packet.get()), "packet");
      if (!clip.tamper || clip.tamper(packets, *packet)) {
        av_packet_rescale_ts(packet.get(), codec->time_base, stream->time_base);
        packet->stream_index = 0;
        check(av_write_frame(output.get(), packet.get()), "packet");
      }
      ++packets;
      av_packet_unref(packet.get());
    }
  };
  for (int k = 0; k < clip.frames; ++k) {
    const std::unique_ptr<AVFrame, void (*)(AVFrame*)> frame(av_frame_alloc(), [](AVFrame* f) { av_frame_free(&f); });
    frame->format = clip.format;
    frame->width = clip.width;
    frame->height = clip.height;
    frame->color_range = clip.range;
    frame->colorspace = clip.matrix;
    frame->quality = codec->global_quality;
    check(av_frame_get_buffer(frame.get(), 0), "frame");
    frame->interlaced_frame = clip.fields != Clip::Fields::none ? 1 : 0;
    frame->top_field_first = clip.fields == Clip::Fields::top_first ? 1 : 0;
    if (clip.paint)
      clip.paint(*frame, k);
    else
      paint(*frame, k);
    frame->pts = k;
    check(avcodec_send_frame(codec.get(), frame.get()), "encode");
    write_packets();
  }
  check(avcodec_send_frame(codec.get(), nullptr), "encode");
  write_packets();
  check(av_write_trailer(output.get()), "trailer");
  if ((output->oformat->flags & AVFMT_NOFILE) == 0) avio_closep(&output->pb);
}

// The bytes that one sees of an image: equal images, equal hash, however they lie in memory. FNV-1a.
inline std::uint64_t hash_of(const Image& image, std::uint64_t hash = 0xcbf29ce484222325) {
  const auto add = [&](std::uint8_t byte) { hash = (hash ^ byte) * 0x100000001b3; };
  require_all(image);
  add(static_cast<std::uint8_t>(image.format));
  for (int i = 0; i < 3; ++i)
    for (int y = 0; y < plane_rows(image.format, i, image.height); ++y)
      for (std::size_t x = 0; x < plane_row_bytes(image.format, i, image.width); ++x)
        add(image.planes[static_cast<std::size_t>(i)]
                .data[y * image.planes[static_cast<std::size_t>(i)].stride + static_cast<std::ptrdiff_t>(x)]);
  return hash;
}

}  // namespace huetrack::capture
