#include "hosts/camera_host.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "capture/timing/capture_clock.h"
#include "hosts/frame_message.h"
#include "hosts/frame_window.h"
#include "hosts/machine_clock.h"
#include "hosts/match_finder.h"
#include "hosts/wanted_matches.h"
#include "hosts/wanted_outlines.h"
#include "idl/arrivals.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/dds_participant.h"
#include "idl/topics.h"

namespace huetrack::hosts {

namespace dds = eprosima::fastdds::dds;
using namespace std::chrono_literals;

namespace {

constexpr auto published_every = 1s;
constexpr std::uint32_t most_of_outlines = 32 * 1024;  // bytes of a sample: sixteen for each of a tracker's 64 cameras
constexpr const char* new_keys = "make new ones with configs/dds/secure.sh, role host; ";
// One Ethernet packet (MTU 1500 minus IP and UDP headers). A larger datagram is lost with any of its fragments: 64 kB
// ones at a rate of 1 in 23 when 1 packet in 1000 is lost. The kernel also keeps the other fragments for 30 s until its
// memory for them is full (net.ipv4.ipfrag_high_thresh, 4 MB), and then accepts no large datagram at all. Of small
// datagrams Fast DDS retransmits only the lost ones.
constexpr idl::Datagrams of_frames{.largest = 1472, .buffer = 1 << 20};

// The same states, by number.
msg::HostedCameraState state_of(capture::CaptureState state) {
  static_assert(std::uint32_t(capture::CaptureState::delivering) == msg::HOSTED_CAMERA_DELIVERING &&
                std::uint32_t(capture::CaptureState::absent) == msg::HOSTED_CAMERA_ABSENT);
  return static_cast<msg::HostedCameraState>(state);
}

bool have_all(dds::DataWriter& writer) {
  return writer.wait_for_acknowledgments({0, 0}) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
}

bool has_readers(dds::DataWriter& writer) {
  dds::PublicationMatchedStatus matched;
  writer.get_publication_matched_status(matched);
  return matched.current_count > 0;
}

}  // namespace

bool is_host_name(std::string_view name) {
  return !name.empty() && name.size() <= 100 && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
  });
}

std::string name_of_this_machine() {
  std::string name = idl::PublisherIdentity::of_this_process({}).host;
  std::erase_if(name, [](char c) { return !is_host_name(std::string_view(&c, 1)); });
  return name;
}

struct CameraHost::Impl {
  struct Camera {
    std::string name;
    capture::LiveCamera live;
    dds::DataWriter* writer = nullptr;
    WantedOutlines outlines;  // guarded by outlines_mutex
    std::mutex mutex;
    WantedMatches wanted;                      // guarded by mutex
    std::string light;                         // description of light problems; guarded by mutex
    std::vector<capture::CameraEvent> events;  // of light, not reported yet; guarded by mutex
    std::atomic<std::uint64_t> frames = 0, refused = 0, left_out = 0, bytes = 0;
  };

  Impl(CameraHostOptions given, std::vector<capture::LiveCamera> live)
      : options(std::move(given)),
        run(capture::unix_now().time_since_epoch().count()),
        participant(options.transport, nullptr, of_frames),
        host(
            participant.create_writer<msg::CameraHostPubSubType>(idl::camera_host_topic, idl::status_writer_qos(), "")),
        echo(participant.create_writer<msg::ClockEchoPubSubType>(idl::clock_echo_topic, idl::clock_writer_qos(), "")),
        probe(participant.create_reader<msg::ClockProbePubSubType>(idl::clock_probe_topic, idl::clock_reader_qos())) {
    for (std::size_t c = 0; c < live.size(); ++c) {
      auto& camera = cameras.emplace_back(std::make_unique<Camera>());
      camera->name = options.cameras.at(c);
      camera->live = std::move(live[c]);
      camera->writer = &participant.create_writer<msg::CameraFramePubSubType>(
          idl::camera_frames_topic(options.host, camera->name), idl::camera_frames_writer_qos(), "");
    }
    try {
      looked_for =
          &participant.create_reader<msg::LookedForColorsPubSubType>(idl::looked_for_topic, idl::status_reader_qos());
      matches_writer = &participant.create_writer<msg::CameraMatchesPubSubType>(idl::camera_matches_topic(options.host),
                                                                                idl::camera_matches_writer_qos(), "");
    } catch (const std::runtime_error& error) {
      if (!participant.is_access_controlled()) throw;
      looked_for = nullptr;
      refusal = std::string(
                    "its matches cannot be sent (send: matches of a tracker), because this host's keys are too old: ") +
                new_keys + error.what();
    }
    try {
      outlines = &participant.create_reader<msg::ExpectedOutlinesPubSubType>(idl::camera_outlines_topic(options.host),
                                                                             idl::clock_reader_qos(), most_of_outlines);
    } catch (const std::runtime_error& error) {
      if (!participant.is_access_controlled()) throw;
      if (refusal.empty())
        refusal = std::string(
                      "trackers cannot fit outlines with its matches (send: matches), because this host's keys are too "
                      "old: ") +
                  new_keys + error.what();
    }
    clock = std::jthread([this](const std::stop_token& stop) { answer_clock_probes(stop); });
    if (looked_for != nullptr)
      request_reader = std::jthread([this](const std::stop_token& stop) { read_requested_colors(stop); });
  }

  // A thread of its own, because every delay of an answer adds to the clock's uncertainty.
  void answer_clock_probes(const std::stop_token& stop) {
    idl::Arrivals questions(probe);
    msg::ClockProbe question;
    while (!stop.stop_requested()) {
      questions.wait(100ms);
      const capture::Timestamp came = capture::unix_now();
      while (idl::take_next(probe, question)) {
        msg::ClockEcho answer;
        answer.host(options.host);
        answer.run(run);
        answer.tracker(question.tracker());
        answer.number(question.number());
        answer.sent_at(question.sent_at());
        answer.received_at(came.time_since_epoch().count());
        const MachineClock clock_here = machine_clock();
        answer.machine(clock_here.machine);
        answer.zero(clock_here.zero.time_since_epoch().count());
        answer.kept_s(clock_here.kept_s.value_or(std::numeric_limits<double>::quiet_NaN()));
        answer.answered_at(capture::unix_now().time_since_epoch().count());
        echo.write(&answer);
      }
    }
  }

  void read_requested_colors(const std::stop_token& stop) {
    idl::Arrivals arrivals(*looked_for);
    msg::LookedForColors request;
    while (!stop.stop_requested()) {
      arrivals.wait(100ms);
      while (idl::take_next(*looked_for, request)) {
        if (request.host() != options.host) continue;
        const auto camera = std::ranges::find(cameras, request.camera(), [](const auto& c) { return c->name; });
        if (camera == cameras.end()) continue;
        const std::scoped_lock lock((*camera)->mutex);
        (*camera)->wanted.update(request, std::chrono::steady_clock::now());
      }
    }
  }

  // False: no tracker requests a colour.
  static bool has_requests(Camera& camera, MatchFinderOptions& out) {
    const std::scoped_lock lock(camera.mutex);
    camera.wanted.all(std::chrono::steady_clock::now(), out);
    return !out.colors.empty();
  }

  // Reads the trackers' predicted outlines for all cameras, and returns the places for this camera's frame.
  void update_outlines(Camera& camera, const capture::Frame& frame, std::vector<capture::PatchPlace>& out) {
    out.clear();
    if (outlines == nullptr) return;
    const std::scoped_lock lock(outlines_mutex);
    while (idl::take_next(*outlines, outlines_message)) {
      for (const msg::OutlinesOfCamera& of : outlines_message.cameras()) {
        const auto known = std::ranges::find(cameras, of.camera(), [](const auto& c) { return c->name; });
        if (known != cameras.end() && of.run() == run) (*known)->outlines.update(outlines_message.tracker(), of);
      }
    }
    camera.outlines.places_at(frame.stamped_at, out);
    camera.outlines.note(frame.sequence, frame.stamped_at);
  }

  // A tracker that receives matches has too few pictures to detect this.
  void watch_light(Camera& camera, const MatchFinder& finder, capture::LightFindings& known) const {
    if (!options.describe_light || finder.light() == known) return;
    known = finder.light();
    std::string text = options.describe_light(known);
    const std::scoped_lock lock(camera.mutex);
    camera.light = text;
    if (!text.empty())
      camera.events.push_back({.at = capture::unix_now(),
                               .state = capture::CaptureState::delivering,
                               .is_problem = true,
                               .message = std::move(text)});
  }

  template <typename Message>
  static void send(Camera& camera, dds::DataWriter& writer, Message& message) {
    if (writer.write(&message)) {
      ++camera.frames;
      camera.bytes += message.bytes().size();
    } else {
      ++camera.refused;
    }
  }

  void send_frames(Camera& camera, const std::stop_token& stop) {
    msg::CameraFrame message;
    message.run(run);
    msg::CameraMatches matches;
    matches.run(run);
    matches.camera(camera.name);
    MatchFinder finder;
    MatchFinderOptions requests;
    capture::LightFindings light;
    FrameWindow window;
    while (const auto frame = camera.live.source->next(stop)) {
      if (matches_writer != nullptr && has_readers(*matches_writer) && has_requests(camera, requests)) {
        update_outlines(camera, *frame, requests.patches);
        matches.number(frame->sequence);
        matches.stamped_at(frame->stamped_at.time_since_epoch().count());
        const auto bytes = frame->status == capture::FrameStatus::ok ? finder.find(*frame, requests) : std::nullopt;
        watch_light(camera, finder, light);
        matches.is_damaged(!bytes);
        matches.bytes().clear();
        if (bytes) matches.bytes().assign(bytes->begin(), bytes->end());
        send(camera, *matches_writer, matches);
      } else if (!(std::exchange(light, {}) == capture::LightFindings{})) {
        const std::scoped_lock lock(camera.mutex);  // without requests light is not watched
        camera.light.clear();
      }
      if (frame->matches || !has_readers(*camera.writer)) continue;  // a frame of matches has no picture
      if (!window.may_send(have_all(*camera.writer), std::chrono::steady_clock::now())) {
        ++camera.left_out;
        continue;
      }
      to_message(*frame, message);
      send(camera, *camera.writer, message);
    }
  }

  static std::string warning_of(Camera& camera, const capture::CameraHealth& health) {
    const std::scoped_lock lock(camera.mutex);
    return health.warning + (health.warning.empty() || camera.light.empty() ? "" : "; ") + camera.light;
  }

  void write_states() {
    msg::CameraHost out;
    out.host(options.host);
    out.run(run);
    out.program_version(options.program_version);
    for (const auto& camera : cameras) {
      const capture::CameraHealth health = camera->live.health();
      msg::HostedCamera& to = out.cameras().emplace_back();
      to.name(camera->name);
      to.state(state_of(health.state));
      to.message(health.state == capture::CaptureState::delivering ? warning_of(*camera, health) : health.message);
      if (health.stream) {
        to.width(static_cast<std::uint16_t>(health.stream->width));
        to.height(static_cast<std::uint16_t>(health.stream->height));
        to.fps(health.stream->fps);
      }
      to.frames(health.frames);
      to.dropped(health.dropped);
      to.corrupted(health.corrupted);
    }
    out.at(capture::unix_now().time_since_epoch().count());
    host.write(&out);
  }

  const CameraHostOptions options;
  const std::int64_t run;
  idl::DdsParticipant participant;
  dds::DataWriter &host, &echo;
  dds::DataReader& probe;
  dds::DataReader* looked_for = nullptr;      // nullptr: the keys do not allow it
  dds::DataWriter* matches_writer = nullptr;  // of all cameras; nullptr: the keys do not allow it
  dds::DataReader* outlines = nullptr;        // of all cameras; nullptr: the keys do not allow it
  std::string refusal;                        // the reason; reported once
  std::vector<std::unique_ptr<Camera>> cameras;
  std::mutex outlines_mutex;
  msg::ExpectedOutlines outlines_message;  // scratch; guarded by outlines_mutex
  std::chrono::steady_clock::time_point published_at{};
  std::jthread clock, request_reader;  // last: they end first
};

void require_host_names(const std::string& host, std::span<const std::string> cameras) {
  if (!is_host_name(host))
    throw std::invalid_argument("host: \"" + host +
                                "\": the name of a camera host has letters, digits, '_', '-' and '.' only");
  for (const std::string& name : cameras)
    if (!is_host_name(name))
      throw std::invalid_argument("cameras: \"" + name +
                                  "\": the name of a camera has letters, digits, '_', '-' and '.' only");
}

CameraHost::CameraHost(CameraHostOptions options, std::vector<capture::LiveCamera> cameras) {
  require_host_names(options.host, options.cameras);
  impl_ = std::make_unique<Impl>(std::move(options), std::move(cameras));
}

CameraHost::~CameraHost() = default;

void CameraHost::run(const std::stop_token& stop) {
  std::vector<std::jthread> threads;
  for (auto& camera : impl_->cameras)
    threads.emplace_back([this, &camera, stop] { impl_->send_frames(*camera, stop); });
}

std::vector<CameraHost::Event> CameraHost::publish_states() {
  std::vector<Event> out;
  if (const std::string refusal = std::exchange(impl_->refusal, ""); !refusal.empty())
    for (const auto& camera : impl_->cameras)
      out.push_back(
          {camera->name,
           {.at = capture::unix_now(), .state = camera->live.health().state, .is_problem = true, .message = refusal}});
  for (const auto& camera : impl_->cameras) {
    for (auto& event : camera->live.take_events()) out.push_back({camera->name, std::move(event)});
    const std::scoped_lock lock(camera->mutex);
    for (auto& event : std::exchange(camera->events, {})) out.push_back({camera->name, std::move(event)});
  }
  const auto now = std::chrono::steady_clock::now();
  if (!out.empty() || now - impl_->published_at >= published_every) {
    impl_->published_at = now;
    impl_->write_states();
  }
  return out;
}

std::vector<capture::CameraHealth> CameraHost::healths() const {
  std::vector<capture::CameraHealth> out;
  for (const auto& camera : impl_->cameras) out.push_back(camera->live.health());
  return out;
}

std::vector<SentFigures> CameraHost::sent() const {
  std::vector<SentFigures> out;
  for (const auto& camera : impl_->cameras)
    out.push_back(
        {.frames = camera->frames, .refused = camera->refused, .left_out = camera->left_out, .bytes = camera->bytes});
  return out;
}

std::string CameraHost::description() const {
  return impl_->participant.description();
}

}  // namespace huetrack::hosts
