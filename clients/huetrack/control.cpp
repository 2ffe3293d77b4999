#include "control.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <map>
#include <optional>
#include <stdexcept>

#include "calib/files/joined.h"
#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "clients/live_view/page_server.h"
#include "clients/live_view/recording_download.h"
#include "commands.h"
#include "idl/arrivals.h"
#include "idl/control_words.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"

namespace huetrack::client {
namespace {

namespace dds = eprosima::fastdds::dds;
using live_view::RecordingDownload;
using namespace std::chrono_literals;
using ControlClock = std::chrono::steady_clock;

constexpr auto no_service_after = 2s;  // discovery takes well below 1 s on a network
constexpr auto second_service_after = 300ms;
constexpr auto asked_again_after = 1s;
constexpr auto no_reply_after = 5s;
constexpr std::size_t most_services_named = 20;

struct Addressed {
  std::string host;
  std::uint32_t pid = 0;
};

class ControlConnection {
 public:
  explicit ControlConnection(const idl::ParticipantOptions& options)
      : participant_(options),
        status_(participant_.create_reader<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_reader_qos())),
        reply_(
            participant_.create_reader<msg::ControlReplyPubSubType>(idl::control_reply_topic, idl::teach_reader_qos())),
        request_(participant_.create_writer<msg::ControlRequestPubSubType>(idl::control_request_topic,
                                                                           idl::teach_writer_qos(), "")) {}

  // wanted: HOST/PID; empty: the only one. Throws std::runtime_error.
  Addressed service(const std::string& wanted) {
    std::map<std::string, Addressed> services;
    std::vector<std::string> named;
    auto until = ControlClock::now() + no_service_after;
    while (!has_ended() && ControlClock::now() < until && !services.contains(wanted)) {
      msg::ServiceStatus sample;
      while (idl::take_next(status_, sample)) {
        const std::string id = sample.host() + "/" + std::to_string(sample.pid());
        if (services.size() == most_services_named || services.contains(id)) continue;
        if (services.empty() && wanted.empty()) until = ControlClock::now() + second_service_after;
        services[id] = {sample.host(), sample.pid()};
        named.push_back(fmt::format("{} ({})", id, sample.config_file()));
      }
      status_.wait_for_unread_message(eprosima::fastrtps::Duration_t(0, 20'000'000));
    }
    if (services.empty()) throw std::runtime_error("no huetrackd publishes its status " + what_to_check(participant_));
    if (const auto asked = services.find(wanted); asked != services.end()) return asked->second;
    if (!wanted.empty())
      throw std::runtime_error("there is no service " + wanted + "; there are: " + files::joined(named));
    if (services.size() > 1)
      throw std::runtime_error("there are several services; select one with --service HOST/PID: " +
                               files::joined(named));
    return services.begin()->second;
  }

  void send(msg::ControlRequest& request) { request_.write(&request); }

  // A reply to this client; waits shortly.
  std::optional<msg::ControlReply> next(const std::string& client) {
    msg::ControlReply reply;
    reply_.wait_for_unread_message(eprosima::fastrtps::Duration_t(0, 20'000'000));
    while (idl::take_next(reply_, reply))
      if (reply.client() == client) return reply;
    return std::nullopt;
  }

 private:
  idl::DdsParticipant participant_;
  dds::DataReader &status_, &reply_;
  dds::DataWriter& request_;
};

// Writes a file that appears only when it is complete, or stdout.
class ControlOutput {
 public:
  // This and the other members throw std::runtime_error: the file exists or cannot be written.
  explicit ControlOutput(const std::filesystem::path& file) {
    if (file == "-") return;
    std::error_code none;
    if (std::filesystem::exists(file, none))
      throw std::runtime_error(file.string() + " exists; give another name with --out");
    file_.emplace(file);
  }
  void write(std::string_view bytes) {
    if (file_) return file_->write(bytes);
    if (files::write_all(STDOUT_FILENO, bytes) != bytes.size())
      throw std::runtime_error(std::string("cannot write stdout: ") + std::strerror(errno));
  }
  void finish() {
    if (file_) file_->finish();
  }

 private:
  std::optional<files::WholeFile> file_;  // none: stdout
};

int fetch(ControlConnection& connection, const Addressed& service, const std::vector<std::string>& what,
          const std::filesystem::path& file) {
  RecordingDownload download(what, live_view::random_token(), service.host, service.pid);
  std::optional<ControlOutput> to;
  std::vector<char> part(64 * 1024);
  while (!has_ended()) {
    if (auto request = download.next_request(ControlClock::now())) connection.send(*request);
    if (const auto reply = connection.next(download.client())) download.take(*reply);
    const auto state = download.state();
    if (state == RecordingDownload::State::failed) throw std::runtime_error(download.failure());
    if (state == RecordingDownload::State::awaited) continue;
    if (!to) to.emplace(file);  // not before the first piece
    while (const std::size_t n = download.read(part.data(), part.size())) to->write({part.data(), n});
    if (download.state() != RecordingDownload::State::ended) continue;
    to->finish();
    say(fmt::format("{} bytes in {}{}", download.bytes(), file.string(),
                    what[0] == "record" ? "; tar -xf unpacks it" : ""));
    return 0;
  }
  return 1;
}

// Column headings of the replies that are lists.
std::string columns_of(const std::vector<std::string>& words) {
  if (words == std::vector<std::string>{"record", "list"})
    return "recording\tbegun_at_s\tlength_s\tbytes\tcameras\tstate\n";
  if (words == std::vector<std::string>{"target", "list"})
    return "target\tradius_m\tcount\thue_deg\tsaturation\tintensity\n";
  if (words.size() == 3 && words[0] == "camera" && words[1] == "controls")
    return "control\tvalue\tmin\tmax\tstep\tdefault\tkind\tmenu\truled\n";
  if (words.size() > 3 && words[0] == "camera") return "control\tasked\tgot\tproblem\n";
  return "";
}

int ask(ControlConnection& connection, const Addressed& service, const std::vector<std::string>& words) {
  msg::ControlRequest request;
  request.client(live_view::random_token());
  request.number(1);
  request.host(service.host);
  request.pid(service.pid);
  request.words(words);
  std::optional<msg::ControlReply> reply;
  const auto end = ControlClock::now() + no_reply_after;
  for (auto again = ControlClock::now(); !reply && !has_ended() && ControlClock::now() < end;) {
    // Repeated until there is a reply, since discovery may not be complete. The service executes it once.
    if (ControlClock::now() >= again) {
      connection.send(request);
      again = ControlClock::now() + asked_again_after;
    }
    reply = connection.next(request.client());
  }
  if (!reply) {
    if (!has_ended()) say("no reply from the service; versions before requests in words do not answer");
    return 1;
  }
  std::string text = reply->rows().empty() ? "" : columns_of(words);
  for (const msg::ControlRow& row : reply->rows()) {
    std::vector<std::string> columns;
    for (const std::string& column : row.columns()) columns.push_back(files::printable(column, files::longest_message));
    text += files::joined(columns, "\t") + "\n";
  }
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    throw std::runtime_error(std::string("cannot write stdout: ") + std::strerror(errno));
  if (!reply->reason().empty()) say(reply->reason());
  return reply->granted() ? 0 : 1;
}

}  // namespace

int control(const ControlOptions& options) {
  ControlConnection connection(options.participant);
  const Addressed service = connection.service(options.service);
  const auto& words = options.words;
  if (words.size() == 3 && words[0] == "record" && words[1] == "download") {
    if (!idl::is_recording_name(words[2])) throw std::runtime_error(words[2] + ": that is no recording's name");
    return fetch(connection, service, RecordingDownload::recording_words(words[2]),
                 options.out.empty() ? std::filesystem::path(words[2] + ".tar") : options.out);
  }
  if (words == RecordingDownload::report_words())
    return fetch(connection, service, words, options.out.empty() ? "calibration.html" : options.out);
  if (words.size() > 1 && words[0] == "calibrate" && words[1] == "print")
    return fetch(connection, service, words, options.out.empty() ? "board.pdf" : options.out);
  return ask(connection, service, words);
}

}  // namespace huetrack::client
