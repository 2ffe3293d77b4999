#include "clients/bag/picture_bag.h"

#include <map>
#include <span>
#include <stop_token>
#include <utility>

#include "calib/model/rig_yaml.h"
#include "capture/frames/jpeg_encoder.h"
#include "clients/bag/ros_messages.h"
#include "idl/camera_info.h"
#include "idl/ros_fields.h"
#include "idl/topics.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::bag {
namespace {

namespace sensor = sensor_msgs::msg::dds_;
constexpr int quality = 95;  // of pictures that are not recorded as JPEG
// A replay delivers frames in order of arrival, which may differ from that of their times.
constexpr std::chrono::seconds at_most_late{2};

std::string image_definition() {
  return "std_msgs/Header header\nstring format\nuint8[] data\n" + header_definition();
}

std::string info_definition() {
  return "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
         "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nRegionOfInterest roi\n" +
         separator() +
         "MSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\n"
         "bool do_rectify\n" +
         header_definition();
}

sensor::CameraInfo_ info_of(const calib::Camera& camera) {
  const calib::CameraModel& model = camera.model;
  std::vector<double> distortion;
  std::visit([&](const auto& lens) { distortion.assign(lens.distortion.begin(), lens.distortion.end()); },
             model.lens());
  return idl::camera_info(std::uint32_t(camera.image_size.width), std::uint32_t(camera.image_size.height), model.name(),
                          {model.fx(), model.fy(), model.cx(), model.cy()}, std::move(distortion));
}

// Some webcams omit the Huffman tables, which is not allowed in single pictures (ITU-T T.81, B.2.4.2).
bool has_huffman_tables(std::span<const std::uint8_t> jpeg) {
  constexpr std::uint8_t marker = 0xff, table = 0xc4, scan = 0xda;
  for (std::size_t i = 2; i + 4 <= jpeg.size() && jpeg[i] == marker;) {
    if (jpeg[i + 1] == table) return true;
    if (jpeg[i + 1] == scan) return false;
    i += 2 + std::size_t(jpeg[i + 2] << 8 | jpeg[i + 3]);
  }
  return false;
}

std::vector<std::uint8_t> jpeg_of(const capture::Frame& frame) {
  if (frame.encoded && has_huffman_tables(*frame.encoded)) return *frame.encoded;
  return capture::encode_picture(frame.pixels, {frame.pixels.width, frame.pixels.height}, quality);
}

}  // namespace

struct RecordedPictures::Impl {
  calib::CameraRig rig;
  recordings::Recording recording;
  std::vector<std::string> names;
  std::optional<recordings::ReplaySource> source;
  std::vector<Topic> topics;
  std::vector<std::optional<sensor::CameraInfo_>> infos;  // per camera
  std::vector<std::size_t> topic_of;                      // per camera: of its images; that of its info follows
  std::chrono::nanoseconds offset{0};
  std::multimap<std::int64_t, Message> waiting;
  std::vector<std::string> warnings;
  bool has_ended = false;

  void read_on() {
    auto frame = source->next(std::stop_token());
    if (!frame) {
      has_ended = true;
      return;
    }
    if (frame->status != capture::FrameStatus::ok) return;
    const auto c = std::size_t(frame->camera);
    const std::int64_t at_ns = ros_time(frame->captured_at.time_since_epoch(), offset);
    sensor::CompressedImage_ image;
    idl::set_header(image.header(), at_ns, names[c]);
    image.format("jpeg");
    image.data(jpeg_of(*frame));
    waiting.emplace(at_ns, Message{topic_of[c], at_ns, cdr_of(image)});
    if (!infos[c]) return;
    idl::set_header(infos[c]->header(), at_ns, names[c]);
    waiting.emplace(at_ns, Message{topic_of[c] + 1, at_ns, cdr_of(*infos[c])});
  }
};

RecordedPictures::RecordedPictures(std::span<const std::string> recording, std::filesystem::path rig,
                                   std::size_t first_topic, std::chrono::nanoseconds offset)
    : impl_(std::make_unique<Impl>()) {
  impl_->offset = offset;
  impl_->recording = recordings::read_recording(recording);
  const std::filesystem::path beside = impl_->recording.file.parent_path() / "rig.yaml";
  if (rig.empty() && std::filesystem::exists(beside)) rig = beside;
  if (!rig.empty()) impl_->rig = calib::read_rig(rig);
  recordings::ReplayOptions options{.keeps_encoded = true};
  for (const recordings::RecordedCamera& camera : impl_->recording.cameras) {
    impl_->names.push_back(camera.name);
    const auto in_rig = impl_->rig.index_of(camera.name);
    const calib::Camera* known = in_rig ? &impl_->rig.cameras[std::size_t(*in_rig)] : nullptr;
    // Mid-exposure, as for the track's positions.
    options.timing.push_back({.latency = capture::duration_of(known ? known->timing.latency_s.value_or(0) : 0),
                              .readout = capture::duration_of(known ? known->timing.readout_s.value_or(0) : 0)});
    const std::string word = word_of(camera.name);
    impl_->topic_of.push_back(first_topic + impl_->topics.size());
    impl_->topics.push_back(
        {idl::ros2_image_topic(word).substr(rtps_prefix), "sensor_msgs/msg/CompressedImage", image_definition()});
    impl_->infos.push_back(known ? std::optional(info_of(*known)) : std::nullopt);
    if (known)
      impl_->topics.push_back(
          {idl::ros2_camera_info_topic(word).substr(rtps_prefix), "sensor_msgs/msg/CameraInfo", info_definition()});
    else
      impl_->warnings.push_back(rig.empty() ? "no rig is known (--rig): camera " + camera.name + " has no CameraInfo"
                                            : rig.string() + " has no camera " + camera.name + ": no CameraInfo");
  }
  impl_->source.emplace(impl_->recording, impl_->names, options);
}

RecordedPictures::~RecordedPictures() = default;

const std::vector<Topic>& RecordedPictures::topics() const {
  return impl_->topics;
}

const calib::CameraRig& RecordedPictures::rig() const {
  return impl_->rig;
}

std::optional<Message> RecordedPictures::next() {
  auto& waiting = impl_->waiting;
  const std::int64_t late_ns = std::chrono::nanoseconds(at_most_late).count();
  while (!impl_->has_ended && (waiting.empty() || waiting.rbegin()->first - waiting.begin()->first < late_ns))
    impl_->read_on();
  if (waiting.empty()) return std::nullopt;
  Message message = std::move(waiting.begin()->second);
  waiting.erase(waiting.begin());
  return message;
}

std::vector<std::string> RecordedPictures::take_warnings() {
  for (std::string& warning : impl_->source->take_warnings()) impl_->warnings.push_back(std::move(warning));
  return std::exchange(impl_->warnings, {});
}

std::optional<double> RecordedPictures::started_at_s() const {
  const auto& at = impl_->recording.started_at;
  return at ? std::optional(capture::seconds(*at)) : std::nullopt;
}

}  // namespace huetrack::bag
