#include "idl/topics.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <utility>

namespace huetrack::idl {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::Duration_t;

namespace {

constexpr std::uint32_t ms = 1'000'000;  // nanoseconds

// Sample sizes vary. A writer allocates payloads when needed and reuses them.
constexpr auto growing = eprosima::fastrtps::rtps::DYNAMIC_REUSABLE_MEMORY_MODE;

constexpr std::uint32_t KiB = 1024;
// Limits of a topic's reader. Samples wait in it for lost earlier ones, and their memory is kept: at most about 16 MB
// per topic with few keys.
struct Room {
  std::string_view topic;
  std::uint32_t largest;   // bytes of a sample
  std::int32_t instances;  // at once; those of writers that left are replaced
};
constexpr std::int32_t most_instances = 4000;  // some hundred bytes each
constexpr Room rooms[] = {
    {object_position_topic, 16 * KiB, most_instances},
    {camera_pose_topic, 4 * KiB, most_instances},
    {object_set_topic, 64 * KiB, 256},
    {status_topic, 256 * KiB, 64},
    {camera_times_topic, 64 * KiB, 256},
    {scene_topic, 1024 * KiB, 16},
    {preview_topic, 2048 * KiB, most_instances},
    {camera_map_topic, 128 * KiB, 128},
    {teach_request_topic, 64 * KiB, 1},
    {teach_reply_topic, 4096 * KiB, 1},
    {control_request_topic, 16 * KiB, 1},
    {control_reply_topic, 512 * KiB, 1},
    {camera_host_topic, 64 * KiB, 256},
    {clock_probe_topic, 1 * KiB, 1},
    {clock_echo_topic, 1 * KiB, 1},
    {host_clocks_topic, 64 * KiB, 256},
    {looked_for_topic, 8 * KiB, 2000},
};

const Room* room_of(std::string_view topic) {
  const auto* const known = std::ranges::find(rooms, topic, &Room::topic);
  return known == std::end(rooms) ? nullptr : known;
}

constexpr std::size_t longest_user_data = 16 * KiB;  // of some hundred targets
constexpr int most_cameras_of_host = 32;             // with `send: matches`
// Frames per camera that wait for a retransmission, which takes some 50 ms: over four at 120 frames/s.
constexpr int matches_kept = 8;
constexpr int samples_from_the_start = 4;  // allocated at the start; more on demand

// Fast DDS' default is 10 instances, so an eleventh target would silently be missing.
template <typename Qos>
void without_instance_limit(Qos& qos) {
  qos.resource_limits().max_instances = 0;
  qos.resource_limits().max_samples_per_instance = 0;
  qos.resource_limits().max_samples = 0;
}

dds::DataWriterQos reliable_writer(int depth) {
  dds::DataWriterQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.reliability().max_blocking_time = Duration_t(0, 20 * ms);  // a full socket must not delay tracking
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = Duration_t(0, 200 * ms);
  qos.data_sharing().off();  // shared memory only by the user's XML
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
  // Every payload has largest_sample() bytes; larger samples are rejected.
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  qos.resource_limits().allocated_samples = samples_from_the_start;
  qos.resource_limits().max_instances = most_instances;
  qos.resource_limits().max_samples_per_instance = depth;
  qos.resource_limits().max_samples = depth * most_instances;
  return qos;
}

constexpr std::uint32_t liveliness_lease_s = 1;

}  // namespace

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
  if (user_data.size() > longest_user_data) return std::nullopt;
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
  return !name.empty() && name.size() <= longest_name && letter(name.front()) && std::ranges::all_of(name, allowed) &&
         name.find("__") == std::string_view::npos;
}

std::optional<std::uint32_t> largest_sample(std::string_view topic) {
  const Room* const room = room_of(topic);
  return room == nullptr ? std::nullopt : std::optional(room->largest);
}

void limit_instances(std::string_view topic, dds::DataReaderQos& qos) {
  const Room* const room = room_of(topic);
  if (room == nullptr) return;
  auto& limits = qos.resource_limits();
  limits.max_instances = std::min(limits.max_instances, room->instances);
  limits.max_samples = limits.max_instances * limits.max_samples_per_instance;
}

dds::DataWriterQos object_position_writer_qos() {
  dds::DataWriterQos qos = reliable_writer(10);
  qos.liveliness().kind = dds::AUTOMATIC_LIVELINESS_QOS;
  qos.liveliness().lease_duration = Duration_t(liveliness_lease_s, 0);
  qos.liveliness().announcement_period = Duration_t(0, 333 * ms);
  return qos;
}

dds::DataReaderQos object_position_reader_qos(int depth) {
  dds::DataReaderQos qos = reliable_reader(depth);
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
  return reliable_reader(4);
}

dds::DataWriterQos camera_frames_writer_qos() {
  dds::DataWriterQos qos = reliable_writer(4);
  qos.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
  // Not too early: frames that are still in the network's queue would be sent again and again.
  qos.reliable_writer_qos().times.heartbeatPeriod = Duration_t(0, 20 * ms);
  qos.reliable_writer_qos().times.nackResponseDelay = Duration_t(0, 10 * ms);
  // When an unacknowledged sample is replaced, Fast DDS adds a heartbeat to every fragment. The first fragment then
  // announces the whole frame, whose rest is requested and sent twice by a network that is already too slow.
  qos.reliable_writer_qos().disable_heartbeat_piggyback = true;
  return qos;
}

dds::DataWriterQos camera_matches_writer_qos() {
  dds::DataWriterQos qos = camera_frames_writer_qos();
  qos.history().depth = matches_kept;
  // Few datagrams, but for the picture of each second. Fast DDS' asynchronous thread would spin as long as a capture
  // thread holds the writer's mutex.
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = Duration_t(0, 40 * ms);
  return qos;
}

dds::DataReaderQos camera_frames_reader_qos() {
  dds::DataReaderQos qos = reliable_reader(4);
  qos.reliable_reader_qos().times.heartbeatResponseDelay = Duration_t(0, 1 * ms);
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().max_samples = 4;
  return qos;
}

dds::DataReaderQos camera_matches_reader_qos() {
  dds::DataReaderQos qos = camera_frames_reader_qos();
  qos.history().depth = matches_kept;
  qos.resource_limits().max_instances = most_cameras_of_host;
  qos.resource_limits().max_samples_per_instance = matches_kept;
  qos.resource_limits().max_samples = most_cameras_of_host * matches_kept;
  return qos;
}

dds::DataWriterQos clock_writer_qos() {
  dds::DataWriterQos qos = reliable_writer(4);
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  return qos;
}

dds::DataReaderQos clock_reader_qos() {
  dds::DataReaderQos qos = reliable_reader(64);  // all hosts answer at the same time
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  return qos;
}

dds::DataWriterQos ros2_writer_qos() {
  return reliable_writer(10);
}

}  // namespace huetrack::idl
