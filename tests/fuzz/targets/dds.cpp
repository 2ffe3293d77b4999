// A sample as it comes over the bus. The first byte chooses its type; the rest is the serialized payload, no longer
// than a reader of ours takes.
#include <fastcdr/exceptions/Exception.h>
#include <fastdds/rtps/common/InstanceHandle.h>
#include <fastdds/rtps/common/SerializedPayload.h>

#include <array>

#include "clients/huetrack/printable_sample.h"
#include "clients/huetrack/sample_format.h"
#include "clients/live_view/events.h"
#include "color/color_region.h"
#include "fuzz/fuzz_target.h"
#include "hosts/frame_message.h"
#include "hosts/wanted_matches.h"
#include "hosts/wanted_outlines.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/camera_timesPubSubTypes.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/object_setPubSubTypes.h"
#include "idl/topics.h"

using namespace huetrack;
using namespace std::chrono_literals;

namespace {

template <typename PubSubType, typename Use>
void receive(const char* topic, std::string_view bytes, Use&& use) {
  if (const auto largest = idl::largest_sample(topic); largest && bytes.size() > *largest) return;
  PubSubType type;
  typename PubSubType::type sample;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  if (!type.deserialize(&payload, &sample)) return;
  // Fast DDS asks for the key of a sample that came without one, in its own thread.
  eprosima::fastrtps::rtps::InstanceHandle_t key;
  if (type.m_isGetKeyDefined) type.getKey(&sample, &key);
  use(sample);
}

template <typename Sample>
void print(Sample& sample) {
  live_view::to_json(sample);
  client::make_printable(sample);
  for (const auto format : {client::Format::text, client::Format::csv, client::Format::json, client::Format::tum})
    client::line(format, sample, 0, 4);
}

// A frame of another host's camera, as the tracker reads it: all its pixels are in memory.
void decode(msg::CameraFrame& message) {
  const auto& bytes = message.bytes();
  if (fuzz::is_long_to_decode({reinterpret_cast<const char*>(bytes.data()), bytes.size()})) return;
  capture::JpegReader decoder;
  const capture::Image image = hosts::from_message(std::move(message), decoder).pixels;
  capture::require_all(image);
  volatile unsigned sum = 0;  // so that the reading stays
  for (int p = 0; p < 3; ++p) {
    const capture::Plane& plane = image.planes[static_cast<std::size_t>(p)];
    for (int row = 0; plane.data != nullptr && row < capture::plane_rows(image.format, p, image.height); ++row)
      for (std::size_t i = 0; i < capture::plane_row_bytes(image.format, p, image.width); ++i)
        sum = sum + plane.data[row * plane.stride + static_cast<std::ptrdiff_t>(i)];
  }
}

// What matches in a frame of another host's camera, as the tracker reads it.
void read_matches(msg::CameraMatches& message) {
  const auto& bytes = message.bytes();
  if (fuzz::is_long_to_decode({reinterpret_cast<const char*>(bytes.data()), bytes.size()})) return;
  capture::JpegReader decoder;
  capture::Image latest;
  const capture::Frame frame = hosts::from_message(std::move(message), decoder, latest);
  constexpr int longest = 4096;  // the tracker takes only what has the size of the rig's camera
  if (!frame.matches || frame.pixels.width > longest || frame.pixels.height > longest) return;
  volatile unsigned sum = 0;  // so that the reading stays
  for (const auto& patch : frame.matches->patches)
    for (int v = 0; v < patch.image.height; ++v)
      for (int u = 0; u < patch.image.width; ++u)
        sum = sum + (patch.image.format == capture::PixelFormat::bgr ? capture::bgr_at(patch.image, u, v).g
                                                                     : capture::yuv_at(patch.image, u, v).v);
  color::MatchBits bits(frame.pixels.width, frame.pixels.height);
  color::RegionFinder finder;
  for (const auto& of : frame.matches->colors) {
    bits.look_at(of);
    finder.components(bits, 8, {}, 40, 200, 2);
  }
}

}  // namespace

HUETRACK_FUZZ_TARGET(dds) {
  if (input.empty()) return;
  const std::string_view bytes = input.substr(1);
  const auto to_json = [](const auto& sample) { live_view::to_json(sample); };
  switch (static_cast<unsigned char>(input.front()) % 20) {
    case 0:
      return receive<msg::ObjectPositionPubSubType>(idl::object_position_topic, bytes,
                                                    [](auto& sample) { print(sample); });
    case 1:
      return receive<msg::CameraPosePubSubType>(idl::camera_pose_topic, bytes, [](auto& sample) { print(sample); });
    case 2:
      return receive<msg::ServiceStatusPubSubType>(idl::status_topic, bytes, [](auto& sample) {
        live_view::to_json(sample, 0);
        client::make_printable(sample);
        client::text(sample, 0);
      });
    case 3:
      return receive<msg::ScenePubSubType>(idl::scene_topic, bytes, to_json);
    case 4:
      return receive<msg::PreviewPubSubType>(idl::preview_topic, bytes, to_json);
    case 5:
      return receive<msg::CameraMapPubSubType>(idl::camera_map_topic, bytes, to_json);
    case 6:
      return receive<msg::TeachReplyPubSubType>(idl::teach_reply_topic, bytes, to_json);
    case 7:
      return receive<msg::TeachRequestPubSubType>(idl::teach_request_topic, bytes, [](auto&) {});
    case 8:
      return receive<msg::CameraTimesPubSubType>(idl::camera_times_topic, bytes, [](auto& sample) {
        live_view::to_json(sample);
        client::make_printable(sample);
      });
    case 9:
      return receive<msg::ControlReplyPubSubType>(idl::control_reply_topic, bytes, to_json);
    case 10:
      return receive<msg::ControlRequestPubSubType>(idl::control_request_topic, bytes, [](auto&) {});
    case 11:
      return receive<msg::HostClocksPubSubType>(idl::host_clocks_topic, bytes, [](auto& sample) {
        live_view::to_json(sample);
        client::make_printable(sample);
        client::text({}, 0, nullptr, {}, {}, &sample);
      });
    case 12:
      if (const auto identity = idl::PublisherIdentity::from(bytes))
        idl::PublisherIdentity::from(identity->user_data());
      return;
    case 13:
      return receive<msg::ObjectSetPubSubType>(idl::object_set_topic, bytes, [](auto& sample) {
        client::make_printable(sample);
        client::text({}, 0, nullptr, {}, std::span(&sample, 1));
      });
    case 14:
      return receive<msg::CameraHostPubSubType>(idl::camera_host_topic, bytes, [](auto&) {});
    case 15:
      return receive<msg::CameraFramePubSubType>("huetrack/frames", bytes, decode);
    case 16:
      return receive<msg::CameraMatchesPubSubType>("huetrack/matches", bytes, read_matches);
    case 17:
      return receive<msg::LookedForColorsPubSubType>(idl::looked_for_topic, bytes,
                                                     [](auto& sample) { hosts::wanted_of(sample); });
    case 18:
      return receive<msg::ExpectedOutlinesPubSubType>("huetrack/outlines", bytes, [](auto& sample) {
        for (const auto& of : sample.cameras()) {
          hosts::WantedOutlines wanted;
          wanted.note(of.number(), capture::Timestamp(std::chrono::hours(1)));
          std::vector<capture::PatchPlace> places;
          if (wanted.update(sample.tracker(), of))
            wanted.places_at(capture::Timestamp(std::chrono::hours(1) + 33ms), places);
        }
      });
    default:
      return receive<msg::ClockEchoPubSubType>(idl::clock_echo_topic, bytes, [](auto&) {});
  }
}
