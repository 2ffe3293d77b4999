#include "position_subscription.h"

#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "calib/files/document_path.h"
#include "calib/files/text_file.h"
#include "idl/huetrackPubSubTypes.h"
#include "printable_sample.h"

namespace huetrack::client {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::types::ReturnCode_t;

namespace {

template <typename Sample>
struct Of;
template <>
struct Of<msg::ObjectPosition> {
  using Type = msg::ObjectPositionPubSubType;
  static constexpr const char* topic = idl::object_position_topic;
  static constexpr const char* other_topic = idl::camera_pose_topic;
  static constexpr const char* named = ", targets";
};
template <>
struct Of<msg::CameraPose> {
  using Type = msg::CameraPosePubSubType;
  static constexpr const char* topic = idl::camera_pose_topic;
  static constexpr const char* other_topic = idl::object_position_topic;
  static constexpr const char* named = ", camera";
};

std::string description_of(const std::optional<idl::PublisherIdentity>& identity, const char* named) {
  if (!identity) return "a program that is not huetrackd";
  std::string text = "process " + std::to_string(identity->pid) + " on " + files::printable(identity->host);
  if (!identity->targets.empty()) text += named;
  for (const std::string& target : identity->targets) text += " " + files::printable(target);
  return text;
}

bool is_same_process(const std::optional<idl::PublisherIdentity>& a, const std::optional<idl::PublisherIdentity>& b) {
  return a && b && a->host == b->host && a->pid == b->pid;
}

constexpr auto silent_after = std::chrono::seconds(1);  // the lease of the publishers' liveliness
constexpr std::size_t most_announced = 1000,
                      most_writers = 1000;  // that are kept in mind: anybody may announce any number

}  // namespace

template <typename Sample>
void SampleSubscription<Sample>::Announcements::on_publisher_discovery(dds::DomainParticipant*,
                                                                       rtps::WriterDiscoveryInfo&& info) {
  const std::string topic(info.info.topicName().c_str());
  if (topic != Of<Sample>::topic && topic != Of<Sample>::other_topic) return;
  const std::lock_guard lock(mutex_);
  if (info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
    if (const auto it = known_.find(info.info.guid()); it != known_.end()) it->second.there = false;
    return;
  }
  if (known_.size() >= most_writers) std::erase_if(known_, [](const auto& entry) { return !entry.second.there; });
  if (known_.size() >= most_writers) return;
  const auto& bytes = info.info.m_qos.m_userData;
  known_[info.info.guid()] = {idl::PublisherIdentity::from(std::string(bytes.begin(), bytes.end())), topic};
}

template <typename Sample>
std::optional<idl::PublisherIdentity> SampleSubscription<Sample>::Announcements::find(
    const rtps::GUID_t& writer) const {
  const std::lock_guard lock(mutex_);
  const auto it = known_.find(writer);
  return it == known_.end() ? std::nullopt : it->second.identity;
}

template <typename Sample>
bool SampleSubscription<Sample>::Announcements::has_gone(const rtps::GUID_t& writer) const {
  const std::lock_guard lock(mutex_);
  const auto it = known_.find(writer);
  return it != known_.end() && !it->second.there;
}

template <typename Sample>
std::set<std::string> SampleSubscription<Sample>::Announcements::names_on(const std::string& topic) const {
  std::set<std::string> names;
  const std::lock_guard lock(mutex_);
  for (const auto& [guid, known] : known_) {
    if (!known.there || known.topic != topic || !known.identity) continue;
    for (const std::string& name : known.identity->targets) names.insert(files::printable(name));
  }
  return names;
}

template <typename Sample>
std::string SampleSubscription<Sample>::publisher_unless_accepted(const std::string& name, const rtps::GUID_t& writer) {
  const auto now = std::chrono::steady_clock::now();
  const auto identity = announcements_.find(writer);
  const auto it = accepted_.find(name);
  if (it == accepted_.end()) {
    if (accepted_.size() >= most_announced) return description_of(identity, "");
    accepted_[name] = {writer, identity, now};
    return "";
  }
  Accepted& accepted = it->second;
  const bool is_the_one = accepted.writer == writer || is_same_process(accepted.identity, identity);
  const bool is_over = now - accepted.last_sample > silent_after || announcements_.has_gone(accepted.writer);
  if (!is_the_one && !is_over && (accepted.identity || !identity)) return description_of(identity, "");
  accepted = {writer, identity, now};
  return "";
}

template <typename Sample>
SampleSubscription<Sample>::SampleSubscription(const idl::ParticipantOptions& options)
    : participant_(options, &announcements_),
      reader_(
          participant_.create_reader<typename Of<Sample>::Type>(Of<Sample>::topic, idl::object_position_reader_qos())),
      arrivals_(reader_) {}

template <typename Sample>
std::optional<Received<Sample>> SampleSubscription<Sample>::next(std::chrono::milliseconds at_most) {
  const auto until = std::chrono::steady_clock::now() + at_most;
  Sample sample;
  dds::SampleInfo info;
  for (;;) {
    if (idl::take_next(reader_, sample, info)) {
      make_printable(sample);
      return Received<Sample>{sample, publisher_unless_accepted(name_of(sample), info.sample_identity.writer_guid())};
    }
    const auto left = until - std::chrono::steady_clock::now();
    if (left <= std::chrono::steady_clock::duration::zero()) return std::nullopt;
    arrivals_.wait(left);
  }
}

template <typename Sample>
std::vector<std::string> SampleSubscription<Sample>::news() {
  std::vector<std::string> sentences;
  dds::LivelinessChangedStatus liveliness;
  if (reader_.get_liveliness_changed_status(liveliness) == ReturnCode_t::RETCODE_OK &&
      liveliness.alive_count != publishers_) {
    const auto identity = announcements_.find(rtps::iHandle2GUID(liveliness.last_publication_handle));
    const bool more = liveliness.alive_count > publishers_;
    publishers_ = liveliness.alive_count;
    sentences.push_back((more ? "a publisher is there: " : "a publisher went away: ") +
                        description_of(identity, Of<Sample>::named) +
                        (more              ? ""
                         : publishers_ > 0 ? "; " + std::to_string(publishers_) + " left"
                                           : "; waiting for one to come back"));
  }
  dds::RequestedIncompatibleQosStatus incompatible;
  if (reader_.get_requested_incompatible_qos_status(incompatible) == ReturnCode_t::RETCODE_OK &&
      incompatible.total_count_change > 0) {
    const std::string policy = incompatible.last_policy_id == dds::LIVELINESS_QOS_POLICY_ID    ? "liveliness"
                               : incompatible.last_policy_id == dds::RELIABILITY_QOS_POLICY_ID ? "reliability"
                               : incompatible.last_policy_id == dds::DURABILITY_QOS_POLICY_ID
                                   ? "durability"
                                   : "policy " + std::to_string(incompatible.last_policy_id);
    sentences.push_back("a publisher is there, but it offers less than we ask for (" + policy +
                        "), so nothing comes from it: its XML profile, or ours, changed the QoS; see " +
                        files::document_path("idl/README.md"));
  }
  return sentences;
}

template <typename Sample>
std::set<std::string> SampleSubscription<Sample>::targets() const {
  return announcements_.names_on(Of<Sample>::topic);
}

template <typename Sample>
std::set<std::string> SampleSubscription<Sample>::others() const {
  return announcements_.names_on(Of<Sample>::other_topic);
}

template class SampleSubscription<msg::ObjectPosition>;
template class SampleSubscription<msg::CameraPose>;

}  // namespace huetrack::client
