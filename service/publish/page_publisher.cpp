#include "publish/page_publisher.h"

#include <algorithm>
#include <cassert>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <stdexcept>

#include "idl/arrivals.h"
#include "idl/dds_participant.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/ros2_messagesPubSubTypes.h"
#include "idl/topics.h"
#include "publish/ros_view.h"

namespace huetrack::publish {

namespace dds = eprosima::fastdds::dds;

namespace {

int readers_of(const dds::DataWriter& writer) {
  dds::PublicationMatchedStatus matched;
  // Not const in Fast DDS.
  const_cast<dds::DataWriter&>(writer).get_publication_matched_status(matched);
  return matched.current_count;
}

static_assert(static_cast<std::uint32_t>(camera_tracking::CameraMapPoint::State::not_sought) ==
                  msg::CAMERA_MAP_POINT_NOT_SOUGHT &&
              static_cast<std::uint32_t>(camera_tracking::CameraMapPoint::State::missed) ==
                  msg::CAMERA_MAP_POINT_MISSED &&
              static_cast<std::uint32_t>(camera_tracking::CameraMapPoint::State::found) == msg::CAMERA_MAP_POINT_FOUND);

constexpr std::size_t most_map_points = 1000;  // 45 kB: one UDP datagram

// All fields except camera, host and pid.
msg::CameraMap to_message(const camera_tracking::CameraMap& map, capture::Timestamp captured) {
  msg::CameraMap out;
  out.captured_at(captured.time_since_epoch().count());
  out.map_points(static_cast<std::uint32_t>(map.points.size()));
  const std::size_t count = std::min(map.points.size(), most_map_points);
  for (std::size_t i = 0; i < count; ++i) {
    const camera_tracking::CameraMapPoint& from = map.points[i * map.points.size() / count];
    msg::CameraMapPoint& to = out.points().emplace_back();
    to.id(from.id);
    for (Eigen::Index k = 0; k < 3; ++k)
      to.position()[static_cast<std::size_t>(k)] = static_cast<float>(from.position[k]);
    std::size_t upper = 0;
    for (Eigen::Index row = 0; row < 3; ++row)
      for (Eigen::Index column = row; column < 3; ++column)
        to.covariance()[upper++] = static_cast<float>(from.covariance(row, column));
    to.state(static_cast<msg::CameraMapPointState>(from.state));
    to.given(from.given);
  }
  return out;
}

struct PageConnection {
  PageConnection(const EstimatePublisherOptions& options, const std::string& who)
      : participant(options.transport("huetrackd view")),
        scene(participant.create_writer<msg::ScenePubSubType>(idl::scene_topic, idl::status_writer_qos(), who)),
        preview(participant.create_writer<msg::PreviewPubSubType>(idl::preview_topic, idl::preview_writer_qos(), who)),
        reply(
            participant.create_writer<msg::TeachReplyPubSubType>(idl::teach_reply_topic, idl::teach_writer_qos(), who)),
        request(
            participant.create_reader<msg::TeachRequestPubSubType>(idl::teach_request_topic, idl::teach_reader_qos())),
        control_reply(participant.create_writer<msg::ControlReplyPubSubType>(idl::control_reply_topic,
                                                                             idl::teach_writer_qos(), who)),
        control_request(participant.create_reader<msg::ControlRequestPubSubType>(idl::control_request_topic,
                                                                                 idl::teach_reader_qos())) {
    if (!options.tracked_camera.empty())
      map = &participant.create_writer<msg::CameraMapPubSubType>(idl::camera_map_topic, idl::status_writer_qos(), who);
    if (!options.ros2) return;
    using ImageType = sensor_msgs::msg::dds_::CompressedImage_PubSubType;
    using InfoType = sensor_msgs::msg::dds_::CameraInfo_PubSubType;
    using MarkersType = visualization_msgs::msg::dds_::MarkerArray_PubSubType;
    using TfType = tf2_msgs::msg::dds_::TFMessage_PubSubType;
    for (const std::string& camera : options.cameras) {
      const std::string name = ros_name(camera);
      images.push_back(
          &participant.create_ros2_writer<ImageType>(idl::ros2_image_topic(name), idl::ros2_image_type_hash));
      infos.push_back(&participant.create_ros2_writer<InfoType>(idl::ros2_camera_info_topic(name),
                                                                idl::ros2_camera_info_type_hash));
    }
    markers = &participant.create_ros2_writer<MarkersType>(idl::ros2_markers_topic, idl::ros2_markers_type_hash);
    tf_static = &participant.create_writer<TfType>(idl::ros2_tf_static_topic, idl::status_writer_qos(),
                                                   idl::ros2_user_data(idl::ros2_tf_type_hash));
  }

  // Waits for the last replies to arrive: the service may restart on a request.
  ~PageConnection() {
    for (dds::DataWriter* writer : {&reply, &control_reply})
      writer->wait_for_acknowledgments(eprosima::fastrtps::Duration_t(0, 500'000'000));
  }
  PageConnection(const PageConnection&) = delete;
  PageConnection& operator=(const PageConnection&) = delete;

  idl::DdsParticipant participant;
  dds::DataWriter &scene, &preview, &reply;
  dds::DataReader& request;
  dds::DataWriter& control_reply;
  dds::DataReader& control_request;
  dds::DataWriter* map = nullptr;               // null without a tracked camera
  std::vector<dds::DataWriter*> images, infos;  // by camera; empty without ROS 2
  dds::DataWriter* markers = nullptr;           // null without ROS 2
  dds::DataWriter* tf_static = nullptr;
};

}  // namespace

struct PagePublisher::Impl {
  explicit Impl(EstimatePublisherOptions o)
      : options(std::move(o)),
        identity(idl::PublisherIdentity::of_this_process(options.targets)),
        connection(std::make_unique<PageConnection>(options, identity.user_data())) {}

  const EstimatePublisherOptions options;
  const idl::PublisherIdentity identity;
  std::unique_ptr<PageConnection> connection;
  bool write_scene() {
    bool ok = connection->scene.write(&*scene);
    if (connection->tf_static != nullptr) {
      auto tf = to_static_tf(*scene, options.frame_id, options.tracked_camera);
      ok = connection->tf_static->write(&tf) && ok;
    }
    return ok;
  }

  std::optional<msg::Scene> scene;    // the last one, for a new connection
  std::optional<msg::CameraMap> map;  // the last one, for a new connection
};

PagePublisher::PagePublisher(EstimatePublisherOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
PagePublisher::~PagePublisher() = default;

bool PagePublisher::publish(msg::Scene scene) noexcept {
  scene.host(impl_->identity.host);
  scene.pid(impl_->identity.pid);
  scene.frame_id(impl_->options.frame_id);
  impl_->scene = std::move(scene);
  return impl_->write_scene();
}

bool PagePublisher::publish(const msg::Preview& preview) noexcept {
  PageConnection& bus = *impl_->connection;
  bool ok = bus.preview.write(const_cast<msg::Preview*>(&preview));  // write() takes void*, but only reads
  for (std::size_t c = 0; impl_->scene && c < bus.images.size(); ++c) {
    if (impl_->options.cameras[c] != preview.camera() || readers_of(*bus.images[c]) + readers_of(*bus.infos[c]) == 0)
      continue;
    auto image = to_ros_image(preview);
    auto info = to_camera_info(preview, impl_->scene->cameras()[c]);
    ok = bus.images[c]->write(&image) && ok;
    ok = bus.infos[c]->write(&info) && ok;
  }
  return ok;
}

bool PagePublisher::publish(const camera_tracking::CameraMap& map, capture::Timestamp captured) noexcept {
  assert(impl_->connection->map != nullptr);
  impl_->map = to_message(map, captured);
  impl_->map->camera(impl_->options.tracked_camera);
  impl_->map->host(impl_->identity.host);
  impl_->map->pid(impl_->identity.pid);
  return impl_->connection->map->write(&*impl_->map);
}

bool PagePublisher::publish(std::span<const object_tracking::ObjectEstimate> estimates,
                            capture::Timestamp captured) noexcept {
  dds::DataWriter* const markers = impl_->connection->markers;
  if (markers == nullptr || !impl_->scene || readers_of(*markers) == 0) return true;
  auto array = to_markers(*impl_->scene, estimates, captured, impl_->options.frame_id, impl_->options.tracked_camera);
  return markers->write(&array);
}

bool PagePublisher::publish(const msg::TeachReply& reply) noexcept {
  return impl_->connection->reply.write(const_cast<msg::TeachReply*>(&reply));
}

bool PagePublisher::publish(const msg::ControlReply& reply) noexcept {
  return impl_->connection->control_reply.write(const_cast<msg::ControlReply*>(&reply));
}

namespace {

template <typename Request>
std::optional<Request> next_of(dds::DataReader& reader, const idl::PublisherIdentity& us) {
  Request request;
  while (idl::take_next(reader, request))
    if (request.host() == us.host && request.pid() == us.pid) return request;
  return std::nullopt;
}

}  // namespace

std::optional<msg::TeachRequest> PagePublisher::next_request() {
  return next_of<msg::TeachRequest>(impl_->connection->request, impl_->identity);
}

std::optional<msg::ControlRequest> PagePublisher::next_control_request() {
  return next_of<msg::ControlRequest>(impl_->connection->control_request, impl_->identity);
}

int PagePublisher::picture_subscribers() const {
  const PageConnection& bus = *impl_->connection;
  int readers = readers_of(bus.preview);
  for (const auto* writer : bus.images) readers += readers_of(*writer);
  for (const auto* writer : bus.infos) readers += readers_of(*writer);
  return readers;
}

int PagePublisher::marker_subscribers() const {
  const dds::DataWriter* const markers = impl_->connection->markers;
  return markers != nullptr ? readers_of(*markers) : 0;
}

void PagePublisher::check_network() {
  if (!impl_->connection->participant.network_changed()) return;
  try {
    impl_->connection = std::make_unique<PageConnection>(impl_->options, impl_->identity.user_data());
    if (impl_->scene) impl_->write_scene();
    if (impl_->map) impl_->connection->map->write(&*impl_->map);
  } catch (const std::invalid_argument&) {  // a configured interface is gone: EstimatePublisher warns
  } catch (const std::runtime_error&) {     // Fast DDS refuses
  }
}

}  // namespace huetrack::publish
