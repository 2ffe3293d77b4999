#include "idl/dds_participant.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fstream>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "idl/topics.h"

#ifdef __SANITIZE_ADDRESS__
// Debian's Fast DDS 2.9.1 deletes an object with a wrong size (~RTPSReader): harmless, but AddressSanitizer would
// abort.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "new_delete_type_mismatch=0";
}
#endif

namespace huetrack::idl {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;

namespace {

constexpr int max_domain = 232;  // the RTPS port numbers end there

// Redirects Fast DDS' messages, which by default go to stdout, into a client's CSV.
class FastDdsMessages {
 public:
  static FastDdsMessages& instance() {
    static auto& messages = *new FastDdsMessages;  // never destroyed: Fast DDS' log thread outlives main()
    return messages;
  }

  // Runs `call` and returns Fast DDS' messages meanwhile ("" if none) instead of printing them.
  template <typename Call>
  std::string during(Call call) {
    dds::Log::Flush();
    {
      const std::lock_guard lock(mutex_);
      collecting_ = true;
      collected_.clear();
    }
    call();
    dds::Log::Flush();
    const std::lock_guard lock(mutex_);
    collecting_ = false;
    return collected_;
  }

 private:
  struct Consumer : dds::LogConsumer {
    void Consume(const dds::Log::Entry& entry) override { instance().consume(entry); }
  };

  FastDdsMessages() {
    dds::Log::ClearConsumers();
    dds::Log::RegisterConsumer(std::make_unique<Consumer>());
  }

  void consume(const dds::Log::Entry& entry) {
    const std::lock_guard lock(mutex_);
    if (collecting_) {
      collected_ += (collected_.empty() ? "" : "; ") + entry.message;
    } else {
      std::string message = entry.message;  // may contain foreign topic names
      std::ranges::replace_if(
          message, [](unsigned char c) { return c < ' ' || c == 0x7F; }, ' ');
      std::fprintf(stderr, "Fast DDS: %s\n", message.c_str());
    }
  }

  std::mutex mutex_;
  bool collecting_ = false;  // guarded by mutex_
  std::string collected_;    // guarded by mutex_
};

constexpr std::uintmax_t largest_profiles = 4U << 20U;  // bytes

void check_readable(const std::filesystem::path& file, const std::string& role) {
  if (!std::filesystem::is_regular_file(file))
    throw std::invalid_argument(file.string() + ": " + role + " does not exist or is not a file");
  if (!std::ifstream(file)) throw std::invalid_argument(file.string() + ": " + role + " cannot be read");
  if (std::filesystem::file_size(file) > largest_profiles)  // Fast DDS has no limit
    throw std::invalid_argument(file.string() + ": " + role + " is larger than " +
                                std::to_string(largest_profiles >> 20U) + " MiB: not a file of this kind");
}

// Fast DDS itself only prints an error and continues without the file, or with half of it.
void load_profiles(const std::filesystem::path& profiles) {
  auto& factory = *dds::DomainParticipantFactory::get_instance();
  const char* environment = std::getenv("FASTRTPS_DEFAULT_PROFILES_FILE");
  const bool has_environment = environment != nullptr && *environment != '\0';
  if (has_environment) check_readable(environment, "the file in FASTRTPS_DEFAULT_PROFILES_FILE");
  if (!profiles.empty()) check_readable(profiles, "the DDS profiles file");

  bool ok = true;
  std::string errors =
      FastDdsMessages::instance().during([&] { ok = factory.load_profiles() == ReturnCode_t::RETCODE_OK; });
  if (!ok || !errors.empty())
    throw std::invalid_argument(std::string(has_environment ? environment : "DEFAULT_FASTRTPS_PROFILES.xml") +
                                ": not a valid Fast DDS profiles file: " + errors);
  if (profiles.empty()) return;
  errors = FastDdsMessages::instance().during(
      [&] { ok = factory.load_XML_profiles_file(profiles.string()) == ReturnCode_t::RETCODE_OK; });
  if (!ok || !errors.empty())
    throw std::invalid_argument(profiles.string() + ": not a valid Fast DDS profiles file: " + errors);
}

// The user's participant profile, if there is one.
bool participant_profile(dds::DomainParticipantQos& qos) {
  auto& factory = *dds::DomainParticipantFactory::get_instance();
  bool named = false;
  // Discards the message about a missing profile, the usual case.
  FastDdsMessages::instance().during(
      [&] { named = factory.get_participant_qos_from_profile("huetrack", qos) == ReturnCode_t::RETCODE_OK; });
  if (named) return true;
  factory.get_default_participant_qos(qos);
  return !(qos == dds::PARTICIPANT_QOS_DEFAULT);
}

// lacking: one sentence per interface that this host lacks
std::vector<NetworkInterface> select(const std::vector<std::string>& wanted, std::vector<std::string>& lacking) {
  const std::vector<NetworkInterface> present = network_interfaces();
  std::vector<NetworkInterface> selected;
  for (const std::string& one : wanted) {
    const std::size_t before = selected.size();
    std::ranges::copy_if(present, std::back_inserter(selected),
                         [&](const NetworkInterface& i) { return i.name == one || i.address == one; });
    if (selected.size() == before)
      lacking.push_back("DDS interface \"" + one +
                        "\": this host has no such interface or IPv4 address that is up; it has " + describe(present));
  }
  // Two programs of one host communicate only if both use loopback, or neither.
  const auto is_loopback = [](const NetworkInterface& i) { return i.address == "127.0.0.1"; };
  if (!selected.empty() && std::ranges::none_of(selected, is_loopback))
    std::ranges::copy_if(present, std::back_inserter(selected), is_loopback);
  return selected;
}

bool load_participant_profile(const ParticipantOptions& options, dds::DomainParticipantQos& qos) {
  load_profiles(options.profiles);
  if (!participant_profile(qos)) return false;
  if (!options.interfaces.empty())
    throw std::invalid_argument(
        "DDS interfaces are set, but the XML has a participant profile: write the interfaces there "
        "(interfaceWhiteList of its transport), or remove one of the two");
  return true;
}

}  // namespace

std::vector<std::string> check(const ParticipantOptions& options) {
  resolve_domain(options.domain);
  std::vector<std::string> lacking;
  dds::DomainParticipantQos qos;
  if (!load_participant_profile(options, qos)) select(options.interfaces, lacking);
  return lacking;
}

std::vector<NetworkInterface> network_interfaces() {
  ::ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<::ifaddrs, decltype(&::freeifaddrs)> owner(first, ::freeifaddrs);
  std::vector<NetworkInterface> list;
  for (const ::ifaddrs* i = first; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET) continue;
    if ((i->ifa_flags & IFF_RUNNING) == 0) continue;  // no carrier: Fast DDS does not use it
    char text[INET_ADDRSTRLEN] = "";
    const auto* address = static_cast<const ::sockaddr_in*>(static_cast<const void*>(i->ifa_addr));
    ::inet_ntop(AF_INET, &address->sin_addr, text, sizeof text);
    list.push_back({i->ifa_name, text});
  }
  return list;
}

std::string describe(const std::vector<NetworkInterface>& list) {
  if (list.empty()) return "no network interface";
  std::vector<std::string> texts;
  texts.reserve(list.size());
  for (const NetworkInterface& i : list) texts.push_back(i.name + " " + i.address);
  return fmt::format("{}", fmt::join(texts, ", "));
}

int resolve_domain(std::optional<int> configured) {
  const std::string range = "must be a whole number from 0 to " + std::to_string(max_domain);
  if (configured) {
    if (*configured < 0 || *configured > max_domain)
      throw std::invalid_argument("DDS domain " + std::to_string(*configured) + ": " + range);
    return *configured;
  }
  const char* environment = std::getenv("ROS_DOMAIN_ID");
  if (environment == nullptr || *environment == '\0') return 0;
  const std::string_view text = environment;
  int domain = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), domain);
  if (error != std::errc{} || end != text.data() + text.size() || domain < 0 || domain > max_domain)
    throw std::invalid_argument("environment variable ROS_DOMAIN_ID=\"" + std::string(text) + "\": " + range);
  return domain;
}

DdsParticipant::DdsParticipant(const ParticipantOptions& options, dds::DomainParticipantListener* listener,
                               const Datagrams& datagrams)
    : domain_(resolve_domain(options.domain)), interfaces_(network_interfaces()) {
  dds::DomainParticipantQos qos;
  if (load_participant_profile(options, qos)) {
    transport_ = "transports as the participant profile says";
    is_access_controlled_ = std::ranges::any_of(
        qos.properties().properties(), [](const auto& property) { return property.name() == "dds.sec.access.plugin"; });
  } else {
    std::vector<std::string> lacking;
    const std::vector<NetworkInterface> selected = select(options.interfaces, lacking);
    if (!lacking.empty()) throw std::invalid_argument(lacking.front());
    if (!selected.empty()) transport_ = "UDP on " + describe(selected) + " only";
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    for (const NetworkInterface& i : selected) udp->interfaceWhiteList.push_back(i.address);
    if (datagrams.largest > 0) udp->maxMessageSize = datagrams.largest;
    udp->sendBufferSize = udp->receiveBufferSize = datagrams.buffer;
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    auto& discovery = qos.wire_protocol().builtin.discovery_config;
    discovery.leaseDuration = {3, 0};
    discovery.leaseDuration_announcementperiod = {1, 0};
  }
  qos.name(options.name);

  const std::string errors = FastDdsMessages::instance().during([&] {
    participant_ = dds::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<dds::DomainId_t>(domain_), qos, listener, dds::StatusMask::none());
    if (participant_ == nullptr) return;
    publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  });
  if (publisher_ == nullptr || subscriber_ == nullptr) {
    if (participant_ != nullptr) leave();
    throw std::runtime_error("cannot join DDS domain " + std::to_string(domain_) + ": " + errors);
  }
  if (!errors.empty()) std::fprintf(stderr, "Fast DDS: %s\n", errors.c_str());
}

DdsParticipant::~DdsParticipant() {
  leave();
}

void DdsParticipant::leave() {
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

dds::Topic* DdsParticipant::topic(const std::string& name, dds::TypeSupport type,
                                  std::optional<std::uint32_t> largest) {
  // Cyclone DDS would reject our writers for invalid type information.
  type->auto_fill_type_information(false);
  type->auto_fill_type_object(false);
  if (const auto known = largest_sample(name)) largest = known;
  if (largest) type->m_typeSize = *largest;  // memory of a reader's sample
  type.register_type(participant_);
  return participant_->create_topic(name, type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
}

std::string DdsParticipant::reason(const std::string& errors) const {
  if (is_access_controlled_ && errors.find("not found in allow rule") != std::string::npos)
    return "the permissions of this participant (DDS Security, dds.sec.access in its profile) do not have it";
  return errors;
}

dds::DataWriter& DdsParticipant::create_writer(const std::string& name, dds::TypeSupport type, dds::DataWriterQos qos,
                                               const std::string& user_data) {
  dds::DataWriter* writer = nullptr;
  dds::DataWriterQos profile;
  auto& messages = FastDdsMessages::instance();
  // Discards the message about a missing profile, the usual case.
  messages.during([&] {
    if (publisher_->get_datawriter_qos_from_profile(name, profile) != ReturnCode_t::RETCODE_OK) return;
    qos = profile;
    profiled_topics_.push_back(name);
  });
  if (qos.user_data().empty()) qos.user_data().setValue({user_data.begin(), user_data.end()});
  const std::string errors = messages.during([&] {
    if (dds::Topic* t = topic(name, type)) writer = publisher_->create_datawriter(t, qos);
  });
  if (writer == nullptr) throw std::runtime_error("cannot publish on DDS topic " + name + ": " + reason(errors));
  return *writer;
}

void DdsParticipant::delete_writer(eprosima::fastdds::dds::DataWriter& writer) {
  eprosima::fastdds::dds::Topic* const topic = writer.get_topic();
  publisher_->delete_datawriter(&writer);
  participant_->delete_topic(topic);  // refused if still in use
}

dds::DataReader& DdsParticipant::create_reader(const std::string& name, dds::TypeSupport type, dds::DataReaderQos qos,
                                               std::optional<std::uint32_t> largest) {
  dds::DataReader* reader = nullptr;
  dds::DataReaderQos profile;
  limit_instances(name, qos);
  auto& messages = FastDdsMessages::instance();
  messages.during([&] {
    if (subscriber_->get_datareader_qos_from_profile(name, profile) != ReturnCode_t::RETCODE_OK) return;
    qos = profile;
    profiled_topics_.push_back(name);
  });
  const std::string errors = messages.during([&] {
    if (dds::Topic* t = topic(name, type, largest)) reader = subscriber_->create_datareader(t, qos);
  });
  if (reader == nullptr) throw std::runtime_error("cannot subscribe to DDS topic " + name + ": " + reason(errors));
  return *reader;
}

bool DdsParticipant::network_changed() {
  std::vector<NetworkInterface> now = network_interfaces();
  const bool steady = now == last_seen_;  // not during a DHCP renewal
  last_seen_ = std::move(now);
  return steady && last_seen_ != interfaces_;
}

std::string DdsParticipant::description() const {
  std::string text = "DDS domain " + std::to_string(domain_) + ", " +
                     (transport_.empty() ? "UDP on " + describe(interfaces_) : transport_);
  for (std::size_t i = 0; i < profiled_topics_.size(); ++i)
    text += (i == 0 ? ", QoS by XML profile: " : ", ") + profiled_topics_[i];
  return text;
}

}  // namespace huetrack::idl
