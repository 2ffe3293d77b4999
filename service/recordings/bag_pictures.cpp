#include "recordings/bag_pictures.h"

#include <fmt/format.h>

extern "C" {
#include <libavutil/imgutils.h>
}

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/median.h"
#include "calib/files/text_file.h"
#include "calib/yaml/yaml_reader.h"
#include "recordings/bags/camera_topics.h"

namespace huetrack::recordings {
namespace {

constexpr std::int64_t most_lost_warnings = 5;  // further ones are summed up
constexpr std::size_t frames_for_period = 30;
constexpr std::size_t most_out_of_order = 16;      // capacity: pictures in memory, half a second
constexpr std::int64_t largest_picture = 1 << 26;  // pixels

// sensor_msgs' encodings as FFmpeg's pixel formats; those of 16 bits in little and in big endian.
struct RosEncoding {
  std::string_view name;
  AVPixelFormat little, big;
};
constexpr std::array<RosEncoding, 27> ros_encodings{{
    {"bgr8", AV_PIX_FMT_BGR24, AV_PIX_FMT_BGR24},
    {"8UC3", AV_PIX_FMT_BGR24, AV_PIX_FMT_BGR24},  // OpenCV's order
    {"rgb8", AV_PIX_FMT_RGB24, AV_PIX_FMT_RGB24},
    {"bgra8", AV_PIX_FMT_BGRA, AV_PIX_FMT_BGRA},
    {"8UC4", AV_PIX_FMT_BGRA, AV_PIX_FMT_BGRA},
    {"rgba8", AV_PIX_FMT_RGBA, AV_PIX_FMT_RGBA},
    {"bgr16", AV_PIX_FMT_BGR48LE, AV_PIX_FMT_BGR48BE},
    {"16UC3", AV_PIX_FMT_BGR48LE, AV_PIX_FMT_BGR48BE},
    {"rgb16", AV_PIX_FMT_RGB48LE, AV_PIX_FMT_RGB48BE},
    {"bgra16", AV_PIX_FMT_BGRA64LE, AV_PIX_FMT_BGRA64BE},
    {"rgba16", AV_PIX_FMT_RGBA64LE, AV_PIX_FMT_RGBA64BE},
    {"mono8", AV_PIX_FMT_GRAY8, AV_PIX_FMT_GRAY8},
    {"8UC1", AV_PIX_FMT_GRAY8, AV_PIX_FMT_GRAY8},
    {"mono16", AV_PIX_FMT_GRAY16LE, AV_PIX_FMT_GRAY16BE},
    {"yuv422", AV_PIX_FMT_UYVY422, AV_PIX_FMT_UYVY422},
    {"uyvy", AV_PIX_FMT_UYVY422, AV_PIX_FMT_UYVY422},
    {"yuv422_yuy2", AV_PIX_FMT_YUYV422, AV_PIX_FMT_YUYV422},
    {"yuyv", AV_PIX_FMT_YUYV422, AV_PIX_FMT_YUYV422},
    {"nv21", AV_PIX_FMT_NV21, AV_PIX_FMT_NV21},
    {"nv12", AV_PIX_FMT_NV12, AV_PIX_FMT_NV12},
    {"nv24", AV_PIX_FMT_NV24, AV_PIX_FMT_NV24},
    {"bayer_rggb8", AV_PIX_FMT_BAYER_RGGB8, AV_PIX_FMT_BAYER_RGGB8},
    {"bayer_bggr8", AV_PIX_FMT_BAYER_BGGR8, AV_PIX_FMT_BAYER_BGGR8},
    {"bayer_gbrg8", AV_PIX_FMT_BAYER_GBRG8, AV_PIX_FMT_BAYER_GBRG8},
    {"bayer_grbg8", AV_PIX_FMT_BAYER_GRBG8, AV_PIX_FMT_BAYER_GRBG8},
    {"bayer_rggb16", AV_PIX_FMT_BAYER_RGGB16LE, AV_PIX_FMT_BAYER_RGGB16BE},
    {"bayer_bggr16", AV_PIX_FMT_BAYER_BGGR16LE, AV_PIX_FMT_BAYER_BGGR16BE},
}};

// Packets of a film, of which most are no pictures on their own: by FFmpeg's name, or a start code (Annex B).
bool is_of_film(const bags::PictureMessage& picture) {
  constexpr std::array<std::uint8_t, 4> start_code{0, 0, 0, 1};
  const AVCodecDescriptor* const codec = avcodec_descriptor_get_by_name(picture.encoding.c_str());
  return (codec != nullptr && codec->type == AVMEDIA_TYPE_VIDEO && (codec->props & AV_CODEC_PROP_INTRA_ONLY) == 0) ||
         std::ranges::equal(picture.data.first(std::min(picture.data.size(), start_code.size())), start_code);
}

std::string names_of(std::span<const bags::CameraTopics> cameras) {
  std::string list;
  for (const auto& camera : cameras) list += (list.empty() ? "" : ", ") + camera.picture.name;
  return list;
}

std::string other_topics(const bags::Contents& contents) {
  std::string list;
  for (const bags::BagTopic& topic : contents.topics)
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", files::printable(topic.name, 80),
                        files::printable(topic.type, 80));
  if (list.empty() && !contents.warnings.empty()) return "nothing of it is left: " + contents.warnings.front();
  return list.empty() ? "it holds no messages" : "its topics are " + files::printable(list, 600);
}

std::vector<bags::CameraTopics> cameras_in(const std::filesystem::path& bag, bags::Contents& contents) {
  contents = bags::contents_of(bag);
  auto cameras = bags::cameras_of(contents.topics);
  if (cameras.empty())
    throw files::ConfigError(bag, 0,
                             "has no topic of sensor_msgs/Image or CompressedImage with pictures of a camera (convert "
                             "others, as H.264 in messages, to one of these, or to a video); " +
                                 other_topics(contents));
  return cameras;
}

// What metadata.yaml promises and the folder does not hold.
void check_metadata(const std::filesystem::path& bag, std::vector<std::string>& warnings) {
  std::error_code error;
  if (!std::filesystem::is_directory(bag, error)) return;
  const auto file = bag / "metadata.yaml";
  if (!std::filesystem::exists(file, error)) {
    warnings.push_back(bag.string() +
                       ": has no metadata.yaml, so its recorder was killed: its files are read by their numbers");
    return;
  }
  const auto about = yaml::YamlReader::file(file).map("rosbag2_bagfile_information");
  for (const std::string& part : about.strings("relative_file_paths"))
    if (const auto name = std::filesystem::path(part).filename(); !std::filesystem::exists(bag / name, error))
      warnings.push_back(file.string() + ": lists " + files::printable(part) +
                         ", which is not there: its part of the recording is missing");
}

void release_owner(void* owner, std::uint8_t*) {
  delete static_cast<std::shared_ptr<const void>*>(owner);
}

}  // namespace

Recording recording_of_bag(const std::filesystem::path& bag) {
  Recording recording{.file = bag, .cameras = {}, .warnings = {}, .started_at = {}};
  check_metadata(bag, recording.warnings);
  bags::Contents contents;
  for (const bags::CameraTopics& found : cameras_in(bag, contents)) {
    RecordedCamera camera;
    camera.name = found.camera;
    camera.frames = bag;
    camera.topic = found.picture.name;
    recording.cameras.push_back(std::move(camera));
  }
  return recording;
}

std::string topic_of(const std::filesystem::path& bag, const std::string& camera, const std::string& topic) {
  bags::Contents contents;
  if (!topic.empty()) {
    contents = bags::contents_of(bag);
    const auto named = std::ranges::find(contents.topics, topic, &bags::BagTopic::name);
    if (named != contents.topics.end() && bags::is_picture(*named)) return topic;
    throw files::ConfigError(bag, 0,
                             (named == contents.topics.end()
                                  ? "has no topic " + files::printable(topic, 80)
                                  : files::printable(topic, 80) + " is of type " + files::printable(named->type, 80) +
                                        ", not of sensor_msgs/Image or CompressedImage") +
                                 " (frames of camera " + camera + "); " + other_topics(contents));
  }
  const auto cameras = cameras_in(bag, contents);
  if (cameras.size() == 1) return cameras.front().picture.name;
  const auto own = std::ranges::find(cameras, camera, &bags::CameraTopics::camera);
  if (own != cameras.end()) return own->picture.name;
  throw files::ConfigError(
      bag, 0,
      fmt::format("has several topics of pictures, and none is called {0}: say which is camera {0}, with topic: in a "
                  "recording.yaml or {0}={1}:{2} in a command; they are {3}",
                  camera, bag.filename().string(), cameras.front().picture.name, names_of(cameras)));
}

BagPictures::BagPictures(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded)
    : camera_(camera),
      selection_(camera),
      warnings_(warnings),
      keeps_encoded_(keeps_encoded),
      messages_(camera.frames, camera.topic) {
  decoder_.depth().state(camera.bits);
  measure_period();
}

void BagPictures::measure_period() {
  bags::TopicReader first(camera_.frames, camera_.topic);
  std::vector<std::int64_t> steps, logged, stamped;
  while (logged.size() <= frames_for_period) {
    const auto message = first.next();
    if (!message) break;
    const auto picture = bags::picture_of(*message);
    is_stamped_ = is_stamped_ || (picture && picture->stamp_ns != 0);
    logged.push_back(message->logged_at_ns), stamped.push_back(picture ? picture->stamp_ns : 0);
  }
  const std::vector<std::int64_t>& times = is_stamped_ ? stamped : logged;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  if (steps.empty()) return;
  period_ = capture::Duration(std::max<std::int64_t>(0, files::median(std::move(steps))));
}

// header.stamp, or when it was recorded
std::int64_t BagPictures::time_of(const bags::BagMessage& message) const {
  const auto picture = is_stamped_ ? bags::picture_of(message) : std::nullopt;
  return picture ? picture->stamp_ns : message.logged_at_ns;
}

// Recorders with several threads, and networks, change the order of neighbours.
std::optional<bags::BagMessage> BagPictures::next_by_time() {
  while (waiting_.size() <= most_out_of_order) {
    auto message = messages_.next();
    if (!message) break;
    const std::int64_t time = time_of(*message);
    waiting_.emplace(time, std::move(*message));
  }
  if (waiting_.empty()) return std::nullopt;
  return std::move(waiting_.extract(waiting_.begin()).mapped());
}

std::optional<Shown> BagPictures::next() {
  const auto last = selection_.last();
  while (!last || index_ <= *last) {
    const auto message = next_by_time();
    std::ranges::move(messages_.take_warnings(), std::back_inserter(warnings_));
    if (!message) {
      if (lost_ > most_lost_warnings)
        warn(std::to_string(lost_ - most_lost_warnings) + " more frames that do not decode");
      lost_ = 0;
      return std::nullopt;
    }
    const std::int64_t number = index_++;
    if (!selection_.contains(number)) continue;
    const auto picture = bags::picture_of(*message);
    Shown shown{.index = number, .stamp = {}, .image = {}};
    if (picture && !is_stamped_ && !std::exchange(has_warned_of_stamps_, true))
      warn(
          "its messages have no time stamps (header.stamp is 0): the times of recording them are used, which are late "
          "by transport and load: calibrate the latency (huetrack-calibrate time)");
    shown.stamp =
        capture::Timestamp{capture::Duration(picture && is_stamped_ ? picture->stamp_ns : message->logged_at_ns)};
    problem_ = "its message is damaged";
    std::optional<capture::Image> image;
    if (picture && picture->is_compressed) {
      const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(picture->data.begin(), picture->data.end());
      image = decoder_.decode(bytes);
      if (image && keeps_encoded_ && is_jpeg(*bytes) && !decoder_.turns()) shown.jpeg = bytes;
      for (const std::string& note : decoder_.take_notes()) warn(note);
      problem_ = decoder_.take_problem() + " (format \"" + files::printable(picture->encoding) + "\")";
      if (is_of_film(*picture)) problem_ += ", but a part of a film, as H.264: convert these messages to a video";
    } else if (picture) {
      image = raw(*message, *picture);
    }
    if (image)
      shown.image = std::move(*image);
    else if (++lost_ <= most_lost_warnings)
      warn("frame " + std::to_string(number) + " does not decode: " + problem_);
    return shown;
  }
  return std::nullopt;
}

// The message's own bytes, without a copy where Image has the format.
std::optional<capture::Image> BagPictures::raw(const bags::BagMessage& message, const bags::PictureMessage& picture) {
  const auto encoding = std::ranges::find(ros_encodings, picture.encoding, &RosEncoding::name);
  if (encoding == ros_encodings.end()) {
    problem_ =
        "its encoding is \"" + files::printable(picture.encoding) + "\", no picture of a camera that is supported";
    return std::nullopt;
  }
  const AVPixelFormat format = picture.is_big_endian ? encoding->big : encoding->little;
  const int width = static_cast<int>(std::min<std::uint32_t>(picture.width, 1 << 15));
  const int height = static_cast<int>(std::min<std::uint32_t>(picture.height, 1 << 15));
  capture::FramePtr frame(capture::not_null(av_frame_alloc()));
  std::array<int, 4> least{};
  if (width < 1 || height < 1 || static_cast<std::int64_t>(width) * height > largest_picture ||
      av_image_fill_linesizes(least.data(), format, width) < 0 || picture.step > std::uint32_t{1} << 20 ||
      static_cast<int>(picture.step) < least[0]) {
    problem_ =
        fmt::format("its message says {}x{} pixels and {} bytes a row", picture.width, picture.height, picture.step);
    return std::nullopt;
  }
  frame->format = format;
  frame->width = width;
  frame->height = height;
  frame->linesize[0] = static_cast<int>(picture.step);
  frame->linesize[1] = least[1] == 0 ? 0 : static_cast<int>(picture.step) * (least[1] / least[0]);  // nv12, nv21, nv24
  auto* bytes = const_cast<std::uint8_t*>(picture.data.data());                                     // read only
  const int needed = av_image_fill_pointers(frame->data, format, height, bytes, frame->linesize);
  // The last row may lack its padding.
  if (needed < 0 ||
      static_cast<std::size_t>(needed) > picture.data.size() + picture.step - static_cast<std::size_t>(least[0])) {
    problem_ = fmt::format("it has {} bytes instead of {}", picture.data.size(), needed);
    return std::nullopt;
  }
  auto owner = std::make_unique<std::shared_ptr<const void>>(message.owner);
  frame->buf[0] = capture::not_null(
      av_buffer_create(bytes, picture.data.size(), release_owner, owner.get(), AV_BUFFER_FLAG_READONLY));
  owner.release();
  problem_ = "FFmpeg cannot convert " + picture.encoding;
  return decoder_.image_of(std::move(frame));
}

}  // namespace huetrack::recordings
