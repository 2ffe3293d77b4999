#include "commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <vector>

#include "calib/yaml/output_file.h"
#include "calib/yaml/text_file.h"
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

// Discovery takes 0.1 s on one host and well below 1 s on a network; what is silent for so long is not there.
constexpr auto nobody_after = 1500ms;
constexpr std::size_t most_statuses = 50;
constexpr auto poll = 50ms;  // how late a signal or a farewell may be noticed

std::int64_t unix_now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// What a log may take the place of.
constexpr yaml::FileKind log_kind{"log of huetrack's", [](std::string_view text) {
                                    return text.starts_with("target,t,") || text.starts_with("camera,t,");
                                  }};

// Text to stdout, lines to a file, each one flushed, so that whoever reads has it at once, or datagrams.
class LineWriter {
 public:
  // throws std::runtime_error: the file exists, and may not be replaced, or cannot be written; udp is no address
  LineWriter(const std::filesystem::path& file, bool overwrite, const std::string& udp = "") {
    if (!udp.empty()) udp_.emplace(udp);
    if (file.empty()) return;
    std::error_code none;
    if (!overwrite && std::filesystem::exists(file, none))
      throw std::runtime_error(file.string() + " exists; give another name, or --overwrite");
    file_.emplace(file, log_kind);
  }

  // text: ends with the line's end. false: the reader of the pipe is gone, nobody wants more. throws std::runtime_error
  // when the disk is full.
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
  std::optional<yaml::LineFile> file_;
  std::optional<UdpSender> udp_;
};

std::string joined(const std::set<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

struct Wording {
  const char* samples;  // "no publisher of ..."
  const char* one;      // "nobody publishes ..."
  const char* others;   // "no ..., but there are ...", and how they are watched
  const char* how;
};

constexpr std::size_t most_names = 1000, most_strangers = 100;  // that are kept in mind: anybody may send any number

// A line that people must not take for the service's.
std::string mark_of(std::string text, const std::string& stranger) {
  text.pop_back();
  return text + "   NOT THE SAME PUBLISHER: " + stranger + "\n";
}

// "ball_3" is one of several objects of the target "ball".
bool is_object_of(std::string_view name, std::string_view target) {
  if (!name.starts_with(target) || name.size() < target.size() + 2 || name[target.size()] != '_') return false;
  return std::ranges::all_of(name.substr(target.size() + 1), [](char c) { return c >= '0' && c <= '9'; });
}

// wanted: the name of the target or camera; empty: every one.
template <typename Sample>
int watch_topic(const WatchOptions& options, const std::string& wanted, const std::string& header_line,
                const Wording& words);

}  // namespace

void say(const std::string& sentence) {
  std::fprintf(stderr, "huetrack: %s\n", yaml::printable(sentence, yaml::longest_message).c_str());
}

std::string what_to_check(const idl::DdsParticipant& participant) {
  return "on domain " + std::to_string(participant.domain()) +
         ". Check that huetrackd runs; that it uses the same domain (its config, ROS_DOMAIN_ID; here --domain or "
         "ROS_DOMAIN_ID); that it is on a network of ours (" +
         participant.description() + "); that multicast and UDP ports " +
         std::to_string(7400 + 250 * participant.domain()) + "-" + std::to_string(7649 + 250 * participant.domain()) +
         " are open between the hosts";
}

int watch(const WatchOptions& options) {
  if (options.camera)
    return watch_topic<msg::CameraPose>(options, *options.camera == "all" ? "" : *options.camera,
                                        camera_header(options.format),
                                        {"camera poses", "camera", "targets", "huetrack watch, without --camera"});
  return watch_topic<msg::ObjectPosition>(options, options.target, header(options.format),
                                          {"huetrack positions", "target", "cameras", "huetrack watch --camera NAME"});
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

template <typename Sample>
int watch_topic(const WatchOptions& options, const std::string& wanted, const std::string& header_line,
                const Wording& words) {
  LineWriter out(options.file, options.overwrite, options.udp);
  std::optional<SampleSubscription<Sample>> subscription(options.participant);  // made anew when the network changes
  if (options.udp.empty() && !out.write(header_line)) return 0;

  std::uint64_t lines = 0;
  std::size_t target_width = 0;
  std::set<std::string> seen_targets, strangers;
  bool said_nobody = false, said_others = false;
  std::set<std::string> said_targets;  // those named when ours was not among them
  const Clock::time_point start = Clock::now();
  Clock::time_point last_line = start;
  Clock::time_point last_look_at_network = start;
  const auto finish = [&](int exit_status) {
    if (!options.file.empty()) say(std::to_string(lines) + " samples in " + options.file.string());
    if (!options.udp.empty()) say(std::to_string(lines) + " samples sent to " + options.udp);
    return exit_status;
  };

  while (!ended && (!options.count || lines < *options.count)) {
    const std::optional<Heard<Sample>> heard = subscription->next(poll);
    const Clock::time_point now = Clock::now();
    if (heard) {
      const std::string& name = name_of(heard->sample);
      if (seen_targets.size() < most_names) seen_targets.insert(name);
      if (wanted.empty() || name == wanted || is_object_of(name, wanted)) {
        target_width = std::max(target_width, name.size());
        std::string text = line(options.format, heard->sample, unix_now(), target_width);
        if (!heard->stranger.empty()) {
          if (strangers.size() < most_strangers && strangers.insert(name + heard->stranger).second)
            say(fmt::format("{} {} comes from a second publisher, too, which is {} here: {}", words.one, name,
                            options.format == Format::text ? "marked" : "left out", heard->stranger));
          if (options.format == Format::text && !out.write(mark_of(std::move(text), heard->stranger))) return finish(0);
        } else if (!text.empty()) {
          if (!out.write(text)) return finish(0);
          ++lines;
          last_line = now;
        }
      }
    }
    for (const std::string& sentence : subscription->news()) say(sentence);
    if (now - last_look_at_network > 1s) {
      last_look_at_network = now;
      if (subscription->network_changed()) {
        subscription.emplace(options.participant);
        say("the network has changed: now on " + subscription->participant().description());
      }
    }

    if (subscription->publishers() > 0) {
      said_nobody = true;  // its farewell will be said, and that is enough
      std::set<std::string> targets = subscription->targets();
      targets.insert(seen_targets.begin(), seen_targets.end());
      const bool may_come = std::ranges::any_of(targets, [&](const auto& target) {
        return target == wanted || is_object_of(wanted, target);  // an object of a target that is published
      });
      if (!wanted.empty() && !targets.empty() && !may_come && targets != said_targets) {
        say("nobody publishes " + std::string(words.one) + " " + wanted + " on domain " +
            std::to_string(subscription->participant().domain()) + "; there are: " + joined(targets));
        said_targets = std::move(targets);
      }
    } else if (!said_nobody && now - start > nobody_after) {
      say("no publisher of " + std::string(words.samples) + " " + what_to_check(subscription->participant()) +
          ". Waiting for one");
      said_nobody = true;
    }
    // Nothing will come of what is asked for, but there is something to watch.
    if (!said_others && now - start > nobody_after && seen_targets.empty() && subscription->targets().empty()) {
      if (const auto others = subscription->others(); !others.empty()) {
        say("no " + std::string(words.one) + " is tracked on domain " +
            std::to_string(subscription->participant().domain()) + ", but these " + words.others + ": " +
            joined(others) + ". Watch them with " + words.how);
        said_others = true;
      }
    }
    if (options.timeout && now - last_line > *options.timeout) {
      say("no sample for " +
          std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(now - last_line).count()) +
          " ms (--timeout); " + std::to_string(lines) + " came before");
      return finish(1);
    }
  }
  return finish(0);
}

}  // namespace

int status(const idl::ParticipantOptions& options, StatusFormat format) {
  idl::DdsParticipant participant(options);
  dds::DataReader& reader = participant.create_reader(
      idl::status_topic, dds::TypeSupport(new msg::ServiceStatusPubSubType), idl::status_reader_qos());
  dds::DataReader& times_reader = participant.create_reader(
      idl::camera_times_topic, dds::TypeSupport(new msg::CameraTimesPubSubType), idl::status_reader_qos());
  dds::DataReader& clocks_reader = participant.create_reader(
      idl::host_clocks_topic, dds::TypeSupport(new msg::HostClocksPubSubType), idl::status_reader_qos());
  dds::DataReader& pose_reader = participant.create_reader(
      idl::camera_pose_topic, dds::TypeSupport(new msg::CameraPosePubSubType), idl::object_position_reader_qos());
  dds::DataReader& set_reader = participant.create_reader(
      idl::object_set_topic, dds::TypeSupport(new msg::ObjectSetPubSubType), idl::object_position_reader_qos());
  LineWriter out({}, false);
  // After the first one a moment more: a second service may be there, and the poses of a camera that is tracked.
  Clock::time_point until = Clock::now() + nobody_after;
  constexpr auto a_moment = 300ms;
  bool waited_for_pose = false;
  std::vector<msg::ServiceStatus> statuses;
  std::map<std::pair<std::string, std::uint32_t>, msg::CameraTimes> times;  // by the service's host and process
  std::map<std::pair<std::string, std::uint32_t>, msg::HostClocks> clocks;  // likewise
  std::map<std::string, msg::CameraPose> poses;
  std::map<std::string, msg::ObjectSet> sets;  // by the target; the last of each
  while (!ended && Clock::now() < until) {
    msg::ServiceStatus sample;
    dds::SampleInfo info;
    while (reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      if (statuses.empty()) until = Clock::now() + a_moment;
      make_printable(sample);
      const auto same = std::ranges::find_if(statuses, [&](const msg::ServiceStatus& other) {
        return other.host() == sample.host() && other.pid() == sample.pid();
      });
      if (same != statuses.end())
        *same = sample;  // the newest of each service
      else if (statuses.size() < most_statuses)
        statuses.push_back(sample);
    }
    msg::CameraTimes of_service;
    while (times_reader.take_next_sample(&of_service, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data && times.size() < most_statuses) {
        make_printable(of_service);
        times[{of_service.host(), of_service.pid()}] = of_service;
      }
    msg::HostClocks of_hosts;
    while (clocks_reader.take_next_sample(&of_hosts, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data && clocks.size() < most_statuses) {
        make_printable(of_hosts);
        clocks[{of_hosts.host(), of_hosts.pid()}] = of_hosts;
      }
    msg::CameraPose pose;
    while (pose_reader.take_next_sample(&pose, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data && poses.size() < most_names) {
        make_printable(pose);
        poses[pose.camera()] = pose;
      }
    msg::ObjectSet set;
    while (set_reader.take_next_sample(&set, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data && sets.size() < most_names) {
        make_printable(set);
        sets[set.target()] = set;
      }
    dds::SubscriptionMatchedStatus matched;  // a slow camera's frame takes a while
    if (!statuses.empty() && poses.empty() && !waited_for_pose &&
        pose_reader.get_subscription_matched_status(matched) == ReturnCode_t::RETCODE_OK && matched.current_count > 0) {
      until += 3 * a_moment;
      waited_for_pose = true;
    }
    if (waited_for_pose && !poses.empty()) until = Clock::now();
    reader.wait_for_unread_message(eprosima::fastrtps::Duration_t(0, 50'000'000));
  }
  std::vector<msg::CameraPose> last_poses;
  for (const auto& [_, pose] : poses) last_poses.push_back(pose);
  std::vector<msg::ObjectSet> last_sets;
  for (const auto& [_, set] : sets) last_sets.push_back(set);
  bool is_healthy = true;
  for (const auto& sample : statuses) {
    const auto found = times.find({sample.host(), sample.pid()});
    const msg::CameraTimes* const of_service = found == times.end() ? nullptr : &found->second;
    const auto found_clocks = clocks.find({sample.host(), sample.pid()});
    const msg::HostClocks* const of_hosts = found_clocks == clocks.end() ? nullptr : &found_clocks->second;
    const std::int64_t now = unix_now();
    is_healthy &= problems_of(sample, now).empty();
    if (!out.write(format == StatusFormat::json ? status_json(sample, now, of_service, last_poses, of_hosts)
                                                : text(sample, now, of_service, last_poses, last_sets, of_hosts)))
      break;
  }
  if (statuses.empty()) {
    const std::string why = "no huetrackd publishes its status " + what_to_check(participant);
    if (!ended) say(why);
    if (format == StatusFormat::json) out.write(no_status_json(why));
    return 1;
  }
  return is_healthy ? 0 : unhealthy_status;
}

}  // namespace huetrack::client
