// What comes over DDS into the hub, and what pages ask for out onto the bus.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "clients/live_view/event_hub.h"
#include "clients/live_view/recording_download.h"
#include "idl/dds_participant.h"
#include "idl/huetrack_view.h"

namespace huetrack::live_view {

// thread-compatible but for request(): poll() is one thread's.
class BusReader {
 public:
  // throws as DdsParticipant does.
  BusReader(const idl::ParticipantOptions& options, EventHub& hub);
  ~BusReader();

  // Takes everything that has come. pages: without any, pictures are not subscribed to, so that nobody makes them.
  // Call it every few milliseconds; it does not wait.
  void poll(int pages);

  // Any thread. Empty, or why it is not sent: too many wait already, or DDS Security does not let this program ask.
  std::string request(msg::TeachRequest request);
  std::string request(msg::ControlRequest request);

  // Any thread: a recording of the service that is shown, or a report (RecordingDownload's words). It goes on while
  // somebody holds it. nullptr: why_not says so.
  std::shared_ptr<RecordingDownload> download(const std::vector<std::string>& words, std::string& why_not);
  int downloads() const { return downloading_; }  // that go on

  std::string description() const;

  using Process = std::array<unsigned char, 8>;  // as DDS names it

 private:
  struct Connection;
  struct Previews;
  void take_positions();  // and poses
  void take_statuses();
  void take_what_services_say();
  void take_replies();
  void take_control_replies();
  void go_on_with_downloads();
  void take_previews();
  std::vector<std::shared_ptr<RecordingDownload>> held_downloads();
  template <typename Request>
  std::string enqueue(std::deque<Request>& queue, Request request);  // as request()
  template <typename Request>
  void send_all(std::deque<Request>& queue, eprosima::fastdds::dds::DataWriter* writer);  // nullptr: to nobody
  void tell_pulse();

  const idl::ParticipantOptions options_;
  EventHub& hub_;
  std::unique_ptr<Connection> connection_;
  const std::string refused_;           // why nothing may be asked; empty: it may
  std::unique_ptr<Previews> previews_;  // null while there is no page
  std::chrono::steady_clock::time_point next_pulse_{}, no_page_since_{};
  // Several may publish on one bus, by mistake: shown is the one that was heard first last, the others are named.
  struct Service {
    std::chrono::steady_clock::time_point began, heard;
    Process process{};
    std::map<std::string, std::string> events;  // the last ones, by their keys in the hub
    std::string config_file;
    std::string host;
    std::uint32_t pid = 0;
    std::set<std::string> cameras;
  };
  Service* service(const std::string& who);  // nullptr: there are too many
  void show(const std::string& who);
  bool is_of_another(const Process& process);
  void append(const Process& process, std::string event);
  void keep(const std::string& who, const std::string& name, const std::string& json, const std::string& camera = "");
  bool is_shown(const std::string& who) const { return who == shown_; }

  std::map<std::string, Service> services_;  // by host/pid
  std::string shown_;                        // empty: none
  // What came before its service had said who it is.
  struct Early {
    Process process;
    std::string event;
    bool is_told;  // when it came, as nothing else was shown
  };
  std::deque<Early> early_;
  std::map<std::string, std::chrono::steady_clock::time_point> replies_;  // hub keys, when they came
  std::string trouble_;
  std::map<Process, std::uint64_t>
      strangers_;  // samples since the last pulse that are not of the service that is shown

  std::atomic<int> downloading_ = 0;

  std::mutex mutex_;
  std::deque<msg::TeachRequest> requests_;                   // guarded by mutex_
  std::deque<msg::ControlRequest> control_requests_;         // guarded by mutex_
  std::vector<std::weak_ptr<RecordingDownload>> downloads_;  // guarded by mutex_
  std::string shown_host_;                                   // guarded by mutex_; of the service that is shown
  std::uint32_t shown_pid_ = 0;                              // guarded by mutex_
};

}  // namespace huetrack::live_view
