// The subscription to huetrack/object_position or huetrack/camera_pose, and who publishes there.
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

// A sample, as terminals may show it. Anybody on the bus may publish under a name. The one that is believed is the
// first that was heard under it, or a huetrackd that comes after a program that does not say who it is; when it ends or
// falls silent, the next.
template <typename Sample>
struct Heard {
  Sample sample;
  std::string stranger;  // who sent it; empty: the one that is believed
};

// thread-compatible. Sample: msg::ObjectPosition or msg::CameraPose.
template <typename Sample>
class SampleSubscription {
 public:
  explicit SampleSubscription(const idl::ParticipantOptions& options);  // throws what DdsParticipant throws

  // Waits for a sample, at most for the time given; nullopt when none came.
  std::optional<Heard<Sample>> next(std::chrono::milliseconds at_most);

  // What happened to the publishers since the last call, one sentence each: one appeared, went away (killed ones too,
  // about 1 s later), or does not fit.
  std::vector<std::string> news();

  int publishers() const { return publishers_; }                     // alive, as of the last news()
  std::set<std::string> targets() const;                             // that publishers announce; cameras for poses
  std::set<std::string> others() const;                              // cameras that are announced; targets for poses
  bool network_changed() { return participant_.network_changed(); }  // see DdsParticipant
  const idl::DdsParticipant& participant() const { return participant_; }

 private:
  // Reads who a writer is from its USER_DATA. thread-safe: called from Fast DDS' threads.
  class Announcements : public eprosima::fastdds::dds::DomainParticipantListener {
   public:
    void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
    std::optional<idl::PublisherIdentity> find(const eprosima::fastrtps::rtps::GUID_t& writer) const;
    bool has_gone(const eprosima::fastrtps::rtps::GUID_t& writer) const;
    std::set<std::string> names_on(const std::string& topic) const;

   private:
    struct Known {
      std::optional<idl::PublisherIdentity> identity;  // nullopt: it does not say who it is
      std::string topic;                               // of positions or of poses
      bool there = true;                               // kept when it is gone, so that its farewell can name it
    };
    mutable std::mutex mutex_;
    std::map<eprosima::fastrtps::rtps::GUID_t, Known> known_;  // guarded by mutex_
  };

  // Who is believed, under one name.
  struct Believed {
    eprosima::fastrtps::rtps::GUID_t writer;
    std::optional<idl::PublisherIdentity> identity;
    std::chrono::steady_clock::time_point heard;
  };
  std::string stranger(const std::string& name, const eprosima::fastrtps::rtps::GUID_t& writer);

  Announcements announcements_;  // before participant_: it outlives it
  idl::DdsParticipant participant_;
  eprosima::fastdds::dds::DataReader& reader_;
  idl::Arrivals arrivals_;
  int publishers_ = 0;
  std::map<std::string, Believed> believed_;  // by the target's or the camera's name
};

using PositionSubscription = SampleSubscription<msg::ObjectPosition>;

}  // namespace huetrack::client
