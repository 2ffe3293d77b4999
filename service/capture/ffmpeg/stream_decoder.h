// Decodes the packets of one stream, and tells errors of a picture from remarks on what is beside it.
#pragma once

#include "capture/ffmpeg/ffmpeg_log.h"
#include "capture/ffmpeg/ffmpeg_objects.h"

namespace huetrack::capture {

struct FreeParser {
  void operator()(AVCodecParserContext* p) const { av_parser_close(p); }
};

struct DecoderOptions {
  int threads = 1;  // slices of one picture; frame threads would hide which picture an error belongs to
  bool is_live = false;
  std::int64_t most_pixels = 1 << 26;  // of one picture: a damaged header must not cost gigabytes
  FfmpegLog* log = nullptr;            // receives messages of slice threads; must outlive the decoder
};

// thread-compatible. No error concealment: invented pixels would be measured.
class StreamDecoder {
 public:
  // 0, or an AVERROR. stream: nullptr where packets say all that the decoder must know, as JPEGs do.
  int open(const AVStream* stream, const AVCodec& decoder, const DecoderOptions& options);
  void close() { codec_.reset(); }
  bool is_open() const { return codec_ != nullptr; }
  const AVCodecContext& codec() const { return *codec_; }

  // Before send(). Removes supplemental messages that are damaged, which some cameras write into every picture, or that
  // nothing needs: the decoder's errors are then those of the picture. Of MPEG-4, pictures that older encoders packed
  // together get packets of their own; of a PNG, texts and other chunks beside its pixels are removed. False: the
  // packet only adds the second field to the picture that the packet before began.
  bool examine(AVPacket& packet);
  // At the end: the picture that was packed into the last packet, if none followed that stands for it. False: there is
  // none.
  bool take_packed(AVPacket& packet);
  void begin_anew() { avcodec_flush_buffers(codec_.get()); }  // after the end

  int send(const AVPacket* packet) { return avcodec_send_packet(codec_.get(), packet); }  // nullptr: the end
  int receive(AVFrame& frame) { return avcodec_receive_frame(codec_.get(), &frame); }

 private:
  int open_unpacker(const AVStream& stream);

  CodecPtr codec_;
  FilterPtr unpacker_;                                        // for MPEG-4
  std::unique_ptr<AVCodecParserContext, FreeParser> parser_;  // for H.264, whose fields may have packets of their own
  CodecPtr headers_;                                          // the parser's
  int length_bytes_ = 0;    // of the length before every unit of H.264 and HEVC; 0: start codes
  int unpaired_field_ = 0;  // AVPictureStructure of the packet before; 0: none
};

}  // namespace huetrack::capture
