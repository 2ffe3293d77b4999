#include "idl/topics.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

namespace huetrack::idl {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::Duration_t;

namespace {

constexpr std::uint32_t ms = 1'000'000;  // nanoseconds

// Samples hold strings and sequences, so their size varies. Payloads are allocated when they are needed and used again:
// preallocated ones have the size of the longest sample there could be, which is 20 MB for the topics of the pages.
constexpr auto growing = eprosima::fastrtps::rtps::DYNAMIC_REUSABLE_MEMORY_MODE;

// Fast DDS' default is 10 instances, and the eleventh target would silently not be there.
template <typename Qos>
void without_instance_limit(Qos& qos) {
  qos.resource_limits().max_instances = 0;
  qos.resource_limits().max_samples_per_instance = 0;
  qos.resource_limits().max_samples = 0;
}

dds::DataWriterQos reliable_writer(int depth) {
  dds::DataWriterQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.reliability().max_blocking_time = Duration_t(0, 20 * ms);  // a full socket must not hold the tracking up
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = Duration_t(0, 200 * ms);
  qos.data_sharing().off();  // shared memory only where the user's XML asks for it
  qos.endpoint().history_memory_policy = growing;
  without_instance_limit(qos);
  return qos;
}

dds::DataReaderQos reliable_reader(int depth) {
  dds::DataReaderQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.data_sharing().off();
  qos.endpoint().history_memory_policy = growing;
  without_instance_limit(qos);
  return qos;
}

constexpr std::uint32_t liveliness_lease_s = 1;

}  // namespace

std::string ros2_pose_topic(std::string_view target) {
  return "rt/huetrack/" + std::string(target) + "/pose";
}

std::string ros2_image_topic(std::string_view camera) {
  return "rt/huetrack/" + std::string(camera) + "/image/compressed";
}

std::string ros2_camera_info_topic(std::string_view camera) {
  return "rt/huetrack/" + std::string(camera) + "/camera_info";
}

std::string ros2_camera_pose_topic(std::string_view camera) {
  return "rt/huetrack/camera/" + std::string(camera) + "/pose";
}

std::string ros2_user_data(std::string_view type_hash) {
  return "typehash=" + std::string(type_hash) + ";";
}

PublisherIdentity PublisherIdentity::of_this_process(std::vector<std::string> targets) {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = '?';
  return {host.data(), static_cast<std::uint32_t>(::getpid()), std::move(targets)};
}

std::string PublisherIdentity::user_data() const {
  std::string text = "host=" + host + ";pid=" + std::to_string(pid) + ";targets=";
  for (std::size_t i = 0; i < targets.size(); ++i) text += (i > 0 ? "," : "") + targets[i];
  return text + ";";
}

std::optional<PublisherIdentity> PublisherIdentity::from(std::string_view user_data) {
  const auto take = [&](std::string_view key) -> std::optional<std::string_view> {
    const std::size_t end = user_data.find(';');
    if (!user_data.starts_with(key) || end == std::string_view::npos) return std::nullopt;
    const std::string_view value = user_data.substr(key.size(), end - key.size());
    user_data.remove_prefix(end + 1);
    return value;
  };
  PublisherIdentity identity;
  const auto host = take("host=");
  const auto pid = host ? take("pid=") : std::nullopt;
  auto targets = pid ? take("targets=") : std::nullopt;
  if (!targets || std::from_chars(pid->data(), pid->data() + pid->size(), identity.pid).ec != std::errc{})
    return std::nullopt;
  identity.host = *host;
  while (!targets->empty()) {
    const std::size_t comma = std::min(targets->find(','), targets->size());
    identity.targets.emplace_back(targets->substr(0, comma));
    targets->remove_prefix(std::min(comma + 1, targets->size()));
  }
  return identity;
}

bool is_target_name(std::string_view name) {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto allowed = [&](char c) { return letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  return !name.empty() && letter(name.front()) && std::ranges::all_of(name, allowed) &&
         name.find("__") == std::string_view::npos;
}

dds::DataWriterQos object_position_writer_qos() {
  dds::DataWriterQos qos = reliable_writer(10);
  qos.liveliness().kind = dds::AUTOMATIC_LIVELINESS_QOS;
  qos.liveliness().lease_duration = Duration_t(liveliness_lease_s, 0);
  qos.liveliness().announcement_period = Duration_t(0, 333 * ms);
  return qos;
}

dds::DataReaderQos object_position_reader_qos() {
  dds::DataReaderQos qos = reliable_reader(1000);
  qos.liveliness().kind = dds::AUTOMATIC_LIVELINESS_QOS;
  qos.liveliness().lease_duration = Duration_t(liveliness_lease_s, 0);
  return qos;
}

dds::DataWriterQos status_writer_qos() {
  dds::DataWriterQos qos = reliable_writer(1);
  qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  return qos;
}

dds::DataReaderQos status_reader_qos() {
  dds::DataReaderQos qos = reliable_reader(1);
  qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  return qos;
}

dds::DataWriterQos preview_writer_qos() {
  dds::DataWriterQos qos = reliable_writer(1);
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  return qos;
}

dds::DataReaderQos preview_reader_qos() {
  dds::DataReaderQos qos = reliable_reader(1);
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  return qos;
}

dds::DataWriterQos teach_writer_qos() {
  return reliable_writer(10);
}

dds::DataReaderQos teach_reader_qos() {
  return reliable_reader(10);
}

dds::DataWriterQos ros2_writer_qos() {
  return reliable_writer(10);
}

}  // namespace huetrack::idl
