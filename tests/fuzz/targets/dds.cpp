// A sample as it comes over the bus. The first byte chooses its type; the rest is the serialized payload.
#include <fastcdr/exceptions/Exception.h>
#include <fastdds/rtps/common/SerializedPayload.h>

#include <array>

#include "clients/huetrack/printable_sample.h"
#include "clients/huetrack/sample_format.h"
#include "clients/live_view/events.h"
#include "fuzz/fuzz_target.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/camera_timesPubSubTypes.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"

using namespace huetrack;

namespace {

template <typename PubSubType, typename Use>
void receive(std::string_view bytes, Use&& use) {
  PubSubType type;
  typename PubSubType::type sample;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  if (type.deserialize(&payload, &sample)) use(sample);
}

template <typename Sample>
void print(Sample& sample) {
  live_view::to_json(sample);
  client::make_printable(sample);
  for (const auto format : {client::Format::text, client::Format::csv, client::Format::json, client::Format::tum})
    client::line(format, sample, 0, 4);
}

}  // namespace

HUETRACK_FUZZ_TARGET(dds) {
  if (input.empty()) return;
  const std::string_view bytes = input.substr(1);
  const auto to_json = [](const auto& sample) { live_view::to_json(sample); };
  switch (static_cast<unsigned char>(input.front()) % 13) {
    case 0:
      return receive<msg::ObjectPositionPubSubType>(bytes, [](auto& sample) { print(sample); });
    case 1:
      return receive<msg::CameraPosePubSubType>(bytes, [](auto& sample) { print(sample); });
    case 2:
      return receive<msg::ServiceStatusPubSubType>(bytes, [](auto& sample) {
        live_view::to_json(sample, 0);
        client::make_printable(sample);
        client::text(sample, 0);
      });
    case 3:
      return receive<msg::ScenePubSubType>(bytes, to_json);
    case 4:
      return receive<msg::PreviewPubSubType>(bytes, to_json);
    case 5:
      return receive<msg::CameraMapPubSubType>(bytes, to_json);
    case 6:
      return receive<msg::TeachReplyPubSubType>(bytes, to_json);
    case 7:
      return receive<msg::TeachRequestPubSubType>(bytes, [](auto&) {});
    case 8:
      return receive<msg::CameraTimesPubSubType>(bytes, [](auto& sample) {
        live_view::to_json(sample);
        client::make_printable(sample);
      });
    case 9:
      return receive<msg::ControlReplyPubSubType>(bytes, to_json);
    case 10:
      return receive<msg::ControlRequestPubSubType>(bytes, [](auto&) {});
    case 11:
      return receive<msg::HostClocksPubSubType>(bytes, [](auto& sample) {
        live_view::to_json(sample);
        client::make_printable(sample);
        client::text({}, 0, nullptr, {}, {}, &sample);
      });
    default:
      if (const auto identity = idl::PublisherIdentity::from(bytes))
        idl::PublisherIdentity::from(identity->user_data());
  }
}
