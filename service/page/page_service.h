// Serves the pages: previews at their own rate while somebody subscribes, the scene, and the teaching of colours. It
// stands beside the road of the frames: the tracking thread asks one atomic flag per set, and hands over a set only
// when this thread waits for one.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "config/service_config.h"
#include "page/control_handler.h"
#include "page/teaching_session.h"
#include "pipeline/output.h"
#include "pipeline/published_time.h"
#include "publish/page_publisher.h"

namespace huetrack::page {

struct PageServiceOptions {
  // Of a replay: a set that is held may be kept, no driver waits for its buffers. The first set is always taken, and
  // each while it is paused; the newest one is shown again while none comes.
  bool keeps_frames = false;
  // How published times are made; outlives the server. nullptr: they are the capture times.
  const pipeline::PublishedTime* time = nullptr;
  // Set by somebody: the configuration is to be read again, by actions.reload. nullptr: somebody else does that.
  std::atomic<bool>* reload_asked = nullptr;
  // Called from the server's thread. Without reload, nothing can be taught.
  TeachingSession::Actions actions = {};
  ControlHandler::Actions control = {};
};

// thread-safe as said per function. Has a thread of its own, ended by the destructor.
class PageService final : public pipeline::Output {
 public:
  // throws as PagePublisher's constructor does.
  PageService(const config::ServiceConfig& config, PageServiceOptions options);
  ~PageService() override;
  PageService(const PageService&) = delete;
  PageService& operator=(const PageService&) = delete;

  // The tracking thread, for every set: does somebody wait for one?
  bool wants() const noexcept { return wanted_.load(std::memory_order_relaxed); }
  // The tracking thread, when wants(). Never waits for anything but a lock that is held for a swap.
  void offer(pictures::PictureJob job);
  // The camera thread, for every frame of a tracked camera: the same for its map, about once a second.
  bool wants_map() const noexcept { return map_wanted_.load(std::memory_order_relaxed); }
  void offer(camera_tracking::CameraMap map);

  // Any thread: the configuration now in force.
  void take_over(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_camera_pose(const pipeline::TrackedFrame& frame) override;
  void on_config(const config::ServiceConfig& config) noexcept override { take_over(config); }

  std::uint64_t previews() const { return previews_; }  // published since the start

 private:
  void serve(const std::stop_token& stop);
  void publish_previews(const pictures::PictureJob& job);
  void publish_scene();
  void take_requests();
  void take_control_requests();
  void freeze(const capture::FrameSet& set);
  void reply(msg::TeachReply reply);

  capture::Duration clock_offset() const;

  const PageServiceOptions options_;
  const std::size_t particles_;       // of each target in a picture, about
  publish::PagePublisher publisher_;  // this and all that follows to wanted_: the server's thread's
  TeachingSession desk_;
  const ControlHandler control_desk_;
  std::optional<msg::TeachRequest> to_freeze_;  // waits for a set
  std::chrono::steady_clock::time_point asked_to_freeze_{};
  std::optional<msg::TeachReply> last_reply_;
  std::optional<msg::ControlReply> last_control_reply_;
  std::chrono::steady_clock::time_point read_at_{};  // when a piece of a recording was asked for
  std::atomic<bool> wanted_ = false, map_wanted_ = true;
  std::atomic<std::uint64_t> previews_ = 0;

  std::mutex mutex_;
  std::condition_variable_any news_;
  std::optional<pictures::PictureJob> offered_;    // guarded by mutex_
  std::optional<camera_tracking::CameraMap> map_;  // guarded by mutex_
  std::optional<config::ServiceConfig> fresh_;     // guarded by mutex_; to be taken over
  config::ServiceConfig config_;                   // the thread's own
  std::jthread thread_;                            // last: ends before the rest goes
};

}  // namespace huetrack::page
