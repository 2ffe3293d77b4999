#include "clients/live_view/bus_reader.h"

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <stdexcept>

#include "clients/live_view/events.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"

namespace huetrack::live_view {

namespace dds = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;
using eprosima::fastrtps::types::ReturnCode_t;
using namespace std::chrono_literals;

namespace {

constexpr auto pulse_period = 1s;
constexpr auto gone_after = 4s;         // a service that was not heard for so long; it speaks once a second
constexpr auto keep_previews_for = 3s;  // after the last page: a reload is no reason to stop
constexpr std::size_t most_requests = 16;

double unix_now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

template <typename Sample, typename F>
void take_all(dds::DataReader& reader, F&& use) {
  Sample sample;
  dds::SampleInfo info;
  while (reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
    if (info.valid_data) use(sample);
}

ParticipantOptions named(ParticipantOptions options, const char* name) {
  options.name = name;
  return options;
}

}  // namespace

struct BusReader::Connection {
  explicit Connection(const ParticipantOptions& options)
      : participant(named(options, "huetrack view")),
        position(participant.create_reader(topics::object_position, dds::TypeSupport(new msg::ObjectPositionPubSubType),
                                           object_position_reader_qos())),
        camera_pose(participant.create_reader(topics::camera_pose, dds::TypeSupport(new msg::CameraPosePubSubType),
                                              object_position_reader_qos())),
        camera_map(participant.create_reader(topics::camera_map, dds::TypeSupport(new msg::CameraMapPubSubType),
                                             status_reader_qos())),
        status(participant.create_reader(topics::status, dds::TypeSupport(new msg::ServiceStatusPubSubType),
                                         status_reader_qos())),
        scene(
            participant.create_reader(topics::scene, dds::TypeSupport(new msg::ScenePubSubType), status_reader_qos())),
        reply(participant.create_reader(topics::teach_reply, dds::TypeSupport(new msg::TeachReplyPubSubType),
                                        teach_reader_qos())),
        request(participant.create_writer(topics::teach_request, dds::TypeSupport(new msg::TeachRequestPubSubType),
                                          teach_writer_qos(), "")) {}
  DdsParticipant participant;
  dds::DataReader &position, &camera_pose, &camera_map, &status, &scene, &reply;
  dds::DataWriter& request;
};

// A participant of its own: it comes and goes with the pages.
struct BusReader::Previews {
  explicit Previews(const ParticipantOptions& options)
      : participant(named(options, "huetrack view, previews")),
        preview(participant.create_reader(topics::preview, dds::TypeSupport(new msg::PreviewPubSubType),
                                          preview_reader_qos())) {}
  DdsParticipant participant;
  dds::DataReader& preview;
};

BusReader::BusReader(const ParticipantOptions& options, EventHub& hub)
    : options_(options), hub_(hub), connection_(std::make_unique<Connection>(options)) {}

BusReader::~BusReader() = default;

std::string BusReader::description() const {
  return connection_->participant.description();
}

bool BusReader::request(msg::TeachRequest request) {
  const std::scoped_lock lock(mutex_);
  if (requests_.size() >= most_requests) return false;
  requests_.push_back(std::move(request));
  return true;
}

void BusReader::poll(int pages) {
  const auto now = Clock::now();
  if (pages > 0) no_page_since_ = now;
  if (pages > 0 && !previews_) {
    previews_ = std::make_unique<Previews>(options_);
  } else if (previews_ && now > no_page_since_ + keep_previews_for) {
    previews_.reset();
  }
  take_positions();
  take_camera_poses();
  take_camera_maps();
  take_statuses();
  take_scenes();
  take_replies();
  if (previews_) take_previews();
  send_requests();
  if (now >= next_pulse_) {
    next_pulse_ = now + pulse_period;
    tell_pulse();
    if (connection_->participant.network_changed()) {
      try {
        connection_ = std::make_unique<Connection>(options_);
        previews_.reset();  // made anew by the next poll()
        trouble_.clear();
      } catch (const std::invalid_argument& error) {  // a given interface is gone
        trouble_ = error.what();
      } catch (const std::runtime_error& error) {  // Fast DDS refuses
        trouble_ = error.what();
      }
    }
  }
}

void BusReader::take_positions() {
  take_all<msg::ObjectPosition>(connection_->position,
                                [&](const auto& sample) { hub_.append(to_event("position", to_json(sample))); });
}

void BusReader::take_camera_poses() {
  take_all<msg::CameraPose>(connection_->camera_pose,
                            [&](const auto& sample) { hub_.append(to_event("camera_pose", to_json(sample))); });
}

void BusReader::take_camera_maps() {
  take_all<msg::CameraMap>(connection_->camera_map, [&](const auto& sample) {
    const std::string who = sample.host() + "/" + std::to_string(sample.pid());
    services_.try_emplace(who, Clock::now());
    hub_.set("camera_map/" + who, to_event("camera_map", to_json(sample)));
  });
}

void BusReader::take_statuses() {
  take_all<msg::ServiceStatus>(connection_->status, [&](const auto& sample) {
    const std::string who = sample.host() + "/" + std::to_string(sample.pid());
    services_[who] = Clock::now();
    hub_.set("status/" + who, to_event("status", to_json(sample, unix_now())));
  });
  for (auto it = services_.begin(); it != services_.end();) {
    if (Clock::now() - it->second < gone_after) {
      ++it;
      continue;
    }
    hub_.erase("status/" + it->first);
    hub_.erase("scene/" + it->first);
    hub_.erase("camera_map/" + it->first);
    it = services_.erase(it);
  }
}

void BusReader::take_scenes() {
  take_all<msg::Scene>(connection_->scene, [&](const auto& sample) {
    const std::string who = sample.host() + "/" + std::to_string(sample.pid());
    services_.try_emplace(who, Clock::now());
    hub_.set("scene/" + who, to_event("scene", to_json(sample)));
  });
}

void BusReader::take_replies() {
  take_all<msg::TeachReply>(connection_->reply, [&](const auto& sample) {
    // The newest per client: a page takes its own, and replies hold pictures.
    hub_.set(
        "teach/" + sample.client() + (sample.cameras().empty() || sample.cameras()[0].jpeg().empty() ? "" : "/frozen"),
        to_event("teach", to_json(sample)));
  });
}

void BusReader::take_previews() {
  take_all<msg::Preview>(previews_->preview, [&](const auto& sample) {
    hub_.set("preview/" + sample.camera(), to_event("preview", to_json(sample)));
  });
}

void BusReader::send_requests() {
  for (;;) {
    msg::TeachRequest request;
    {
      const std::scoped_lock lock(mutex_);
      if (requests_.empty()) return;
      request = std::move(requests_.front());
      requests_.pop_front();
    }
    connection_->request.write(&request);
  }
}

void BusReader::tell_pulse() {
  dds::LivelinessChangedStatus liveliness;
  connection_->position.get_liveliness_changed_status(liveliness);
  hub_.set("pulse", to_event("pulse", to_json(Pulse{.now = unix_now(),
                                                    .domain = connection_->participant.domain(),
                                                    .bus = connection_->participant.description(),
                                                    .publishers = liveliness.alive_count,
                                                    .trouble = trouble_})));
}

}  // namespace huetrack::live_view
