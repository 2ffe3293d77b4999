#include "clients/live_view/bus_reader.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "clients/live_view/events.h"
#include "clients/live_view/page_server.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/camera_timesPubSubTypes.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/inbox.h"
#include "idl/topics.h"

namespace huetrack::live_view {

namespace dds = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

namespace {

constexpr auto pulse_period = 1s;
constexpr auto gone_after = 4s;         // without a status, which is published once a second
constexpr auto keep_previews_for = 3s;  // after the last page closed: it may only reload
constexpr auto keep_replies_for = 60s;
constexpr std::size_t most_requests = 16;
constexpr std::size_t most_downloads = 4;  // at once; each holds two pieces of a quarter of a megabyte
constexpr std::size_t most_early = 200;
// Limits on what other programs on the bus can make us store, besides those of idl/topics.h and the hub.
constexpr int of_a_target = 16;  // positions that wait for a lost one
constexpr std::size_t most_services = 8, most_maps = 4, most_replies = 32, most_foreign = 16;

double unix_now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// The part of a writer's GUID that all participants of one process share (vendor, host, process) in Fast DDS.
BusReader::Process process_of(const dds::SampleInfo& info) {
  BusReader::Process process{};
  const auto& prefix = info.sample_identity.writer_guid().guidPrefix.value;
  std::copy_n(std::begin(prefix), process.size(), process.begin());
  return process;
}

// Takes a bounded number of samples, so that a flood does not block the others.
template <typename Sample, typename F>
void take_all(idl::Inbox<Sample>& inbox, F&& use) {
  for (std::size_t left = idl::Inbox<Sample>::most_samples; left > 0; --left) {
    const auto arrived = inbox.take();
    if (!arrived) return;
    use(arrived->sample, process_of(arrived->info));
  }
}

template <typename Sample>
std::string id_of(const Sample& sample) {
  return sample.host() + "/" + std::to_string(sample.pid());
}

std::string preview_key(const std::string& camera) {
  return "preview/" + camera;
}

idl::ParticipantOptions named(idl::ParticipantOptions options, const char* name) {
  options.name = name;
  return options;
}

}  // namespace

struct BusReader::Connection {
  explicit Connection(const idl::ParticipantOptions& options)
      : participant(named(options, "huetrack view")),
        position_reader(attach<msg::ObjectPositionPubSubType>(position, idl::object_position_topic,
                                                              idl::object_position_reader_qos(of_a_target))),
        request(request_writer<msg::TeachRequestPubSubType>(idl::teach_request_topic)),
        control_request(request_writer<msg::ControlRequestPubSubType>(idl::control_request_topic)) {
    attach<msg::CameraPosePubSubType>(camera_pose, idl::camera_pose_topic,
                                      idl::object_position_reader_qos(of_a_target));
    attach<msg::CameraMapPubSubType>(camera_map, idl::camera_map_topic, idl::status_reader_qos());
    attach<msg::ServiceStatusPubSubType>(status, idl::status_topic, idl::status_reader_qos());
    attach<msg::ScenePubSubType>(scene, idl::scene_topic, idl::status_reader_qos());
    attach<msg::CameraTimesPubSubType>(times, idl::camera_times_topic, idl::status_reader_qos());
    attach<msg::HostClocksPubSubType>(clocks, idl::host_clocks_topic, idl::status_reader_qos());
    attach<msg::TeachReplyPubSubType>(reply, idl::teach_reply_topic, idl::teach_reader_qos());
    attach<msg::ControlReplyPubSubType>(control_reply, idl::control_reply_topic, idl::teach_reader_qos());
  }
  idl::Inbox<msg::ObjectPosition> position;
  idl::Inbox<msg::CameraPose> camera_pose;
  idl::Inbox<msg::CameraMap> camera_map;
  idl::Inbox<msg::ServiceStatus> status;
  idl::Inbox<msg::Scene> scene;
  idl::Inbox<msg::CameraTimes> times;
  idl::Inbox<msg::HostClocks> clocks;
  idl::Inbox<msg::TeachReply> reply;
  idl::Inbox<msg::ControlReply> control_reply;
  idl::DdsParticipant participant;  // its readers end before the inboxes
  dds::DataReader& position_reader;
  std::string refused;                         // why there is no writer; declared before the writers, which set it
  dds::DataWriter *request, *control_request;  // null: not permitted

 private:
  template <typename Type>
  dds::DataReader& attach(idl::Inbox<typename Type::type>& inbox, const char* topic, const dds::DataReaderQos& qos) {
    dds::DataReader& reader = participant.create_reader<Type>(topic, qos);
    inbox.attach(reader);
    return reader;
  }
  template <typename Type>
  dds::DataWriter* request_writer(const char* topic) {
    try {
      return &participant.create_writer<Type>(topic, idl::teach_writer_qos(), "");
    } catch (const std::runtime_error& error) {
      if (!participant.is_access_controlled()) throw;
      refused = error.what();
      return nullptr;
    }
  }
};

// Has its own participant, which exists only while pages are open.
struct BusReader::Previews {
  explicit Previews(const idl::ParticipantOptions& options) : participant(named(options, "huetrack view, previews")) {
    inbox.attach(participant.create_reader<msg::PreviewPubSubType>(idl::preview_topic, idl::preview_reader_qos()));
  }
  idl::Inbox<msg::Preview> inbox;
  idl::DdsParticipant participant;
};

BusReader::BusReader(const idl::ParticipantOptions& options, EventHub& hub)
    : options_(options),
      hub_(hub),
      connection_(std::make_unique<Connection>(options)),
      refused_(connection_->refused) {}

BusReader::~BusReader() = default;

std::string BusReader::description() const {
  return connection_->participant.description();
}

template <typename Request>
std::string BusReader::enqueue(std::deque<Request>& queue, Request request) {
  if (!refused_.empty()) return "This page may only watch: " + refused_ + ".";
  const std::scoped_lock lock(mutex_);
  if (queue.size() >= most_requests) return "Too many requests wait for the service.";
  if (request.host().empty()) {
    if (shown_host_.empty()) return "There is no service to ask.";
    request.host(shown_host_);
    request.pid(shown_pid_);
  }
  queue.push_back(std::move(request));
  return "";
}

std::string BusReader::request(msg::TeachRequest request) {
  return enqueue(requests_, std::move(request));
}

std::string BusReader::request(msg::ControlRequest request) {
  return enqueue(control_requests_, std::move(request));
}

std::shared_ptr<RecordingDownload> BusReader::download(const std::vector<std::string>& words, std::string& why_not) {
  const std::scoped_lock lock(mutex_);
  std::erase_if(downloads_, [](const auto& download) { return download.expired(); });
  why_not = !refused_.empty()                     ? "This page may only watch: " + refused_ + "."
            : shown_host_.empty()                 ? "There is no service to ask."
            : downloads_.size() >= most_downloads ? "Too many recordings are being downloaded at once."
                                                  : "";
  if (!why_not.empty()) return nullptr;
  // Unique, and not guessable by a page.
  auto download = std::make_shared<RecordingDownload>(words, random_token(), shown_host_, shown_pid_);
  downloads_.push_back(download);
  return download;
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
  take_statuses();
  take_what_services_say();
  take_replies();
  take_control_replies();
  if (previews_) take_previews();
  send_all(requests_, connection_->request);
  send_all(control_requests_, connection_->control_request);
  go_on_with_downloads();
  if (now >= next_pulse_) {
    next_pulse_ = now + pulse_period;
    publish_pulse();
    if (connection_->participant.network_changed()) {
      try {
        connection_ = std::make_unique<Connection>(options_);
        previews_.reset();  // recreated by the next poll()
        trouble_.clear();
      } catch (const std::invalid_argument& error) {  // a given interface is gone
        trouble_ = error.what();
      } catch (const std::runtime_error& error) {  // Fast DDS refuses
        trouble_ = error.what();
      }
    }
  }
}

bool BusReader::is_silent(const Service& service) {
  return Clock::now() - service.last_status >= gone_after;
}

BusReader::Service* BusReader::service(const std::string& id) {
  if (services_.size() >= most_services && !services_.contains(id)) {
    const auto silent = std::ranges::find_if(services_, [](const auto& entry) { return is_silent(entry.second); });
    if (silent == services_.end() || is_shown(silent->first)) return nullptr;
    services_.erase(silent);
  }
  const auto [it, is_new] = services_.try_emplace(id);
  if (is_new) it->second.began = it->second.last_status = Clock::now();
  return &it->second;
}

// Switches all pages to this service.
void BusReader::show(const std::string& id) {
  if (const auto old = services_.find(shown_); old != services_.end()) {
    for (const auto& [key, event] : old->second.events) hub_.erase(key);
    for (const std::string& camera : old->second.cameras) hub_.erase(preview_key(camera));
  }
  hub_.forget_appended();
  shown_ = id;
  {
    const std::scoped_lock lock(mutex_);
    shown_host_ = id.empty() ? "" : services_.at(id).host;
    shown_pid_ = id.empty() ? 0 : services_.at(id).pid;
  }
  if (id.empty()) return;
  const Service& now = services_.at(id);
  hub_.set("status", now.events.at("status"));  // first: it identifies the service
  for (const auto& [key, event] : now.events)
    if (key != "status") hub_.set(key, event);
  for (const Early& early : early_)
    if (early.process == now.process) hub_.append(early.event, early.was_sent);
  early_.clear();
}

// Stores the latest sample of a service, per camera where it is of one.
void BusReader::keep(const std::string& id, const std::string& name, const std::string& json,
                     const std::string& camera) {
  Service* const of = service(id);
  if (of == nullptr) return;
  const std::string key = name + (camera.empty() ? "" : "/" + camera);
  const auto is_of_camera = [](const auto& event) { return event.first.find('/') != std::string::npos; };
  if (!camera.empty() && !of->events.contains(key) &&
      std::size_t(std::ranges::count_if(of->events, is_of_camera)) >= most_maps)
    return;
  const std::string& event = of->events[key] = to_event(name, json);
  if (is_shown(id)) hub_.set(key, event);
}

// Positions and previews do not name their service, but DDS names the process that wrote them. Samples of other
// processes than the shown service's are not shown, but counted for publish_pulse().
bool BusReader::is_of_another(const Process& process) {
  if (shown_.empty() || services_.at(shown_).process == process) return false;
  const bool is_known =
      std::ranges::any_of(services_, [&](const auto& entry) { return entry.second.process == process; });
  if (!is_known && (foreign_samples_.size() < most_foreign || foreign_samples_.contains(process)))
    ++foreign_samples_[process];
  return true;
}

void BusReader::append(const Process& process, std::string event) {
  // Before its service's first status: kept, since a held replay publishes no others.
  const bool was_sent = !is_of_another(process);
  if (std::ranges::none_of(services_, [&](const auto& entry) { return entry.second.process == process; })) {
    early_.push_back({process, event, was_sent});
    if (early_.size() > most_early) early_.pop_front();
  }
  if (was_sent) hub_.append(std::move(event));
}

void BusReader::take_positions() {
  take_all(connection_->position,
           [&](const auto& sample, const Process& process) { append(process, to_event("position", to_json(sample))); });
  take_all(connection_->camera_pose, [&](const auto& sample, const Process& process) {
    append(process, to_event("camera_pose", to_json(sample)));
  });
}

void BusReader::take_statuses() {
  const auto now = Clock::now();
  take_all(connection_->status, [&](const auto& sample, const Process& process) {
    const std::string id = id_of(sample);
    Service* const it = service(id);
    if (it == nullptr) return;
    it->last_status = now;
    it->process = process;
    it->host = sample.host();
    it->pid = sample.pid();
    it->config_file = sample.config_file();
    std::set<std::string> cameras;
    for (const auto& camera : sample.cameras()) cameras.insert(camera.name());
    if (is_shown(id))
      for (const std::string& camera : it->cameras)
        if (!cameras.contains(camera)) hub_.erase(preview_key(camera));
    it->cameras = std::move(cameras);
    keep(id, "status", to_json(sample, unix_now()));
  });
  // Kept: one that goes on, as after a laptop's sleep, publishes its scene only when that changes.
  if (!shown_.empty() && is_silent(services_.at(shown_))) {
    show("");
    ::malloc_trim(0);  // returns megabytes of pictures to the system
  }
  // Of the services with a status.
  std::string newest;
  for (const auto& [id, it] : services_)
    if (it.events.contains("status") && !is_silent(it) &&
        (newest.empty() || std::pair(it.began, id) > std::pair(services_.at(newest).began, newest)))
      newest = id;
  if (newest != shown_) show(newest);
}

void BusReader::take_what_services_say() {
  take_all(connection_->camera_map, [&](const auto& sample, const Process&) {
    keep(id_of(sample), "camera_map", to_json(sample), sample.camera());
  });
  take_all(connection_->scene,
           [&](const auto& sample, const Process&) { keep(id_of(sample), "scene", to_json(sample)); });
  take_all(connection_->times,
           [&](const auto& sample, const Process&) { keep(id_of(sample), "camera_times", to_json(sample)); });
  take_all(connection_->clocks,
           [&](const auto& sample, const Process&) { keep(id_of(sample), "host_clocks", to_json(sample)); });
}

void BusReader::take_replies() {
  const auto now = Clock::now();
  take_all(connection_->reply, [&](const auto& sample, const Process&) {
    // The latest per client, for that client only, and for a short time: replies contain pictures.
    const std::string key =
        "teach/" + sample.client() + (sample.cameras().empty() || sample.cameras()[0].jpeg().empty() ? "" : "/frozen");
    if (replies_.size() >= most_replies && !replies_.contains(key)) return;
    hub_.set(key, to_event("teach", to_json(sample)), sample.client());
    replies_[key] = now;
  });
  std::erase_if(replies_, [&](const auto& entry) {
    if (now - entry.second < keep_replies_for) return false;
    hub_.erase(entry.first);
    return true;
  });
}

// Those that are still shared.
std::vector<std::shared_ptr<RecordingDownload>> BusReader::held_downloads() {
  const std::scoped_lock lock(mutex_);
  std::erase_if(downloads_, [](const auto& download) { return download.expired(); });
  std::vector<std::shared_ptr<RecordingDownload>> held;
  for (const auto& download : downloads_)
    if (auto one = download.lock()) held.push_back(std::move(one));
  return held;
}

void BusReader::take_control_replies() {
  const auto downloads = held_downloads();
  take_all(connection_->control_reply, [&](const auto& sample, const Process& process) {
    if (is_of_another(process)) return;
    for (const auto& download : downloads)
      if (download->client() == sample.client()) return download->take(sample);
    // Each of them: a page that misses the reply to an earlier request repeats that request.
    if (sample.bytes().empty()) hub_.append(to_event("control", to_json(sample)), false, sample.client());
  });
}

void BusReader::go_on_with_downloads() {
  const auto downloads = held_downloads();
  for (const auto& download : downloads)
    if (auto request = download->next_request(Clock::now()); request && connection_->control_request != nullptr)
      connection_->control_request->write(&*request);
  downloading_ = int(downloads.size());
}

void BusReader::take_previews() {
  take_all(previews_->inbox, [&](const msg::Preview& preview, const Process& process) {
    // Pictures of cameras that the shown service does not name would never be removed.
    if (is_of_another(process) || shown_.empty() || !services_.at(shown_).cameras.contains(preview.camera())) return;
    hub_.set(preview_key(preview.camera()), to_event("preview", to_json(preview)));
  });
}

template <typename Request>
void BusReader::send_all(std::deque<Request>& queue, dds::DataWriter* writer) {
  for (;;) {
    Request request;
    {
      const std::scoped_lock lock(mutex_);
      if (queue.empty()) return;
      request = std::move(queue.front());
      queue.pop_front();
    }
    if (writer != nullptr) writer->write(&request);
  }
}

void BusReader::publish_pulse() {
  std::string trouble = trouble_;
  if (services_.size() > 1 && !shown_.empty()) {
    std::vector<std::string> others;
    for (const auto& [id, it] : services_)
      // Not one that ended, also before the shown one began.
      if (!is_shown(id) && it.events.contains("status") && !is_silent(it) &&
          it.last_status > services_.at(shown_).began)
        others.push_back(id + " (" + it.config_file + ")");
    if (!others.empty())
      trouble += fmt::format(
          "{}More than one service publishes here. Shown is the one that came last, {} ({}); not shown: {}. End one, "
          "or give them different dds: {{domain: ...}}",
          trouble.empty() ? "" : "; ", shown_, services_.at(shown_).config_file, fmt::join(others, ", "));
  }
  for (const auto& [process, samples] : std::exchange(foreign_samples_, {}))
    trouble += fmt::format(
        "{}{} samples came from a program that is not the service shown: they are not shown. Without "
        "DDS Security, anybody on this network can send them",
        trouble.empty() ? "" : "; ", samples);
  dds::LivelinessChangedStatus liveliness;
  connection_->position_reader.get_liveliness_changed_status(liveliness);
  hub_.set("pulse", to_event("pulse", to_json(Pulse{.now = unix_now(),
                                                    .domain = connection_->participant.domain(),
                                                    .bus = connection_->participant.description(),
                                                    .publishers = liveliness.alive_count,
                                                    .trouble = trouble})));
}

}  // namespace huetrack::live_view
