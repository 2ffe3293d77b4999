// The subscription to huetrack/object_position or huetrack/camera_pose, with its publishers.
#pragma once

#include <chrono>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "idl/arrivals.h"
#include "idl/dds_participant.h"
#include "idl/huetrack.h"
#include "idl/topics.h"

namespace huetrack::client {

// A sample with printable strings. Any program on the bus may publish under a name. The accepted publisher of a name is
// the first one, or a huetrackd after an unidentified program; when it ends or is silent, the next one.
template <typename Sample>
struct Received {
  Sample sample;
  std::string other_publisher;  // description of the sender; empty: the accepted one
};

// thread-compatible. Sample: msg::ObjectPosition or msg::CameraPose.
template <typename Sample>
class SampleSubscription {
 public:
  explicit SampleSubscription(const idl::ParticipantOptions& options);  // throws as DdsParticipant

  // Waits for a sample; nullopt: timeout.
  std::optional<Received<Sample>> next(std::chrono::milliseconds at_most);

  // Changes of the publishers since the last call, one sentence each: one appeared, went away (killed ones after about
  // 1 s), or has an incompatible QoS.
  std::vector<std::string> news();

  int publishers() const { return publishers_; }                     // alive, as of the last news()
  std::set<std::string> targets() const;                             // announced targets; of poses: cameras
  std::set<std::string> others() const;                              // announced cameras; of poses: targets
  bool network_changed() { return participant_.network_changed(); }  // see DdsParticipant
  const idl::DdsParticipant& participant() const { return participant_; }

 private:
  // Identifies writers by their USER_DATA. thread-safe: called by Fast DDS' threads.
  class Announcements : public eprosima::fastdds::dds::DomainParticipantListener {
   public:
    void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
    std::optional<idl::PublisherIdentity> find(const eprosima::fastrtps::rtps::GUID_t& writer) const;
    bool has_gone(const eprosima::fastrtps::rtps::GUID_t& writer) const;
    std::set<std::string> names_on(const std::string& topic) const;

   private:
    struct Known {
      std::optional<idl::PublisherIdentity> identity;  // nullopt: unidentified
      std::string topic;                               // of positions or of poses
      bool there = true;                               // false: gone, kept for the message about it
    };
    mutable std::mutex mutex_;
    std::map<eprosima::fastrtps::rtps::GUID_t, Known> known_;  // guarded by mutex_
  };

  // The accepted publisher of a name.
  struct Accepted {
    eprosima::fastrtps::rtps::GUID_t writer;
    std::optional<idl::PublisherIdentity> identity;
    std::chrono::steady_clock::time_point last_sample;
  };
  // Description of the writer, or empty if it is the accepted publisher of the name.
  std::string publisher_unless_accepted(const std::string& name, const eprosima::fastrtps::rtps::GUID_t& writer);

  Announcements announcements_;  // before participant_: it outlives it
  idl::DdsParticipant participant_;
  eprosima::fastdds::dds::DataReader& reader_;
  idl::Arrivals arrivals_;
  int publishers_ = 0;
  std::map<std::string, Accepted> accepted_;  // by target or camera
};

using PositionSubscription = SampleSubscription<msg::ObjectPosition>;

}  // namespace huetrack::client
