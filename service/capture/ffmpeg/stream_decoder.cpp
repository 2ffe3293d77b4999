#include "capture/ffmpeg/stream_decoder.h"

extern "C" {
#include <libavcodec/bsf.h>
#include <libavutil/opt.h>
}

#include <utility>

namespace huetrack::capture {
namespace {

// Numbers of NAL units with supplemental enhancement information; nullptr: the codec has none.
const char* message_units(AVCodecID codec) {
  return codec == AV_CODEC_ID_H264 ? "6" : codec == AV_CODEC_ID_HEVC ? "39-40" : nullptr;
}

AVBSFContext* filter_without(const char* units, const AVStream& stream) {
  const AVBitStreamFilter* kind = av_bsf_get_by_name("filter_units");
  AVBSFContext* filter = nullptr;
  if (kind == nullptr || av_bsf_alloc(kind, &filter) < 0) return nullptr;
  if (avcodec_parameters_copy(filter->par_in, stream.codecpar) < 0 ||
      av_opt_set(filter->priv_data, "remove_types", units, 0) < 0 || av_bsf_init(filter) < 0)
    av_bsf_free(&filter);
  return filter;
}

}  // namespace

void FreeFilter::operator()(AVBSFContext* p) const {
  av_bsf_free(&p);
}

int StreamDecoder::open(const AVStream* stream, const AVCodec& decoder, const DecoderOptions& options) {
  codec_.reset(not_null(avcodec_alloc_context3(&decoder)));
  if (stream != nullptr) {
    if (const int e = avcodec_parameters_to_context(codec_.get(), stream->codecpar); e < 0) return e;
    codec_->pkt_timebase = stream->time_base;
  }
  codec_->max_pixels = options.most_pixels;
  codec_->opaque = options.log;
  codec_->err_recognition = AV_EF_CRCCHECK;
  // FFmpeg's TIFF decoder would refuse every tag that it does not know.
  if (decoder.id != AV_CODEC_ID_TIFF) codec_->err_recognition |= AV_EF_EXPLODE;
  if (options.is_live) codec_->flags |= AV_CODEC_FLAG_LOW_DELAY;
  codec_->thread_count = options.threads;
  codec_->thread_type = FF_THREAD_SLICE;
  if (const int e = avcodec_open2(codec_.get(), &decoder, nullptr); e < 0) return e;

  parser_.reset();
  remove_messages_.reset();
  unpaired_field_ = 0;
  if (const char* units = message_units(decoder.id); units != nullptr && stream != nullptr) {
    parser_.reset(av_parser_init(decoder.id));
    headers_.reset(not_null(avcodec_alloc_context3(&decoder)));
    if (const int e = avcodec_parameters_to_context(headers_.get(), stream->codecpar); e < 0) return e;
    if (parser_) parser_->flags |= PARSER_FLAG_COMPLETE_FRAMES;
    remove_messages_.reset(filter_without(units, *stream));
  }
  return 0;
}

bool StreamDecoder::examine(AVPacket& packet) {
  if (!parser_ || packet.size == 0) return true;
  FfmpegLog remarks;
  {
    const FfmpegLogScope scope(remarks);
    std::uint8_t* out = nullptr;
    int size = 0;
    av_parser_parse2(parser_.get(), headers_.get(), &out, &size, packet.data, packet.size, packet.pts, packet.dts,
                     packet.pos);
    if (remarks.count() > 0 && remove_messages_) {
      PacketPtr rest(av_packet_clone(&packet));  // the filter takes it
      if (rest && av_bsf_send_packet(remove_messages_.get(), rest.get()) == 0 &&
          av_bsf_receive_packet(remove_messages_.get(), rest.get()) == 0 && rest->size > 0) {
        av_packet_unref(&packet);
        av_packet_move_ref(&packet, rest.get());
      }
    }
  }
  const int structure = parser_->picture_structure;
  const bool is_field = structure == AV_PICTURE_STRUCTURE_TOP_FIELD || structure == AV_PICTURE_STRUCTURE_BOTTOM_FIELD;
  const int before = std::exchange(unpaired_field_, 0);
  if (!is_field) return true;
  if (before != 0 && before != structure) return false;
  unpaired_field_ = structure;
  return true;
}

}  // namespace huetrack::capture
