#include "recordings/recording_writer.h"

#include <fmt/format.h>

extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <mutex>
#include <span>
#include <stdexcept>
#include <system_error>

#include "calib/files/number_text.h"
#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "capture/ffmpeg/ffmpeg_log.h"
#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/ffmpeg/ffmpeg_picture.h"
#include "capture/frames/file_descriptor.h"
#include "capture/frames/image_copy.h"
#include "recordings/matches_reader.h"

namespace huetrack::recordings {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Thrown by the file classes, caught in write().
struct WriteError {
  fs::path file;
  std::string why;
};

std::string system_text(int error) {
  return std::generic_category().message(error);
}

// The system's text for a system error of FFmpeg: "No space left on device".
std::string text_of(int error) {
  const int code = AVUNERROR(error);
  return code > 0 && code < 200 ? system_text(code) : capture::error_text(error);
}

// A valid file name: keeps letters, digits and -_.
std::string file_name_of(const std::string& camera) {
  std::string name = camera;
  std::ranges::replace_if(
      name, [](unsigned char c) { return std::isalnum(c) == 0 && c != '-' && c != '_' && c != '.'; }, '_');
  if (name.starts_with('.')) name.front() = '_';
  return name;
}

std::string decimal_seconds(capture::Timestamp at) {
  return files::seconds_text(at.time_since_epoch().count());
}

// Recorded times include the latency: the rig may know it better when the recording is played.
std::string row_text(const std::string& picture, const capture::Frame& frame) {
  return fmt::format("{},{},{},{},{},{},{}\n", picture, decimal_seconds(frame.captured_at + frame.latency),
                     frame.sequence, frame.arrival, decimal_seconds(frame.stamped_at), frame.clock.of,
                     frame.clock.sigma.count());
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out)
    throw capture::CaptureError({errno, std::generic_category()},
                                file.string() + ": cannot be written: " + system_text(errno));
}

// ---- A file that always ends with a whole row

class CsvFile {
 public:
  explicit CsvFile(fs::path file)
      : file_(std::move(file)), fd_(::open(file_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)) {
    if (fd_.get() < 0)
      throw capture::CaptureError({errno, std::generic_category()},
                                  file_.string() + ": cannot be made: " + system_text(errno));
  }
  void add(const std::string& row) { rows_ += row; }

  // throws WriteError; the file then ends with the last row that fit.
  void flush() {
    const std::size_t done = files::write_all(fd_.get(), rows_);
    if (done < rows_.size()) {
      const int error = errno;
      const auto last_row_end = rows_.rfind('\n', done > 0 ? done - 1 : 0);
      const std::size_t whole = done == 0 || last_row_end == std::string::npos ? 0 : last_row_end + 1;
      if (::ftruncate(fd_.get(), size_ + static_cast<off_t>(whole)) != 0) throw WriteError{file_, system_text(errno)};
      rows_.clear();
      throw WriteError{file_, system_text(error)};
    }
    size_ += static_cast<off_t>(rows_.size());
    rows_.clear();
  }

 private:
  fs::path file_;
  capture::FileDescriptor fd_;
  off_t size_ = 0;    // of whole rows on disk
  std::string rows_;  // not written yet
};

// ---- How an image is stored

// HuffYUV is planar.
capture::PixelFormat planar(capture::PixelFormat format) {
  return format == capture::PixelFormat::yuyv   ? capture::PixelFormat::i422
         : format == capture::PixelFormat::nv12 ? capture::PixelFormat::i420
                                                : format;
}

bool is_packed(const capture::Image& image) {
  capture::Image packed = image;
  capture::set_packed(packed, image.planes[0].data, nullptr);
  return std::ranges::equal(image.planes, packed.planes, [](const auto& a, const auto& b) {
    return b.data == nullptr || (a.data == b.data && a.stride == b.stride);
  });
}

// yuyv and nv12 with each component in a plane of its own.
void unpack(const capture::Image& image, AVFrame& to) {
  const auto row = [&](std::size_t plane, int y) { return image.planes[plane].data + y * image.planes[plane].stride; };
  const auto out = [&](int plane, int y) { return to.data[plane] + y * to.linesize[plane]; };
  if (image.format == capture::PixelFormat::yuyv) {
    for (int y = 0; y < image.height; ++y) {
      const std::uint8_t* from = row(0, y);
      std::uint8_t* luma = out(0, y);
      std::uint8_t* u = out(1, y);
      std::uint8_t* v = out(2, y);
      for (int x = 0; x < image.width / 2; ++x) {
        luma[2 * x] = from[4 * x];
        u[x] = from[4 * x + 1];
        luma[2 * x + 1] = from[4 * x + 2];
        v[x] = from[4 * x + 3];
      }
    }
    return;
  }
  for (int y = 0; y < image.height; ++y) std::memcpy(out(0, y), row(0, y), static_cast<std::size_t>(image.width));
  for (int y = 0; y < image.height / 2; ++y) {
    const std::uint8_t* from = row(1, y);
    for (int x = 0; x < image.width / 2; ++x) {
      out(1, y)[x] = from[2 * x];
      out(2, y)[x] = from[2 * x + 1];
    }
  }
}

// Cameras do not send BGR, and Matroska does not know it raw.
bool can_be_stored(const capture::Frame& frame) {
  return frame.encoded || frame.pixels.format != capture::PixelFormat::bgr;
}

// ---- One camera's video file

class VideoFile {
 public:
  // All later frames must match the first. throws WriteError
  VideoFile(fs::path file, const capture::Frame& first, RawStorage storage)
      : file_(std::move(file)),
        format_(first.pixels.format),
        width_(first.pixels.width),
        height_(first.pixels.height),
        range_(first.pixels.range),
        is_jpeg_(first.encoded != nullptr) {
    // Matroska has no raw 4:4:4; cameras send it only as JPEG.
    const bool is_huffyuv = !is_jpeg_ && (storage == RawStorage::huffyuv || format_ == capture::PixelFormat::i444);
    AVFormatContext* opened = nullptr;
    check(avformat_alloc_output_context2(&opened, nullptr, "matroska", file_.c_str()));
    AVStream* stream = capture::not_null(avformat_new_stream(opened, nullptr));
    output_.reset(opened);
    stream->time_base = {1, 1000};
    AVCodecParameters& parameters = *stream->codecpar;
    if (is_huffyuv) {
      open_encoder();
      check(avcodec_parameters_from_context(&parameters, encoder_.get()));
    } else {
      parameters.codec_type = AVMEDIA_TYPE_VIDEO;
      parameters.codec_id = is_jpeg_ ? AV_CODEC_ID_MJPEG : AV_CODEC_ID_RAWVIDEO;
      parameters.format = capture::av_format_of(format_);
      if (!is_jpeg_) parameters.codec_tag = avcodec_pix_fmt_to_codec_tag(capture::av_format_of(format_));
    }
    parameters.width = width_;
    parameters.height = height_;
    parameters.color_range = range_ == capture::ColorRange::full ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
    const bool is_yuv = format_ != capture::PixelFormat::bgr && format_ != capture::PixelFormat::grey;
    if (is_yuv) parameters.color_space = AVCOL_SPC_SMPTE170M;  // BT.601
    output_->flags |= AVFMT_FLAG_BITEXACT;
    check(avio_open(&output_->pb, ("file:" + file_.string()).c_str(), AVIO_FLAG_WRITE));
    check(avformat_write_header(output_.get(), nullptr));
    time_base_ = stream->time_base;
  }

  bool takes(const capture::Frame& frame) const {
    return frame.pixels.format == format_ && frame.pixels.width == width_ && frame.pixels.height == height_ &&
           frame.pixels.range == range_ && (frame.encoded != nullptr) == is_jpeg_;
  }

  // since_start: for players; the exact time is in the CSV. throws WriteError
  void write(const capture::Frame& frame, capture::Duration since_start) {
    const auto ms = std::chrono::round<std::chrono::milliseconds>(since_start).count();
    last_ms_ = std::max<std::int64_t>({ms, 0, last_ms_ + 1});
    if (encoder_) {
      encode(frame.pixels);
    } else {  // the packet refers to our bytes during the call
      const std::span<const std::uint8_t> bytes = stored(frame);
      packet_->data = const_cast<std::uint8_t*>(bytes.data());
      packet_->size = static_cast<int>(bytes.size());
      packet_->flags = AV_PKT_FLAG_KEY;
    }
    packet_->pts = packet_->dts = last_ms_;
    packet_->stream_index = 0;
    av_packet_rescale_ts(packet_.get(), {1, 1000}, time_base_);
    const int result = av_write_frame(output_.get(), packet_.get());
    av_packet_unref(packet_.get());
    check(result);
  }

  // Flushes everything to the system, readable without what follows. throws WriteError
  void flush() {
    check(av_write_frame(output_.get(), nullptr));  // ends the cluster
    avio_flush(output_->pb);
    check(output_->pb->error);
  }

  void finish() {
    check(av_write_trailer(output_.get()));
    avio_flush(output_->pb);
    check(output_->pb->error);
  }

  std::uint64_t bytes() const { return static_cast<std::uint64_t>(std::max<std::int64_t>(avio_tell(output_->pb), 0)); }

 private:
  void check(int error) const {
    if (error < 0) throw WriteError{file_, text_of(error)};
  }

  // Uncompressed; valid until the next call.
  std::span<const std::uint8_t> stored(const capture::Frame& frame) {
    if (is_jpeg_) return *frame.encoded;
    const std::size_t count = capture::packed_bytes(frame.pixels);
    capture::require_all(frame.pixels);
    if (is_packed(frame.pixels)) return {frame.pixels.planes[0].data, count};
    scratch_.resize(count);
    capture::pack(frame.pixels, scratch_.data());
    return scratch_;
  }

  void open_encoder() {
    const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_FFVHUFF);
    if (!codec) throw WriteError{file_, "this FFmpeg has no HuffYUV encoder: use raw_storage: uncompressed"};
    encoder_.reset(capture::not_null(avcodec_alloc_context3(codec)));
    encoder_->width = width_;
    encoder_->height = height_;
    encoder_->pix_fmt = capture::av_format_of(planar(format_));
    encoder_->time_base = {1, 1000};
    encoder_->thread_count = 1;
    encoder_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    check(avcodec_open2(encoder_.get(), codec, nullptr));
  }

  void encode(const capture::Image& image) {
    if (!picture_) {
      picture_.reset(capture::not_null(av_frame_alloc()));
      picture_->format = encoder_->pix_fmt;
      picture_->width = width_;
      picture_->height = height_;
      check(av_frame_get_buffer(picture_.get(), 0));
    }
    check(av_frame_make_writable(picture_.get()));
    capture::require_all(image);
    if (planar(image.format) != image.format)
      unpack(image, *picture_);
    else
      for (int i = 0; i < 3; ++i)
        for (int y = 0; y < capture::plane_rows(image.format, i, image.height); ++y)
          std::memcpy(
              picture_->data[i] + y * picture_->linesize[i],
              image.planes[static_cast<std::size_t>(i)].data + y * image.planes[static_cast<std::size_t>(i)].stride,
              capture::plane_row_bytes(image.format, i, image.width));
    picture_->pts = last_ms_;
    check(avcodec_send_frame(encoder_.get(), picture_.get()));
    check(avcodec_receive_packet(encoder_.get(), packet_.get()));
  }

  fs::path file_;
  capture::PixelFormat format_;
  int width_, height_;
  capture::ColorRange range_;
  bool is_jpeg_;
  capture::OutputPtr output_;
  capture::CodecPtr encoder_;  // null: the bytes as they are
  capture::FramePtr picture_;
  capture::PacketPtr packet_{capture::not_null(av_packet_alloc())};
  AVRational time_base_{1, 1000};
  std::vector<std::uint8_t> scratch_;
  std::int64_t last_ms_ = -1;
};

// ---- One camera's matches: a file that always ends with a whole frame

class MatchesFile {
 public:
  explicit MatchesFile(fs::path file)
      : file_(std::move(file)), fd_(::open(file_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)) {
    if (fd_.get() < 0) throw WriteError{file_, system_text(errno)};
    waiting_ += matches_file_begins;
  }
  void write(const capture::Frame& frame) {
    const auto length = static_cast<std::uint32_t>(frame.encoded->size());
    for (unsigned i = 0; i < 4; ++i) waiting_ += static_cast<char>(length >> (8 * i) & 0xff);
    waiting_.append(frame.encoded->begin(), frame.encoded->end());
  }

  // throws WriteError; the file then ends where it ended before.
  void flush() {
    if (files::write_all(fd_.get(), waiting_) < waiting_.size()) {
      const int error = errno;
      waiting_.clear();
      if (::ftruncate(fd_.get(), size_) != 0) throw WriteError{file_, system_text(errno)};
      throw WriteError{file_, system_text(error)};
    }
    size_ += static_cast<off_t>(waiting_.size());
    waiting_.clear();
  }
  std::uint64_t bytes() const { return static_cast<std::uint64_t>(size_) + waiting_.size(); }

 private:
  fs::path file_;
  capture::FileDescriptor fd_;
  off_t size_ = 0;       // of whole frames on disk
  std::string waiting_;  // not written yet
};

struct CameraFiles {
  fs::path video_path;
  bool are_matches = false;
  std::unique_ptr<CsvFile> times;
  std::unique_ptr<VideoFile> video;  // created with the first good frame, as is the next
  std::unique_ptr<MatchesFile> matches;
  std::int64_t next_picture = 0;
  std::optional<capture::Timestamp> last_at;
  Clock::time_point last_flush{};

  // Read by figures() on any thread.
  std::atomic<std::uint64_t> frames{0}, left_out{0}, bytes{0};

  void flush() {
    // The video first: a picture without a row is ignored, but a row without its picture counts as missing.
    if (video) {
      video->flush();
      bytes = video->bytes();
    }
    if (matches) {
      matches->flush();
      bytes = matches->bytes();
    }
    times->flush();
    last_flush = Clock::now();
  }
};

std::size_t held_bytes(const capture::Frame& frame) {
  return sizeof(capture::Frame) + (frame.encoded        ? frame.encoded->size()
                                   : frame.pixels.owner ? capture::packed_bytes(frame.pixels)
                                                        : 0);
}

}  // namespace

std::vector<std::string> RecordingOptions::problems() const {
  std::vector<std::string> found;
  if (folder.empty()) found.push_back("folder is empty");
  if (cameras.empty()) found.push_back("cameras is empty");
  for (const auto& camera : cameras)
    if (camera.empty()) found.push_back("a camera has no name");
  if (!are_matches.empty() && are_matches.size() != cameras.size())
    found.push_back("are_matches has not one entry per camera");
  if (flush_every <= capture::Duration::zero()) found.push_back("flush_every must be positive");
  return found;
}

struct RecordingWriter::Impl {
  explicit Impl(RecordingOptions o) : options(std::move(o)) {
    capture::take_over_ffmpeg_log();
    make_folder();
    std::string yaml =
        "# Written by huetrack. The times (t_s) in the CSV files are UNIX time, in seconds: so the clock's zero is "
        "UNIX time's.\nversion: 1\nstarted_at: 0\ncameras:\n";
    std::vector<std::string> names;
    for (std::size_t i = 0; i < options.cameras.size(); ++i) {
      std::string name = file_name_of(options.cameras[i]);
      if (std::ranges::find(names, name) != names.end()) name.append("_").append(std::to_string(i));
      names.push_back(name);
      auto camera = std::make_unique<CameraFiles>();
      camera->are_matches = !options.are_matches.empty() && options.are_matches[i];
      const std::string video = name + (camera->are_matches ? matches_file_ending : ".mkv");
      camera->video_path = options.folder / video;
      camera->times = std::make_unique<CsvFile>(options.folder / (name + ".csv"));
      camera->times->add("frame,t_s,sequence,arrival,stamp_s,clock,clock_sigma_ns\n");
      yaml += fmt::format("  {}: {{frames: {}, timestamps: {}}}\n", files::in_yaml_quotes(options.cameras[i]),
                          files::in_yaml_quotes(video), files::in_yaml_quotes(name + ".csv"));
      files.push_back(std::move(camera));
    }
    try {
      for (const auto& camera : files) camera->times->flush();
    } catch (const WriteError& e) {
      throw capture::CaptureError(std::make_error_code(std::errc::io_error),
                                  e.file.string() + ": cannot be written: " + e.why);
    }
    if (!options.rig_yaml.empty()) write_text(options.folder / "rig.yaml", options.rig_yaml);
    for (const auto& [name, content] : options.files) write_text(options.folder / name, content);
    if (!options.config_yaml.empty()) write_text(options.folder / "huetrackd.yaml", options.config_yaml);
    write_text(options.folder / "recording.yaml", yaml);
  }

  void make_folder() const {
    std::error_code error;
    fs::create_directories(options.folder, error);
    if (error)
      throw capture::CaptureError(
          error, options.folder.string() + ": the recording's folder cannot be made: " + error.message());
    const bool is_empty = fs::is_empty(options.folder, error);
    if (error || !is_empty)
      throw capture::CaptureError(
          std::make_error_code(std::errc::file_exists),
          options.folder.string() + ": is not an empty folder: give a new one for each recording");
  }

  bool write(const capture::Frame& frame) {
    if (has_failed) return false;
    assert(frame.camera >= 0 && static_cast<std::size_t>(frame.camera) < files.size());
    CameraFiles& files_of_camera = *files[static_cast<std::size_t>(frame.camera)];
    try {
      append(files_of_camera, frame);
      return true;
    } catch (const WriteError& e) {
      fail(e);
      return false;
    }
  }

  void append(CameraFiles& camera, const capture::Frame& frame) {
    if (camera.last_at && frame.captured_at <= *camera.last_at) {
      ++camera.left_out;
      return;
    }
    // A corrupted frame has no picture, only its time.
    std::string picture;
    if (frame.status == capture::FrameStatus::ok) {
      if (!(camera.are_matches ? append_matches(camera, frame) : append_picture(camera, frame))) {
        ++camera.left_out;
        return;
      }
      picture = std::to_string(camera.next_picture++);
    }
    camera.times->add(row_text(picture, frame));
    camera.last_at = frame.captured_at;
    ++camera.frames;
    if (camera.video) camera.bytes = camera.video->bytes();
    if (camera.matches) camera.bytes = camera.matches->bytes();
    if (Clock::now() - camera.last_flush >= options.flush_every) camera.flush();
  }

  // False: not a frame of matches.
  bool append_matches(CameraFiles& camera, const capture::Frame& frame) {
    if (!frame.matches || !frame.encoded) return false;
    if (!camera.matches) camera.matches = std::make_unique<MatchesFile>(camera.video_path);
    start_of(frame);
    camera.matches->write(frame);
    return true;
  }
  bool append_picture(CameraFiles& camera, const capture::Frame& frame) {
    if (frame.matches) return false;
    if (!camera.video && can_be_stored(frame))
      camera.video = std::make_unique<VideoFile>(camera.video_path, frame, options.raw_storage);
    if (!camera.video || !camera.video->takes(frame)) return false;
    camera.video->write(frame, frame.captured_at - start_of(frame));
    return true;
  }

  capture::Timestamp start_of(const capture::Frame& frame) {
    const std::scoped_lock lock(mutex);
    if (!started_at) {
      started_at = frame.captured_at;
      first_write = Clock::now();
    }
    return *started_at;
  }

  void fail(const WriteError& error) {
    const std::scoped_lock lock(mutex);
    if (failure) return;
    const auto after = first_write ? std::chrono::duration<double>(Clock::now() - *first_write).count() : 0.0;
    failure = fmt::format("{}: {}: recording stopped after {:.1f} s; what was written until then replays",
                          error.file.string(), error.why, after);
    has_failed = true;
  }

  void finish() {
    if (std::exchange(is_finished, true)) return;
    for (const auto& camera : files) {
      try {
        if (has_failed) {
          camera->times->flush();  // rows of flushed pictures
          continue;
        }
        camera->flush();
        if (!camera->video) continue;
        camera->video->finish();
        camera->bytes = camera->video->bytes();
      } catch (const WriteError& e) {
        fail(e);
      }
    }
  }

  const RecordingOptions options;
  std::vector<std::unique_ptr<CameraFiles>> files;  // each used by its writing thread
  std::atomic<bool> has_failed{false};
  bool is_finished = false;

  mutable std::mutex mutex;
  std::optional<capture::Timestamp> started_at;  // guarded by mutex; of the first frame
  std::optional<Clock::time_point> first_write;  // guarded by mutex
  std::optional<std::string> failure;            // guarded by mutex
};

RecordingWriter::RecordingWriter(RecordingOptions options) {
  for (const auto& problem : options.problems()) throw std::invalid_argument("RecordingWriter: " + problem);
  impl_ = std::make_unique<Impl>(std::move(options));
}

RecordingWriter::~RecordingWriter() {
  finish();
}

bool RecordingWriter::write(const capture::Frame& frame) {
  return impl_->write(frame);
}

std::optional<std::string> RecordingWriter::failure() const {
  const std::scoped_lock lock(impl_->mutex);
  return impl_->failure;
}

std::vector<RecordedCameraFigures> RecordingWriter::figures() const {
  std::vector<RecordedCameraFigures> figures;
  for (const auto& camera : impl_->files)
    figures.push_back({.frames = camera->frames, .left_out = camera->left_out, .bytes = camera->bytes});
  return figures;
}

const fs::path& RecordingWriter::folder() const {
  return impl_->options.folder;
}

void RecordingWriter::finish() {
  impl_->finish();
}

// ---- Pre-roll

std::vector<std::string> PreRollOptions::problems() const {
  std::vector<std::string> found;
  if (length <= capture::Duration::zero()) found.push_back("length must be positive");
  if (most_bytes == 0) found.push_back("most_bytes must be positive");
  return found;
}

PreRoll::PreRoll(PreRollOptions options) : options_(options) {
  for (const auto& problem : options_.problems()) throw std::invalid_argument("PreRoll: " + problem);
}

void PreRoll::push(const capture::Frame& frame) {
  Held held{.frame = frame, .bytes = held_bytes(frame)};
  capture::Image& image = held.frame.pixels;
  if (frame.encoded) {
    image.planes = {};
    image.owner.reset();
    image.on_demand.reset();
    static const auto known_from_encoded = std::make_shared<const capture::Matches>();
    if (frame.matches) held.frame.matches = known_from_encoded;
  } else if (frame.status == capture::FrameStatus::ok && has_pixels(frame.pixels)) {
    image = capture::copy_of(frame.pixels);
  }
  bytes_ += held.bytes;
  newest_ = std::max(newest_.value_or(frame.captured_at), frame.captured_at);
  frames_.push_back(std::move(held));
  shrink();
}

void PreRoll::shrink() {
  const auto is_too_old = [&](const capture::Frame& frame) { return *newest_ - frame.captured_at > options_.length; };
  while (frames_.size() > 1 && (bytes_ > options_.most_bytes || is_too_old(frames_.front().frame))) {
    if (!is_too_old(frames_.front().frame)) cut_to_ = *newest_ - frames_[1].frame.captured_at;
    bytes_ -= frames_.front().bytes;
    frames_.pop_front();
  }
}

std::vector<capture::Frame> PreRoll::take() {
  std::vector<capture::Frame> frames;
  frames.reserve(frames_.size());
  for (auto& held : frames_) frames.push_back(std::move(held.frame));
  frames_.clear();
  bytes_ = 0;
  newest_.reset();
  return frames;
}

}  // namespace huetrack::recordings
