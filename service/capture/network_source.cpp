#include "capture/network_source.h"

extern "C" {
#include <libavutil/opt.h>
}

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <span>
#include <stdexcept>
#include <thread>
#include <utility>

#include "capture/ffmpeg/ffmpeg_log.h"
#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/ffmpeg/ffmpeg_picture.h"
#include "capture/ffmpeg/stream_decoder.h"
#include "capture/frames/jpeg_splitter.h"
#include "capture/jpeg/jpeg_reader.h"
#include "capture/timing/camera_clock.h"
#include "capture/timing/capture_clock.h"

namespace huetrack::capture {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::array<std::string_view, 7> schemes{"rtsp", "rtsps", "http", "https", "tcp", "udp", "rtp"};
// Protocols that a stream may open: a play list must not read this host's files.
constexpr const char* protocols = "rtsp,rtsps,rtp,rtcp,udp,tcp,tls,http,https,httpproxy";
// Bytes per allocation of FFmpeg: room for a plane of such a picture with its edges. An RTSP header may announce two
// gigabytes.
constexpr std::size_t most_bytes_per_allocation = 80 << 20;
constexpr int damaged_in_a_row = 60;      // pictures, until the stream is opened again
constexpr std::size_t most_waiting = 64;  // packets whose picture has not come
// Bytes of a stream before its next picture.
constexpr std::int64_t most_without_picture = 32 << 20;

std::string_view scheme_of(std::string_view address) {
  const auto end = address.find("://");
  return end == std::string_view::npos ? std::string_view() : address.substr(0, end);
}

// Passwords stay out of logs and off the bus.
std::string without_password(const std::string& address) {
  if (!is_network_address(address)) return address;
  const auto begin = address.find("://") + 3;
  const auto end = std::min(address.find_first_of("/?#", begin), address.size());
  const auto at = address.rfind('@', end);
  const auto host = at == std::string::npos || at < begin ? begin : at + 1;
  return address.substr(0, begin) + address.substr(host, end - host);  // many have it in path or query, too
}

}  // namespace

bool is_network_address(std::string_view device) {
  return !scheme_of(device).empty();
}

std::vector<std::string> NetworkSourceOptions::problems() const {
  std::vector<std::string> found;
  const auto check = [&](bool is_fine, const std::string& sentence) {
    if (!is_fine) found.push_back(sentence);
  };
  check(camera >= 0, "camera is " + std::to_string(camera) + ", but must be >= 0");
  check(std::ranges::find(schemes, scheme_of(address)) != schemes.end(),
        "the address must begin with rtsp://, rtsps://, http://, https://, tcp://, udp:// or rtp://");
  check(width > 0 && height > 0,
        "the size is " + std::to_string(width) + "x" + std::to_string(height) + ", but must be positive");
  check(retry > 0ms && patience > 0ms, "retry and patience must be positive");
  return found;
}

struct NetworkSource::Impl {
  explicit Impl(NetworkSourceOptions o) : options(std::move(o)), shown(without_password(options.address)) {
    if (const auto problems = options.problems(); !problems.empty()) throw std::invalid_argument(problems.front());
    take_over_ffmpeg_log();
    av_max_alloc(most_bytes_per_allocation);  // of the whole process
    state.last_progress = Clock::now();
  }
  ~Impl() { close(); }  // calls is_over(), which needs the members
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // FFmpeg's interrupt callback, called some ten times a second while it waits.
  static int is_over(void* closure) {
    auto& self = *static_cast<Impl*>(closure);
    const auto now = Clock::now();
    {
      const std::scoped_lock lock(self.mutex);
      self.state.last_progress = now;
    }
    return self.stop.stop_requested() || now > self.deadline || self.sends_too_much() ? 1 : 0;
  }
  void wait_from_now() {
    deadline = Clock::now() + options.patience;
    bytes_before = bytes_read();
  }
  std::int64_t bytes_read() const {
    if (jpegs) return jpegs->bytes_read;
    return asking != nullptr && asking->pb != nullptr ? asking->pb->bytes_read : 0;
  }
  bool is_open() const { return format || jpegs; }
  bool sends_too_much() const { return bytes_read() - bytes_before > most_without_picture; }
  // Why is_over() ended FFmpeg's wait.
  std::string reason_for_end(const char* otherwise) const {
    return sends_too_much() ? "it sends " + std::to_string(most_without_picture >> 20) + " MiB without a picture"
                            : otherwise;
  }

  void report(CaptureState now, bool is_problem, const std::string& message) {
    const std::scoped_lock lock(mutex);
    const bool is_known = state.state == now && state.message == message;
    state.state = now;
    state.message = message;
    if (!is_known) events.push_back({unix_now(), now, is_problem, message});
  }

  // Returns why it cannot be opened; empty: success.
  std::string open() {
    close();
    wait_from_now();
    AVDictionary* dictionary = nullptr;
    av_dict_set(&dictionary, "protocol_whitelist", protocols, 0);
    if (scheme_of(options.address).starts_with("http")) {
      AVIOContext* io = nullptr;
      const AVIOInterruptCB interrupt{&Impl::is_over, this};
      const int error = avio_open2(&io, options.address.c_str(), AVIO_FLAG_READ, &interrupt, &dictionary);
      if (error >= 0 && sends_jpegs(*io)) {
        av_dict_free(&dictionary);
        jpegs.reset(io);
        wait_from_now();
        const int e = decoder.open(nullptr, *avcodec_find_decoder(AV_CODEC_ID_MJPEG), {.is_live = true});
        return e < 0 ? error_text(e) : std::string();
      }
      connection.reset(io);
      if (error < 0) {
        av_dict_free(&dictionary);
        return opening_problem(error);
      }
      av_dict_set(&dictionary, "protocol_whitelist", protocols, 0);  // avio_open2() took it
    }
    av_dict_set(&dictionary, "rtsp_transport", "tcp", 0);  // late rather than torn
    av_dict_set(&dictionary, "fflags", "nobuffer", 0);
    av_dict_set_int(&dictionary, "analyzeduration", 1'000'000, 0);  // microseconds
    AVFormatContext* opened = avformat_alloc_context();
    if (opened == nullptr) return "there is no memory";
    opened->interrupt_callback = {&Impl::is_over, this};
    opened->pb = connection.get();  // the same one: a server may serve but one client, once (ffmpeg -listen 1)
    const int error = avformat_open_input(&opened, options.address.c_str(), nullptr, &dictionary);
    av_dict_free(&dictionary);
    if (error < 0) return opening_problem(error);
    format.reset(opened);
    asking = opened;
    const int found = avformat_find_stream_info(format.get(), nullptr);
    const AVCodec* codec = nullptr;
    const int best = found < 0 ? found : av_find_best_stream(format.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    if (best < 0 || codec == nullptr)
      return found == AVERROR_EXIT || sends_too_much() ? reason_for_end("no picture comes") : "it has no video stream";
    stream = format->streams[best];
    if (const int e = decoder.open(stream, *codec, {.is_live = true}); e < 0) return error_text(e);
    pictures.set_stream(*stream);
    return {};
  }

  static std::string opening_problem(int error) {
    return error == AVERROR_EXIT ? "it does not answer" : error_text(error);
  }

  // Motion JPEG by the answer's type. FFmpeg's reader of it needs a first boundary, and boundaries that begin with --.
  static bool sends_jpegs(AVIOContext& io) {
    std::uint8_t* type = nullptr;
    if (av_opt_get(&io, "mime_type", AV_OPT_SEARCH_CHILDREN, &type) < 0) return false;
    const std::string_view mime = type != nullptr ? reinterpret_cast<const char*>(type) : "";
    const bool is_jpeg = mime.starts_with("multipart/") || mime.starts_with("image/jp") || mime.ends_with("jpeg");
    av_free(type);
    return is_jpeg;
  }

  void close() {
    asking = nullptr;
    jpegs.reset();
    splitter = {};
    decoder.close();
    format.reset();
    connection.reset();
    stream = nullptr;
    arrivals.clear();
    damaged = 0;
  }

  void lose(const std::string& why) {
    close();
    report(CaptureState::absent, true, shown + ": " + why + "; trying again");
  }

  void pause() {
    for (const auto end = Clock::now() + options.retry; Clock::now() < end && !stop.stop_requested();) {
      std::this_thread::sleep_for(10ms);
      const std::scoped_lock lock(mutex);
      state.last_progress = Clock::now();
    }
  }

  // ---- One picture after the other

  struct Arrived {
    std::optional<Image> image;  // nullopt: damaged
    Timestamp at;
    std::shared_ptr<const std::vector<std::uint8_t>> encoded;
  };

  void lose(int error) {
    lose(error == AVERROR_EOF    ? "the stream has ended"
         : error == AVERROR_EXIT ? reason_for_end("no picture comes")
                                 : error_text(error));
  }

  std::optional<Arrived> read_jpeg() {
    auto bytes = splitter.next();
    if (!bytes) {
      std::array<std::uint8_t, 1 << 15> some{};
      const int count = avio_read_partial(jpegs.get(), some.data(), static_cast<int>(some.size()));
      if (count <= 0) {
        if (!stop.stop_requested() && count != AVERROR(EAGAIN)) lose(count == 0 ? AVERROR_EOF : count);
        return std::nullopt;
      }
      splitter.add(std::span(some).first(static_cast<std::size_t>(count)));
      bytes = splitter.next();
    }
    if (!bytes) return std::nullopt;
    const Timestamp at = unix_now();
    wait_from_now();
    auto kept = std::make_shared<const std::vector<std::uint8_t>>(std::move(*bytes));
    if (auto decoded = decode_jpeg(kept, at)) return decoded;
    if (av_new_packet(packet.get(), static_cast<int>(kept->size())) < 0) return std::nullopt;
    std::ranges::copy(*kept, packet->data);
    auto arrived = decode_by_ffmpeg(at);
    av_packet_unref(packet.get());
    return arrived;
  }

  // nullopt: of a kind that only FFmpeg decodes.
  std::optional<Arrived> decode_jpeg(std::shared_ptr<const std::vector<std::uint8_t>> kept, Timestamp at) {
    JpegResult decoded = jpeg.read(kept);
    if (decoded.is_unsupported) return std::nullopt;
    return Arrived{std::move(decoded.image), at, std::move(kept)};
  }

  // nullopt: none yet, or the stream is lost (then it is closed).
  std::optional<Arrived> read() {
    if (Clock::now() > deadline || sends_too_much()) {  // other data, such as audio, may go on coming
      lose(reason_for_end("no picture comes"));
      return std::nullopt;
    }
    if (jpegs) return read_jpeg();
    if (const int error = av_read_frame(format.get(), packet.get()); error < 0) {
      if (stop.stop_requested() || error == AVERROR(EAGAIN)) return std::nullopt;
      lose(error);
      return std::nullopt;
    }
    const Timestamp at = unix_now();
    if (sends_too_much()) {  // FFmpeg returned the incomplete data as a packet
      av_packet_unref(packet.get());
      lose(reason_for_end(""));
      return std::nullopt;
    }
    std::optional<Arrived> arrived;
    if (packet->stream_index == stream->index && packet->size > 0) {
      wait_from_now();
      arrived = decode(at);
    }
    av_packet_unref(packet.get());
    return arrived;
  }

  std::optional<Arrived> decode(Timestamp at) {
    if (decoder.codec().codec_id == AV_CODEC_ID_MJPEG)
      if (auto arrived = decode_jpeg(jpeg.keep({packet->data, std::size_t(packet->size)}), at)) return arrived;
    return decode_by_ffmpeg(at);
  }

  std::optional<Arrived> decode_by_ffmpeg(Timestamp at) {
    // A decoder may return this packet's picture only after a later packet.
    const bool begins = decoder.examine(*packet);
    if (packet->pts != AV_NOPTS_VALUE && begins) arrivals[packet->pts] = at;
    while (arrivals.size() > most_waiting) arrivals.erase(arrivals.begin());
    if (decoder.send(packet.get()) < 0) return Arrived{std::nullopt, at, nullptr};
    std::optional<Arrived> newest;  // of several at once, older ones would come late
    for (FramePtr frame(not_null(av_frame_alloc())); decoder.receive(*frame) == 0;
         frame.reset(not_null(av_frame_alloc()))) {
      if (const auto known = arrivals.find(frame->pts); known != arrivals.end()) {
        at = known->second;
        arrivals.erase(arrivals.begin(), std::next(known));
      }
      newest = Arrived{pictures.image_of(std::move(frame), decoder.codec().codec_id), at, nullptr};
    }
    return newest;
  }

  std::optional<Frame> next() {
    wait_from_now();  // the caller may have paused
    while (!stop.stop_requested()) {
      if (!is_open()) {
        if (const std::string problem = open(); !problem.empty()) {
          if (stop.stop_requested()) break;
          lose(problem);
          pause();
          continue;
        }
        wait_from_now();
      }
      std::optional<Arrived> arrived = read();
      if (arrived && arrived->image &&
          (arrived->image->width != options.width || arrived->image->height != options.height)) {
        lose("its pictures are " + std::to_string(arrived->image->width) + "x" +
             std::to_string(arrived->image->height) + ", and the rig's are " + std::to_string(options.width) + "x" +
             std::to_string(options.height) + "; before there is a rig give size in the configuration");
        arrived.reset();
      }
      if (arrived) return frame_of(std::move(*arrived));
      if (!is_open()) pause();
    }
    close();
    return std::nullopt;
  }

  Frame frame_of(Arrived arrived) {
    Frame frame;
    frame.camera = options.camera;
    frame.sequence = sequence++;
    frame.stamped_at = arrived.at;
    frame.arrived_at = arrived.at;
    frame.latency = options.timing.latency;
    frame.readout = options.timing.readout;
    if (arrived.image) {
      frame.captured_at = clock.smoothed(arrived.at) - options.timing.latency;
      frame.pixels = std::move(*arrived.image);
      frame.encoded = std::move(arrived.encoded);
      damaged = 0;
      report(CaptureState::delivering, false,
             "delivers " + std::string(avcodec_get_name(decoder.codec().codec_id)) +
                 "; its time stamps are arrival times");
    } else {
      frame.captured_at = arrived.at - options.timing.latency;
      frame.status = FrameStatus::corrupted;
      if (++damaged >= damaged_in_a_row) lose("no picture decodes");
    }
    const std::scoped_lock lock(mutex);
    ++(frame.status == FrameStatus::ok ? state.frames : state.corrupted);
    state.last_frame = frame.captured_at;
    state.last_progress = Clock::now();
    state.stamp = StampKind::dequeued;
    state.warning = options.timing.latency == Duration{0}
                        ? "its time stamps are arrival times, and its latency is unknown: measure it with "
                          "huetrack-calibrate time, or set latency_offset_s"
                        : "";
    for (const std::string& note : pictures.take_notes())
      events.push_back({unix_now(), state.state, true, shown + ": " + note});
    return frame;
  }

  const NetworkSourceOptions options;
  const std::string shown;
  std::stop_token stop;  // this and all members up to `mutex` belong to the thread that calls next()
  Clock::time_point deadline{};
  IoPtr connection;  // of format, over HTTP
  InputPtr format;
  IoPtr jpegs;  // instead of format: motion JPEG over HTTP
  JpegSplitter splitter;
  const AVFormatContext* asking = nullptr;  // format, once it is open
  std::int64_t bytes_before = 0;            // read when the wait for a picture began
  StreamDecoder decoder;
  AVStream* stream = nullptr;  // of format
  const PacketPtr packet{not_null(av_packet_alloc())};
  std::map<std::int64_t, Timestamp> arrivals;  // by the packets' presentation times
  int damaged = 0;                             // in a row
  std::uint32_t sequence = 0;
  CameraClock clock;
  JpegReader jpeg;
  PictureMaker pictures;

  mutable std::mutex mutex;
  CameraHealth state;               // guarded by mutex
  std::vector<CameraEvent> events;  // guarded by mutex
};

NetworkSource::NetworkSource(NetworkSourceOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
NetworkSource::~NetworkSource() = default;

std::optional<Frame> NetworkSource::next(std::stop_token stop) {
  impl_->stop = std::move(stop);
  return impl_->next();
}

CameraHealth NetworkSource::health() const {
  const std::scoped_lock lock(impl_->mutex);
  return impl_->state;
}

std::vector<CameraEvent> NetworkSource::take_events() {
  const std::scoped_lock lock(impl_->mutex);
  return std::exchange(impl_->events, {});
}

}  // namespace huetrack::capture
