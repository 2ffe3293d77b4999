// Joins a DDS domain: domain, network interfaces and the user's XML profiles are checked, because Fast DDS silently
// ignores errors in them. For service and clients.
#pragma once

#include <cstdint>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <optional>
#include <string>
#include <vector>

#include "idl/participant_options.h"
#include "idl/topics.h"

namespace huetrack::idl {

struct NetworkInterface {
  std::string name;     // "eth0"
  std::string address;  // IPv4, "192.168.0.5"
  bool operator==(const NetworkInterface&) const = default;
};
std::vector<NetworkInterface> network_interfaces();               // up, with carrier and IPv4 address; empty if unknown
std::string describe(const std::vector<NetworkInterface>& list);  // "lo 127.0.0.1, eth0 192.168.0.5"

// The configured domain, else ROS_DOMAIN_ID, else 0. throws std::invalid_argument if outside 0..232.
int resolve_domain(std::optional<int> configured);

// Checks options without joining: throws std::invalid_argument as DdsParticipant does, but returns interfaces that this
// host lacks as warnings, one sentence each. Loads the profiles: call once in a process.
std::vector<std::string> check(const ParticipantOptions& options);

// Network parameters, unless a participant profile sets them. 0: the defaults, datagrams of 64 kB and the host's
// buffers.
struct Datagrams {
  std::uint32_t largest = 0;  // bytes
  std::uint32_t buffer = 0;   // bytes per socket, limited by net.core.rmem_max and wmem_max
};

// Our default is UDPv4 only (no shared memory: a full /dev/shm, two users or two containers break it silently) and a
// participant lease of 3 s. In the XML, a participant profile named "huetrack", or else one with is_default_profile,
// replaces that; a data_writer or data_reader profile whose name is a topic's replaces the QoS of that topic.
//
// While one exists, messages of Fast DDS go to stderr, one line each. Profiles are global to the process.
// thread-compatible; writers and readers are thread-safe.
class DdsParticipant {
 public:
  // listener (may be null; outlives this) is called for discovered participants and endpoints, from Fast DDS' threads.
  // throws std::invalid_argument on wrong options or a wrong XML file, naming it; std::runtime_error with Fast DDS'
  // message if it refuses.
  explicit DdsParticipant(const ParticipantOptions& options,
                          eprosima::fastdds::dds::DomainParticipantListener* listener = nullptr,
                          const Datagrams& datagrams = {});
  ~DdsParticipant();  // announces it: others notice within 50 ms
  DdsParticipant(const DdsParticipant&) = delete;
  DdsParticipant& operator=(const DdsParticipant&) = delete;

  // Owned by this object. throws std::runtime_error with Fast DDS' message if it refuses.
  eprosima::fastdds::dds::DataWriter& create_writer(const std::string& topic, eprosima::fastdds::dds::TypeSupport type,
                                                    eprosima::fastdds::dds::DataWriterQos qos,
                                                    const std::string& user_data);
  // Does not wait for acknowledgements.
  void delete_writer(eprosima::fastdds::dds::DataWriter& writer);
  // largest: bytes of a sample, if largest_sample() does not know the topic; equal for all topics of a type.
  eprosima::fastdds::dds::DataReader& create_reader(const std::string& topic, eprosima::fastdds::dds::TypeSupport type,
                                                    eprosima::fastdds::dds::DataReaderQos qos,
                                                    std::optional<std::uint32_t> largest = {});
  // Writer and reader of a generated type's topic.
  template <typename Type>
  eprosima::fastdds::dds::DataWriter& create_writer(const std::string& topic,
                                                    const eprosima::fastdds::dds::DataWriterQos& qos,
                                                    const std::string& user_data) {
    return create_writer(topic, eprosima::fastdds::dds::TypeSupport(new Type), qos, user_data);
  }
  template <typename Type>
  eprosima::fastdds::dds::DataReader& create_reader(const std::string& topic,
                                                    const eprosima::fastdds::dds::DataReaderQos& qos,
                                                    std::optional<std::uint32_t> largest = {}) {
    return create_reader(topic, eprosima::fastdds::dds::TypeSupport(new Type), qos, largest);
  }
  // Writer of a ROS 2 topic; type_hash: of topics.h.
  template <typename Type>
  eprosima::fastdds::dds::DataWriter& create_ros2_writer(const std::string& topic, const char* type_hash) {
    return create_writer<Type>(topic, ros2_writer_qos(), ros2_user_data(type_hash));
  }

  // Call it about once a second. True if the host's addresses have changed and were the same in two consecutive calls:
  // create a new participant, because Fast DDS uses and announces the addresses of the time of creation.
  bool network_changed();

  int domain() const { return domain_; }
  // The profile has DDS Security's access control (configs/dds/secure.sh): missing permissions cause a
  // std::runtime_error that names them.
  bool is_access_controlled() const { return is_access_controlled_; }
  std::string description() const;  // one line for the log: "DDS domain 0, UDP on lo 127.0.0.1, eth0 192.168.0.5"

 private:
  void leave();
  std::string reason(const std::string& errors) const;  // explains a refusal
  eprosima::fastdds::dds::Topic* topic(const std::string& name, eprosima::fastdds::dds::TypeSupport type,
                                       std::optional<std::uint32_t> largest = {});

  int domain_;
  std::vector<NetworkInterface> interfaces_;  // at creation
  std::vector<NetworkInterface> last_seen_;   // by network_changed()
  std::string transport_;                     // for description(); empty: UDPv4 on every interface
  std::vector<std::string> profiled_topics_;  // whose QoS came from XML
  bool is_access_controlled_ = false;
  eprosima::fastdds::dds::DomainParticipant* participant_ = nullptr;
  eprosima::fastdds::dds::Publisher* publisher_ = nullptr;
  eprosima::fastdds::dds::Subscriber* subscriber_ = nullptr;
};

}  // namespace huetrack::idl
