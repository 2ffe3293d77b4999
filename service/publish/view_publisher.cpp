#include "publish/view_publisher.h"

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <stdexcept>

#include "idl/dds_participant.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"

namespace huetrack {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;

namespace {

int readers_of(const dds::DataWriter& writer) {
  dds::PublicationMatchedStatus matched;
  // Not const in Fast DDS, though it changes nothing but "since the last call".
  const_cast<dds::DataWriter&>(writer).get_publication_matched_status(matched);
  return matched.current_count;
}

struct Connection {
  Connection(const EstimatePublisherOptions& options, const std::string& who)
      : participant({.name = "huetrackd view",
                     .domain = options.domain,
                     .interfaces = options.interfaces,
                     .profiles = options.profiles}),
        scene(participant.create_writer(topics::scene, dds::TypeSupport(new msg::ScenePubSubType), status_writer_qos(),
                                        who)),
        preview(participant.create_writer(topics::preview, dds::TypeSupport(new msg::PreviewPubSubType),
                                          preview_writer_qos(), who)),
        reply(participant.create_writer(topics::teach_reply, dds::TypeSupport(new msg::TeachReplyPubSubType),
                                        teach_writer_qos(), who)),
        request(participant.create_reader(topics::teach_request, dds::TypeSupport(new msg::TeachRequestPubSubType),
                                          teach_reader_qos())) {}

  DdsParticipant participant;
  dds::DataWriter &scene, &preview, &reply;
  dds::DataReader& request;
};

}  // namespace

struct ViewPublisher::Impl {
  explicit Impl(EstimatePublisherOptions o)
      : options(std::move(o)),
        identity(PublisherIdentity::of_this_process(options.targets)),
        connection(std::make_unique<Connection>(options, identity.user_data())) {}

  const EstimatePublisherOptions options;
  const PublisherIdentity identity;
  std::unique_ptr<Connection> connection;
  std::optional<msg::Scene> scene;  // the last one, for a new connection
};

ViewPublisher::ViewPublisher(EstimatePublisherOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
ViewPublisher::~ViewPublisher() = default;

bool ViewPublisher::publish(msg::Scene scene) noexcept {
  scene.host(impl_->identity.host);
  scene.pid(impl_->identity.pid);
  scene.frame_id(impl_->options.frame_id);
  impl_->scene = std::move(scene);
  return impl_->connection->scene.write(&*impl_->scene);
}

bool ViewPublisher::publish(const msg::Preview& preview) noexcept {
  return impl_->connection->preview.write(const_cast<msg::Preview*>(&preview));  // write() takes void*, and only reads
}

bool ViewPublisher::publish(const msg::TeachReply& reply) noexcept {
  return impl_->connection->reply.write(const_cast<msg::TeachReply*>(&reply));
}

std::optional<msg::TeachRequest> ViewPublisher::next_request() {
  msg::TeachRequest request;
  dds::SampleInfo info;
  while (impl_->connection->request.take_next_sample(&request, &info) == ReturnCode_t::RETCODE_OK) {
    if (info.valid_data && request.host() == impl_->identity.host && request.pid() == impl_->identity.pid)
      return request;
  }
  return std::nullopt;
}

int ViewPublisher::preview_subscribers() const {
  return readers_of(impl_->connection->preview);
}

void ViewPublisher::look_after_network() {
  if (!impl_->connection->participant.network_changed()) return;
  try {
    impl_->connection = std::make_unique<Connection>(impl_->options, impl_->identity.user_data());
    if (impl_->scene) impl_->connection->scene.write(&*impl_->scene);
  } catch (const std::invalid_argument&) {  // a configured interface is gone: EstimatePublisher warns of the same
  } catch (const std::runtime_error&) {     // Fast DDS refuses: likewise
  }
}

}  // namespace huetrack
