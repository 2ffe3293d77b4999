#include "hosts/remote_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>

#include "capture/timing/camera_clock.h"
#include "capture/timing/capture_clock.h"
#include "hosts/camera_host.h"
#include "hosts/clock_offset.h"
#include "hosts/frame_message.h"
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
using Clock = std::chrono::steady_clock;

namespace {

constexpr auto probe_every = 250ms, probe_at_start_every = 30ms;
constexpr std::uint32_t probes_at_start = 20;
constexpr auto silent_after = 2500ms;        // hosts publish their state every second
constexpr auto awaited_for = 60s;            // a host that vanished may be back soon
constexpr auto alive_for = 3 * probe_every;  // after an answer: another host of the same name is ignored meanwhile
constexpr auto twin_reported_for = 5s;       // after both have answered
constexpr auto stalled_after = 1s;
constexpr auto longest_wait = 50ms;      // for a frame, before a stop is checked
constexpr unsigned most_groups = 8;      // of cameras of matches
constexpr auto clocks_compared_in = 5s;  // no advice on clocks before: they improve quickly
// Hysteresis of the warning. At 1 ms a ball at 1 m/s has 1 mm of error, as much as from all other sources.
constexpr double bad_clock_sigma_s = 1e-3, good_clock_sigma_s = 0.7e-3;
constexpr double longest_kept_s = 1000;     // a larger reported error means: not synchronised
constexpr double worst_clock_sigma_s = 1;   // upper limit of StampClock::sigma
constexpr std::uint32_t longest_loss = 30;  // frames; a longer one is an outage, which is reported by itself
constexpr std::uint32_t most_of_header = 64 * 1024, most_of_matches_header = 1024;
// Synchronised cameras' frames arrive at the same moment.
constexpr idl::Datagrams room_for_frames{.buffer = 4 << 20};

constexpr auto colors_sent_every = 2s;  // less than half of WantedMatches::forgotten_after
constexpr std::size_t most_colors = capture::Matches::most;
constexpr std::uint32_t longest_without_colors = 60;  // frames; a host needs a few for new colours

// The camera's format, as far as StreamFormat has it.
std::optional<capture::CaptureFormat> format_of(const capture::Frame& frame) {
  if (frame.encoded && !frame.matches) return capture::CaptureFormat::mjpeg;
  switch (frame.pixels.format) {
    case capture::PixelFormat::yuyv:
      return capture::CaptureFormat::yuyv;
    case capture::PixelFormat::nv12:
      return capture::CaptureFormat::nv12;
    case capture::PixelFormat::grey:
      return capture::CaptureFormat::grey;
    case capture::PixelFormat::i420:
    case capture::PixelFormat::i422:
    case capture::PixelFormat::i444:
      if (frame.matches) return capture::CaptureFormat::mjpeg;
      break;
    case capture::PixelFormat::bgr:
      break;
  }
  return std::nullopt;
}

// How to improve the clock; empty: fine. is_open: sigma_s is too large for good positions.
std::string clock_advice(const capture::HostClock& clock, bool is_open) {
  if (clock.is_contradicted && !clock.is_ours && clock.kept_s)
    return fmt::format(
        "the clock of {} is {:.1f} ms off ours, where NTP or PTP say that both are kept to {:.1f} ms: give both one "
        "source of time; the measured offset is taken off",
        clock.host, 1e3 * clock.offset_s, 1e3 * *clock.kept_s);
  if (!is_open) return {};
  const std::string known = fmt::format("the clock of {} is known to {:.1f} ms only", clock.host, 1e3 * clock.sigma_s);
  if (clock.kept_s)
    return fmt::format(
        "{}, and NTP keeps it to {:.1f} ms: a cable instead of a wireless network, chrony there with this host as its "
        "server, or, where the network cards stamp (ethtool -T), linuxptp on both",
        known, 1e3 * *clock.kept_s);
  return known +
         ": install chrony on both (apt install chrony), there with this host as its server; where the network cards "
         "stamp (ethtool -T) linuxptp is better; a cable instead of a wireless network helps, too";
}

// Stamps are untrusted. Two valid ones can be subtracted without overflow: from a few days before 1970 (a host whose
// clock was never set) to the year 2096.
bool is_a_time(std::int64_t unix_ns) {
  return unix_ns > -1'000'000'000'000'000 && unix_ns < 4'000'000'000'000'000'000;
}

capture::Timestamp timestamp(std::int64_t unix_ns) {
  return capture::Timestamp(capture::Duration(unix_ns));
}

}  // namespace

struct RemoteCameras::Impl {
  // Members of Host and Camera are guarded by `mutex` unless stated otherwise.
  struct Host {
    std::int64_t run = 0;
    ClockOffset clock;
    std::optional<Clock::time_point> seen_at;
    Clock::time_point answered_at{};  // its last clock echo
    // Another host of the same name that answers at the same time.
    std::uint32_t answered_by_twin = 0;  // the number of a probe
    std::optional<Clock::time_point> twin_at;
    std::vector<msg::HostedCamera> cameras;
    std::uint16_t number = 0;      // Frame::clock
    std::optional<double> kept_s;  // MachineClock::kept_s of both hosts combined; nullopt: not on both
    bool is_this_machine = false;
    std::string advice;                   // on its clock
    dds::DataReader* matches = nullptr;   // of all its cameras; thread-safe by itself
    dds::DataWriter* outlines = nullptr;  // the same
    msg::ExpectedOutlines expected;       // not sent yet; guarded by outlines_mutex
  };
  struct Camera {
    RemoteCameraOptions options;
    dds::DataReader* reader = nullptr;        // thread-safe by itself; nullptr: with matches, see Host::matches
    std::unique_ptr<idl::Arrivals> arrivals;  // of reader; the source's
    capture::CameraHealth health;
    std::vector<capture::CameraEvent> events;
    std::optional<Clock::time_point> frame_at;
    bool was_absent = false;  // since it delivered
    std::vector<capture::MatchedColor> looked_for;
    std::optional<Clock::time_point> colors_sent_at;  // nullopt: not sent yet
    // Used by the source's thread only, unless stated otherwise.
    capture::JpegReader jpeg;
    capture::CameraClock clock;
    std::int64_t run = 0;                        // written under `mutex`
    std::uint32_t base = 0;                      // of the run's numbers; written under `mutex`
    std::optional<std::uint32_t> last_sequence;  // Frame::sequence
    capture::DamageWatch losses;                 // in the network
    capture::Image picture;                      // the latest picture, with matches
    std::uint32_t without_colors = 0;            // frames in a row
  };

  Impl(const idl::ParticipantOptions& transport, std::vector<RemoteCameraOptions> given)
      : participant(transport, nullptr, room_for_frames),
        probe(
            participant.create_writer<msg::ClockProbePubSubType>(idl::clock_probe_topic, idl::clock_writer_qos(), "")),
        echo(participant.create_reader<msg::ClockEchoPubSubType>(idl::clock_echo_topic, idl::clock_reader_qos())),
        looked_for(participant.create_writer<msg::LookedForColorsPubSubType>(idl::looked_for_topic,
                                                                             idl::status_writer_qos(), "")),
        states(participant.create_reader<msg::CameraHostPubSubType>(idl::camera_host_topic, idl::status_reader_qos())),
        // Not seeded: it must differ between programs, and no result depends on it.
        tracker(static_cast<std::int64_t>(std::random_device{}()) << 32 | std::random_device{}()) {
    std::uint32_t largest = 0, largest_matches = 0;
    for (const auto& options : given) {
      largest = std::max(largest, static_cast<std::uint32_t>(3 * options.width * options.height) + most_of_header);
      largest_matches =
          std::max(largest_matches, static_cast<std::uint32_t>(most_bytes_of_matches(options.width, options.height)) +
                                        most_of_matches_header);
    }
    for (auto& options : given) {
      auto& camera = *cameras.emplace_back(std::make_unique<Camera>());
      camera.options = std::move(options);
      const auto& [host, there] = std::tie(camera.options.host, camera.options.camera_there);
      if (!camera.options.are_matches) {
        camera.reader = &participant.create_reader<msg::CameraFramePubSubType>(
            idl::camera_frames_topic(host, there), idl::camera_frames_reader_qos(), largest);
        camera.arrivals = std::make_unique<idl::Arrivals>(*camera.reader);
      } else if (hosts[host].matches == nullptr) {
        hosts[host].matches = &participant.create_reader<msg::CameraMatchesPubSubType>(
            idl::camera_matches_topic(host), idl::camera_matches_reader_qos(), largest_matches);
        hosts[host].outlines = &participant.create_writer<msg::ExpectedOutlinesPubSubType>(
            idl::camera_outlines_topic(host), idl::clock_writer_qos(), "");
      }
      camera.health.last_progress = Clock::now();
      hosts[camera.options.host];
    }
    for (std::uint16_t number = 1; auto& [name, host] : hosts) host.number = number++;
    started = Clock::now();
    keeper = std::jthread([this](const std::stop_token& stop) { run_keeper(stop); });
  }

  // Thread: sends clock probes, reads answers and states.
  void run_keeper(const std::stop_token& stop) {
    // Also wakes up for states: their reader keeps memory for the most that ever waited in it.
    idl::Arrivals answers(std::array{&echo, &states});
    auto next_probe = Clock::now();
    while (!stop.stop_requested()) {
      const auto now = Clock::now();
      read_states();
      if (now >= next_probe) {
        send_probe();
        update_states();
        next_probe = now + (needs_clock_soon() ? probe_at_start_every : probe_every);
      }
      send_colors();
      read_clock_echoes();
      answers.wait(std::max<Clock::duration>(next_probe - Clock::now(), 1ms));
      read_clock_echoes();
    }
  }

  // At the start, and while frames of a present (or recently present) host wait for its clock.
  bool needs_clock_soon() const {
    if (probes < probes_at_start) return true;
    const auto now = Clock::now();
    const std::scoped_lock lock(mutex);
    return std::ranges::any_of(hosts, [&](const auto& entry) {
      const Host& host = entry.second;
      return host.seen_at && now - *host.seen_at < awaited_for &&
             !(host.clock.is_known() && now - host.answered_at < 2 * probe_every);
    });
  }

  void send_probe() {
    msg::ClockProbe question;
    question.tracker(tracker);
    question.number(++probes);
    const capture::Timestamp now = capture::unix_now();
    sent_probes[probes % sent_probes.size()] = {probes, now};
    question.sent_at(now.time_since_epoch().count());
    probe.write(&question);
  }

  void look_for(Camera& camera, std::span<const capture::MatchedColor> colors) {
    const std::scoped_lock lock(mutex);
    camera.looked_for.assign(colors.begin(), colors.begin() + std::ptrdiff_t(std::min(colors.size(), most_colors)));
    camera.colors_sent_at.reset();
  }

  void expect_outlines(Camera& camera, std::uint32_t frame, std::span<const capture::ExpectedOutline> outlines) {
    msg::OutlinesOfCamera of;
    of.camera(camera.options.camera_there);
    to_message(outlines, of);
    const std::scoped_lock lock(mutex, outlines_mutex);
    of.run(camera.run);
    of.number(frame + camera.base);
    hosts.at(camera.options.host).expected.cameras().push_back(std::move(of));
  }

  // Called by the tracking thread. Writes at once, so that the next frames can use it.
  void send_outlines(Host& host) {
    const std::scoped_lock lock(outlines_mutex);
    if (host.expected.cameras().empty()) return;
    host.expected.tracker(tracker);
    host.outlines->write(&host.expected);
    host.expected.cameras().clear();
  }

  // On a change, and periodically, because a host may have started since.
  void send_colors() {
    const auto now = Clock::now();
    for (const auto& camera : cameras) {
      if (!camera->options.are_matches) continue;
      msg::LookedForColors out;
      {
        const std::scoped_lock lock(mutex);
        if (camera->colors_sent_at && now - *camera->colors_sent_at < colors_sent_every) continue;
        camera->colors_sent_at = now;
        to_message({camera->looked_for, capture::duration_of(camera->options.picture_every_s)}, out);
      }
      out.tracker(tracker);
      out.host(camera->options.host);
      out.camera(camera->options.camera_there);
      looked_for.write(&out);
    }
  }

  void read_clock_echoes() {
    const capture::Timestamp came = capture::unix_now();
    msg::ClockEcho answer;
    while (idl::take_next(echo, answer)) {
      if (answer.tracker() != tracker) continue;
      if (!std::ranges::all_of(std::array{answer.received_at(), answer.answered_at(), answer.zero()}, is_a_time))
        continue;
      const auto& [number, sent] = sent_probes[answer.number() % sent_probes.size()];
      const std::scoped_lock lock(mutex);
      const auto known = hosts.find(answer.host());
      if (known == hosts.end() || number != answer.number()) continue;
      Host& host = known->second;
      if (host.run != answer.run()) {  // another program: its clock offset differs
        if (is_alive(host)) {
          host.answered_by_twin = answer.number();
          continue;
        }
        host.run = answer.run();
        host.clock.forget();
        host.answered_by_twin = 0;
      }
      host.answered_at = Clock::now();
      // Both answer: this host still answers after its namesake did.
      if (host.answered_by_twin != 0 && answer.number() > host.answered_by_twin) {
        host.twin_at = host.answered_at;
        host.answered_by_twin = 0;
      }
      const MachineClock here = machine_clock();
      const MachineClock there{.machine = answer.machine(),
                               .zero = timestamp(answer.zero()),
                               .kept_s = answer.kept_s() >= 0 && answer.kept_s() < longest_kept_s
                                             ? std::optional(answer.kept_s())
                                             : std::nullopt};
      const ClockSync together = clock_sync(here, there);
      host.is_this_machine = together.sigma_s == 0;
      host.kept_s =
          std::isinf(together.sigma_s) || host.is_this_machine ? std::nullopt : std::optional(together.sigma_s);
      host.clock.set_sync(together);
      host.clock.add({.request_sent = sent,
                      .request_received = timestamp(answer.received_at()),
                      .reply_sent = timestamp(answer.answered_at()),
                      .reply_received = came});
    }
  }

  // Under `mutex`.
  static bool is_alive(const Host& host) { return host.run != 0 && Clock::now() - host.answered_at < alive_for; }

  void read_states() {
    msg::CameraHost message;
    while (idl::take_next(states, message)) {
      const std::scoped_lock lock(mutex);
      const auto known = hosts.find(message.host());
      if (known == hosts.end() || (message.run() != known->second.run && is_alive(known->second))) continue;
      known->second.seen_at = Clock::now();
      known->second.cameras = std::move(message.cameras());
    }
  }

  static std::string delivering(const Camera& camera) {
    return (camera.options.are_matches ? "delivering which pixels match, from " : "delivering, from ") +
           camera.options.host;
  }

  // A camera's state and its message.
  std::pair<capture::CaptureState, std::string> state_of(const Camera& camera, Clock::time_point now) const {
    const Host& host = hosts.at(camera.options.host);
    const std::string& name = camera.options.host;
    const bool has_frames = camera.frame_at && now - *camera.frame_at < stalled_after;
    if (has_frames) return {capture::CaptureState::delivering, delivering(camera)};
    if (!host.seen_at)
      return {capture::CaptureState::absent,
              "its host " + name + " is not found: is `huetrackd capture` running there, with host: " + name +
                  ", in the same DDS domain and network?"};
    if (now - *host.seen_at > silent_after)
      return {capture::CaptureState::absent, "its host " + name + " is silent: waiting for its return"};
    const auto there =
        std::ranges::find(host.cameras, camera.options.camera_there, [](const auto& c) { return c.name(); });
    if (there == host.cameras.end()) {
      std::vector<std::string> names;
      for (const auto& c : host.cameras) names.push_back(c.name());
      return {capture::CaptureState::absent, "its host " + name + " has no camera " + camera.options.camera_there +
                                                 "; it has " +
                                                 (names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", ")))};
    }
    if (there->state() == msg::HOSTED_CAMERA_ABSENT)
      return {capture::CaptureState::absent, name + ": " + there->message()};
    if (there->state() == msg::HOSTED_CAMERA_STALLED)
      return {capture::CaptureState::stalled, name + ": " + there->message()};
    if (there->width() != 0 && (there->width() != camera.options.width || there->height() != camera.options.height))
      return {capture::CaptureState::absent, name + " sends " + std::to_string(there->width()) + "x" +
                                                 std::to_string(there->height()) + ", the rig was calibrated at " +
                                                 std::to_string(camera.options.width) + "x" +
                                                 std::to_string(camera.options.height) + ": set size there"};
    if (!host.clock.is_known())
      return {capture::CaptureState::waiting, "the clock of " + name + " is being compared with ours"};
    if (camera.frame_at || there->state() == msg::HOSTED_CAMERA_DELIVERING)
      return {camera.frame_at ? capture::CaptureState::stalled : capture::CaptureState::waiting,
              "no frames come from " + name +
                  (camera.options.are_matches ? "; for send: matches its program must be as new as ours, and so its "
                                                "keys, and its camera must not hang on one picture"
                                              : "")};
    return {capture::CaptureState::waiting,
            name + ": " + (there->message().empty() ? "no frame yet" : there->message())};
  }

  // Under `mutex`.
  capture::HostClock clock_of(const std::string& name) const {
    const Host& host = hosts.at(name);
    capture::HostClock out;
    out.host = name;
    out.is_known = host.clock.is_known();
    if (!out.is_known) return out;
    const capture::Timestamp now = capture::unix_now();
    out.offset_s = capture::seconds(host.clock.at(now));
    out.sigma_s = host.clock.sigma_s(now);
    out.drift = host.clock.drift();
    out.round_trip_s = host.clock.round_trip_s();
    out.is_ours = host.is_this_machine && !host.clock.is_contradicted();
    out.kept_s = host.kept_s;
    out.is_contradicted = host.clock.is_contradicted();
    out.advice = clock_advice(out, out.sigma_s > (host.advice.empty() ? bad_clock_sigma_s : good_clock_sigma_s));
    return out;
  }

  void update_states() {
    const auto now = Clock::now();
    const std::scoped_lock lock(mutex);
    for (auto& camera : cameras) {
      auto [state, message] = state_of(*camera, now);
      // Discovery takes some time: that is no event.
      if (state != capture::CaptureState::delivering && !camera->frame_at && now - started < silent_after) continue;
      report(*camera, state, std::move(message));
    }
    if (now - started < clocks_compared_in) return;
    for (auto& [name, host] : hosts) host.advice = clock_of(name).advice;
  }

  static void report(Camera& camera, capture::CaptureState state, std::string message) {
    if (camera.health.state == state && camera.health.message == message) return;
    if (state == capture::CaptureState::absent) camera.was_absent = camera.frame_at.has_value();
    if (state == capture::CaptureState::delivering && std::exchange(camera.was_absent, false))
      ++camera.health.reconnects;
    camera.health.state = state;
    camera.health.message = message;
    camera.events.push_back(
        {.at = capture::unix_now(),
         .state = state,
         .is_problem = state == capture::CaptureState::absent || state == capture::CaptureState::stalled,
         .message = std::move(message)});
  }

  // Consumes the message. nullopt: the host's clock is not known yet, or it is another host of that name.
  template <typename Message>
  std::optional<capture::Frame> frame_of(Camera& camera, Message& message) {
    if (!is_a_time(message.stamped_at())) return std::nullopt;
    const capture::Timestamp arrived_at = capture::unix_now();
    capture::Timestamp stamped_at;
    capture::StampClock clock;
    {
      const std::scoped_lock lock(mutex);
      const Host& host = hosts.at(camera.options.host);
      if (!host.clock.is_known() || host.run != message.run()) return std::nullopt;
      stamped_at = host.clock.ours(timestamp(message.stamped_at()));
      clock = {.of = host.number,
               .sigma = capture::duration_of(std::min(host.clock.sigma_s(stamped_at), worst_clock_sigma_s))};
    }
    const std::uint32_t there = message.number();
    if (camera.run != message.run()) {
      const std::scoped_lock lock(mutex);
      camera.run = message.run();
      camera.base = there - (camera.last_sequence ? *camera.last_sequence + 1 : 0);
    }
    capture::Frame frame;
    if constexpr (std::is_same_v<Message, msg::CameraMatches>)
      frame =
          from_message(std::move(message), camera.jpeg, camera.picture, camera.options.width, camera.options.height);
    else
      frame = from_message(std::move(message), camera.jpeg);
    if (frame.pixels.width != camera.options.width || frame.pixels.height != camera.options.height) {
      frame.status = capture::FrameStatus::corrupted;
      frame.pixels = {};
      frame.matches = nullptr;
      frame.encoded = nullptr;
    }
    const bool is_sound = frame.status == capture::FrameStatus::ok;
    frame.camera = camera.options.camera;
    frame.sequence = there - camera.base;
    frame.stamped_at = stamped_at;
    frame.arrived_at = arrived_at;
    frame.latency = camera.options.timing.latency;
    frame.readout = camera.options.timing.readout;
    frame.clock = clock;
    frame.captured_at = (is_sound ? camera.clock.smoothed(stamped_at) : stamped_at) - frame.latency;

    const std::scoped_lock lock(mutex);
    capture::CameraHealth& health = camera.health;
    const std::uint32_t lost = camera.last_sequence && frame.sequence > *camera.last_sequence + 1
                                   ? frame.sequence - *camera.last_sequence - 1
                                   : 0;
    health.dropped += lost;
    for (std::uint32_t i = 0; lost <= longest_loss && i < lost; ++i) camera.losses.add(true);
    camera.losses.add(false);
    health.warning = camera.losses.is_high()
                         ? fmt::format(
                               "{:.0f} % of its frames are lost between {} and here: format: mjpeg there, a wired "
                               "network, or larger socket buffers (service/hosts/README.md)",
                               100 * camera.losses.share(), camera.options.host)
                         : warning_there(camera);
    camera.last_sequence = frame.sequence;
    if (frame.matches) note_colors(camera, *frame.matches);
    if (!is_sound) {
      ++health.corrupted;
      return frame;
    }
    ++health.frames;
    health.last_frame = frame.captured_at;
    health.stamp = capture::StampKind::end_of_frame;
    camera.frame_at = Clock::now();
    if (const auto known = format_of(frame)) {
      double fps = 0;
      for (const auto& c : hosts.at(camera.options.host).cameras)
        if (c.name() == camera.options.camera_there) fps = c.fps();
      health.stream = capture::StreamFormat{.format = *known,
                                            .width = frame.pixels.width,
                                            .height = frame.pixels.height,
                                            .fps = fps,
                                            .range = frame.pixels.range};
    }
    report(camera, capture::CaptureState::delivering, delivering(camera));
    return frame;
  }

  // Under `mutex`. A warning about the host of a camera that delivers, or reported by that host.
  std::string warning_there(const Camera& camera) const {
    const Host& host = hosts.at(camera.options.host);
    if (host.twin_at && Clock::now() - *host.twin_at < twin_reported_for)
      return fmt::format(
          "two camera hosts are called {}, and only the cameras of the first one are used: give each a name of its "
          "own, host: in the configuration of huetrackd capture",
          camera.options.host);
    for (const auto& there : host.cameras)
      if (there.name() == camera.options.camera_there && there.state() == msg::HOSTED_CAMERA_DELIVERING &&
          !there.message().empty())
        return camera.options.host + " reports: " + there.message();
    return {};
  }

  // Under `mutex`. Warns if requested colours are missing for long.
  static void note_colors(Camera& camera, const capture::Matches& matches) {
    capture::CameraHealth& health = camera.health;
    if (std::ranges::all_of(camera.looked_for, [&](const auto& color) { return matches.of(color) != nullptr; })) {
      camera.without_colors = 0;
      return;
    }
    if (++camera.without_colors < longest_without_colors || !health.warning.empty()) return;
    health.warning = camera.options.host +
                     " sends no matches for some targets' colours: the trackers of this camera together request too "
                     "many colours, or these match too much of its pictures; use send: frames for one of them";
  }

  std::optional<capture::Frame> next(Camera& camera, const std::stop_token& stop) {
    msg::CameraFrame message;
    while (!stop.stop_requested()) {
      {
        const std::scoped_lock lock(mutex);
        camera.health.last_progress = Clock::now();
      }
      if (!idl::take_next(*camera.reader, message)) {
        camera.arrivals->wait(longest_wait);
      } else if (auto frame = frame_of(camera, message)) {
        return frame;
      }
    }
    return std::nullopt;
  }

  // Hosts whose matches one thread reads. Messages are small: with a thread per camera most time went into waking up
  // and lock contention.
  struct Group {
    std::vector<Camera*> cameras;           // of matches, of these hosts
    std::vector<dds::DataReader*> readers;  // one a host
    std::vector<std::string> names;         // of these hosts
  };

  struct Reading {
    explicit Reading(Group of) : group(std::move(of)), arrivals(group.readers) {}
    const Group group;
    idl::Arrivals arrivals;
    std::vector<std::size_t> to_read;  // of the hosts; the last one first
    msg::CameraMatches message;
  };

  std::optional<capture::Frame> next(Reading& reading, const std::stop_token& stop) {
    const Group& group = reading.group;
    while (!stop.stop_requested()) {
      if (reading.to_read.empty()) {
        {
          const std::scoped_lock lock(mutex);
          for (Camera* camera : group.cameras) camera->health.last_progress = Clock::now();
        }
        reading.to_read = reading.arrivals.wait(longest_wait);
        continue;
      }
      const std::size_t host = reading.to_read.back();
      if (!idl::take_next(*group.readers[host], reading.message)) {
        reading.to_read.pop_back();
        continue;
      }
      const auto camera = std::ranges::find_if(group.cameras, [&](const Camera* of) {
        return of->options.camera_there == reading.message.camera() && of->options.host == group.names[host];
      });
      if (camera == group.cameras.end()) continue;  // another tracker requested it
      if (auto frame = frame_of(**camera, reading.message)) return frame;
    }
    return std::nullopt;
  }

  // As many as the machine has cores.
  std::vector<Group> groups() const {
    std::vector<Group> all(std::clamp(std::thread::hardware_concurrency(), 1U, most_groups));
    for (std::size_t next = 0; const auto& [name, host] : hosts) {
      if (host.matches == nullptr) continue;
      Group& group = all[next++ % all.size()];
      group.names.push_back(name);
      group.readers.push_back(host.matches);
      for (const auto& camera : cameras)
        if (camera->options.are_matches && camera->options.host == name) group.cameras.push_back(camera.get());
    }
    return all;
  }

  mutable std::mutex mutex;
  std::mutex outlines_mutex;  // taken after mutex
  std::map<std::string, Host> hosts;
  idl::DdsParticipant participant;
  std::vector<std::unique_ptr<Camera>> cameras;  // use the participant's readers
  dds::DataWriter& probe;
  dds::DataReader& echo;
  dds::DataWriter& looked_for;
  dds::DataReader& states;
  const std::int64_t tracker;
  std::uint32_t probes = 0;  // the keeper's
  std::array<std::pair<std::uint32_t, capture::Timestamp>, 32> sent_probes{};
  Clock::time_point started;
  std::jthread keeper;  // last: it ends first
};

RemoteCameras::RemoteCameras(const idl::ParticipantOptions& transport, std::vector<RemoteCameraOptions> cameras) {
  for (const auto& camera : cameras)
    for (const auto& name : {camera.host, camera.camera_there})
      if (!is_host_name(name))
        throw std::invalid_argument("camera " + camera.name + ": \"" + name +
                                    "\" is no name of a camera host or of its camera: letters, digits, '_', '-', '.'");
  impl_ = std::make_shared<Impl>(transport, std::move(cameras));
}

std::vector<capture::LiveCamera> RemoteCameras::live() const {
  class Source final : public capture::FrameSource {
   public:
    Source(std::shared_ptr<Impl> all, Impl::Camera& camera) : all_(std::move(all)), camera_(camera) {}
    std::optional<capture::Frame> next(std::stop_token stop) override { return all_->next(camera_, stop); }

   private:
    std::shared_ptr<Impl> all_;
    Impl::Camera& camera_;
  };
  class SourceOfMany final : public capture::FrameSource {
   public:
    SourceOfMany(std::shared_ptr<Impl> all, Impl::Group group) : all_(std::move(all)), reading_(std::move(group)) {}
    std::optional<capture::Frame> next(std::stop_token stop) override { return all_->next(reading_, stop); }

   private:
    std::shared_ptr<Impl> all_;
    Impl::Reading reading_;
  };
  std::vector<Impl::Group> groups = impl_->groups();
  const auto source_of = [&](Impl::Camera& camera) -> std::unique_ptr<capture::FrameSource> {
    if (!camera.options.are_matches) return std::make_unique<Source>(impl_, camera);
    const auto group = std::ranges::find_if(
        groups, [&](const auto& of) { return !of.cameras.empty() && of.cameras.front() == &camera; });
    return group == groups.end() ? nullptr : std::make_unique<SourceOfMany>(impl_, std::move(*group));
  };
  std::vector<capture::LiveCamera> out;
  for (const auto& camera : impl_->cameras) {
    Impl::Camera* of = camera.get();
    out.push_back({.camera = of->options.camera,
                   .source = source_of(*of),
                   .health =
                       [all = impl_, of] {
                         const std::scoped_lock lock(all->mutex);
                         capture::CameraHealth health = of->health;
                         capture::HostClock& clock = health.clock.emplace(all->clock_of(of->options.host));
                         clock.advice = all->hosts.at(of->options.host).advice;
                         return health;
                       },
                   .take_events =
                       [all = impl_, of] {
                         const std::scoped_lock lock(all->mutex);
                         return std::exchange(of->events, {});
                       }});
    if (of->options.are_matches)
      out.back().look_for = [all = impl_, of](std::span<const capture::MatchedColor> colors) {
        all->look_for(*of, colors);
      };
    if (of->options.are_matches)
      out.back().expect_outlines = [all = impl_, of](std::uint32_t frame,
                                                     std::span<const capture::ExpectedOutline> outlines) {
        all->expect_outlines(*of, frame, outlines);
      };
    if (of->options.are_matches)
      out.back().send_outlines = [all = impl_, host = &impl_->hosts.at(of->options.host)] {
        all->send_outlines(*host);
      };
  }
  return out;
}

}  // namespace huetrack::hosts
