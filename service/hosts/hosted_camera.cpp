#include "hosts/hosted_camera.h"

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

constexpr auto asked_every = 250ms, asked_at_start_every = 30ms;
constexpr std::uint32_t asked_at_start = 20;
constexpr auto silent_after = 2500ms;        // of a host that tells its state every second
constexpr auto awaited_for = 60s;            // a host that went: it may be back any moment
constexpr auto alive_for = 3 * asked_every;  // after an answer: another one of its name is not listened to
constexpr auto twin_told_for = 5s;           // after both have answered
constexpr auto stalled_after = 1s;
constexpr auto longest_wait = 50ms;      // for a frame, until a stop is noticed
constexpr unsigned most_groups = 8;      // of cameras of matches
constexpr auto clocks_compared_in = 5s;  // what is said of them before will be better soon
// A ball at 1 m/s is then a millimetre off, as much as all else that is not known of it. Told until it is well below,
// so that it does not come and go.
constexpr double told_clock_sigma_s = 1e-3, untold_clock_sigma_s = 0.7e-3;
constexpr double longest_kept_s = 1000;     // who says more keeps no time
constexpr double worst_clock_sigma_s = 1;   // no more is said of it with a frame
constexpr std::uint32_t longest_loss = 30;  // frames; what is longer is an outage, and told as such
constexpr std::uint32_t most_of_header = 64 * 1024, most_of_matches_header = 1024;
// The cameras of a hall expose at one moment, and their frames come at one.
constexpr idl::Datagrams room_for_frames{.buffer = 4 << 20};

constexpr auto looked_for_told_every = 2s;  // less than half of WantedMatches::forgotten_after
constexpr std::size_t most_looked_for = capture::Matches::most;
constexpr std::uint32_t longest_without_colors = 60;  // frames; a host that was told other colours takes a few

// Of what a camera sends, or was looked at there: what StreamFormat has a word for.
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

// What would make it better. is_open: it is known worse than positions need.
std::string clock_advice(const capture::HostClock& clock, bool is_open) {
  if (clock.is_contradicted && !clock.is_ours && clock.kept_s)
    return fmt::format(
        "the clock of {} is {:.1f} ms off ours, where NTP or PTP say that both are kept to {:.1f} ms: give both one "
        "source "
        "of time; the measured offset is taken off",
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

// Anybody may have sent it. Two of them can be subtracted: until the year 2096; and from a few days before 1970, as a
// host whose clock has never been set may have been started then.
bool is_a_time(std::int64_t unix_ns) {
  return unix_ns > -1'000'000'000'000'000 && unix_ns < 4'000'000'000'000'000'000;
}

capture::Timestamp timestamp(std::int64_t unix_ns) {
  return capture::Timestamp(capture::Duration(unix_ns));
}

}  // namespace

struct HostedCameras::Impl {
  // All of a host and of a camera is guarded by `mutex`, but for what says otherwise.
  struct Host {
    std::int64_t run = 0;
    ClockOffset clock;
    std::optional<Clock::time_point> heard_at;
    Clock::time_point answered_at{};  // when it last said what time it is
    // Another program that answers by this name while this one does.
    std::uint32_t answered_by_twin = 0;  // the number of a question
    std::optional<Clock::time_point> twin_at;
    std::vector<msg::HostedCamera> cameras;
    std::uint16_t number = 0;      // Frame::clock
    std::optional<double> kept_s;  // MachineClock::kept_s of it and of ours together; nullopt: not on both
    bool is_this_machine = false;
    std::string advice;                   // on its clock
    dds::DataReader* matches = nullptr;   // of all its cameras; thread-safe by itself
    dds::DataWriter* outlines = nullptr;  // the same
    msg::ExpectedOutlines expected;       // not told yet; guarded by outlines_mutex
  };
  struct Camera {
    HostedCameraOptions options;
    dds::DataReader* reader = nullptr;        // thread-safe by itself; nullptr: of matches, which come by Host::matches
    std::unique_ptr<idl::Arrivals> arrivals;  // of reader; the source's
    capture::CameraHealth health;
    std::vector<capture::CameraEvent> events;
    std::optional<Clock::time_point> frame_at;
    bool was_absent = false;  // since it delivered
    std::vector<capture::MatchedColor> looked_for;
    std::optional<Clock::time_point> looked_for_told_at;  // nullopt: not told yet
    // The source's own.
    capture::JpegDecoder decoder;
    capture::CameraClock clock;
    std::int64_t run = 0;                 // written under `mutex`
    std::uint32_t base = 0;               // of the run's numbers; written under `mutex`
    std::optional<std::uint32_t> handed;  // the last one of ours
    capture::DamageWatch losses;          // on the way
    capture::Image picture;               // the latest beside matches
    std::uint32_t without_colors = 0;     // frames in a row
  };

  Impl(const idl::ParticipantOptions& transport, std::vector<HostedCameraOptions> given)
      : participant(transport, nullptr, room_for_frames),
        probe(
            participant.create_writer<msg::ClockProbePubSubType>(idl::clock_probe_topic, idl::clock_writer_qos(), "")),
        echo(participant.create_reader<msg::ClockEchoPubSubType>(idl::clock_echo_topic, idl::clock_reader_qos())),
        looked_for(participant.create_writer<msg::LookedForColorsPubSubType>(idl::looked_for_topic,
                                                                             idl::status_writer_qos(), "")),
        states(participant.create_reader<msg::CameraHostPubSubType>(idl::camera_host_topic, idl::status_reader_qos())),
        // Not of the seeded randomness: it must differ between programs, and nothing is computed from it.
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
    keeper = std::jthread([this](const std::stop_token& stop) { keep(stop); });
  }

  // Asks for the time, hears answers and states.
  void keep(const std::stop_token& stop) {
    // States are taken as they come, too: their reader holds the room of the most that ever waited in it.
    idl::Arrivals answers(std::array{&echo, &states});
    auto next_question = Clock::now();
    while (!stop.stop_requested()) {
      const auto now = Clock::now();
      hear_states();
      if (now >= next_question) {
        ask();
        judge();
        next_question = now + (is_in_a_hurry() ? asked_at_start_every : asked_every);
      }
      tell_what_is_looked_for();
      hear_time();
      answers.wait(std::max<Clock::duration>(next_question - Clock::now(), 1ms));
      hear_time();
    }
  }

  // At the start, and while a host is there, or was until a moment ago, whose frames wait for its clock.
  bool is_in_a_hurry() const {
    if (asked < asked_at_start) return true;
    const auto now = Clock::now();
    const std::scoped_lock lock(mutex);
    return std::ranges::any_of(hosts, [&](const auto& entry) {
      const Host& host = entry.second;
      return host.heard_at && now - *host.heard_at < awaited_for &&
             !(host.clock.is_known() && now - host.answered_at < 2 * asked_every);
    });
  }

  void ask() {
    msg::ClockProbe question;
    question.tracker(tracker);
    question.number(++asked);
    const capture::Timestamp now = capture::unix_now();
    questions[asked % questions.size()] = {asked, now};
    question.sent_at(now.time_since_epoch().count());
    probe.write(&question);
  }

  void look_for(Camera& camera, std::span<const capture::MatchedColor> colors) {
    const std::scoped_lock lock(mutex);
    camera.looked_for.assign(colors.begin(), colors.begin() + std::ptrdiff_t(std::min(colors.size(), most_looked_for)));
    camera.looked_for_told_at.reset();
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

  // On the thread that tracks: written at once, or the next frames would be without.
  void send_outlines(Host& host) {
    const std::scoped_lock lock(outlines_mutex);
    if (host.expected.cameras().empty()) return;
    host.expected.tracker(tracker);
    host.outlines->write(&host.expected);
    host.expected.cameras().clear();
  }

  // On a change, and again and again: a host may have come up since.
  void tell_what_is_looked_for() {
    const auto now = Clock::now();
    for (const auto& camera : cameras) {
      if (!camera->options.are_matches) continue;
      msg::LookedForColors out;
      {
        const std::scoped_lock lock(mutex);
        if (camera->looked_for_told_at && now - *camera->looked_for_told_at < looked_for_told_every) continue;
        camera->looked_for_told_at = now;
        to_message({camera->looked_for, capture::duration_of(camera->options.picture_every_s)}, out);
      }
      out.tracker(tracker);
      out.host(camera->options.host);
      out.camera(camera->options.camera_there);
      looked_for.write(&out);
    }
  }

  void hear_time() {
    const capture::Timestamp came = capture::unix_now();
    msg::ClockEcho answer;
    while (idl::take_next(echo, answer)) {
      if (answer.tracker() != tracker) continue;
      if (!std::ranges::all_of(std::array{answer.received_at(), answer.answered_at(), answer.zero()}, is_a_time))
        continue;
      const auto& [number, sent] = questions[answer.number() % questions.size()];
      const std::scoped_lock lock(mutex);
      const auto known = hosts.find(answer.host());
      if (known == hosts.end() || number != answer.number()) continue;
      Host& host = known->second;
      if (host.run != answer.run()) {  // another program, whose clock counts from another start
        if (is_alive(host)) {
          host.answered_by_twin = answer.number();
          continue;
        }
        host.run = answer.run();
        host.clock.forget();
        host.answered_by_twin = 0;
      }
      host.answered_at = Clock::now();
      // It is not the one before, whose place another one took, when it answers what was asked later.
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
      const KeptTogether together = kept_together(here, there);
      host.is_this_machine = together.sigma_s == 0;
      host.kept_s =
          std::isinf(together.sigma_s) || host.is_this_machine ? std::nullopt : std::optional(together.sigma_s);
      host.clock.set_kept(together);
      host.clock.add({.asked = sent,
                      .question_came = timestamp(answer.received_at()),
                      .answered = timestamp(answer.answered_at()),
                      .answer_came = came});
    }
  }

  // Under `mutex`.
  static bool is_alive(const Host& host) { return host.run != 0 && Clock::now() - host.answered_at < alive_for; }

  void hear_states() {
    msg::CameraHost said;
    while (idl::take_next(states, said)) {
      const std::scoped_lock lock(mutex);
      const auto known = hosts.find(said.host());
      if (known == hosts.end() || (said.run() != known->second.run && is_alive(known->second))) continue;
      known->second.heard_at = Clock::now();
      known->second.cameras = std::move(said.cameras());
    }
  }

  static std::string delivering(const Camera& camera) {
    return (camera.options.are_matches ? "delivering which pixels match, from " : "delivering, from ") +
           camera.options.host;
  }

  // What the state of a camera is by what was heard of its host, and the sentence that goes with it.
  std::pair<capture::CaptureState, std::string> state_of(const Camera& camera, Clock::time_point now) const {
    const Host& host = hosts.at(camera.options.host);
    const std::string& name = camera.options.host;
    const bool has_frames = camera.frame_at && now - *camera.frame_at < stalled_after;
    if (has_frames) return {capture::CaptureState::delivering, delivering(camera)};
    if (!host.heard_at)
      return {capture::CaptureState::absent, "its host " + name +
                                                 " is not heard of: is `huetrackd capture` running "
                                                 "there, with host: " +
                                                 name + ", in the same DDS domain and network?"};
    if (now - *host.heard_at > silent_after)
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
                  (camera.options.are_matches
                       ? "; for send: matches its program must be as new as ours, and so its keys, and its "
                         "camera must not hang on one picture"
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
    out.advice = clock_advice(out, out.sigma_s > (host.advice.empty() ? told_clock_sigma_s : untold_clock_sigma_s));
    return out;
  }

  void judge() {
    const auto now = Clock::now();
    const std::scoped_lock lock(mutex);
    for (auto& camera : cameras) {
      auto [state, message] = state_of(*camera, now);
      // Hosts take some time to be found: that is no event.
      if (state != capture::CaptureState::delivering && !camera->frame_at && now - started < silent_after) continue;
      tell(*camera, state, std::move(message));
    }
    if (now - started < clocks_compared_in) return;
    for (auto& [name, host] : hosts) host.advice = clock_of(name).advice;
  }

  static void tell(Camera& camera, capture::CaptureState state, std::string message) {
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

  // Takes what is in the message. nullopt: not for us yet.
  template <typename Message>
  std::optional<capture::Frame> frame_of(Camera& camera, Message& message) {
    if (!is_a_time(message.stamped_at())) return std::nullopt;
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
      camera.base = there - (camera.handed ? *camera.handed + 1 : 0);
    }
    capture::Frame frame;
    if constexpr (std::is_same_v<Message, msg::CameraMatches>)
      frame =
          from_message(std::move(message), camera.decoder, camera.picture, camera.options.width, camera.options.height);
    else
      frame = from_message(std::move(message), camera.decoder);
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
    frame.latency = camera.options.timing.latency;
    frame.readout = camera.options.timing.readout;
    frame.clock = clock;
    frame.captured_at = (is_sound ? camera.clock.smoothed(stamped_at) : stamped_at) - frame.latency;

    const std::scoped_lock lock(mutex);
    capture::CameraHealth& health = camera.health;
    const std::uint32_t lost =
        camera.handed && frame.sequence > *camera.handed + 1 ? frame.sequence - *camera.handed - 1 : 0;
    health.dropped += lost;
    for (std::uint32_t i = 0; lost <= longest_loss && i < lost; ++i) camera.losses.add(true);
    camera.losses.add(false);
    health.warning =
        camera.losses.is_high()
            ? fmt::format(
                  "{:.0f} % of its frames are lost between {} and here: format: mjpeg there, a wired network, or "
                  "larger socket buffers (service/hosts/README.md)",
                  100 * camera.losses.share(), camera.options.host)
            : wrong_there(camera);
    camera.handed = frame.sequence;
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
    tell(camera, capture::CaptureState::delivering, delivering(camera));
    return frame;
  }

  // Under `mutex`. What is wrong with the host of a camera that delivers, or is by what it says.
  std::string wrong_there(const Camera& camera) const {
    const Host& host = hosts.at(camera.options.host);
    if (host.twin_at && Clock::now() - *host.twin_at < twin_told_for)
      return fmt::format(
          "two camera hosts are called {}, and only the cameras of the first one are used: give each a name of its "
          "own, host: in the configuration of huetrackd capture",
          camera.options.host);
    for (const auto& there : host.cameras)
      if (there.name() == camera.options.camera_there && there.state() == msg::HOSTED_CAMERA_DELIVERING &&
          !there.message().empty())
        return camera.options.host + " says: " + there.message();
    return {};
  }

  // Under `mutex`. Whether all that is looked for is in them.
  static void note_colors(Camera& camera, const capture::Matches& matches) {
    capture::CameraHealth& health = camera.health;
    if (std::ranges::all_of(camera.looked_for, [&](const auto& color) { return matches.of(color) != nullptr; })) {
      camera.without_colors = 0;
      return;
    }
    if (++camera.without_colors < longest_without_colors || !health.warning.empty()) return;
    health.warning = camera.options.host +
                     " does not say what matches the targets' colours: the trackers that use this camera look for more "
                     "of them together, or they match more of its pictures, than it can tell; take send: frames for "
                     "one of them";
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

  // Hosts whose matches one thread reads. What comes is small, and with a thread for each camera, waking up, and
  // waiting for one another, was most of what it took.
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
      if (camera == group.cameras.end()) continue;  // or another tracker looks for it
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
  std::vector<std::unique_ptr<Camera>> cameras;  // they wait for its readers
  dds::DataWriter& probe;
  dds::DataReader& echo;
  dds::DataWriter& looked_for;
  dds::DataReader& states;
  const std::int64_t tracker;
  std::uint32_t asked = 0;  // the keeper's
  std::array<std::pair<std::uint32_t, capture::Timestamp>, 32> questions{};
  Clock::time_point started;
  std::jthread keeper;  // last: it ends first
};

HostedCameras::HostedCameras(const idl::ParticipantOptions& transport, std::vector<HostedCameraOptions> cameras) {
  for (const auto& camera : cameras)
    for (const auto& name : {camera.host, camera.camera_there})
      if (!is_host_name(name))
        throw std::invalid_argument("camera " + camera.name + ": \"" + name +
                                    "\" is no name of a camera host or of its camera: letters, digits, '_', '-', '.'");
  impl_ = std::make_shared<Impl>(transport, std::move(cameras));
}

std::vector<capture::LiveCamera> HostedCameras::live() const {
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
