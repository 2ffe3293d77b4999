#include "capture/ffmpeg/stream_decoder.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace huetrack::capture {
namespace {

using Bytes = std::span<std::uint8_t>;

// A picture consists of units (ITU-T H.264, H.265: NAL units). Length and start of the first one in the bytes; nullopt:
// none.
struct Unit {
  std::size_t begin, end;  // of its own bytes, after the length or start code
};
std::optional<Unit> first_unit(Bytes bytes, int length_bytes) {
  constexpr std::array<std::uint8_t, 3> start_code{0, 0, 1};
  if (length_bytes == 0) {
    const auto start = std::ranges::search(bytes, start_code);
    if (start.empty()) return std::nullopt;
    const auto next = std::ranges::search(std::span(start.end(), bytes.end()), start_code);
    return Unit{
        std::size_t(start.end() - bytes.begin()),
        bytes.size() - std::size_t(next.empty() ? 0 : std::to_address(bytes.end()) - std::to_address(next.begin()))};
  }
  const auto prefix = static_cast<std::size_t>(length_bytes);
  if (bytes.size() <= prefix) return std::nullopt;
  std::size_t length = 0;
  for (std::size_t i = 0; i < prefix; ++i) length = length << 8 | bytes[i];
  if (length > bytes.size() - prefix) return std::nullopt;
  return Unit{prefix, prefix + length};
}

// Supplemental messages that the decoder uses (which fields a picture has, where it may start), and whole.
bool are_needed(Bytes unit) {
  std::vector<std::uint8_t> plain;  // without the bytes that keep start codes out
  for (std::size_t i = 1; i < unit.size(); ++i)
    if (i < 3 || unit[i] != 3 || unit[i - 1] != 0 || unit[i - 2] != 0) plain.push_back(unit[i]);
  while (!plain.empty() && plain.back() == 0) plain.pop_back();
  constexpr std::size_t buffering_period = 0, picture_timing = 1, recovery_point = 6;
  constexpr std::size_t user_data = 5,
                        least_user_data = 16;         // bytes; names the encoder, for whose faults FFmpeg allows
  for (std::size_t at = 0; at + 1 < plain.size();) {  // the last byte is a stop bit
    const auto number = [&] {
      std::size_t sum = 0;
      while (at < plain.size() && plain[at] == 0xFF) sum += plain[at++];
      return at < plain.size() ? sum + plain[at++] : sum;
    };
    const std::size_t type = number(), size = number();
    const bool is_used = type == buffering_period || type == picture_timing || type == recovery_point ||
                         (type == user_data && size >= least_user_data);
    if (!is_used || size > plain.size() - at) return false;
    at += size;
  }
  return true;
}

enum class UnitKind { slice, dropped, other };
UnitKind kind_of(AVCodecID codec, Bytes unit) {
  if (unit.empty()) return UnitKind::other;
  if (codec == AV_CODEC_ID_HEVC) {
    constexpr int first_of_no_slice = 32, messages = 39;  // those before the picture
    const int type = (unit[0] >> 1) & 63;
    return type < first_of_no_slice ? UnitKind::slice : type == messages ? UnitKind::dropped : UnitKind::other;
  }
  constexpr int last_of_slices = 5, messages = 6;
  const int type = unit[0] & 31;
  if (type >= 1 && type <= last_of_slices) return UnitKind::slice;
  return type == messages && !are_needed(unit) ? UnitKind::dropped : UnitKind::other;
}

// They come before the picture's slices.
void remove_messages(AVPacket& packet, AVCodecID codec, int length_bytes) {
  if (av_packet_make_writable(&packet) < 0) return;
  const Bytes all(packet.data, static_cast<std::size_t>(packet.size));
  std::size_t kept = 0, at = 0;
  while (const auto unit = first_unit(all.subspan(at), length_bytes)) {
    const UnitKind kind = kind_of(codec, all.subspan(at + unit->begin, unit->end - unit->begin));
    if (kind == UnitKind::slice) break;
    if (kind != UnitKind::dropped) {
      std::memmove(packet.data + kept, packet.data + at, unit->end);
      kept += unit->end;
    }
    at += unit->end;
  }
  if (kept == at || all.size() == at) return;  // nothing to remove, or no picture: the decoder's to judge
  std::memmove(packet.data + kept, packet.data + at, all.size() - at);
  av_shrink_packet(&packet, static_cast<int>(kept + all.size() - at));
}

// Chunks of a PNG that no decoder needs for the pixels: their names begin with a small letter. Of transparency (tRNS)
// we use nothing.
void remove_ancillary_chunks(AVPacket& packet) {
  constexpr std::size_t signature = 8, beside_data = 12;  // bytes; of a chunk: its length, name and checksum
  const std::size_t size = static_cast<std::size_t>(packet.size);
  if (size <= signature || av_packet_make_writable(&packet) < 0) return;
  std::size_t kept = signature;
  for (std::size_t at = signature; at < size;) {
    std::size_t chunk = size - at;  // the last one may be cut off
    if (chunk >= beside_data) {
      const std::uint8_t* length = packet.data + at;
      chunk = std::min(chunk, beside_data + (std::size_t{length[0]} << 24 | std::size_t{length[1]} << 16 |
                                             std::size_t{length[2]} << 8 | std::size_t{length[3]}));
      constexpr std::uint8_t small = 0x20;
      if ((length[4] & small) != 0) {
        at += chunk;
        continue;
      }
    }
    std::memmove(packet.data + kept, packet.data + at, chunk);
    kept += chunk, at += chunk;
  }
  av_shrink_packet(&packet, static_cast<int>(kept));
}

// By the configuration record (avcC, hvcC) that such streams have.
int length_bytes_of(const AVCodecParameters& parameters) {
  const std::span<const std::uint8_t> record(parameters.extradata, static_cast<std::size_t>(parameters.extradata_size));
  const std::size_t at = parameters.codec_id == AV_CODEC_ID_H264 ? 4 : 21;  // ISO 14496-15
  return record.size() > at && record[0] == 1 ? (record[at] & 3) + 1 : 0;
}

}  // namespace

int StreamDecoder::open(const AVStream* stream, const AVCodec& decoder, const DecoderOptions& options) {
  codec_.reset(not_null(avcodec_alloc_context3(&decoder)));
  unpacker_.reset();
  if (stream != nullptr) {
    if (const int e = decoder.id == AV_CODEC_ID_MPEG4 ? open_unpacker(*stream) : 0; e < 0) return e;
    const AVCodecParameters* parameters = unpacker_ ? unpacker_->par_out : stream->codecpar;
    if (const int e = avcodec_parameters_to_context(codec_.get(), parameters); e < 0) return e;
    codec_->pkt_timebase = stream->time_base;
  }
  codec_->max_pixels = options.most_pixels;
  codec_->opaque = options.log;
  codec_->err_recognition = AV_EF_CRCCHECK | AV_EF_EXPLODE;
  if (options.is_live) codec_->flags |= AV_CODEC_FLAG_LOW_DELAY;
  codec_->thread_count = options.threads;
  codec_->thread_type = FF_THREAD_SLICE;
  if (const int e = avcodec_open2(codec_.get(), &decoder, nullptr); e < 0) return e;

  parser_.reset();
  unpaired_field_ = 0;
  length_bytes_ = stream != nullptr ? length_bytes_of(*stream->codecpar) : 0;
  if (decoder.id != AV_CODEC_ID_H264 || stream == nullptr) return 0;
  parser_.reset(av_parser_init(decoder.id));
  headers_.reset(not_null(avcodec_alloc_context3(&decoder)));
  if (const int e = avcodec_parameters_to_context(headers_.get(), stream->codecpar); e < 0) return e;
  if (parser_) parser_->flags |= PARSER_FLAG_COMPLETE_FRAMES;
  return 0;
}

// DivX and XviD put a picture and the B frames before it into one packet, and follow it with empty packets.
int StreamDecoder::open_unpacker(const AVStream& stream) {
  const AVBitStreamFilter* filter = av_bsf_get_by_name("mpeg4_unpack_bframes");
  if (filter == nullptr) return 0;  // an FFmpeg without it; its decoder unpacks, with wrong times
  AVBSFContext* opened = nullptr;
  if (const int e = av_bsf_alloc(filter, &opened); e < 0) return e;
  unpacker_.reset(opened);
  if (const int e = avcodec_parameters_copy(opened->par_in, stream.codecpar); e < 0) return e;
  opened->time_base_in = stream.time_base;
  return av_bsf_init(opened);
}

bool StreamDecoder::examine(AVPacket& packet) {
  const AVCodecID codec = codec_->codec_id;
  if (codec == AV_CODEC_ID_PNG) remove_ancillary_chunks(packet);
  if (unpacker_ && packet.size > 0 && av_bsf_send_packet(unpacker_.get(), &packet) == 0)
    return av_bsf_receive_packet(unpacker_.get(), &packet) == 0;
  if (packet.size == 0 || (codec != AV_CODEC_ID_H264 && codec != AV_CODEC_ID_HEVC)) return true;
  remove_messages(packet, codec, length_bytes_);
  if (!parser_) return true;
  FfmpegLog remarks;  // the decoder will repeat what matters
  const FfmpegLogScope scope(remarks);
  std::uint8_t* out = nullptr;
  int size = 0;
  av_parser_parse2(parser_.get(), headers_.get(), &out, &size, packet.data, packet.size, packet.pts, packet.dts,
                   packet.pos);
  const int structure = parser_->picture_structure;
  const bool is_field = structure == AV_PICTURE_STRUCTURE_TOP_FIELD || structure == AV_PICTURE_STRUCTURE_BOTTOM_FIELD;
  const int before = std::exchange(unpaired_field_, 0);
  if (!is_field) return true;
  if (before != 0 && before != structure) return false;
  unpaired_field_ = structure;
  return true;
}

bool StreamDecoder::take_packed(AVPacket& packet) {
  if (!unpacker_) return false;
  static constexpr std::array<std::uint8_t, 5> not_coded{0, 0, 1, 0xB6, 0x50};  // a picture like the one before
  if (av_new_packet(&packet, static_cast<int>(not_coded.size())) < 0) return false;
  std::ranges::copy(not_coded, packet.data);
  if (av_bsf_send_packet(unpacker_.get(), &packet) < 0 || av_bsf_receive_packet(unpacker_.get(), &packet) < 0)
    return false;
  return packet.size > static_cast<int>(not_coded.size());
}

}  // namespace huetrack::capture
