#include "commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <map>
#include <set>
#include <stdexcept>
#include <vector>

#include "calib/files/joined.h"
#include "calib/files/number_text.h"
#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "idl/arrivals.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/camera_timesPubSubTypes.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/object_setPubSubTypes.h"
#include "idl/topics.h"
#include "position_subscription.h"
#include "printable_sample.h"
#include "service_health.h"
#include "udp_sender.h"

namespace huetrack::client {

namespace dds = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;
using eprosima::fastrtps::types::ReturnCode_t;
using namespace std::chrono_literals;

namespace {

volatile std::sig_atomic_t ended = 0;

// Discovery takes 0.1 s on one host and well below 1 s on a network.
constexpr auto no_publisher_after = 1500ms;
constexpr std::size_t most_statuses = 50;
constexpr auto poll = 50ms;  // delay until a signal is noticed

std::int64_t unix_now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Files that a log may overwrite.
constexpr files::FileKind log_kind{"log of huetrack's", [](std::string_view text) {
                                     return text.starts_with("target,t,") || text.starts_with("camera,t,");
                                   }};

// Lines to stdout or a file, each one flushed, or datagrams.
class LineWriter {
 public:
  // Throws std::runtime_error: the file exists or cannot be written; udp is no address.
  LineWriter(const std::filesystem::path& file, bool overwrite, const std::string& udp = "") {
    if (!udp.empty()) udp_.emplace(udp);
    if (file.empty()) return;
    std::error_code none;
    if (!overwrite && std::filesystem::exists(file, none))
      throw std::runtime_error(file.string() + " exists; give another name, or --overwrite");
    file_.emplace(file, log_kind);
  }

  // text: ends with the line's end. false: the pipe was closed. Throws std::runtime_error if the disk is full.
  bool write(std::string_view text) {
    if (text.empty()) return true;
    if (udp_) {
      if (text.ends_with('\n')) text.remove_suffix(1);
      if (const std::string trouble = udp_->send(text); !trouble.empty()) say(trouble);
      return true;
    }
    if (file_) {
      file_->write(text.substr(0, text.size() - 1));
      file_->flush();
      return true;
    }
    if (std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0) return true;
    if (errno == EPIPE) return false;
    throw std::runtime_error(std::string("cannot write stdout: ") + std::strerror(errno));
  }

 private:
  std::optional<files::LineFile> file_;
  std::optional<UdpSender> udp_;
};

struct Wording {
  const char* samples;  // "no publisher of object positions ..."
  const char* one;      // "no publisher of target ball ..."
  const char* others;   // "no ..., but there are ...", and how they are watched
  const char* how;
};

constexpr std::size_t most_names = 1000, most_other_publishers = 100;  // bounds what a program can make us store

std::string mark_of(std::string text, const std::string& publisher) {
  text.pop_back();
  return text + "   NOT THE SAME PUBLISHER: " + publisher + "\n";
}

}  // namespace

void say(const std::string& sentence) {
  std::fprintf(stderr, "huetrack: %s\n", files::printable(sentence, files::longest_message).c_str());
}

std::string what_to_check(const idl::DdsParticipant& participant) {
  return "on domain " + std::to_string(participant.domain()) +
         ". Check that huetrackd runs; that it uses the same domain (its config, ROS_DOMAIN_ID; here --domain or "
         "ROS_DOMAIN_ID); that it is on a network of ours (" +
         participant.description() +
         "), or, if it keeps to its host with dds: {interfaces: [lo]}, that --interface lo is given "
         "here; that multicast and UDP ports " +
         std::to_string(7400 + 250 * participant.domain()) + "-" + std::to_string(7649 + 250 * participant.domain()) +
         " are open between the hosts";
}

void end_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { ended = 1; };
  for (const int signal : {SIGINT, SIGTERM}) ::sigaction(signal, &action, nullptr);
  action.sa_handler = SIG_IGN;  // `huetrack watch | head` ends quietly: the write fails with EPIPE
  ::sigaction(SIGPIPE, &action, nullptr);
}

bool has_ended() {
  return ended != 0;
}

namespace {

// Prints every sample of a topic as a line, and on stderr what is wrong while none is received.
template <typename Sample>
class TopicWatch {
 public:
  TopicWatch(const WatchOptions& options, const std::string& wanted, const Wording& words)
      : options_(options),
        wanted_(wanted),
        words_(words),
        out_(options.file, options.overwrite, options.udp),
        subscription_(std::in_place, options.participant) {}

  int run(const std::string& header_line) {
    if (options_.udp.empty() && !out_.write(header_line)) return 0;
    while (!ended && (!options_.count || lines_ < *options_.count)) {
      const std::optional<Received<Sample>> received = subscription_->next(poll);
      const Clock::time_point now = Clock::now();
      if (received && !take(*received, now)) return finish(0);
      look_at_network(now);
      if (subscription_->publishers() > 0) {
        said_no_publisher_ = true;  // its end will be reported
        report_available_targets();
      } else if (!said_no_publisher_ && now - start_ > no_publisher_after) {
        say("no publisher of " + std::string(words_.samples) + " " + what_to_check(subscription_->participant()) +
            ". Waiting for one");
        said_no_publisher_ = true;
      }
      report_other_kind(now);
      if (options_.timeout && now - last_line_ > *options_.timeout) {
        say("no sample for " +
            std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(now - last_line_).count()) +
            " ms (--timeout); " + std::to_string(lines_) + " came before");
        return finish(1);
      }
    }
    return finish(0);
  }

 private:
  // false: the output was closed.
  bool take(const Received<Sample>& received, Clock::time_point now) {
    const std::string& name = name_of(received.sample);
    if (seen_targets_.size() < most_names) seen_targets_.insert(name);
    if (!wanted_.empty() && name != wanted_ && !files::is_object_of(name, wanted_)) return true;
    target_width_ = std::max(target_width_, name.size());
    std::string text = line(options_.format, received.sample, unix_now(), target_width_);
    if (!received.other_publisher.empty()) return take_of_other_publisher(received, std::move(text));
    if (text.empty()) return true;
    if (!out_.write(text)) return false;
    ++lines_;
    last_line_ = now;
    return true;
  }

  bool take_of_other_publisher(const Received<Sample>& received, std::string text) {
    const std::string& name = name_of(received.sample);
    if (other_publishers_.size() < most_other_publishers &&
        other_publishers_.insert(name + received.other_publisher).second)
      say(fmt::format("{} {} comes from a second publisher, too, which is {} here: {}", words_.one, name,
                      options_.format == Format::text ? "marked" : "left out", received.other_publisher));
    return options_.format != Format::text || out_.write(mark_of(std::move(text), received.other_publisher));
  }

  void look_at_network(Clock::time_point now) {
    for (const std::string& sentence : subscription_->news()) say(sentence);
    if (now - last_look_at_network_ <= 1s) return;
    last_look_at_network_ = now;
    if (subscription_->network_changed()) {
      subscription_.emplace(options_.participant);
      say("the network has changed: now on " + subscription_->participant().description());
    }
  }

  // If the wanted target is not among them.
  void report_available_targets() {
    std::set<std::string> targets = subscription_->targets();
    targets.insert(seen_targets_.begin(), seen_targets_.end());
    const bool may_come = std::ranges::any_of(targets, [&](const auto& target) {
      return target == wanted_ || files::is_object_of(wanted_, target);  // an object of a target that is published
    });
    if (wanted_.empty() || targets.empty() || may_come || targets == reported_targets_) return;
    say("no publisher of " + std::string(words_.one) + " " + wanted_ + " on domain " +
        std::to_string(subscription_->participant().domain()) + "; there are: " + files::joined(targets));
    reported_targets_ = std::move(targets);
  }

  // Nothing is published on this topic, but on the other one.
  void report_other_kind(Clock::time_point now) {
    if (reported_other_kind_ || now - start_ <= no_publisher_after || !seen_targets_.empty() ||
        !subscription_->targets().empty())
      return;
    const auto others = subscription_->others();
    if (others.empty()) return;
    say("no " + std::string(words_.one) + " is tracked on domain " +
        std::to_string(subscription_->participant().domain()) + ", but these " + words_.others + ": " +
        files::joined(others) + ". Watch them with " + words_.how);
    reported_other_kind_ = true;
  }

  int finish(int exit_status) const {
    if (!options_.file.empty()) say(std::to_string(lines_) + " samples in " + options_.file.string());
    if (!options_.udp.empty()) say(std::to_string(lines_) + " samples sent to " + options_.udp);
    return exit_status;
  }

  const WatchOptions& options_;
  const std::string wanted_;  // the name of the target or camera; empty: every one
  const Wording words_;
  LineWriter out_;
  std::optional<SampleSubscription<Sample>> subscription_;  // made anew when the network changes
  std::uint64_t lines_ = 0;
  std::size_t target_width_ = 0;
  std::set<std::string> seen_targets_, other_publishers_;
  bool said_no_publisher_ = false, reported_other_kind_ = false;
  std::set<std::string> reported_targets_;  // those named when ours was not among them
  const Clock::time_point start_ = Clock::now();
  Clock::time_point last_line_ = start_, last_look_at_network_ = start_;
};

}  // namespace

int watch(const WatchOptions& options) {
  if (options.camera)
    return TopicWatch<msg::CameraPose>(options, *options.camera == "all" ? "" : *options.camera,
                                       {"camera poses", "camera", "targets", "huetrack watch, without --camera"})
        .run(camera_header(options.format));
  return TopicWatch<msg::ObjectPosition>(options, options.target,
                                         {"huetrack positions", "target", "cameras", "huetrack watch --camera NAME"})
      .run(header(options.format));
}

namespace {

// Collects the latest samples that `status` shows.
class StatusListener {
 public:
  explicit StatusListener(idl::DdsParticipant& participant)
      : statuses_in_(
            participant.create_reader<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_reader_qos())),
        times_in_(
            participant.create_reader<msg::CameraTimesPubSubType>(idl::camera_times_topic, idl::status_reader_qos())),
        clocks_in_(
            participant.create_reader<msg::HostClocksPubSubType>(idl::host_clocks_topic, idl::status_reader_qos())),
        hosts_in_(
            participant.create_reader<msg::CameraHostPubSubType>(idl::camera_host_topic, idl::status_reader_qos())),
        poses_in_(participant.create_reader<msg::CameraPosePubSubType>(idl::camera_pose_topic,
                                                                       idl::object_position_reader_qos())),
        sets_in_(participant.create_reader<msg::ObjectSetPubSubType>(idl::object_set_topic,
                                                                     idl::object_position_reader_qos())),
        positions_in_(participant.create_reader<msg::ObjectPositionPubSubType>(idl::object_position_topic,
                                                                               idl::object_position_reader_qos())) {}

  // Until the first status, then a moment longer for a second service, positions and the poses of a tracked camera; not
  // longer than until all that was discovered has come.
  void listen() {
    constexpr auto a_moment = 300ms, shortest = 100ms;  // the shortest: a second service is discovered by then
    Clock::time_point until = Clock::now() + no_publisher_after;
    bool waited_for_pose = false;
    while (!ended && Clock::now() < until) {
      const bool was_empty = statuses_.empty();
      take_all();
      if (was_empty && !statuses_.empty()) until = Clock::now() + a_moment;
      if (!statuses_.empty() && Clock::now() > until - a_moment + shortest && has_all()) break;
      if (!statuses_.empty() && poses_.empty() && !waited_for_pose && publishers(poses_in_) > 0) {  // a slow camera
        until += 3 * a_moment;
        waited_for_pose = true;
      }
      if (waited_for_pose && !poses_.empty()) until = Clock::now();
      statuses_in_.wait_for_unread_message(eprosima::fastrtps::Duration_t(0, 50'000'000));
    }
  }

  bool has_status() const { return !statuses_.empty(); }

  // Returns whether all services are healthy.
  bool write(LineWriter& out, StatusFormat format) const {
    const auto poses = values_of(poses_);
    const auto sets = values_of(sets_);
    bool is_healthy = true;
    for (const auto& sample : statuses_) {
      const Process process{sample.host(), sample.pid()};
      const auto times = times_.find(process);
      const auto clocks = clocks_.find(process);
      const msg::CameraTimes* const of_service = times == times_.end() ? nullptr : &times->second;
      const msg::HostClocks* const of_hosts = clocks == clocks_.end() ? nullptr : &clocks->second;
      const std::int64_t now = unix_now();
      is_healthy &= problems_of(sample, now).empty();
      if (!out.write(format == StatusFormat::json ? status_json(sample, now, of_service, poses, of_hosts)
                                                  : text(sample, now, of_service, poses, sets, of_hosts, positions_)))
        break;
    }
    return is_healthy;
  }

  // All camera hosts.
  void write_hosts(LineWriter& out) const {
    for (const auto& [_, host] : hosts_)
      if (!out.write(text(host))) return;
  }

 private:
  using Process = std::pair<std::string, std::uint32_t>;  // the service's host and process

  template <typename Sample>
  static void take_each(dds::DataReader& reader, auto&& keep) {
    Sample sample;
    while (idl::take_next(reader, sample)) {
      make_printable(sample);
      keep(sample);
    }
  }
  template <typename Sample, typename Key>
  static void take_each(dds::DataReader& reader, std::map<Key, Sample>& newest, std::size_t most, auto&& key_of) {
    take_each<Sample>(reader, [&](const Sample& sample) {
      if (newest.size() < most) newest[key_of(sample)] = sample;
    });
  }
  template <typename Key, typename Sample>
  static std::vector<Sample> values_of(const std::map<Key, Sample>& newest) {
    std::vector<Sample> values;
    for (const auto& [_, sample] : newest) values.push_back(sample);
    return values;
  }

  static std::size_t publishers(const dds::DataReader& reader) {
    dds::SubscriptionMatchedStatus matched;
    const bool is_known = reader.get_subscription_matched_status(matched) == ReturnCode_t::RETCODE_OK;
    return is_known && matched.current_count > 0 ? std::size_t(matched.current_count) : 0;
  }
  // Something of every discovered publisher of a status, and of each other topic that has one.
  bool has_all() const {
    const auto has = [](const dds::DataReader& reader, const auto& samples) {
      return !samples.empty() || publishers(reader) == 0;
    };
    return statuses_.size() >= publishers(statuses_in_) && has(times_in_, times_) && has(clocks_in_, clocks_) &&
           has(hosts_in_, hosts_) && has(poses_in_, poses_) && has(sets_in_, sets_) && has(positions_in_, positions_);
  }

  void take_all() {
    take_each<msg::ServiceStatus>(statuses_in_, [&](const msg::ServiceStatus& sample) {
      const auto same = std::ranges::find_if(statuses_, [&](const msg::ServiceStatus& other) {
        return other.host() == sample.host() && other.pid() == sample.pid();
      });
      if (same != statuses_.end())
        *same = sample;
      else if (statuses_.size() < most_statuses)
        statuses_.push_back(sample);
    });
    const auto process_of = [](const auto& sample) { return Process{sample.host(), sample.pid()}; };
    take_each(times_in_, times_, most_statuses, process_of);
    take_each(clocks_in_, clocks_, most_statuses, process_of);
    take_each(hosts_in_, hosts_, most_statuses, [](const msg::CameraHost& host) { return host.host(); });
    take_each(poses_in_, poses_, most_names, [](const msg::CameraPose& pose) { return pose.camera(); });
    take_each(sets_in_, sets_, most_names, [](const msg::ObjectSet& set) { return set.target(); });
    take_each<msg::ObjectPosition>(positions_in_, [&](const msg::ObjectPosition& position) {
      if (positions_.size() < most_positions) positions_.push_back(position);
    });
  }

  static constexpr std::size_t most_positions = 10'000;

  dds::DataReader &statuses_in_, &times_in_, &clocks_in_, &hosts_in_, &poses_in_, &sets_in_, &positions_in_;
  std::vector<msg::ServiceStatus> statuses_;  // in order of discovery
  std::map<Process, msg::CameraTimes> times_;
  std::map<Process, msg::HostClocks> clocks_;
  std::map<std::string, msg::CameraHost> hosts_;
  std::map<std::string, msg::CameraPose> poses_;
  std::map<std::string, msg::ObjectSet> sets_;  // by target
  std::vector<msg::ObjectPosition> positions_;
};

}  // namespace

int status(const idl::ParticipantOptions& options, StatusFormat format) {
  idl::DdsParticipant participant(options);
  StatusListener listener(participant);
  LineWriter out({}, false);
  listener.listen();
  const bool is_healthy = listener.write(out, format);
  if (format == StatusFormat::text) listener.write_hosts(out);
  if (listener.has_status()) return is_healthy ? 0 : unhealthy_status;
  const std::string why = "no huetrackd publishes its status " + what_to_check(participant);
  if (!ended) say(why);
  if (format == StatusFormat::json) out.write(no_status_json(why));
  return 1;
}

}  // namespace huetrack::client
