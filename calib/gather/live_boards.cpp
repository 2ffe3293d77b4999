#include "calib/gather/live_boards.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <future>
#include <mutex>
#include <thread>

#include "calib/board/grey_view.h"
#include "calib/gather/board_evidence.h"
#include "calib/gather/motion_blur.h"
#include "calib/gather/progress_line.h"
#include "capture/timing/frame_synchronizer.h"

namespace huetrack::gather {
namespace {

using Clock = std::chrono::steady_clock;

// The newest frame set of live cameras and its predecessor; older ones are dropped. thread-safe.
class NewestSet {
 public:
  static constexpr auto shortly = std::chrono::milliseconds(200);
  struct Taken {
    capture::FrameSet set;
    std::optional<capture::FrameSet> before;  // the predecessor; nullopt: none
  };
  NewestSet(std::vector<LiveCameraSource>& cameras, capture::Duration tolerance)
      : synchronizer_({.camera_count = static_cast<int>(cameras.size()), .tolerance = tolerance}),
        open_(static_cast<std::size_t>(
            std::ranges::count_if(cameras, [](const auto& camera) { return camera.source != nullptr; }))) {
    for (const LiveCameraSource& camera : cameras) {
      if (!camera.source) continue;
      threads_.emplace_back([this, source = camera.source.get()](const std::stop_token& stop) {
        while (auto frame = source->next(stop)) push(std::move(*frame));
        const std::scoped_lock lock(mutex_);
        if (--open_ == 0) {
          while (auto set = synchronizer_.flush()) take_in(std::move(*set));
        }
        arrived_.notify_all();
      });
    }
  }

  // nullopt: nothing new within `patience`, or ended.
  std::optional<Taken> take(std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, patience, [&] { return newest_.has_value() || open_ == 0; });
    if (!newest_) return std::nullopt;
    return Taken{*std::exchange(newest_, std::nullopt), std::exchange(before_, std::nullopt)};
  }
  bool ended() {
    const std::scoped_lock lock(mutex_);
    return open_ == 0 && !newest_;
  }

 private:
  void push(capture::Frame frame) {
    const std::scoped_lock lock(mutex_);
    for (capture::FrameSet& set : synchronizer_.push(std::move(frame))) take_in(std::move(set));
    if (newest_) arrived_.notify_all();
  }
  void take_in(capture::FrameSet set) {  // under mutex_
    if (newest_ && (!before_ || set.at - before_->at > shortly)) before_ = std::move(newest_);
    newest_ = std::move(set);
  }

  std::mutex mutex_;
  std::condition_variable arrived_;
  capture::FrameSynchronizer synchronizer_;  // these four guarded by mutex_
  std::optional<capture::FrameSet> newest_, before_;
  std::size_t open_;
  std::vector<std::jthread> threads_;  // last member: joined first
};

// Whether the board has hardly moved since the previous set, in all cameras that saw it in both; at least one.
bool is_at_rest(const std::vector<solver::BoardView>& now, const std::vector<solver::BoardView>& before, double dt_s,
                const std::vector<calib::ImageSize>& sizes) {
  bool any = false;
  for (const solver::BoardView& view : now) {
    const auto same = std::ranges::find(before, view.camera, &solver::BoardView::camera);
    if (same == before.end()) continue;
    const auto moved = moved_px(view, *same);
    if (!moved) continue;
    any = true;
    constexpr double widths_per_second = 0.04;
    if (*moved > widths_per_second * sizes[static_cast<std::size_t>(view.camera)].width * std::max(dt_s, 0.05))
      return false;
  }
  return any;
}

// A frame set with the board detections.
struct Look {
  double at_s = 0;             // since the first set
  std::vector<cv::Mat> greys;  // per camera; empty: the set lacks its frame
  bool is_complete = true;     // all cameras have a frame
  std::vector<solver::BoardView> views;
  std::string motion_blurred;  // a camera with motion blur; empty: none
};

// The views so far, and the instructions for the user. thread-compatible.
class Gathering {
 public:
  Gathering(const std::vector<LiveCameraSource>& cameras, const board::BoardDetector& detector,
            const LiveBoardsOptions& options)
      : detector_(detector),
        evidence_(detector.board()),
        options_(options),
        sizes_(cameras.size()),
        shown_(cameras.size()),
        blur_detectors_(cameras.size()),
        line_(options.progress),
        page_(options.page) {
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      names_.push_back(cameras[c].name);
      found_.cameras.emplace_back();
      found_.cameras.back().name = shown_[c].camera = cameras[c].name;
    }
  }

  void tell_trouble(std::vector<LiveCameraSource>& cameras) {
    for (LiveCameraSource& camera : cameras) {
      if (!camera.take_trouble) continue;
      for (const std::string& trouble : camera.take_trouble()) {
        line_.clear();
        std::fprintf(stderr, "huetrack-calibrate: %s: %s\n", camera.name.c_str(), trouble.c_str());
      }
    }
  }

  // False: nothing is missing, and until_enough is set.
  bool take(const NewestSet::Taken& taken) {
    // On a slow computer sets are far apart: the predecessor shows whether the board rests.
    constexpr double seldom_s = 0.4;
    if (taken.before && capture::seconds(taken.set.at) - first_s_.value_or(0) - before_s_ > seldom_s) {
      Look before = look_at(*taken.before);
      before_ = std::move(before.views);
      before_s_ = before.at_s;
    }
    Look look = look_at(taken.set);
    ++found_.sets_looked_at;
    if (!coverage_ && std::ranges::none_of(sizes_, [](calib::ImageSize s) { return s.width == 0; }))
      coverage_.emplace(detector_.board(), names_, sizes_);
    const std::string status = keep_if_new(look);
    before_ = std::move(look.views);
    before_s_ = look.at_s;
    if (options_.looked) options_.looked(status);
    if (!coverage_) {
      tell_awaited();
      return true;
    }
    const auto needs = coverage_->needs();
    if (!ProgressLine::is_machine_readable() && line_.due())
      line_.draw(status + (needs.empty() ? "" : "; then: " + needs.front()) + "\n" + coverage_->lines());
    if (page_.due()) page_.show(shown_, *coverage_, status);
    if (ProgressLine::is_machine_readable() && line_.due()) tell(status, needs);
    return !options_.until_enough || !needs.empty();
  }

  // While a camera has no image yet.
  void tell_awaited() {
    if (coverage_ || !line_.due()) return;
    std::vector<std::string_view> names;
    for (const PictureTally& camera : found_.cameras) {
      if (camera.pictures == 0) names.emplace_back(camera.name);
    }
    line_.draw(fmt::format("waiting for the first image of {}", fmt::to_string(fmt::join(names, ", "))));
  }

  // throws InputError: a camera without images, or without kept views.
  FoundBoards finish() {
    line_.clear();
    evidence_.refuse_wrong_board();
    found_.board = evidence_.board();
    found_.board_doubt = evidence_.doubt();
    page_.close("finished with " + std::to_string(found_.set_at_s.size()) + " frame sets");
    for (const PictureTally& camera : found_.cameras) {
      if (camera.pictures == 0) throw InputError("camera " + camera.name + " delivered no image");
    }
    for (std::size_t c = 0; c < found_.cameras.size(); ++c) {
      if (std::ranges::find(found_.views, static_cast<int>(c), &solver::BoardView::camera) == found_.views.end())
        throw InputError(why_no_view(found_.cameras[c]));
    }
    return std::move(found_);
  }

 private:
  // For a calling program: the counts of each camera, all needs, and the status, which ends the message.
  void tell(const std::string& status, const std::vector<std::string>& needs) {
    const auto list = [](const auto& numbers) { return fmt::to_string(fmt::join(numbers, ",")); };
    for (std::size_t c = 0; c < names_.size(); ++c) {
      const ViewCoverage::CameraCoverage& of = coverage_->cameras()[c];
      send_to_program("coverage", {names_[c], std::to_string(of.views), std::to_string(ViewCoverage::enough_views),
                                   fmt::format("{:.0f}", 100 * of.image_share()),
                                   fmt::format("{:.0f}", 100 * ViewCoverage::enough_image), list(of.corners),
                                   list(of.tilts), shown_[c].caption});
    }
    for (const std::string& need : needs) send_to_program("need", {need});
    line_.show(status, static_cast<int>(found_.set_at_s.size()), std::nullopt, "");
  }

  // Detects the board on all cores, and counts.
  Look look_at(const capture::FrameSet& set) {
    ++found_.sets_seen;
    if (!first_s_) first_s_ = capture::seconds(set.at);
    Look look;
    look.at_s = capture::seconds(set.at) - *first_s_;
    look.greys.resize(names_.size());
    std::vector<std::future<board::BoardDetection>> detections(names_.size());
    for (std::size_t c = 0; c < names_.size(); ++c) {
      if (!set.frames[c]) {
        look.is_complete = false;
        continue;
      }
      cv::Mat& grey = look.greys[c] = board_grey_of(set.frames[c]->pixels);
      sizes_[c] = found_.cameras[c].image_size = {grey.cols, grey.rows};
      detections[c] = std::async(std::launch::async, [this, &grey] { return detector_.detect(board::view_of(grey)); });
    }
    for (std::size_t c = 0; c < names_.size(); ++c) {
      if (!detections[c].valid()) continue;
      board::BoardDetection detection = detections[c].get();
      if (detection.found()) {
        blur_detectors_[c].found(look.greys[c], detection.px);
      } else if (blur_detectors_[c].may_be_in(look.greys[c])) {
        detection.why_not = motion_blur_reason;
        look.motion_blurred = names_[c];
      }
      count(c, look.greys[c], detection);
      if (!detection.found()) continue;
      look.views.push_back({static_cast<int>(c),
                            0,
                            fmt::format("{} at {:.2f} s", names_[c], look.at_s),
                            std::move(detection.ids),
                            std::move(detection.px),
                            {},
                            detection.blur_px});
    }
    return look;
  }

  void count(std::size_t c, const cv::Mat& grey, const board::BoardDetection& detection) {
    PictureTally& camera = found_.cameras[c];
    ++camera.pictures;
    evidence_.add(detection, grey);
    shown_[c].grey = grey;
    shown_[c].corners = detection.px;
    shown_[c].caption = detection.why_not;
    if (detection.found()) {
      shown_[c].caption = std::to_string(detection.ids.size()) + " corners";
      if (detection.blur_px > 0) shown_[c].caption += fmt::format(", edges blurred by {:.1f} px", detection.blur_px);
    }
    if (detection.found()) {
      ++camera.boards;
    } else {
      ++camera.why_not[detection.why_not];
    }
  }

  // Keeps views of a resting board at a new place; returns the status. An incomplete set (a camera lags) gives no
  // shared views.
  std::string keep_if_new(const Look& look) {
    const bool rests = is_at_rest(look.views, before_, look.at_s - before_s_, sizes_);
    if (!coverage_ || !look.is_complete || !rests || !coverage_->is_new(look.views)) {
      if (rests) ++found_.duplicates;
      if (!look.motion_blurred.empty())
        return fmt::format("hold it still: {} in {}'s image", motion_blur_reason, look.motion_blurred);
      if (look.views.empty()) return "no camera sees the board";
      return !rests ? "hold it still" : "seen before: move it elsewhere";
    }
    coverage_->add(look.views);
    for (solver::BoardView view : look.views) {
      view.set = static_cast<int>(found_.set_at_s.size());
      found_.thumbnails.push_back(thumbnail_of(look.greys[static_cast<std::size_t>(view.camera)]));
      found_.views.push_back(std::move(view));
    }
    found_.set_at_s.push_back(look.at_s);
    return "kept view " + std::to_string(found_.set_at_s.size());
  }

  std::string why_no_view(const PictureTally& camera) const {
    const std::string board = "camera " + camera.name + ": the board (" + detector_.board().description() + ") was ";
    if (camera.boards > 0) return board + "never at rest";
    const auto why = std::ranges::max_element(camera.why_not, {}, [](const auto& entry) { return entry.second; });
    return board + "in none of its " + std::to_string(camera.pictures) + " images" +
           (why == camera.why_not.end() ? std::string() : ": " + why->first);
  }

  const board::BoardDetector& detector_;
  BoardEvidence evidence_;
  const LiveBoardsOptions& options_;
  FoundBoards found_;
  std::vector<std::string> names_;
  std::vector<calib::ImageSize> sizes_;   // width 0: no image yet
  std::optional<ViewCoverage> coverage_;  // once all sizes are known
  std::optional<double> first_s_;
  std::vector<solver::BoardView> before_;  // of the previous set, at
  double before_s_ = 0;
  std::vector<ShownPicture> shown_;
  std::vector<MotionBlurDetector> blur_detectors_;  // per camera
  ProgressLine line_;
  DetectionPage page_;
};

}  // namespace

FoundBoards gather_live(std::vector<LiveCameraSource> cameras, const board::BoardDetector& detector,
                        const LiveBoardsOptions& options, std::stop_token stop) {
  Gathering gathering(cameras, detector, options);
  NewestSet newest(cameras, options.tolerance);
  const auto start = Clock::now();
  const auto is_over = [&] {
    return options.seconds && Clock::now() - start > std::chrono::duration<double>(*options.seconds);
  };
  while (!stop.stop_requested() && !newest.ended() && !is_over()) {
    gathering.tell_trouble(cameras);
    const auto set = newest.take(std::chrono::milliseconds(200));
    if (!set) {
      gathering.tell_awaited();
    } else if (!gathering.take(*set)) {
      break;
    }
  }
  return gathering.finish();
}

}  // namespace huetrack::gather
