#include "publish/service_finder.h"

#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <map>
#include <thread>

#include "idl/arrivals.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/topics.h"

namespace huetrack::publish {

namespace dds = eprosima::fastdds::dds;

std::vector<RunningService> running_services(const EstimatePublisherOptions& options,
                                             std::chrono::milliseconds patience) {
  idl::DdsParticipant participant(options.transport("huetrackd"));
  dds::DataReader& reader =
      participant.create_reader<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_reader_qos());
  const std::string host = idl::PublisherIdentity::of_this_process({}).host;
  std::map<std::pair<std::string, std::uint32_t>, RunningService> found;
  const auto until = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < until) {
    msg::ServiceStatus sample;
    while (idl::take_next(reader, sample))
      found[{sample.host(), sample.pid()}] = {sample.pid(), sample.host() == host, sample.mode(), sample.config_file()};
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  std::vector<RunningService> services;
  for (auto& [who, service] : found) services.push_back(std::move(service));
  return services;
}

}  // namespace huetrack::publish
