#include "recordings/video_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <fstream>
#include <functional>
#include <set>
#include <string_view>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/files_beside.h"
#include "capture/ffmpeg/ffmpeg_log.h"
#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/ffmpeg/ffmpeg_picture.h"
#include "capture/ffmpeg/stream_decoder.h"
#include "capture/jpeg/jpeg_reader.h"
#include "recordings/image_series.h"
#include "recordings/joined_parts.h"
#include "recordings/mpeg4_clock.h"
#include "recordings/picture_decoder.h"
#include "recordings/picture_order.h"
#include "recordings/stream_parts.h"

namespace huetrack::recordings {

bool FrameSelection::contains(std::int64_t index) const {
  if (index < camera_.first_frame || (index - camera_.first_frame) % camera_.every != 0) return false;
  return camera_.timestamps.empty() ||
         std::ranges::binary_search(camera_.timestamps, index, {}, &std::pair<std::int64_t, capture::Timestamp>::first);
}

std::optional<std::int64_t> FrameSelection::last() const {
  return camera_.timestamps.empty() ? std::nullopt : std::optional(camera_.timestamps.back().first);
}

std::int64_t FrameSelection::count_below(std::int64_t end) const {
  if (camera_.timestamps.empty())
    return end <= camera_.first_frame ? 0 : (end - camera_.first_frame + camera_.every - 1) / camera_.every;
  return std::ranges::count_if(camera_.timestamps,
                               [&](const auto& row) { return row.first < end && contains(row.first); });
}

namespace {

constexpr std::int64_t longest_gap_frames = 1000;  // a damaged time stamp must not create frames
constexpr double rounding_s = 1.001e-3;            // of stamps in Matroska, FLV and edit lists: milliseconds
constexpr int most_mpeg4_waits = 4;                // frames: XviD and DivX write at most 3 B frames in a row
constexpr int most_warnings = 5;                   // of one kind; further ones are summed up

// Formats that are a film, picture or sound by themselves. Play lists (hls, concat, dash) name other files, and FFmpeg
// would block on a pipe among them.
constexpr const char* films =
    "matroska,webm,mov,avi,mjpeg,mjpeg_2000,mpegts,mpeg,mpegvideo,m4v,h264,hevc,av1,obu,ivf,ogg,asf,flv,nut,dv,gif,"
    "apng,yuv4mpegpipe,mpjpeg,rm,wtv,mxf,vc1,image2,png_pipe,jpeg_pipe,bmp_pipe,tiff_pipe,webp_pipe,jpegls_pipe,j2k_"
    "pipe,pgm_pipe,ppm_pipe,pam_pipe,pbm_pipe,exr_pipe,qoi_pipe,dpx_pipe,sgi_pipe,sunrast_pipe,wav,mp3,flac,aac";

// Without a container there are no time stamps: FFmpeg counts packets at 25 a second, and the first picture of MPEG-2
// gets none.
constexpr std::array<std::string_view, 7> elementary_streams{"mpegvideo", "m4v", "h264", "hevc", "vc1", "obu", "av1"};
bool has_no_stamps(const AVInputFormat& format) {
  return (format.flags & AVFMT_NOTIMESTAMPS) != 0 || std::ranges::count(elementary_streams, format.name) > 0;
}
// Pictures one after the other, as `cat *.png` writes them: the first one is at 0, the others have no time.
bool is_series_of_pictures(const AVInputFormat& format) {
  return std::string_view(format.name).ends_with("_pipe");
}

}  // namespace

struct VideoReader::Impl {
  Impl(const RecordedCamera& c, int threads, std::vector<std::string>& w, std::optional<std::stop_token> g, bool keeps)
      : camera(c), selection(c), warnings(w), growing(std::move(g)), keeps_jpeg(keeps) {
    capture::take_over_ffmpeg_log();
    auto parts = stream_parts(c.frames, warnings);
    if (parts.empty()) images = image_files_of(c);
    if (parts.empty()) parts = {images.empty() ? camera.frames : images.front().path};
    open(parts, threads);
  }

  [[noreturn]] void fail(const std::filesystem::path& file, const std::string& what) {
    throw files::ConfigError(file, 0, what + log.take() + " (frames of camera " + camera.name + ")");
  }

  // parts: of one film, or a file
  void open(const std::vector<std::filesystem::path>& parts, int threads) {
    const std::filesystem::path& file = parts.front();
    const capture::FfmpegLogScope scope(log);
    std::error_code error;
    if (!std::filesystem::exists(file, error)) fail(file, "no such file" + files::files_beside(file));
    if (!std::filesystem::is_regular_file(file, error))
      fail(file, "is not a file: give a video, or images as a pattern like %06d.png or \"" + (file / "*.png").string() +
                     "\"" + files::files_beside(file / "*") +
                     "; a folder may hold the parts of a film as transport streams (.MTS, .ts): if it holds others, " +
                     how_to_join);
    if (std::filesystem::file_size(file, error) == 0 && !error) fail(file, "is empty");

    // Local files only: a play list in a recording must not access the network.
    AVDictionary* options = nullptr;
    av_dict_set(&options, "protocol_whitelist", "file", 0);
    av_dict_set(&options, "format_whitelist", films, 0);
    av_dict_set(&options, "pattern_type", "none", 0);                       // image_files_of() handles series of images
    AVFormatContext* opened = capture::not_null(avformat_alloc_context());  // freed if it cannot be opened
    if (growing) {
      av_dict_set(&options, "follow", "1", 0);
      opened->interrupt_callback = {
          [](void* stop) { return static_cast<const std::stop_token*>(stop)->stop_requested() ? 1 : 0; }, &*growing};
    }
    if (parts.size() > 1) {
      joined = std::make_unique<JoinedParts>(parts);
      opened->pb = joined->io();
    }
    const int open_error = avformat_open_input(&opened, ("file:" + file.string()).c_str(), nullptr, &options);
    av_dict_free(&options);
    if (open_error < 0) {
      const std::string said = log.take();
      if (const auto advice = advice_to_convert(file); !advice.empty()) fail(file, advice);
      if (said.find("whitelist") != std::string::npos)
        fail(file, "is no film: a play list, or what else only names other files, is not followed");
      fail(file, "is not a video or image that FFmpeg can read: " + capture::error_text(open_error) + said);
    }
    format.reset(opened);
    std::vector<AVDictionary*> limits(format->nb_streams, nullptr);
    const capture::DecoderOptions decoding{.threads = threads, .log = &log};
    for (auto& limit : limits) av_dict_set_int(&limit, "max_pixels", decoding.most_pixels, 0);
    const int found = avformat_find_stream_info(format.get(), limits.data());
    for (auto& limit : limits) av_dict_free(&limit);
    const AVCodec* decoder = nullptr;
    const int best = found < 0 ? found : av_find_best_stream(format.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (best == AVERROR_DECODER_NOT_FOUND) fail(file, "its video codec is not in this FFmpeg");
    // FFmpeg plays text files as terminal pictures.
    if (best < 0 || !decoder || decoder->id == AV_CODEC_ID_ANSI) {
      const auto advice = advice_to_convert(file);
      fail(file, advice.empty() ? "has no video stream" : advice);
    }
    for (unsigned i = 0; i < format->nb_streams; ++i)
      if (static_cast<int>(i) != best) format->streams[i]->discard = AVDISCARD_ALL;
    stream = format->streams[best];

    if (const int e = codec.open(stream, *decoder, decoding); e < 0)
      fail(file, "its video cannot be decoded: " + capture::error_text(e));
    pictures.set_stream(*stream);
    pictures.keep_fields(camera.first_field.has_value());
    pictures.depth().state(camera.bits);
    const AVCodecDescriptor* properties = avcodec_descriptor_get(decoder->id);
    is_intra_only = properties && (properties->props & AV_CODEC_PROP_INTRA_ONLY) != 0;
    is_delayed = (decoder->capabilities & AV_CODEC_CAP_DELAY) != 0;
    if (!images.empty()) {
      if (is_delayed)
        fail(file, std::string("is a film (") + decoder->name + "), not an image: if the files are its parts, " +
                       how_to_join);
      is_intra_only = true;
      format.reset();
      stream = nullptr;
    }
    if (stream) {
      const std::string_view container = format->iformat->name;
      is_avi = container == "avi";
      has_stamps = !has_no_stamps(*format->iformat);
      if (is_avi) order.take_times_of_decoding(stream->codecpar->video_delay);
      if (!joined) order.expect_delay(stream->codecpar->video_delay);  // FFmpeg has not joined our parts
      count_listed_packets(container);
      // A transport or program stream's clock begins anywhere: players begin at its first picture.
      const bool begins_anywhere = (format->iformat->flags & AVFMT_TS_DISCONT) != 0;
      if (begins_anywhere && stream->start_time != AV_NOPTS_VALUE) clock_start = stream->start_time;
    }
    if (stream) note_priming();
    damaged = log.container_count() > 0;  // while finding the streams
    log.take();
    note_layout();
  }

  // Matroska has no times before 0: where AAC begins earlier, with the samples that prime its decoder, FFmpeg's muxer
  // makes all times later by those.
  void note_priming() {
    const AVDictionaryEntry* muxer = av_dict_get(format->metadata, "encoder", nullptr, 0);
    if (!std::string_view(format->iformat->name).starts_with("matroska") || muxer == nullptr ||
        !std::string_view(muxer->value).starts_with("Lavf"))
      return;
    constexpr int aac_frame = 1024;  // samples; one of them primes the decoder
    for (unsigned i = 0; i < format->nb_streams; ++i) {
      const AVStream& sound = *format->streams[i];
      if (sound.codecpar->codec_id == AV_CODEC_ID_AAC && sound.codecpar->sample_rate > 0 && sound.start_time == 0)
        priming = av_rescale_q(aac_frame, {1, sound.codecpar->sample_rate}, stream->time_base);
    }
  }

  // Of an MP4 or MOV: an edit list leaves some out, at the ends (no packets) or up to its first picture (trimmed ones).
  void count_listed_packets(std::string_view container) {
    listed_packets = listed_frames = stream->nb_frames;
    if (container.find("mp4") == std::string_view::npos || stream->nb_frames == 0) return;
    listed_packets = listed_frames = avformat_index_get_entries_count(stream);
    for (int i = 0; i < listed_packets; ++i)
      if ((avformat_index_get_entry(stream, i)->flags & AVINDEX_DISCARD_FRAME) != 0) --listed_frames;
  }

  void note_layout() {
    for (const std::string& note : pictures.take_notes()) warnings.push_back(camera.frames.string() + ": " + note);
  }

  void warn(int& count, const std::string& text) {
    if (++count <= most_warnings) warnings.push_back(camera.frames.string() + ": " + text);
  }

  void sum_up(int& count, const std::string& what) {
    if (count > most_warnings)
      warnings.push_back(camera.frames.string() + ": " + std::to_string(count - most_warnings) + " more " + what);
    count = 0;
  }

  // ---- One picture after the other

  std::optional<Shown> next() {
    const capture::FfmpegLogScope scope(log);
    while (ready.empty() && !ended) {
      const auto last = selection.last();
      if (last && index > *last) return std::nullopt;
      if (images.empty())
        read_packet();
      else
        read_image();
    }
    if (ready.empty()) return std::nullopt;
    Shown picture = std::move(ready.front());
    ready.pop_front();
    note_layout();
    return picture;
  }

  void read_image() {
    if (next_image == images.size()) {
      end();
      return;
    }
    const ImageFile& file = images[next_image++];
    index = file.number;
    if (!selection.contains(index)) {
      ++index;
      return;
    }
    log.take();
    std::error_code error;
    std::ifstream in;  // a pipe among the pictures would block forever
    if (std::filesystem::is_regular_file(file.path, error)) in.open(file.path, std::ios::binary | std::ios::ate);
    const auto size = in ? static_cast<std::int64_t>(in.tellg()) : 0;
    std::optional<capture::Image> image;
    if (in && size > 0 && size < (1 << 30) && av_new_packet(packet.get(), static_cast<int>(size)) == 0) {
      packet->flags |= AV_PKT_FLAG_KEY;  // FFmpeg's PNG decoder supports predicted pictures
      in.seekg(0);
      if (in.read(reinterpret_cast<char*>(packet->data), size)) image = decode_one().image;
      av_packet_unref(packet.get());
    }
    if (!image) warn(lost_warnings, file.path.filename().string() + " does not decode" + log.take());
    accept(std::nullopt, std::move(image));
  }

  void read_packet() {
    log.take();  // drops messages without a warning
    int result = av_read_frame(format.get(), packet.get());
    for (int i = 0; result == AVERROR(EAGAIN) && i < 1000; ++i) result = av_read_frame(format.get(), packet.get());
    const bool is_damaged = log.container_count() > 0;
    if (result < 0) {
      damaged = damaged || is_damaged;
      // A truncated file may lack frames before its last one; one that was cut while it was copied has all that it
      // lists.
      may_lack_last = is_delayed && !(listed_packets > 0 && packets >= listed_packets);
      decode_rest();
      const bool read_failed = result != AVERROR_EOF || (format->pb && format->pb->error < 0);
      if (read_failed || is_damaged || ends_early())
        warnings.push_back(camera.frames.string() + ": is cut off or damaged: " + std::to_string(index) + " frames" +
                           (frame_count() && *frame_count() > index
                                ? " instead of about " + std::to_string(*frame_count())
                                : std::string()) +
                           log.take());
      end();
      return;
    }
    if (packet->stream_index == stream->index) {
      ++packets;
      if (is_damaged || (packet->flags & AV_PKT_FLAG_CORRUPT) != 0) {
        warn(damage_warnings, "is damaged near frame " + std::to_string(index) + log.take());
        damaged = true;
        lost_reference(sent_key);
      }
      stamp_from_avi_index();
      use_times_of_decoding();
      if (!has_first_packet) find_decoding_delay();
      if (packets > 1 && is_series_of_pictures(*format->iformat)) has_stamps = false;
      if (!has_stamps) packet->pts = packet->dts = AV_NOPTS_VALUE;
      if (is_delayed)
        decode_delayed();
      else
        decode_immediate();
    }
    av_packet_unref(packet.get());
  }

  // ASF with B frames has no others: in ascending order they are those of showing, as an AVI's.
  void use_times_of_decoding() {
    if (packets == 1 && packet->pts == AV_NOPTS_VALUE && packet->dts != AV_NOPTS_VALUE && has_stamps) {
      has_only_times_of_decoding = true;
      order.take_times_of_decoding(stream->codecpar->video_delay);
    }
    if (has_only_times_of_decoding) packet->pts = packet->dts;
  }

  // Where B frames are decoded before they are shown, films begin later than 0 by that delay if their times of decoding
  // begin at 0 (fragmented MP4, FLV; copied from such a file or an AVI), unless an edit list takes that out. Matroska
  // and NUT do not store times of decoding: there a whole number of frames is taken for it.
  void find_decoding_delay() {
    has_first_packet = true;
    const std::int64_t begin = is_avi || stream->start_time == AV_NOPTS_VALUE ? packet->pts : stream->start_time;
    const int reordered = stream->codecpar->video_delay;
    if (clock_start || begin == AV_NOPTS_VALUE || begin <= 0) return;
    const auto is_none = [&](double ticks) { return std::abs(ticks) * av_q2d(stream->time_base) <= rounding_s; };
    if (priming > 0 && (begin >= priming || is_none(static_cast<double>(begin - priming))))
      decoding_delay = is_none(static_cast<double>(begin - priming)) ? begin : priming;
    const std::int64_t first = begin - decoding_delay;
    if (reordered == 0 || first <= 0) return;
    const std::string_view container = format->iformat->name;
    const bool has_decoding_times = !is_avi && container != "nut" && !container.starts_with("matroska");
    if (has_decoding_times && packet->dts != AV_NOPTS_VALUE && is_none(static_cast<double>(packet->dts))) {
      decoding_delay = begin;
      return;
    }
    const AVRational rate = stream->r_frame_rate.num > 0 ? stream->r_frame_rate : stream->avg_frame_rate;
    const double period = av_q2d(av_inv_q(av_mul_q(rate, stream->time_base)));
    const double frames = std::round(static_cast<double>(first) / period);
    const int longest = codec.codec().codec_id == AV_CODEC_ID_MPEG4 ? most_mpeg4_waits : reordered;
    if (!(frames >= 1 && frames <= longest && is_none(static_cast<double>(first) - frames * period))) return;
    decoding_delay = begin;
    if (camera.fps > 0 || !camera.timestamps.empty() || camera.offset != capture::Duration::zero()) return;
    const std::string begin_s = std::to_string(capture::seconds(duration_of_ticks(first))).substr(0, 5);
    warnings.push_back(camera.frames.string() + ": begins at " + begin_s +
                       " s, as long as the coding of its B frames takes, so it is played from 0: if the camera really "
                       "began so much later, give offset_s: " +
                       begin_s);
  }

  // An AVI's only time stamps are chunk numbers, and FFmpeg counts only chunks that it finds. The index has the right
  // number. FFmpeg leaves out some of them as times of showing.
  void stamp_from_avi_index() {
    if (!is_avi || packet->dts == AV_NOPTS_VALUE) return;
    packet->pts = packet->dts;
    packets = std::max(packets, packet->dts + 1);  // empty chunks are none
    if (packet->pos < 0) return;
    const AVIndexEntry* entry = nullptr;
    for (; next_avi_entry < avformat_index_get_entries_count(stream); ++next_avi_entry) {
      const AVIndexEntry* next = avformat_index_get_entry(stream, next_avi_entry);
      if (next->pos > packet->pos) break;
      entry = next;
    }
    if (!entry || entry->timestamp <= packet->pts) return;
    packet->pts = entry->timestamp;
    damaged = true;
  }

  // For a decoder without delay: packet number equals frame number.
  void decode_immediate() {
    const auto pts = packet->pts != AV_NOPTS_VALUE ? std::optional(packet->pts) : std::nullopt;
    if (is_repeated(pts)) {
      warn(damage_warnings, "has frames twice near frame " + std::to_string(index) + ": the first is used");
      damaged = true;
      return;
    }
    ++sent_key;
    if (is_intra_only && !selection.contains(index + frames_lost_before(pts))) {
      accept(pts, std::nullopt);
      return;
    }
    const bool is_key = (packet->flags & AV_PKT_FLAG_KEY) != 0;
    Decoded decoded = (packet->flags & AV_PKT_FLAG_CORRUPT) != 0 && is_intra_only ? Decoded{} : decode_one();
    if (!decoded.image && decoded.is_hidden) return;
    if (frames_lost_before(pts) > 0 || !decoded.image) lost_reference(sent_key - 1);
    accept(pts, keep_if_sound(std::move(decoded.image), is_key, sent_key));
  }

  struct Decoded {
    std::optional<capture::Image> image;
    bool is_hidden = false;  // a reference picture of VP8/VP9 that is never shown: not numbered
  };

  Decoded decode_one() {
    Decoded result;
    if (packet->size == 0) return result;  // would signal the end to the decoder
    const AVCodecID kind = codec.codec().codec_id;
    const std::span<const std::uint8_t> bytes(packet->data, static_cast<std::size_t>(packet->size));
    if (kind == AV_CODEC_ID_TIFF) return {.image = tiff_of(bytes, pictures)};
    if (is_intra_only) pictures.tag(capture::tags_of(bytes));
    if (kind == AV_CODEC_ID_MJPEG && decode_jpeg(result)) return result;
    codec.examine(*packet);
    const int errors_before = log.count();
    int error = codec.send(packet.get());
    while (error == 0) {
      capture::FramePtr frame(capture::not_null(av_frame_alloc()));
      error = codec.receive(*frame);
      if (error == 0 && !result.image) result.image = image_from(std::move(frame));
    }
    result.is_hidden = error == AVERROR(EAGAIN) && (kind == AV_CODEC_ID_VP8 || kind == AV_CODEC_ID_VP9);
    // It reports damaged slices only in the log, and shows what was there before instead.
    const bool is_patched = kind == AV_CODEC_ID_FFV1 && log.count() > errors_before;
    if ((error != AVERROR(EAGAIN) && error != AVERROR_EOF) || is_patched) result.image.reset();
    return result;
  }

  // With the live cameras' decoder, for the same pixels. False: a kind of JPEG that only FFmpeg decodes (odd sizes,
  // interlaced fields, RGB, ...).
  bool decode_jpeg(Decoded& result) {
    auto bytes = jpeg.keep({packet->data, static_cast<std::size_t>(packet->size)});
    auto decoded = jpeg.read(bytes);
    if (!decoded.image && !decoded.is_unsupported) log.add(decoded.problem);
    if (decoded.is_unsupported) return false;
    // Another size: in a video it is a field of an interlaced picture; an image file is reported and not used.
    const AVCodecContext& stored = codec.codec();
    if (decoded.image && images.empty() && stored.width > 0 &&
        (decoded.image->width != stored.width || decoded.image->height != stored.height))
      return false;
    if (!decoded.image) return true;
    if (stored.color_range == AVCOL_RANGE_MPEG) decoded.image->range = capture::ColorRange::limited;
    result.image = pictures.upright(*decoded.image);
    // A turned picture's bytes are those of another one.
    if (keeps_jpeg && result.image->planes[0].data == decoded.image->planes[0].data) jpeg_bytes = std::move(bytes);
    return true;
  }

  // For a decoder that reorders pictures.
  void decode_delayed() {
    const bool is_trimmed = (packet->flags & AV_PKT_FLAG_DISCARD) != 0;
    packet->flags &= ~AV_PKT_FLAG_DISCARD;  // the order leaves them out, not the decoder
    if (packet->size > 0) {
      const bool begins_anew = codec.codec().codec_id == AV_CODEC_ID_MPEG4 && (packet->flags & AV_PKT_FLAG_KEY) != 0 &&
                               encoder_clock.begins_again({packet->data, static_cast<std::size_t>(packet->size)});
      if (begins_anew) {
        decode_rest();
        codec.begin_anew();
        order.begin_anew();
      }
      if (codec.examine(*packet)) {
        const bool has_pts = packet->pts != AV_NOPTS_VALUE;
        const bool is_key = (packet->flags & AV_PKT_FLAG_KEY) != 0;
        if (is_key) count_repeated();
        // Where packed B frames were split (MPEG-TS), the second picture has the first one's stamp, and its own comes
        // with the placeholder that follows, of which no picture is shown.
        const bool was_packed = codec.codec().codec_id == AV_CODEC_ID_MPEG4 && has_pts && packet->pts == sent_last;
        if (was_packed)
          order.stamps_repeat();
        else
          order.sent(has_pts ? std::optional(packet->pts) : std::nullopt, is_trimmed, is_key);
        if (has_pts) sent_key = std::max(sent_key, packet->pts), sent_last = packet->pts, sent_for = packet->duration;
      }
      if (packet->size > 0 && codec.send(packet.get()) < 0) order.failed();  // an empty one would be the end
    }
    receive();
  }

  // A B frame that no placeholder followed, whose time would be the next one.
  void decode_packed() {
    const capture::PacketPtr packed(capture::not_null(av_packet_alloc()));
    if (!codec.take_packed(*packed) || !sent_last) return;
    packed->pts = sent_key + sent_for;
    order.sent(packed->pts);
    if (codec.send(packed.get()) < 0) order.failed();
    receive();
  }

  // A film that was cut between key frames begins with those before the cut; players leave them out, joining does not.
  void count_repeated() {
    const std::string_view bytes(reinterpret_cast<const char*>(packet->data), static_cast<std::size_t>(packet->size));
    if (!key_pictures.insert(std::hash<std::string_view>()(bytes)).second && repeated++ == 0)
      first_repeated = packets - 1;
  }

  void decode_rest() {
    if (!is_delayed) return;
    decode_packed();
    codec.send(nullptr);
    receive();
    order.end();
    show_ordered();
  }

  void receive() {
    for (int errors = 0; errors < 64;) {
      capture::FramePtr frame(capture::not_null(av_frame_alloc()));
      const int error = codec.receive(*frame);
      if (error == AVERROR(EAGAIN) || error == AVERROR_EOF) break;
      if (error < 0) {
        ++errors;
        order.failed();
        continue;
      }
      const std::int64_t stamp = frame->pts != AV_NOPTS_VALUE ? frame->pts : frame->best_effort_timestamp;
      order.shown(stamp != AV_NOPTS_VALUE ? std::optional(stamp) : std::nullopt, std::move(frame));
    }
    show_ordered();
  }

  void show_ordered() {
    while (auto picture = order.next()) {
      const std::int64_t key = picture->stamp.value_or(sent_key);
      if (picture->stamp && frames_lost_before(picture->stamp) > 0) lost_reference(key - 1);
      const bool is_key = picture->frame && picture->frame->key_frame != 0;
      auto image = picture->frame ? image_from(std::move(picture->frame)) : std::nullopt;
      if (!image) lost_reference(key);
      accept(picture->stamp, keep_if_sound(std::move(image), is_key, picture->stamp ? key : sent_key + 1));
    }
    if (!order.had_stamps_of_decoding() || camera.fps > 0 || !camera.timestamps.empty() ||
        std::exchange(warned_of_order, true))
      return;
    warnings.push_back(camera.frames.string() +
                       ": its time stamps are in the order in which its pictures are coded, not shown: the pictures "
                       "get them in the order shown; if they were not taken at even times, give timestamps, or mux it "
                       "again from a file with right ones");
  }

  // All pictures from a lost one to the next key frame are predicted from it.
  void lost_reference(std::int64_t key) {
    if (!is_intra_only) broken_from = std::max(broken_from.value_or(key), key);
  }

  std::optional<capture::Image> keep_if_sound(std::optional<capture::Image> image, bool is_key, std::int64_t key) {
    if (broken_from && image && is_key && key > *broken_from) broken_from.reset();
    return broken_from ? std::nullopt : std::move(image);
  }

  std::optional<capture::Image> image_from(capture::FramePtr frame) {
    auto image = pictures.image_of(std::move(frame), codec.codec().codec_id);
    tagged_field = image ? pictures.tagged_field() : std::nullopt;
    return image;
  }

  // ---- Numbering

  // Time-stamp ticks from one frame to the next; nullopt if irregular.
  std::optional<double> step() const {
    if (!is_regular || !stream) return std::nullopt;
    if (regular_count >= 2)
      return static_cast<double>(regular_last - *first_pts) / static_cast<double>(regular_count - 1);
    const double ticks = av_q2d(av_inv_q(av_mul_q(stream->avg_frame_rate, stream->time_base)));
    return std::isfinite(ticks) && ticks > 0 ? std::optional(ticks) : std::nullopt;
  }

  // In a damaged file with regular time stamps up to the damage: the number of missing frames before this one; nullopt
  // if that is impossible, so the time stamp itself is damaged.
  std::optional<std::int64_t> gap_before(std::int64_t pts) const {
    const auto ticks = step();
    if ((!damaged && !may_lack_last) || !ticks) return 0;
    const double frames = static_cast<double>(pts - last_pts.value_or(0)) / *ticks - (last_pts ? 1 : 0);
    const auto most =
        frame_count() ? std::clamp<std::int64_t>(*frame_count() - index, 0, longest_gap_frames) : longest_gap_frames;
    if (std::round(frames) > static_cast<double>(most)) return damaged ? std::nullopt : std::optional<std::int64_t>(0);
    return std::max<std::int64_t>(0, std::llround(frames));
  }

  std::int64_t frames_lost_before(std::optional<std::int64_t> pts) const {
    return pts ? gap_before(*pts).value_or(0) : 0;
  }

  // A part of the file that is there twice. (Not detectable with time stamps too coarse to distinguish two frames.)
  bool is_repeated(std::optional<std::int64_t> pts) const {
    const auto ticks = step();
    return pts && last_pts && *pts <= *last_pts && ticks && *ticks >= 2;
  }

  void accept(std::optional<std::int64_t> pts, std::optional<capture::Image> image) {
    if (pts && !gap_before(*pts)) pts.reset();
    for (std::int64_t lost = frames_lost_before(pts), i = lost; i >= 1; --i)
      show(*pts - std::llround(static_cast<double>(i) * *step()), std::nullopt);
    show(pts, std::move(image));
    if (!pts) return;
    if (!first_pts) first_pts = pts;
    if (!damaged) {
      if (last_pts) {
        const auto ticks = regular_count >= 2 ? step() : std::nullopt;
        const double steps = ticks ? static_cast<double>(*pts - *last_pts) / *ticks : 1;
        is_regular = is_regular && *pts > *last_pts && steps > 0.5 && steps < 1.5;
      }
      regular_last = *pts;
      ++regular_count;
    }
    last_pts = pts;
  }

  capture::Duration duration_of_ticks(std::int64_t ticks) const {
    return capture::Duration(av_rescale_q(ticks, stream->time_base, {1, 1'000'000'000}));
  }

  void show(std::optional<std::int64_t> pts, std::optional<capture::Image> image) {
    const std::int64_t number = index++;
    if (!selection.contains(number)) return;
    if (!image && images.empty())
      warn(lost_warnings, "frame " + std::to_string(number) + " does not decode" + log.take());
    Shown picture{.index = number, .stamp = {}, .image = image ? std::move(*image) : capture::Image{}};
    if (picture.image.width > 0) {
      picture.jpeg = std::exchange(jpeg_bytes, nullptr);
      picture.tagged_field = std::exchange(tagged_field, std::nullopt);
    }
    if (pts) picture.stamp = capture::Timestamp{duration_of_ticks(*pts - clock_start.value_or(decoding_delay))};
    ready.push_back(std::move(picture));
  }

  bool ends_early() const {
    if (listed_packets > 0) {
      const std::int64_t empty =
          is_avi ? std::llround(step().value_or(1)) - 1 : 0;  // chunks after every frame, in some AVI
      return std::max(index, packets + empty) < listed_packets;
    }
    const auto ticks = step();
    if (!last_pts || !ticks || format->nb_streams != 1 || format->duration <= 0 ||
        format->duration_estimation_method == AVFMT_DURATION_FROM_BITRATE)
      return false;
    const double second = av_q2d(av_inv_q(stream->time_base));
    const double end = static_cast<double>(format->duration) / AV_TIME_BASE * second;  // from 0 on, in these headers
    const std::int64_t before_0 = std::min<std::int64_t>(0, clock_start.value_or(0));  // a clock that has wrapped
    // Times of showing are later than those of decoding, up to which such a file counts.
    const double delay = has_only_times_of_decoding ? stream->codecpar->video_delay * *ticks : 0;
    return static_cast<double>(*last_pts + order.taken_out() - before_0) + delay + 2.5 * *ticks < end;
  }

  std::optional<std::int64_t> frame_count() const {
    if (!images.empty()) return images.back().number + 1;
    if (listed_frames > 0) return listed_frames;
    const double rate = av_q2d(stream->avg_frame_rate);
    if (format->duration > 0 && rate > 0 && rate < 1e6)
      return std::llround(static_cast<double>(format->duration) / AV_TIME_BASE * rate);
    return std::nullopt;
  }

  void end() {
    ended = true;
    // An empty chunk of an AVI stands for a picture that was dropped.
    if (const auto gaps = order.gaps();
        is_avi && gaps.count > 0 && !damaged && repeated == 0 && camera.fps == 0 && camera.timestamps.empty())
      warnings.push_back(camera.frames.string() + ": has empty chunks at " + std::to_string(gaps.count) +
                         (gaps.count == 1 ? " place" : " places") + ", first after picture " +
                         std::to_string(gaps.first_after - 1) +
                         " of the file: they count as frames that the camera dropped; if it dropped none, give fps");
    if (camera.fps == 0 && camera.timestamps.empty() && !joined && repeated == 0) note_joints();
    sum_up(lost_warnings, "frames that do not decode");
    sum_up(damage_warnings, "damaged places");
  }

  void note_joints() {
    const PictureOrder::Joints joints = order.joints();
    const auto places = [](std::int64_t count, std::int64_t first) {
      return std::to_string(count) + (count == 1 ? " key picture" : " key pictures, first") + " after picture " +
             std::to_string(first - 1) + " of the file, as where films were joined: ";
    };
    if (joints.taken_out > 0)
      warnings.push_back(camera.frames.string() + ": its times jump by the delay of coding B frames before " +
                         places(joints.taken_out, joints.first) +
                         "that is taken out; if the camera dropped frames there, give timestamps");
    if (joints.left > 0 && !damaged)
      warnings.push_back(
          fmt::format("{}: its times jump by up to {:.3f} s before {}if no pictures are missing there, give fps",
                      camera.frames.string(), capture::seconds(duration_of_ticks(joints.longest_left)),
                      places(joints.left, joints.first_left)));
  }

  const RecordedCamera& camera;
  FrameSelection selection;
  std::vector<std::string>& warnings;
  std::optional<std::stop_token> growing;
  capture::FfmpegLog log;
  std::vector<ImageFile> images;  // empty: a video
  const bool keeps_jpeg;
  std::shared_ptr<const std::vector<std::uint8_t>> jpeg_bytes = {};  // of the next picture
  std::optional<capture::FirstField> tagged_field = {};              // of the next picture
  std::size_t next_image = 0;
  std::unique_ptr<JoinedParts> joined;  // of format, when it has several parts
  capture::InputPtr format;             // null for images
  AVStream* stream = nullptr;           // of format
  capture::StreamDecoder codec;
  PictureOrder order;  // of a delayed decoder's
  Mpeg4Clock encoder_clock;
  capture::JpegReader jpeg;
  capture::PacketPtr packet{capture::not_null(av_packet_alloc())};
  capture::PictureMaker pictures;
  int next_avi_entry = 0;
  std::optional<std::int64_t> clock_start;  // ticks; of a container whose clock does not start at 0
  std::int64_t decoding_delay = 0;          // ticks, before the first picture
  std::int64_t priming = 0;                 // ticks, by which sound makes a Matroska file's times later
  bool is_intra_only = false;
  bool is_delayed = false;
  bool is_avi = false;
  bool has_stamps = true;
  bool has_only_times_of_decoding = false;
  bool has_first_packet = false;
  bool warned_of_order = false;
  std::int64_t packets = 0;                            // read
  std::int64_t listed_packets = 0, listed_frames = 0;  // by the file's index or header; 0: unknown

  std::deque<Shown> ready;
  bool ended = false;
  std::int64_t index = 0;  // of the next picture

  // Keys order the pictures: time stamps with a delayed decoder, else packet counts.
  std::int64_t sent_key = -1;
  std::optional<std::int64_t> sent_last = {};  // stamp
  std::int64_t sent_for = 0;                   // ticks: how long its picture is shown
  std::set<std::size_t> key_pictures = {};     // hashes of their bytes
  std::int64_t repeated = 0, first_repeated = 0;
  std::optional<std::int64_t> broken_from;

  bool damaged = false;  // the container, somewhere before this point
  bool may_lack_last = false;
  bool is_regular = true;  // the time stamps, up to the damage
  std::int64_t regular_count = 0;
  std::int64_t regular_last = 0;
  std::optional<std::int64_t> first_pts;
  std::optional<std::int64_t> last_pts;
  int lost_warnings = 0;
  int damage_warnings = 0;
};

VideoReader::VideoReader(const RecordedCamera& camera, int threads, std::vector<std::string>& warnings,
                         std::optional<std::stop_token> growing, bool keeps_jpeg)
    : impl_(std::make_unique<Impl>(camera, threads, warnings, std::move(growing), keeps_jpeg)) {}
VideoReader::~VideoReader() = default;

std::optional<VideoReader::Shown> VideoReader::next() {
  return impl_->next();
}

std::int64_t VideoReader::position() const {
  return impl_->index;
}

std::optional<std::int64_t> VideoReader::frame_count() const {
  return impl_->frame_count();
}

capture::Duration VideoReader::frame_period() const {
  if (!impl_->stream) return capture::Duration::zero();
  // Without a container the pictures' own headers may say it, after the first one.
  const double rate = av_q2d(impl_->has_stamps ? impl_->stream->avg_frame_rate : impl_->codec.codec().framerate);
  return rate > 0 && std::isfinite(rate) ? capture::duration_of(1 / rate) : capture::Duration::zero();
}

bool VideoReader::is_turned() const {
  return impl_->pictures.turns();
}

std::optional<std::string> VideoReader::wrong_times() const {
  if (impl_->repeated == 0) return std::nullopt;
  return fmt::format(
      "{} of its key pictures are there twice, first picture {} of the file, as where films were joined that had been "
      "cut between key frames: times are wrong from there on: join them uncut, or cut them by encoding them anew; if "
      "they are right, add trust_times: true",
      impl_->repeated, impl_->first_repeated);
}

std::span<const ImageFile> VideoReader::series() const {
  return impl_->images;
}

std::optional<int> VideoReader::unexplained_largest() const {
  return impl_->pictures.depth().unexplained_largest();
}

std::optional<capture::Duration> VideoReader::clock_start() const {
  return impl_->clock_start ? std::optional(impl_->duration_of_ticks(*impl_->clock_start)) : std::nullopt;
}

}  // namespace huetrack::recordings
