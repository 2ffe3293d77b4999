#include "pipeline/pipeline.h"

#include <sys/prctl.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>

#include "capture/timing/capture_clock.h"

namespace huetrack::pipeline {
namespace {

// Frames that the rig does not fit, and what users do about it.
std::string other_size_text(const calib::Camera& expected, const calib::ImageSize& size) {
  const calib::ImageSize& own = expected.image_size;
  const auto text_of = [](const calib::ImageSize& of) {
    return std::to_string(of.width) + "x" + std::to_string(of.height);
  };
  std::string text = "camera " + expected.name + ": its frames are " + text_of(size) +
                     ", but the rig was calibrated at " + text_of(own) + ": ";
  const bool are_beside = size == calib::ImageSize{2 * own.width, own.height};
  const bool are_below = size == calib::ImageSize{own.width, 2 * own.height};
  if (are_beside || are_below) {
    const std::string part = "0, " + text_of(own).replace(text_of(own).find('x'), 1, ", ") + "]";
    return text + "if they show two cameras " + (are_beside ? "side by side" : "one below the other") +
           ", give this camera its part, crop: [0, " + part + " or crop: [" +
           (are_beside ? std::to_string(own.width) + ", " + part
                       : "0, " + std::to_string(own.height) + part.substr(1)) +
           "; otherwise calibrate at this size";
  }
  if (size == calib::ImageSize{own.height, own.width})
    return text + "they are turned by 90 degrees: turn the camera back or correct the rotation tag, or calibrate again";
  return text + "use frames of that size, or calibrate at this one";
}

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto status_period = 1s;  // layout: of the status, idl/huetrack.idl

capture::Duration thread_cpu() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec);
}

// For the calling thread.
class Stopwatch {
 public:
  // Since the last lap(), or the constructor.
  StageTime lap() {
    const Clock::time_point wall = Clock::now();
    const capture::Duration cpu = thread_cpu();
    return {.wall = wall - std::exchange(wall_, wall), .cpu = cpu - std::exchange(cpu_, cpu)};
  }

 private:
  Clock::time_point wall_ = Clock::now();
  capture::Duration cpu_ = thread_cpu();
};

StageTime& operator+=(StageTime& sum, const StageTime& lap) {
  sum.wall += lap.wall;
  sum.cpu += lap.cpu;
  return sum;
}

// Returns false if stopped. Sleeps in slices to react to a stop.
bool sleep_until(Clock::time_point when, const std::stop_token& stop) {
  for (auto now = Clock::now(); now < when; now = Clock::now()) {
    if (stop.stop_requested()) return false;
    std::this_thread::sleep_for(std::min<Clock::duration>(when - now, 20ms));
  }
  return !stop.stop_requested();
}

}  // namespace

// Distributes the trackers' work on one set over the calling thread and permanent helpers. Every tracker has its own
// state and random numbers, so the distribution does not change results.
class Pipeline::TrackingTeam {
 public:
  TrackingTeam(std::vector<object_trackers::ObjectTracker>& trackers, int threads)
      : trackers_(trackers),
        per_target_(trackers.size()),
        helpers_(std::max(0, std::min<int>(threads, int(trackers.size())) - 1)),
        start_(helpers_ + 1),
        done_(helpers_ + 1) {
    for (int i = 0; i < helpers_; ++i) {
      threads_.emplace_back([this] {
        for (;;) {
          start_.arrive_and_wait();
          if (task_ == nullptr) return;
          Stopwatch watch;
          work();
          helpers_cpu_ns_ += watch.lap().cpu.count();
          done_.arrive_and_wait();
        }
      });
    }
  }
  ~TrackingTeam() {
    task_ = nullptr;
    if (helpers_ > 0) start_.arrive_and_wait();
  }
  TrackingTeam(const TrackingTeam&) = delete;
  TrackingTeam& operator=(const TrackingTeam&) = delete;

  // estimates: of all targets, in order. Returns the helpers' processor time, as learn().
  capture::Duration update(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& estimates) {
    const capture::Duration helpers_cpu =
        work_all([this, &set](std::size_t i) { trackers_[i].update(set, per_target_[i]); });
    estimates.clear();
    for (std::size_t t = 0; t < per_target_.size(); ++t) {
      for (object_tracking::ObjectEstimate& estimate : per_target_[t]) {
        estimate.target = t;
        estimates.push_back(std::move(estimate));
      }
    }
    return helpers_cpu;
  }
  capture::Duration learn() {
    return work_all([this](std::size_t i) { trackers_[i].learn(); });
  }

 private:
  using OfTracker = std::function<void(std::size_t)>;

  capture::Duration work_all(const OfTracker& task) {
    task_ = &task;
    next_ = 0;
    helpers_cpu_ns_ = 0;
    if (helpers_ > 0) start_.arrive_and_wait();
    work();
    if (helpers_ > 0) done_.arrive_and_wait();
    return capture::Duration(helpers_cpu_ns_);
  }
  void work() {
    for (std::size_t i = next_++; i < trackers_.size(); i = next_++) (*task_)(i);
  }

  std::vector<object_trackers::ObjectTracker>& trackers_;
  std::vector<std::vector<object_tracking::ObjectEstimate>> per_target_;  // of this set
  const int helpers_;
  std::barrier<> start_, done_;      // synchronise the members below
  const OfTracker* task_ = nullptr;  // nullptr at start_: end
  std::atomic<std::size_t> next_ = 0;
  std::atomic<std::int64_t> helpers_cpu_ns_ = 0;
  std::vector<std::jthread> threads_;  // last: joined first
};

Pipeline::Pipeline(const calib::CameraRig& rig, std::vector<std::unique_ptr<capture::FrameSource>> sources,
                   std::vector<object_trackers::ObjectTracker> trackers, PipelineOptions options)
    : rig_(rig),
      sources_(std::move(sources)),
      trackers_(std::move(trackers)),
      options_(std::move(options)),
      frame_sets_(options_.queue_capacity, options_.when_full),
      pictures_(options_.queue_capacity, WhenFull::wait),
      camera_frames_(options_.queue_capacity, options_.when_full),
      camera_pictures_(options_.queue_capacity, WhenFull::wait),
      synchronizer_(options_.frame_sets),
      repeats_(rig.cameras.size()),
      size_checked_(rig.cameras.size(), false) {
  figures_.cameras.resize(rig.cameras.size());
}

Pipeline::~Pipeline() {
  close_sources();
}

void Pipeline::close_sources() {
  std::vector<std::jthread> ending;  // in parallel: each camera may be slow
  for (auto& source : sources_) ending.emplace_back([&source] { source.reset(); });
}

void Pipeline::run(std::stop_token stop) {
  const std::stop_callback forward(stop, [this] {
    stop_.request_stop();
    pictures_.abandon();  // drawing is slow: drop what is not drawn yet
    camera_pictures_.abandon();
  });
  std::jthread drawing([this] { guarded([this] { draw(pictures_, &Output::on_picture); }); });
  std::jthread tracking([this] { guarded([this] { track(); }); });
  std::jthread camera_drawing, camera_tracking;
  if (camera_tracker_) {
    camera_drawing = std::jthread([this] { guarded([this] { draw(camera_pictures_, &Output::on_camera_picture); }); });
    camera_tracking = std::jthread([this] { guarded([this] { track_camera_frames(); }); });
  }
  {
    std::vector<std::jthread> capturing;
    for (auto& source : sources_) {
      capturing.emplace_back([this, &source] { guarded([&] { capture(*source, stop_.get_token()); }); });
    }
  }  // joined: no more frames
  {
    const std::scoped_lock lock(synchronizer_mutex_);
    while (auto set = synchronizer_.flush()) put_in_queue({std::move(*set), capture::unix_now()});
    const std::scoped_lock figures_lock(figures_mutex_);
    figures_.frame_sets = synchronizer_.counters();
  }
  frame_sets_.close();
  camera_frames_.close();
  tracking.join();
  if (camera_tracking.joinable()) camera_tracking.join();
  pictures_.close();
  camera_pictures_.close();
  drawing.join();
  if (camera_drawing.joinable()) camera_drawing.join();
  const std::scoped_lock lock(figures_mutex_);
  if (error_) std::rethrow_exception(error_);
}

PipelineFigures Pipeline::figures() const {
  const std::scoped_lock lock(figures_mutex_);
  PipelineFigures figures = figures_;
  figures.sets_dropped = frame_sets_.dropped();
  figures.camera_frames_dropped = camera_frames_.dropped();
  return figures;
}

TrackedCameraFigures Pipeline::tracked_camera() const {
  const std::scoped_lock lock(figures_mutex_);
  return figures_.tracked_camera;
}

template <typename F>
void Pipeline::guarded(F&& thread_body) {
  try {
    thread_body();
  } catch (...) {  // rethrown by run()
    {
      const std::scoped_lock lock(figures_mutex_);
      if (!error_) error_ = std::current_exception();
    }
    stop_.request_stop();
    frame_sets_.abandon();
    pictures_.abandon();
    camera_frames_.abandon();
    camera_pictures_.abandon();
  }
}

void Pipeline::capture(capture::FrameSource& source, std::stop_token stop) {
  std::vector<bool> mine(rig_.cameras.size(), false);
  for (;;) {
    Stopwatch watch;
    const capture::Duration waited_before = source.waited();
    const std::uint64_t jumps_before = source.jumps();
    auto frame = source.next(stop);
    StageTime lap = watch.lap();
    lap.wall -= source.waited() - waited_before;
    {
      const std::scoped_lock lock(figures_mutex_);
      figures_.decode += lap;
      for (std::size_t c = 0; c < mine.size(); ++c)
        if (mine[c]) set_ended(c, source.ended(int(c)));  // a recording may be rewound
    }
    if (!frame) break;
    mine.at(std::size_t(frame->camera)) = true;
    if (source.jumps() != jumps_before) {
      const std::scoped_lock lock(replacements_mutex_);
      jumps_.push_back(frame->captured_at);
      if (camera_tracker_) camera_jumps_.push_back(frame->captured_at);
    }
    if (pace_) {
      if (!sleep_until(pace_->start + (frame->captured_at - pace_->first), stop)) break;
    }
    receive(std::move(*frame));
  }
  const std::scoped_lock lock(figures_mutex_);
  for (std::size_t c = 0; c < mine.size(); ++c)
    if (mine[c]) set_ended(c, true);
}

void Pipeline::set_ended(std::size_t camera, bool has_ended) {
  if (std::exchange(figures_.cameras[camera].ended, has_ended) != has_ended) ++camera_news_;
}

void Pipeline::receive(capture::Frame frame) {
  const auto camera = std::size_t(frame.camera);
  const capture::Timestamp received_at =
      frame.arrived_at == capture::Timestamp{} ? capture::unix_now() : frame.arrived_at;
  const bool is_sound = frame.status == capture::FrameStatus::ok;
  const bool is_picture = is_sound && capture::has_pixels(frame.pixels);
  const bool is_repeated = is_picture && repeats_[camera].is_repeated(frame.pixels);
  {
    const std::scoped_lock lock(figures_mutex_);
    CameraFigures& figures = figures_.cameras[camera];
    ++(is_sound ? figures.frames : figures.corrupted);
    if (is_sound && figures.frames == 1) ++camera_news_;
    if (figures.last_sequence && frame.sequence > *figures.last_sequence + 1) {
      figures.dropped += frame.sequence - *figures.last_sequence - 1;
    }
    figures.last_sequence = frame.sequence;
    if (is_sound) figures.last_received = Clock::now();
    if (is_picture) figures.has_changed = repeats_[camera].has_changed();
    if (is_repeated) {
      ++figures.repeated;
      if (!figures.repeated_since) figures.repeated_since = frame.captured_at, ++figures.times_repeated;
    } else if (is_sound) {
      figures.repeated_since.reset();
    }
    figures.last_captured = frame.captured_at;
  }

  const std::scoped_lock lock(synchronizer_mutex_);
  if (is_sound && !size_checked_[camera]) {
    const calib::Camera& expected = rig_.cameras[camera];
    const calib::ImageSize size{frame.pixels.width, frame.pixels.height};
    if (size != expected.image_size) {
      throw std::runtime_error(other_size_text(expected, size));
    }
    if (frame.camera == tracked_camera_ && !capture::has_pixels(frame.pixels))
      throw std::runtime_error("camera " + expected.name +
                               ": it sends matches, but tracking the camera needs pictures: set send: frames for it");
    size_checked_[camera] = true;
  }
  frame.arrival = ++arrivals_;
  for (Output* output : outputs_) output->on_frame(frame, received_at);
  if (is_repeated) frame.status = capture::FrameStatus::repeated;  // after the recorder; a replay detects it again
  if (frame.camera == tracked_camera_ && frame.status == capture::FrameStatus::ok)
    put_in_camera_queue({frame, received_at});  // the image is shared, not copied
  Stopwatch watch;
  auto sets = synchronizer_.push(std::move(frame));
  {
    const StageTime lap = watch.lap();
    const std::scoped_lock figures_lock(figures_mutex_);
    figures_.synchronise += lap;
    figures_.frame_sets = synchronizer_.counters();
  }
  for (auto& set : sets) put_in_queue({std::move(set), received_at});
}

void Pipeline::put_in_queue(ReadySet ready) {
  std::optional<ReadySet> pushed_out;
  frame_sets_.push(std::move(ready), &pushed_out);
  if (!pushed_out) return;
  for (Output* output : outputs_) output->on_left_out({.at = pushed_out->set.at});
}

void Pipeline::put_in_camera_queue(ReadyFrame ready) {
  if (std::ranges::binary_search(options_.camera_left_out, ready.frame.captured_at)) return;
  std::optional<ReadyFrame> pushed_out;
  camera_frames_.push(std::move(ready), &pushed_out);
  if (!pushed_out) return;
  for (Output* output : outputs_) output->on_left_out({.at = pushed_out->frame.captured_at, .is_of_camera = true});
}

void Pipeline::track() {
  ::prctl(PR_SET_NAME, "tracking");  // for top -H
  TrackingTeam team(trackers_, options_.threads);
  std::vector<object_tracking::ObjectEstimate> estimates;
  auto next_status = Clock::now() + status_period;
  int reported_camera_news = -1;

  for (;;) {
    {
      const std::scoped_lock lock(figures_mutex_);
      figures_.tracking_round = Clock::now();
    }
    if (auto ready = frame_sets_.pop_for(std::max<Clock::duration>(next_status - Clock::now(), 0ns))) {
      if (std::ranges::binary_search(options_.left_out, ready->set.at)) continue;
      update(std::move(*ready), team, estimates);
    } else if (frame_sets_.ended()) {
      break;
    }
    const bool is_due = Clock::now() >= next_status;
    int camera_news = 0;
    {
      const std::scoped_lock lock(figures_mutex_);
      camera_news = camera_news_;
    }
    if (!is_due && camera_news == reported_camera_news) continue;
    if (is_due) update_searches();
    output_status();
    reported_camera_news = camera_news;
    next_status = Clock::now() + status_period;
  }
  update_searches();
  output_status();
}

void Pipeline::update(ReadySet ready, TrackingTeam& team, std::vector<object_tracking::ObjectEstimate>& estimates) {
  const bool has_new_trackers = take_replacements(ready.set.at);
  begin_anew_after_jumps(ready.set.at);
  // Object tracking uses still cameras only.
  std::optional<capture::FrameSet> of_still_cameras;
  if (tracked_camera_ >= 0) {
    of_still_cameras = ready.set;  // images are shared
    of_still_cameras->frames.at(std::size_t(tracked_camera_)).reset();
  }
  const capture::FrameSet& still = of_still_cameras ? *of_still_cameras : ready.set;
  Stopwatch stages;
  watch(still, has_new_trackers);
  StageTime watched = stages.lap();
  const capture::Duration helpers_cpu = team.update(still, estimates);
  StageTime tracked = stages.lap();
  object_trackers::ObjectTracker::share_times(trackers_);
  tracked.cpu += helpers_cpu;
  if (calibration_) calibration_->learn(estimates);
  if (mistakes_) watch_mistakes(still, estimates);
  watched += stages.lap();
  const TrackedSet result{
      .frames = ready.set,
      .estimates = estimates,
      .received_at = ready.received_at,
      .trackers = trackers_,
      .calibration = calibration_ ? std::span<const CameraCalibration>(calibration_->cameras())
                                  : std::span<const CameraCalibration>(),
      .mistakes = mistakes_ ? mistakes_->mistakes() : std::span<const std::vector<view_watch::Mistake>>(),
      .reloaded = reloaded_};
  for (Output* output : outputs_) output->on_set(result);
  const StageTime published = stages.lap();
  tracked.cpu += team.learn();  // the helpers'
  tracked += stages.lap();
  std::uint64_t index = 0;
  {
    const std::scoped_lock lock(figures_mutex_);
    figures_.watch += watched;
    figures_.track += tracked;
    if (figures_.sets_tracked == 0) figures_.track_first = tracked;
    figures_.publish += published;
    index = figures_.sets_tracked++;
  }
  if (is_picture(index) && !trackers_.empty()) pictures_.push(result.picture(0));
}

void Pipeline::watch(const capture::FrameSet& set, bool has_new_trackers) {
  const bool is_trust_new = calibration_ && calibration_->look(set);
  if (is_trust_new || has_new_trackers || is_inflation_new_) trust_cameras();
  is_inflation_new_ = false;
}

void Pipeline::trust_cameras() {
  std::vector<object_tracking::CameraTrust> trust;
  if (calibration_) trust = calibration_->trust();
  if (mistakes_) add_inflation(mistakes_->inflation(), trust);
  for (auto& tracker : trackers_) tracker.trust(trust);
}

void Pipeline::watch_mistakes(const capture::FrameSet& set,
                              std::span<const object_tracking::ObjectEstimate> estimates) {
  is_inflation_new_ |= mistakes_->look(set, estimates, trackers_, moved_cameras());
  if (mistakes_->late_s().empty()) return;
  for (auto& tracker : trackers_) tracker.correct_times(mistakes_->late_s());
}

std::vector<bool> Pipeline::moved_cameras() const {
  std::vector<bool> moved(rig_.cameras.size(), false);
  for (std::size_t c = 0; calibration_ && c < moved.size(); ++c)
    moved[c] = calibration_->cameras()[c].moved.has_value();
  return moved;
}

bool Pipeline::is_picture(std::uint64_t index) const {
  return options_.pictures_every > 0 && index % std::uint64_t(options_.pictures_every) == 0;
}

void Pipeline::output_status() {
  const PipelineFigures now = figures();
  for (Output* output : outputs_) output->on_status(now);
}

void Pipeline::update_searches() {
  std::vector<objects::SearchFindings> searches, of_run;
  for (const auto& tracker : trackers_) {
    searches.push_back(tracker.search_findings());
    of_run.push_back(tracker.search_findings_of_run());
  }
  const std::scoped_lock lock(replacements_mutex_, figures_mutex_);
  for (const Replacement& next : replacements_)
    if (!next.from) forget_searches(next, searches);
  figures_.searches = std::move(searches);
  figures_.searches_of_run = std::move(of_run);
}

// What was searched says nothing of what replaces it: while a replay is paused, no frame set was tracked with that.
void Pipeline::forget_searches(const Replacement& next, std::vector<objects::SearchFindings>& searches) {
  for (const auto& [target, options, tracker] : next.trackers)
    if (target < searches.size()) searches[target] = {};
}

void Pipeline::replace_trackers(Replacement replacement) {
  if (!replacement.from) {
    const std::scoped_lock lock(figures_mutex_);
    forget_searches(replacement, figures_.searches);
  }
  const std::scoped_lock lock(replacements_mutex_);
  replacements_.push_back(std::move(replacement));
}

bool Pipeline::take_replacements(capture::Timestamp at) {
  reloaded_.clear();
  bool is_any = false;
  const std::scoped_lock lock(replacements_mutex_);
  for (; !replacements_.empty() && replacements_.front().from.value_or(at) <= at; replacements_.pop_front()) {
    for (auto& [target, options, tracker] : replacements_.front().trackers) {
      tracker.take_over_from(trackers_.at(target));
      trackers_.at(target) = std::move(tracker);
      if (mistakes_) mistakes_->reset_target(target, options);
    }
    if (!replacements_.front().config.empty()) reloaded_.push_back(std::move(replacements_.front().config));
    is_any = true;
  }
  return is_any;
}

bool Pipeline::has_jumped(std::deque<capture::Timestamp>& jumps, capture::Timestamp at) {
  const std::scoped_lock lock(replacements_mutex_);
  bool has_jumped = false;
  for (; !jumps.empty() && jumps.front() <= at; jumps.pop_front()) has_jumped = true;
  return has_jumped;
}

void Pipeline::begin_anew_after_jumps(capture::Timestamp at) {
  if (!has_jumped(jumps_, at)) return;
  for (auto& tracker : trackers_) tracker.begin_anew();
  if (calibration_) calibration_->begin_anew();
  if (mistakes_) mistakes_->begin_anew();
}

void Pipeline::track_camera(int camera, std::unique_ptr<camera_tracking::CameraTracker> tracker) {
  tracked_camera_ = camera;
  camera_tracker_ = std::move(tracker);
}

void Pipeline::track_camera_frames() {
  while (auto ready = camera_frames_.pop()) {
    Stopwatch watch;
    if (has_jumped(camera_jumps_, ready->frame.captured_at)) camera_tracker_->begin_anew();
    const camera_tracking::CameraEstimate estimate = camera_tracker_->update(ready->frame);
    const StageTime tracked = watch.lap();
    const std::string why = estimate.has_pose() ? std::string() : camera_tracker_->why_no_pose();
    {
      const std::scoped_lock lock(figures_mutex_);
      figures_.tracked_camera.add(estimate, why);
    }
    Stopwatch publishing;
    // Read without the lock: only this thread writes them.
    const TrackedFrame result{estimate, ready->received_at, figures_.tracked_camera, *camera_tracker_};
    for (Output* output : outputs_) output->on_camera_pose(result);
    const StageTime published = publishing.lap();
    std::uint64_t index = 0;
    {
      const std::scoped_lock lock(figures_mutex_);
      figures_.camera_track += tracked;
      figures_.publish += published;
      index = figures_.camera_frames_tracked++;
    }
    if (is_picture(index)) {
      pictures::CameraPictureJob job{std::move(ready->frame), estimate, camera_tracker_->inside(), {}};
      if (estimate.has_pose() && job.inside.features.empty()) job.start_map = camera_tracker_->map();
      camera_pictures_.push(std::move(job));
    }
  }
}

template <typename Job>
void Pipeline::draw(BoundedQueue<Job>& jobs, void (Output::*on_job)(const Job&)) {
  while (auto job = jobs.pop()) {
    Stopwatch watch;
    for (Output* output : outputs_) (output->*on_job)(*job);
    const StageTime lap = watch.lap();
    const std::scoped_lock lock(figures_mutex_);
    figures_.draw += lap;
  }
}

}  // namespace huetrack::pipeline
