#include "page/page_service.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>

#include "pictures/preview_maker.h"

namespace huetrack::page {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr int niceness = 10;         // of 19
constexpr auto poll_period = 100ms;  // for subscribers
constexpr auto fetch_period = 10ms;  // for a requested set
// A download requests thousands of parts one after the other.
constexpr auto reading_period = 2ms;
constexpr auto reads_on_for = 500ms;
constexpr auto network_period = 1s;
// Pages ask for a state once a second, and repeat a request after 24 s at most. Replies to teaching hold pictures, and
// a page has one such request at a time.
constexpr std::size_t kept_replies = 64, kept_teach_replies = 8;
constexpr auto map_period = 1s;
constexpr auto freeze_patience = 3s;          // for a set to freeze
constexpr auto whole_freeze_patience = 1s;    // for one with a picture of every camera
constexpr auto kept_freeze_patience = 300ms;  // likewise, if a set was kept
constexpr auto repeat_after = 1s;             // a kept set is shown again, for late joiners

bool has_all_pictures(const capture::FrameSet& set) {
  return std::ranges::all_of(set.frames,
                             [](const auto& frame) { return frame && frame->status == capture::FrameStatus::ok; });
}

}  // namespace

PageService::PageService(const config::ServiceConfig& config, PageServiceOptions options)
    : options_(std::move(options)),
      particles_(std::size_t(std::max(1, config.preview.particles))),
      publisher_(config.dds.publisher),
      teaching_(options_.actions),
      control_(options_.control),
      teach_replies_(kept_teach_replies),
      control_replies_(kept_replies),
      wanted_(options_.keeps_frames),
      config_(config),
      thread_([this](const std::stop_token& stop) { serve(stop); }) {}

PageService::~PageService() = default;

void PageService::offer(pictures::PictureJob job) {
  wanted_.store(false, std::memory_order_relaxed);
  const std::scoped_lock lock(mutex_);
  offered_ = std::move(job);
  // No notification: it would cost the tracking thread more than all the rest, and this thread polls.
}

void PageService::on_set(const pipeline::TrackedSet& set) {
  // The set at which a replay is held stays visible, also for pages that are opened later.
  const Playback* const playback = options_.control.playback;
  if (wants() || (playback != nullptr && playback->state().is_paused)) offer(set.picture(particles_));
}

void PageService::offer(camera_tracking::CameraMap map) {
  map_wanted_.store(false, std::memory_order_relaxed);
  const std::scoped_lock lock(mutex_);  // no notification: the thread polls
  map_ = std::move(map);
}

void PageService::take_over(const config::ServiceConfig& config) {
  {
    const std::scoped_lock lock(mutex_);
    fresh_ = config;
  }
  news_.notify_one();
}

void PageService::serve(const std::stop_token& stop) {
  ::prctl(PR_SET_NAME, "view");
  // Lower priority than tracking and capture; per thread in Linux; ignored if refused.
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), niceness);
  publish_scene();
  std::optional<pictures::PictureJob> last;  // only if keeps_frames
  Clock::time_point next_preview{}, next_network = Clock::now() + network_period, next_map{}, shown_at{};
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / config_.preview.rate_hz));
  bool is_watched = false;
  while (!stop.stop_requested()) {
    std::optional<pictures::PictureJob> job;
    std::optional<camera_tracking::CameraMap> map;
    std::optional<config::ServiceConfig> fresh;
    {
      std::unique_lock lock(mutex_);
      auto until = Clock::now() + poll_period;
      if (is_watched && next_preview > Clock::now()) until = std::min(until, next_preview);
      if (wants()) until = Clock::now() + fetch_period;
      if (Clock::now() < read_at_ + reads_on_for) until = std::min(until, Clock::now() + reading_period);
      news_.wait_until(lock, stop, until, [&] { return offered_ || fresh_; });
      job.swap(offered_);
      map.swap(map_);
      fresh.swap(fresh_);
    }
    if (fresh) {
      config_ = std::move(*fresh);
      publish_scene();
    }
    const auto now = Clock::now();
    if (options_.reload_requested != nullptr && options_.reload_requested->exchange(false)) options_.actions.reload();
    take_requests();
    take_control_requests();
    control_.poll();
    if (to_freeze_ && job && (has_all_pictures(job->set) || now > freeze_requested_at_ + whole_freeze_patience)) {
      freeze(job->set);
    } else if (to_freeze_ && last && now > freeze_requested_at_ + kept_freeze_patience) {
      freeze(last->set);
    } else if (to_freeze_ && now > freeze_requested_at_ + freeze_patience) {
      reply(TeachingSession::refusal(*to_freeze_, "The cameras deliver no pictures."));
      to_freeze_.reset();
    }
    const bool wants_moment = teaching_.wants_moment(now);
    if (job && wants_moment) teaching_.add_moment(job->set);
    is_watched = config_.preview.enabled && publisher_.picture_subscribers() + publisher_.marker_subscribers() > 0;
    if (job && is_watched) {
      publish_previews(*job);
      shown_at = now;
      next_preview = now + period;
    } else if (last && !job && is_watched && now >= shown_at + repeat_after) {
      publish_previews(*last);
      shown_at = now;
    }
    if (job && options_.keeps_frames) last = std::move(job);
    if ((is_watched && now >= next_preview) || to_freeze_ || wants_moment)
      wanted_.store(true, std::memory_order_relaxed);
    if (map) {
      publisher_.publish(*map, map->at + clock_offset());
      next_map = now + map_period;
    }
    if (now >= next_map) map_wanted_.store(true, std::memory_order_relaxed);
    if (now >= next_network) {
      next_network = now + network_period;
      publisher_.check_network();
    }
  }
}

void PageService::publish_scene() {
  const std::string why_not =
      !options_.actions.reload ? "This service cannot be taught." : TeachingSession::why_not(config_);
  publisher_.publish(pictures::make_scene(config_, why_not.empty(), why_not));
}

void PageService::take_requests() {
  while (const auto request = publisher_.next_request()) {
    // A repeated request is answered once: new pictures would not be those that the page shows.
    if (to_freeze_ && is_same(*to_freeze_, *request)) continue;
    if (const msg::TeachReply* before = teach_replies_.to(*request)) {
      publisher_.publish(*before);
      continue;
    }
    if (!options_.actions.reload) {
      reply(TeachingSession::refusal(*request, "This service cannot be taught."));
    } else if (request->action() != msg::TEACH_ACTION_FREEZE) {
      reply(teaching_.answer(*request, config_));
    } else if (const std::string why = TeachingSession::why_not(config_); !why.empty()) {
      reply(TeachingSession::refusal(*request, why));
    } else {
      if (to_freeze_)
        reply(TeachingSession::refusal(*to_freeze_, "Another client requested pictures later: request them again."));
      if (!to_freeze_) freeze_requested_at_ = Clock::now();
      to_freeze_ = *request;
    }
  }
}

void PageService::take_control_requests() {
  while (const auto request = publisher_.next_control_request()) {
    if (ControlHandler::is_read(*request)) {
      read_at_ = Clock::now();
      publisher_.publish(control_.answer(*request, config_));
      continue;
    }
    const msg::ControlReply* const before = control_replies_.to(*request);
    publisher_.publish(before ? *before : control_replies_.keep(control_.answer(*request, config_)));
  }
}

void PageService::freeze(const capture::FrameSet& set) {
  reply(teaching_.freeze(*to_freeze_, config_, set));
  to_freeze_.reset();
}

void PageService::publish_previews(const pictures::PictureJob& job) {
  if (publisher_.picture_subscribers() > 0) {
    for (const auto& preview : pictures::make_previews(config_, job, clock_offset()))
      if (publisher_.publish(preview)) ++previews_;
  }
  publisher_.publish(job.estimates, job.set.at + clock_offset());
}

}  // namespace huetrack::page
