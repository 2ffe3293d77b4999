// The DDS side of the bridge: samples into the hub, requests of pages onto the bus.
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

// poll() by one thread; request() and download() by any.
class BusReader {
 public:
  // Throws as DdsParticipant.
  BusReader(const idl::ParticipantOptions& options, EventHub& hub);
  ~BusReader();

  // Takes all received samples; does not block. Call it every few milliseconds.
  //   pages  number of open pages; 0: unsubscribes from the previews, so that the service makes none
  void poll(int pages);

  // Returns an empty string, or why it is not sent: queue full, or not permitted by DDS Security.
  std::string request(msg::TeachRequest request);
  std::string request(msg::ControlRequest request);

  // Starts a download from the shown service (words: of RecordingDownload); it continues while the pointer is shared.
  // nullptr: refused, see why_not.
  std::shared_ptr<RecordingDownload> download(const std::vector<std::string>& words, std::string& why_not);
  int downloads() const { return downloading_; }  // active

  std::string description() const;

  using Process = std::array<unsigned char, 8>;  // as DDS names it

 private:
  struct Connection;
  struct Previews;
  void take_positions();  // and camera poses
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
  void send_all(std::deque<Request>& queue, eprosima::fastdds::dds::DataWriter* writer);  // nullptr: discards
  void publish_pulse();

  const idl::ParticipantOptions options_;
  EventHub& hub_;
  std::unique_ptr<Connection> connection_;
  const std::string refused_;           // why requests are not permitted; empty: they are
  std::unique_ptr<Previews> previews_;  // null while there is no page
  std::chrono::steady_clock::time_point next_pulse_{}, no_page_since_{};
  // If several services publish on one bus, the most recently discovered one is shown; the others are named.
  struct Service {
    std::chrono::steady_clock::time_point began, last_status;
    Process process{};
    std::map<std::string, std::string> events;  // latest, by hub key
    std::string config_file;
    std::string host;
    std::uint32_t pid = 0;
    std::set<std::string> cameras;
  };
  Service* service(const std::string& id);  // nullptr: too many
  static bool is_silent(const Service& service);
  void show(const std::string& id);
  bool is_of_another(const Process& process);
  void append(const Process& process, std::string event);
  void keep(const std::string& id, const std::string& name, const std::string& json, const std::string& camera = "");
  bool is_shown(const std::string& id) const { return id == shown_; }

  std::map<std::string, Service> services_;  // by host/pid; those that are silent, too
  std::string shown_;                        // empty: none
  // Samples received before the first status of their service.
  struct Early {
    Process process;
    std::string event;
    bool was_sent;  // to the hub, because no service was shown
  };
  std::deque<Early> early_;
  std::map<std::string, std::chrono::steady_clock::time_point> replies_;  // hub key: time of reception
  std::string trouble_;
  std::map<Process, std::uint64_t> foreign_samples_;  // since the last pulse, of other processes than the shown service

  std::atomic<int> downloading_ = 0;

  std::mutex mutex_;
  std::deque<msg::TeachRequest> requests_;                   // guarded by mutex_
  std::deque<msg::ControlRequest> control_requests_;         // guarded by mutex_
  std::vector<std::weak_ptr<RecordingDownload>> downloads_;  // guarded by mutex_
  std::string shown_host_;                                   // guarded by mutex_; of the shown service
  std::uint32_t shown_pid_ = 0;                              // guarded by mutex_
};

}  // namespace huetrack::live_view
