// Owning pointers for FFmpeg's objects. FFmpeg is used only here, in network_source and in recordings.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavcodec/bsf.h>
#include <libavformat/avformat.h>
}

#include <array>
#include <memory>
#include <new>
#include <string>

namespace huetrack::capture {

struct CloseInput {
  void operator()(AVFormatContext* p) const { avformat_close_input(&p); }
};
struct CloseOutput {
  void operator()(AVFormatContext* p) const {
    avio_closep(&p->pb);
    avformat_free_context(p);
  }
};
struct FreeCodec {
  void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
};
struct FreeFilter {
  void operator()(AVBSFContext* p) const { av_bsf_free(&p); }
};
struct FreePacket {
  void operator()(AVPacket* p) const { av_packet_free(&p); }
};
struct FreeFrame {
  void operator()(AVFrame* p) const { av_frame_free(&p); }
};
struct CloseIo {
  void operator()(AVIOContext* p) const { avio_closep(&p); }
};
using IoPtr = std::unique_ptr<AVIOContext, CloseIo>;
using InputPtr = std::unique_ptr<AVFormatContext, CloseInput>;
using OutputPtr = std::unique_ptr<AVFormatContext, CloseOutput>;
using CodecPtr = std::unique_ptr<AVCodecContext, FreeCodec>;
using FilterPtr = std::unique_ptr<AVBSFContext, FreeFilter>;
using PacketPtr = std::unique_ptr<AVPacket, FreePacket>;
using FramePtr = std::unique_ptr<AVFrame, FreeFrame>;

template <typename Pointer>
Pointer not_null(Pointer pointer) {
  if (!pointer) throw std::bad_alloc();
  return pointer;
}

inline std::string error_text(int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(error, text.data(), text.size());
  return text.data();
}

}  // namespace huetrack::capture
