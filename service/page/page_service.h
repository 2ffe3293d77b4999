// Serves web pages: previews while there are subscribers, the scene, teaching, requests in words. Works in its own
// thread: the tracking thread checks one atomic flag per set, and passes a set only when it is wanted.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "config/service_config.h"
#include "page/control_handler.h"
#include "page/recent_replies.h"
#include "page/teaching_session.h"
#include "pipeline/output.h"
#include "pipeline/published_time.h"
#include "publish/page_publisher.h"

namespace huetrack::page {

struct PageServiceOptions {
  // For a replay, where sets may be kept (no driver waits for buffers): takes the first set, and each while paused, and
  // shows the newest again while there is no other.
  bool keeps_frames = false;
  // Published time; outlives this. nullptr: the capture time.
  const pipeline::PublishedTime* time = nullptr;
  // Flag that requests a reload by actions.reload; nullptr: not handled here.
  std::atomic<bool>* reload_requested = nullptr;
  // Called from this thread. Without reload, nothing can be taught.
  TeachingSession::Actions actions = {};
  ControlHandler::Actions control = {};
};

// Thread rules per function. Has its own thread, ended by the destructor.
class PageService final : public pipeline::Output {
 public:
  // throws as PagePublisher's constructor.
  PageService(const config::ServiceConfig& config, PageServiceOptions options);
  ~PageService() override;
  PageService(const PageService&) = delete;
  PageService& operator=(const PageService&) = delete;

  // The tracking thread, for every set: whether a set is wanted.
  bool wants() const noexcept { return wanted_.load(std::memory_order_relaxed); }
  // The tracking thread, if wants(). Takes a lock that is held only for a swap.
  void offer(pictures::PictureJob job);
  // The same for the tracked camera's map; the camera thread, about once a second.
  bool wants_map() const noexcept { return map_wanted_.load(std::memory_order_relaxed); }
  void offer(camera_tracking::CameraMap map);

  // Any thread: the configuration now in force.
  void take_over(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_camera_pose(const pipeline::TrackedFrame& frame) override {
    if (wants_map()) offer({frame.estimate.at, frame.tracker.map()});
  }
  void on_config(const config::ServiceConfig& config) noexcept override { take_over(config); }

  std::uint64_t previews() const { return previews_; }  // published since the start

 private:
  void serve(const std::stop_token& stop);
  void publish_previews(const pictures::PictureJob& job);
  void publish_scene();
  void take_requests();
  void take_control_requests();
  void freeze(const capture::FrameSet& set);
  void reply(msg::TeachReply reply) { publisher_.publish(teach_replies_.keep(std::move(reply))); }

  capture::Duration clock_offset() const {
    return options_.time != nullptr ? options_.time->offset() : capture::Duration{0};
  }

  const PageServiceOptions options_;
  const std::size_t particles_;       // of each target in a picture, about
  publish::PagePublisher publisher_;  // this and all members up to wanted_: this thread's
  TeachingSession teaching_;
  const ControlHandler control_;
  std::optional<msg::TeachRequest> to_freeze_;  // waits for a set
  std::chrono::steady_clock::time_point freeze_requested_at_{};
  RecentReplies<msg::TeachReply> teach_replies_;
  RecentReplies<msg::ControlReply> control_replies_;
  std::chrono::steady_clock::time_point read_at_{};  // last request for a part of a recording
  std::atomic<bool> wanted_ = false, map_wanted_ = true;
  std::atomic<std::uint64_t> previews_ = 0;

  std::mutex mutex_;
  std::condition_variable_any news_;
  std::optional<pictures::PictureJob> offered_;    // guarded by mutex_
  std::optional<camera_tracking::CameraMap> map_;  // guarded by mutex_
  std::optional<config::ServiceConfig> fresh_;     // guarded by mutex_; to be applied
  config::ServiceConfig config_;                   // the thread's own
  std::jthread thread_;                            // last: joined first
};

}  // namespace huetrack::page
