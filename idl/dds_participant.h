// How a program joins the bus: domain, network interfaces, the user's XML profiles, each checked, because Fast DDS goes
// on silently where they are wrong. Service and clients share it.
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

namespace huetrack::idl {

struct NetworkInterface {
  std::string name;     // "eth0"
  std::string address;  // IPv4, "192.168.0.5"
  bool operator==(const NetworkInterface&) const = default;
};
std::vector<NetworkInterface>
network_interfaces();  // up, with a carrier and an IPv4 address; empty when the kernel does not say
std::string describe(const std::vector<NetworkInterface>& list);  // "lo 127.0.0.1, eth0 192.168.0.5"

// The configured domain, else ROS_DOMAIN_ID, else 0. throws std::invalid_argument when it is not 0..232.
int resolve_domain(std::optional<int> configured);

// What making a participant with these options would say, without making one: throws std::invalid_argument as
// DdsParticipant does; but an interface that this host lacks, which another host may have, is only a warning, one
// sentence each. It loads the profiles: once in a process.
std::vector<std::string> check(const ParticipantOptions& options);

// How samples go over the network, where no participant profile says it. 0: as Fast DDS and the kernel have it,
// datagrams of 64 kB and the host's usual buffers.
struct Datagrams {
  std::uint32_t largest = 0;  // bytes
  std::uint32_t buffer = 0;   // bytes of each socket, as far as the host allows (net.core.rmem_max, wmem_max)
};

// Our default is UDPv4 only (no shared memory: a full /dev/shm, two users or two containers break it silently) and a
// participant lease of 3 s. In the XML, a participant profile named "huetrack", or else one with is_default_profile,
// replaces that; a data_writer or data_reader profile whose name is a topic's replaces the QoS of that topic.
//
// As long as one lives, messages of Fast DDS go to stderr, one line each, and never to stdout. Profiles are global to
// the process (Fast DDS keeps them so).
// thread-compatible; writing to a writer and reading a reader are thread-safe, as Fast DDS says.
class DdsParticipant {
 public:
  // listener (may be null) hears of discovered participants and endpoints, from Fast DDS' threads; it must outlive
  // this. throws std::invalid_argument on wrong options or a wrong XML file, naming it; std::runtime_error when Fast
  // DDS refuses, with what it said.
  explicit DdsParticipant(const ParticipantOptions& options,
                          eprosima::fastdds::dds::DomainParticipantListener* listener = nullptr,
                          const Datagrams& datagrams = {});
  ~DdsParticipant();  // leaves cleanly: the others see it within 50 ms
  DdsParticipant(const DdsParticipant&) = delete;
  DdsParticipant& operator=(const DdsParticipant&) = delete;

  // Owned by this object. throws std::runtime_error when Fast DDS refuses, with what it said.
  eprosima::fastdds::dds::DataWriter& create_writer(const std::string& topic, eprosima::fastdds::dds::TypeSupport type,
                                                    eprosima::fastdds::dds::DataWriterQos qos,
                                                    const std::string& user_data);
  // Before this goes. Samples that are not acknowledged yet are not waited for.
  void delete_writer(eprosima::fastdds::dds::DataWriter& writer);
  // largest: of a sample, in bytes, where largest_sample() does not know the topic; the same for all topics of a type.
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

  // Fast DDS uses and announces the addresses that the host had when the participant was made. (Setting its QoS again
  // makes it listen on new ones, but its readers and writers go on announcing the old ones.) True when the addresses
  // are others now, and have been so for two calls in a row: time to make a new participant. Call it about once a
  // second.
  bool network_changed();

  int domain() const { return domain_; }
  // The profile has DDS Security's access control (configs/dds/secure.sh): what this participant has no permission for
  // is refused, with a std::runtime_error that says so.
  bool is_access_controlled() const { return is_access_controlled_; }
  std::string description() const;  // one line for the log: "DDS domain 0, UDP on lo 127.0.0.1, eth0 192.168.0.5"

 private:
  void leave();
  std::string reason(const std::string& said) const;  // for which Fast DDS refused
  eprosima::fastdds::dds::Topic* topic(const std::string& name, eprosima::fastdds::dds::TypeSupport type,
                                       std::optional<std::uint32_t> largest = {});

  int domain_;
  std::vector<NetworkInterface> interfaces_;  // when it joined
  std::vector<NetworkInterface> last_seen_;   // by network_changed()
  std::string transport_;                     // for description(); empty: ours on every interface
  std::vector<std::string> profiled_topics_;  // whose QoS came from XML
  bool is_access_controlled_ = false;
  eprosima::fastdds::dds::DomainParticipant* participant_ = nullptr;
  eprosima::fastdds::dds::Publisher* publisher_ = nullptr;
  eprosima::fastdds::dds::Subscriber* subscriber_ = nullptr;
};

}  // namespace huetrack::idl
